"""Files of the maps of a pair; and whether files are as they were written, by the digests in the ledgers."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from hashlib import blake2b, file_digest
from itertools import pairwise
from pathlib import Path

import numpy as np

from isomatch._core.array_file import save_arrays
from isomatch._core.arrays import FloatArray
from isomatch._core.errors import FormatError, MapError
from isomatch._core.files import open_file
from isomatch._core.threads import n_threads
from isomatch.cohort.ledger import (
    FileRow,
    Ledger,
    MapRecord,
    Pair,
    PairRow,
    Rows,
    ShapeRow,
    read_ledgers,
    writing_ledger,
)
from isomatch.cohort.plan import Layout
from isomatch.correspondence import PAIR_FORMAT, SIDES, Correspondence, pair_parts
from isomatch.matching import MatchResult
from isomatch.surfaces import Mesh, reflected

UNKNOWN = -1.0  # in a file, an error that is not known
KEPT = ("prepared", "maps", "corresponded", "landmarks")
"""Folders of the files that have a digest."""
MISSING, CHANGED = "is missing", "was changed after it was written"
MOST_NAMED = 5  # files in an error


@dataclass(frozen=True, eq=False)
class PairMaps:
    """The maps between two shapes, source → target and target → source, with what is known of them.

    The errors are the ``expected_error`` of both, for each vertex where they start, in √area of where they end; nan where
    it is not known, and None in files of earlier versions.
    """

    there: Correspondence
    back: Correspondence
    record: MapRecord
    there_error: FloatArray | None = None
    back_error: FloatArray | None = None

    @classmethod
    def of(cls, there: MatchResult, back: MatchResult, record: MapRecord) -> PairMaps:
        """Take the maps of two results, with their expected errors."""
        return cls(there.map, back.map, record, there.expected_error, back.expected_error)

    @property
    def turned(self) -> PairMaps:
        """The maps of the pair in the other order."""
        return PairMaps(self.back, self.there, self.record, self.back_error, self.there_error)

    def save(self, path: Path) -> None:
        """Write an ``.npz`` file; indices take 4 bytes and barycentric coordinates too."""
        arrays: dict[str, object] = {"record": np.array(json.dumps(self.record.to_json()))}
        for side in SIDES:
            correspondence: Correspondence = getattr(self, side)
            arrays[f"{side}_vertices"] = correspondence.vertices.astype(np.int32)
            arrays[f"{side}_faces"] = correspondence.faces.astype(np.int32)
            arrays[f"{side}_barycentric"] = correspondence.barycentric.astype(np.float32)
            errors = getattr(self, f"{side}_error")
            if errors is not None:
                arrays[f"{side}_expected_error"] = np.nan_to_num(errors, nan=UNKNOWN).astype(np.float32)
        save_arrays(path, PAIR_FORMAT.version, arrays, compressed=True)

    @classmethod
    def load(cls, path: Path) -> PairMaps:
        """Read what `save` wrote; `FormatError` if it is missing (`MissingFileError`) or damaged."""
        arrays = PAIR_FORMAT.read(path)
        try:
            record = MapRecord.from_json(json.loads(arrays["record"]))
            there, back = (Correspondence(**parts) for parts in pair_parts(arrays))
        except (ValueError, KeyError, TypeError, MapError) as error:
            problem = f"{path}: not the maps of a pair ({error})"
            raise FormatError(f"{problem}; remove it and match again") from None
        stored = [arrays.get(f"{side}_expected_error") for side in SIDES]
        errors = [None if each is None else np.where(each < 0, np.nan, each) for each in stored]
        return cls(there, back, record, *errors)


def maps_of_pair(layout: Layout, source: str, target: str) -> PairMaps:
    """Read the maps of a pair, see `Collection.maps`."""
    path = layout.maps((source, target))
    return PairMaps.load(path) if path.exists() else PairMaps.load(layout.maps((target, source))).turned


def as_matched(
    correspondence: Correspondence, source: Mesh, target: Mesh, turned: tuple[bool, bool]
) -> tuple[Correspondence, Mesh, Mesh]:
    """Return a map, kept as that of the surfaces in files, with these as they were matched: the turned ones reflected."""
    if not any(turned):
        return correspondence, source, target
    correspondence.check_fits(source, target)
    source, target = (reflected(mesh) if turn else mesh for mesh, turn in zip((source, target), turned))
    hashes = source.content_hash, target.content_hash
    points = correspondence.faces, correspondence.barycentric
    return Correspondence(correspondence.vertices, correspondence.n_target, *points, *hashes), source, target


def digest_of(path: Path) -> str:
    """Return the digest of the bytes of a file."""
    with open_file(path) as file:
        return file_digest(file, partial(blake2b, digest_size=16)).hexdigest()  # type: ignore[arg-type]


def put_files(ledger: Ledger, layout: Layout, digests: dict[Path, str]) -> None:
    """Write rows of files in the folder of a collection."""
    for path, digest in digests.items():
        ledger.put(path.relative_to(layout.folder).as_posix(), FileRow(time=time.time(), file=digest))


def keep_files(layout: Layout, paths: Iterable[Path]) -> None:
    """Write the digests of files in the folder of a collection to its ledger."""
    with writing_ledger(layout.ledger()) as ledger:
        put_files(ledger, layout, {path: digest_of(path) for path in paths})


def changed_files(layout: Layout, rows: Rows, folders: Iterable[str] = KEPT) -> dict[Path, str]:
    """Find the files in some of the `KEPT` folders that are missing, or not as they were written, and say which it is."""
    wanted = set(folders)
    kept = [each for each in _kept(layout, rows) if each[0].parent.name in wanted]
    with ThreadPoolExecutor(n_threads()) as threads:
        return {path: what for (path, *_), what in zip(kept, threads.map(_wrong, kept)) if what}


def require_unchanged(layout: Layout, folders: Iterable[str]) -> None:
    """Raise `FormatError` if files of some folders of a collection are not as they were written."""
    changed = changed_files(layout, read_ledgers(layout.ledgers()), folders)
    if changed:
        named = [f"{path} {what}" for path, what in list(changed.items())[:MOST_NAMED]]
        more = f" and {len(changed) - MOST_NAMED} more" if len(changed) > MOST_NAMED else ""
        remedy = "run isomatch collect again, which makes what is damaged again"
        raise FormatError(f"{', '.join(named)}{more}; {remedy}")


# a file, the row that has its digest, and the pair whose maps it holds
_Kept = tuple[Path, ShapeRow | PairRow | FileRow, Pair | None]


def _kept(layout: Layout, rows: Rows) -> Iterator[_Kept]:
    for shape in rows.shapes.values():
        if shape.file:
            yield layout.prepared(shape.key), shape, None
    for pair, row in rows.pairs.items():
        if row.file and rows.is_current(pair):
            yield layout.maps(pair), row, pair
    for name, file in rows.files.items():
        yield layout.folder / name, file, None


def _wrong(kept: _Kept) -> str:
    # all bytes are read, since neither time nor size of a file tells that a disk lost some
    path, row, _ = kept
    with suppress(FormatError, OSError):  # the second: the disk does not give it
        if digest_of(path) == row.file:
            return ""
        if isinstance(
            row, PairRow
        ):  # a comparison may have replaced its maps, and was killed before it wrote the row
            record = PairMaps.load(path).record
            if record.key == row.key and record.replaced_by not in ((), row.replaced_by):
                return ""
    return CHANGED if path.exists() else MISSING


def maps_along(
    layout: Layout, path: Sequence[str], mesh_of: Callable[[str], Mesh]
) -> tuple[Correspondence, FloatArray]:
    """Compose the maps from each shape of a path to the next; give also the expected error of each vertex, or nan."""
    composed: Correspondence | None = None
    errors: FloatArray = np.zeros(0)
    for here, to in pairwise(path):
        maps = maps_of_pair(layout, here, to)
        own = np.full(len(maps.there.vertices), np.nan) if maps.there_error is None else maps.there_error
        if composed is None:
            composed, errors = maps.there, own
        else:
            errors = np.asarray(np.hypot(errors, composed.pull_back(own)))  # as if they were independent
            composed = composed.then(maps.there, mesh_of(here), mesh_of(to))
    if composed is None:
        raise ValueError("a path has at least two shapes")
    return composed, errors
