"""Sets stored as two archives, one of all shapes and one of the truth of all pairs."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import NoReturn

import numpy as np

from isomatch._core.array_file import Archive
from isomatch._core.arrays import AnyArray
from isomatch._core.errors import FormatError, MissingFileError
from isomatch.surfaces import Mesh
from isomatch_lab.sets.pair_list import PairList
from isomatch_lab.sets.shape_set import BenchmarkPair

SHAPES, TRUTH = "shapes.npz", "truth.npz"  # files of a set
MIRROR, SCALE = "mirror", "scale"  # endings of names of arrays of truth


@dataclass(frozen=True, eq=False)
class StoredSet:
    """A folder with ``shapes.npz``, ``truth.npz`` and ``pairs.txt``, see `own_set`.

    Parameters
    ----------
    root : Path
        The folder.
    listed : PairList
        Its pairs.
    symmetric : bool
        Whether a mirrored truth is as good as the direct one.
    """

    root: Path
    listed: PairList
    symmetric: bool = False

    @property
    def pairs(self) -> tuple[tuple[str, str], ...]:
        """Names of the pairs."""
        return self.listed.pairs

    @property
    def files(self) -> tuple[Path, ...]:
        """Its files."""
        return tuple(path for path in self.root.iterdir() if path.suffix in (".npz", ".txt", ".toml"))

    def pair(self, source: str, target: str) -> BenchmarkPair:
        """Read two shapes and the truth between them; `FormatError` if these do not fit."""
        path, key = self.root / TRUTH, f"{source}|{target}"
        arrays = _read(path, key, f"{key}|{MIRROR}", f"{key}|{SCALE}")
        if key not in arrays:
            raise MissingFileError(f"{path}: no array {key!r} with the truth of {source} and {target}")
        rows, mirror, unit = (arrays.get(name) for name in (key, f"{key}|{MIRROR}", f"{key}|{SCALE}"))
        shapes = self._mesh(source), self._mesh(target)
        if rows is None or rows.ndim != 2 or rows.shape[1] != 2 or rows.dtype.kind not in "iu":
            raise FormatError(f"{path}: {key!r} is no array (m, 2) of vertices; export it again")
        rows = rows.astype(np.int64)
        for side, column, mesh, least in zip(("source", "target"), rows.T, shapes, (0, -1)):
            if column.min(initial=0) < least or column.max(initial=-1) >= mesh.n_vertices:
                raise FormatError(
                    f"{path}: {key!r} names {side} vertices {column.min()}…{column.max()}, outside "
                    f"0…{mesh.n_vertices - 1}; take shapes and truth from one source"
                )
        has = rows[:, 1] >= 0
        alone = np.setdiff1d(rows[~has, 0], rows[has, 0])
        tells_of_all = len(alone) or len(np.unique(rows[:, 0])) == shapes[0].n_vertices
        truth, mirrored = rows[has], None
        if not len(truth):
            raise FormatError(f"{path}: {key!r} has no vertex with a counterpart; leave this pair out")
        if mirror is not None:
            if mirror.shape != (len(rows),) or mirror.dtype.kind not in "iu":
                message = f"{path}: '{key}|{MIRROR}' is no array of one vertex for each row of {key!r}"
                raise FormatError(message)
            mirrored = np.column_stack([truth[:, 0], mirror[has]]).astype(np.int64)
            if mirrored[:, 1].min() < 0 or mirrored[:, 1].max() >= shapes[1].n_vertices:
                message = f"{path}: '{key}|{MIRROR}' names vertices outside 0…{shapes[1].n_vertices - 1}"
                raise FormatError(message)
        if unit is not None and not (unit.size == 1 and np.isfinite(unit).all() and float(unit) > 0):
            raise FormatError(f"{path}: '{key}|{SCALE}' is no positive number; give √area of the whole")
        return BenchmarkPair(
            f"{source}-{target}", *shapes, truth, mirrored, self.symmetric,
            alone=alone if tells_of_all else None,
            unit=None if unit is None else float(unit),
            group=self.listed.group(source, target),
        )  # fmt: skip

    def _mesh(self, name: str) -> Mesh:
        path = self.root / SHAPES
        arrays = _read(path, name, f"{name}_faces")
        if len(arrays) < 2:
            message = f"{path}: no arrays {name!r} and '{name}_faces', the vertices and faces of a shape"
            raise MissingFileError(message)
        return Mesh(arrays[name], arrays[f"{name}_faces"])


def stored_set(root: Path, symmetric: bool = False) -> StoredSet:
    """Open such a folder; its pairs are listed in ``pairs.txt``, or else are all that have a truth."""
    truths = [key for key in _names(root / TRUTH) if key.count("|") == 1]
    names = {name.removesuffix("_faces") for name in _names(root / SHAPES)}
    listed = PairList.read(root, names) or PairList(
        tuple((a, b) for a, b in (key.split("|") for key in truths))
    )
    return StoredSet(root, listed, symmetric)


def _refuse(path: Path, problem: str) -> NoReturn:
    raise FormatError(
        f"{path}: cannot be read ({problem}); expected arrays as docs/dev/lab/benchmarks.md describes them"
    )


def _names(path: Path) -> list[str]:
    with Archive.opened(path, partial(_refuse, path)) as archive:
        return archive.names


def _read(path: Path, *names: str) -> dict[str, AnyArray]:
    """Read the named arrays that the file has."""
    with Archive.opened(path, partial(_refuse, path)) as archive:
        return archive.read_all([name for name in names if name in archive])
