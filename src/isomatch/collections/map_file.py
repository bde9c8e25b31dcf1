"""Files of the maps of a pair: both directions in little space, with the row of the ledger."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from isomatch.collections.layout import Layout
from isomatch.correspondence import Correspondence
from isomatch.errors import FormatError, MapError
from isomatch.matching import MatchResult
from isomatch.storage.array_file import ArrayFormat, Stored, save_arrays
from isomatch.surfaces import Mesh, reflected
from isomatch.values.arrays import FloatArray

Record = dict[str, Any]
"""What is known of a shape or a pair, as plain values."""

SIDES = ("there", "back")
UNKNOWN = -1.0  # in a file, an error that is not known
FORMAT = ArrayFormat(
    what="the maps of a pair",
    writer="isomatch collect",
    version=1,
    arrays={
        "record": Stored("text"),
        **{
            f"{side}_{name}": stored
            for side, n in zip(SIDES, ("n_source", "n_target"))
            for name, stored in (
                ("vertices", Stored("integer", (n,))),
                ("faces", Stored("integer", (n, 3))),
                ("barycentric", Stored("float", (n, 3))),
            )
        },
        **{
            f"{side}_expected_error": Stored("float", (n,), group="errors")
            for side, n in zip(SIDES, ("n_source", "n_target"))
        },
    },
)


@dataclass(frozen=True, eq=False)
class PairMaps:
    """The maps between two shapes.

    Parameters
    ----------
    there, back : Correspondence
        Source → target, and target → source.
    record : dict
        The row of the pair in the ledger.
    there_error, back_error : (n,) array of float, optional
        ``expected_error`` of both, for each vertex where they start, in √area of where they end; nan where it is not
        known, as in files of earlier versions.
    """

    there: Correspondence
    back: Correspondence
    record: Record
    there_error: FloatArray | None = None
    back_error: FloatArray | None = None

    @classmethod
    def of(cls, there: MatchResult, back: MatchResult, record: Record) -> PairMaps:
        """Take the maps of two results, with their expected errors."""
        return cls(there.map, back.map, record, there.expected_error, back.expected_error)

    @property
    def turned(self) -> PairMaps:
        """The maps of the pair in the other order."""
        return PairMaps(self.back, self.there, self.record, self.back_error, self.there_error)

    def save(self, path: Path) -> None:
        """Write an ``.npz`` file; indices take 4 bytes and barycentric coordinates too."""
        arrays: dict[str, object] = {"record": np.array(json.dumps(self.record))}
        for side in SIDES:
            correspondence: Correspondence = getattr(self, side)
            arrays[f"{side}_vertices"] = correspondence.vertices.astype(np.int32)
            arrays[f"{side}_faces"] = correspondence.faces.astype(np.int32)
            arrays[f"{side}_barycentric"] = correspondence.barycentric.astype(np.float32)
            errors = getattr(self, f"{side}_error")
            if errors is not None:
                arrays[f"{side}_expected_error"] = np.nan_to_num(errors, nan=UNKNOWN).astype(np.float32)
        save_arrays(path, FORMAT.version, arrays, compressed=True)

    @classmethod
    def load(cls, path: Path) -> PairMaps:
        """Read what `save` wrote.

        Raises
        ------
        FormatError
            If the file is missing (`MissingFileError`), damaged, or holds something else.
        """
        arrays = FORMAT.read(path)
        try:
            record = json.loads(arrays["record"])
            hashes = record["source_hash"], record["target_hash"]
            there = _map(arrays, "there", len(arrays["back_vertices"]), *hashes)
            back = _map(arrays, "back", len(arrays["there_vertices"]), *hashes[::-1])
        except (ValueError, KeyError, TypeError, MapError) as error:
            raise FormatError(
                f"{path}: not the maps of a pair ({error}); remove it, and match again"
            ) from None
        errors = [arrays.get(f"{side}_expected_error") for side in SIDES]
        return cls(
            there,
            back,
            record,
            *(None if each is None else np.where(each < 0, np.nan, each) for each in errors),
        )


def maps_of_pair(layout: Layout, source: str, target: str) -> PairMaps:
    """Read the maps of a pair; ``there`` leads from source to target, in whichever order they were matched.

    Raises
    ------
    FormatError
        If the pair is not matched.
    """
    path = layout.maps((source, target))
    return PairMaps.load(path) if path.exists() else PairMaps.load(layout.maps((target, source))).turned


def as_matched(
    correspondence: Correspondence, source: Mesh, target: Mesh, turned: tuple[bool, bool]
) -> tuple[Correspondence, Mesh, Mesh]:
    """Return a map with its surfaces as they were matched: those that are turned are reflected.

    Maps are kept as those of the surfaces in the user's files. Reflection leaves the numbers of vertices as they are.

    Raises
    ------
    MapError
        If it is a map of other surfaces.
    """
    if not any(turned):
        return correspondence, source, target
    correspondence.check_fits(source, target)
    source, target = (reflected(mesh) if turn else mesh for mesh, turn in zip((source, target), turned))
    hashes = source.content_hash, target.content_hash
    points = correspondence.faces, correspondence.barycentric
    return (
        Correspondence(correspondence.vertices, correspondence.n_target, *points, *hashes),
        source,
        target,
    )


def _map(arrays: dict[str, Any], side: str, n_target: int, *hashes: str) -> Correspondence:
    vertices, faces, weights = (arrays[f"{side}_{name}"] for name in ("vertices", "faces", "barycentric"))
    weights = weights.astype(np.float64)
    return Correspondence(vertices, n_target, faces, weights / weights.sum(axis=1, keepdims=True), *hashes)
