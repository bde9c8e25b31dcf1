"""Files of the maps of a pair, and files that changed since they were written."""

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

UNKNOWN_ERROR = -1.0  # value in a file that stands for an unknown expected error
DIGESTED_FOLDERS = ("prepared", "maps", "corresponded", "landmarks")
"""Folders of a collection; the ledgers keep a digest of each of their files."""
MISSING, CHANGED = "is missing", "was changed after it was written"  # words for the damage of a file
MAX_NAMED_FILES = 5  # largest number of files that an error about damaged files names; chosen


@dataclass(frozen=True, eq=False)
class PairMaps:
    """The maps between two shapes, source → target and target → source, with what is known of them.

    The errors are the ``expected_error`` of each vertex where a map starts, in √area of where it
    ends; nan where unknown, and None in files of earlier versions.
    """

    forward: Correspondence
    backward: Correspondence
    record: MapRecord
    forward_error: FloatArray | None = None
    backward_error: FloatArray | None = None

    @classmethod
    def of(cls, forward: MatchResult, backward: MatchResult, record: MapRecord) -> PairMaps:
        """Take the maps of two results, with their expected errors."""
        return cls(forward.map, backward.map, record, forward.expected_error, backward.expected_error)

    @property
    def turned(self) -> PairMaps:
        """The maps of the pair in the other order."""
        return PairMaps(self.backward, self.forward, self.record, self.backward_error, self.forward_error)

    def save(self, path: Path) -> None:
        """Write an ``.npz`` file; indices take 4 bytes and barycentric coordinates too."""
        arrays: dict[str, object] = {"record": np.array(json.dumps(self.record.to_json()))}
        maps, all_errors = (self.forward, self.backward), (self.forward_error, self.backward_error)
        for side, correspondence, errors in zip(SIDES, maps, all_errors):
            arrays[f"{side}_vertices"] = correspondence.vertices.astype(np.int32)
            arrays[f"{side}_faces"] = correspondence.faces.astype(np.int32)
            arrays[f"{side}_barycentric"] = correspondence.barycentric.astype(np.float32)
            if errors is not None:
                arrays[f"{side}_expected_error"] = np.nan_to_num(errors, nan=UNKNOWN_ERROR).astype(np.float32)
        save_arrays(path, PAIR_FORMAT.version, arrays, compressed=True)

    @classmethod
    def load(cls, path: Path) -> PairMaps:
        """Read a file; `FormatError` if it is missing (`MissingFileError`) or damaged."""
        arrays = PAIR_FORMAT.read(path)
        try:
            record = MapRecord.from_json(json.loads(arrays["record"]))
            forward, backward = (Correspondence(**parts) for parts in pair_parts(arrays))
        except (ValueError, KeyError, TypeError, MapError) as error:
            problem = f"not the maps of a pair ({error})"
            raise FormatError(f"{path}: {problem}; remove it and match again") from None
        stored = [arrays.get(f"{side}_expected_error") for side in SIDES]
        errors = [None if error is None else np.where(error < 0, np.nan, error) for error in stored]
        return cls(forward, backward, record, *errors)


def maps_of_pair(layout: Layout, source: str, target: str) -> PairMaps:
    """Read the maps of a pair, see `Collection.maps`."""
    path = layout.maps((source, target))
    return PairMaps.load(path) if path.exists() else PairMaps.load(layout.maps((target, source))).turned


def as_matched(
    correspondence: Correspondence, source: Mesh, target: Mesh, sides: tuple[bool, bool]
) -> tuple[Correspondence, Mesh, Mesh]:
    """Turn a map between surfaces in files into the map between them as matched, maybe reflected."""
    if not any(sides):
        return correspondence, source, target
    correspondence.check_fits(source, target)
    source, target = (reflected(mesh) if side else mesh for mesh, side in zip((source, target), sides))
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


def changed_files(layout: Layout, rows: Rows, folders: Iterable[str] = DIGESTED_FOLDERS) -> dict[Path, str]:
    """Find files in some `DIGESTED_FOLDERS` that are missing or changed, and tell which it is."""
    wanted = set(folders)
    kept = [(path, row) for path, row in _kept_files(layout, rows) if path.parent.name in wanted]
    with ThreadPoolExecutor(n_threads()) as threads:
        return {path: what for (path, _), what in zip(kept, threads.map(_change_of, kept)) if what}


def require_unchanged(layout: Layout, folders: Iterable[str]) -> None:
    """Raise `FormatError` if files of some folders of a collection are not as they were written."""
    found = changed_files(layout, read_ledgers(layout.ledgers()), folders)
    if changed := [f"{path} {what}" for path, what in found.items()]:
        more = f" and {len(changed) - MAX_NAMED_FILES} more" if len(changed) > MAX_NAMED_FILES else ""
        remedy = "run isomatch collect again, which makes what is damaged again"
        raise FormatError(f"{', '.join(changed[:MAX_NAMED_FILES])}{more}; {remedy}")


_KeptFile = tuple[Path, ShapeRow | PairRow | FileRow]  # a file, and the row with its digest


def _kept_files(layout: Layout, rows: Rows) -> Iterator[_KeptFile]:
    yield from ((layout.prepared(row.key), row) for row in rows.shapes.values() if row.file)
    for pair, row in rows.pairs.items():
        if row.file and rows.is_current(pair):
            yield layout.maps(pair), row
    yield from ((layout.folder / name, row) for name, row in rows.files.items())


def _change_of(kept: _KeptFile) -> str:
    path, row = kept  # we compare all bytes: a disk might lose some and report the same size and time
    with suppress(FormatError, OSError):  # an OSError if the disk cannot read the file
        if digest_of(path) == row.file:
            return ""
        if isinstance(row, PairRow):
            # a run might have replaced the maps, and been killed before it wrote their row
            record = PairMaps.load(path).record
            if record.key == row.key and record.replaced_by not in ((), row.replaced_by):
                return ""
    return CHANGED if path.exists() else MISSING


def maps_along(
    layout: Layout, path: Sequence[str], mesh_of: Callable[[str], Mesh]
) -> tuple[Correspondence, FloatArray]:
    """Compose the maps along a path of shapes; also return the expected error of each vertex."""
    pairs = pairwise(path)
    maps = maps_of_pair(layout, *next(pairs))
    composed, errors = maps.forward, _expected_error(maps)
    for pair in pairs:
        maps = maps_of_pair(layout, *pair)
        # The errors of the two maps are taken as independent: their squares add up.
        errors = np.asarray(np.hypot(errors, composed.pull_back(_expected_error(maps))))
        composed = composed.then(maps.forward, *map(mesh_of, pair))
    return composed, errors


def _expected_error(maps: PairMaps) -> FloatArray:
    return np.full(len(maps.forward.vertices), np.nan) if maps.forward_error is None else maps.forward_error
