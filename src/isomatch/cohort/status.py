"""How far a collection is: what is matched, how it ended, and what does not fit."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

from isomatch.cohort.collection import Collection
from isomatch.cohort.combine import Agreement, agreement_of
from isomatch.cohort.map_file import changed_files
from isomatch.cohort.outliers import Outlier, mirror_images, outliers
from isomatch.cohort.rows import PairRow, Rows, SurfaceRow


@dataclass(frozen=True)
class Status:
    """How far a collection is."""

    folder: Path
    shapes: dict[str, int]  # how many there are, ``all``, and how many are ``prepared``
    template: str | None
    pairs: dict[str, int]  # how many there are, ``all``, and of each `PairRow.verdict`
    outcomes: dict[str, int]  # how many pairs ended as each `Outcome`, by its name
    reflected: list[str]  # shapes that are matched as their mirror images
    mirror_images: dict[
        str, str | None
    ]  # shapes that seem to be some, and why they are not reflected, if it was tried
    outliers: list[Outlier]
    agreement: Agreement
    loop: dict[str, Any] | None  # of a ring: its ``open`` legs, and the errors once around it, in √area
    damaged: dict[str, str]  # files and rows that are not as they were written, with what is wrong
    failures: dict[str, str]  # shapes and pairs that failed, with the reasons

    def to_json(self) -> dict[str, Any]:
        """Return plain values."""
        odd, agreement = [outlier._asdict() for outlier in self.outliers], self.agreement._asdict()
        return {**vars(self), "folder": str(self.folder), "outliers": odd, "agreement": agreement}


def status_of(collection: Collection, folders: Iterable[str] = ()) -> Status:
    """Sum up how far a collection is, from the ledgers of all shards, with the damaged files of some `KEPT` folders."""
    rows = collection.rows()
    pairs = collection.wanted_pairs(rows)
    own = [rows.pairs.get(pair, PairRow(state="todo")) for pair in pairs]
    changed = changed_files(collection.layout, rows, folders)
    damaged = {str(path.relative_to(collection.folder)): what for path, what in changed.items()}
    failures = {name: row.error for name, row in rows.shapes.items() if row.state == "failed"}
    failures |= {" and ".join(pair): row.error for pair, row in rows.pairs.items() if row.state == "failed"}
    turned = mirror_images(collection, rows)
    return Status(
        folder=collection.folder,
        shapes={"all": len(collection.shapes), "prepared": sum(map(rows.is_prepared, rows.shapes))},
        template=collection.chosen_template(rows),
        pairs={"all": len(pairs), **Counter(row.verdict for row in own)},
        outcomes=dict(Counter(row.ending for row in own if row.state == "done")),
        reflected=rows.reflected(collection.names),
        mirror_images={name: rows.pairs[pair].not_reflected.get(name) for name, pair in turned.items()},
        outliers=outliers(collection, rows),
        agreement=agreement_of(rows),
        loop=_loop_of(collection, rows) if collection.pairs == "ring" else None,
        damaged=damaged | dict.fromkeys(rows.damaged, "is no row of a collection, and was ignored"),
        failures=failures,
    )


def _loop_of(collection: Collection, rows: Rows) -> dict[str, Any]:
    """Tell how far the template is from itself once around a ring, and where the ring is open."""
    legs = pairwise([*collection.names, collection.names[0]])
    unsure = [list(leg) for leg in legs if not rows.is_current(leg) or rows.is_doubtful(leg)]
    found: dict[str, Any] = {"open": unsure}
    for line in SurfaceRow.read(collection.layout.shapes_table).values():
        errors = {"loop_error": line.loop_error, "greatest_loop_error": line.greatest_loop_error}
        found |= {name: float(error) for name, error in errors.items() if error}
    return found
