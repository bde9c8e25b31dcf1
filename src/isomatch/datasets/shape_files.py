"""One shape of a published set as it lies on disk: meshes in five kinds of files, indices in text."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
from scipy.io import loadmat
from scipy.io.matlab import MatReadError

from isomatch._arrays import AnyArray, FloatArray, IntArray
from isomatch.errors import FormatError, some
from isomatch.surfaces import Mesh, read_mesh

SUFFIXES = (".mat", ".npz", ".obj", ".off", ".ply", ".vert")


def shapes_in(path: Path) -> list[str]:
    """Names of the shapes in a file: its own, or those of all poses in an archive of vertices with common faces."""
    if path.suffix != ".npz":
        return [path.stem]
    try:
        with np.load(path, allow_pickle=False) as data:
            keys = list(data.files)
    except (OSError, ValueError, BadZipFile) as error:
        raise _unreadable(path, error) from error
    if "faces" not in keys:
        return []
    return [path.stem] if "vertices" in keys else [key for key in keys if key != "faces"]


def read_shape(path: Path, name: str) -> Mesh:
    """Read one shape of a file.

    Parameters
    ----------
    path : Path
        ``.off``, ``.obj``, ``.ply``; ``.mat`` with a struct ``surface`` of ``X``, ``Y``, ``Z`` and ``TRIV``; ``.vert``
        with a ``.tri`` beside it, both text; ``.npz`` with ``faces`` and ``vertices`` or poses. Indices count from 1 in
        ``.mat`` and ``.tri``, from 0 in ``.npz``.
    name : str
        Which shape of the file, see `shapes_in`.

    Raises
    ------
    FormatError
        If the file is not of its kind.
    """
    if path.suffix == ".npz":
        data = arrays(path)
        return Mesh(data["vertices" if "vertices" in data else name], data["faces"])
    if path.suffix == ".mat":
        return _read_mat(path)
    if path.suffix == ".vert":
        beside = path.with_suffix(".tri")
        return Mesh(_read_table(path, 3)[:, :3], _from(1, beside, _read_table(beside, 3)[:, :3]))
    return read_mesh(path)


def read_indices(path: Path) -> IntArray:
    """Read vertices from text, one a line, counted from 1 as in ``.vts`` files; return them counted from 0."""
    return _from(1, path, _read_table(path)[:, 0])


def read_landmarks(path: Path) -> tuple[IntArray, IntArray | None]:
    """Read landmarks from text: vertices, and the vertices that they are mirrored to, if a second column tells.

    Both columns count from 0: the vertex, and the line of the landmark that mirrors it.
    """
    table = _from(0, path, _read_table(path))
    vertices, line = table[:, 0], table[:, 1:2].ravel()
    if line.max(initial=0) >= len(table):
        raise FormatError(
            f"{path}: landmarks are mirrored to line {line.max()}, the last is {len(table) - 1}"
        )
    return vertices, vertices[line] if len(line) else None


@lru_cache(maxsize=64)
def arrays(path: Path) -> dict[str, AnyArray]:
    """Read all arrays of an ``.npz`` archive without pickles."""
    try:
        with np.load(path, allow_pickle=False) as data:
            return dict(data)
    except (OSError, ValueError, BadZipFile) as error:
        raise _unreadable(path, error) from error


def _read_mat(path: Path) -> Mesh:
    try:
        surface = loadmat(path, squeeze_me=True, struct_as_record=False)["surface"]
        vertices = np.column_stack([surface.X, surface.Y, surface.Z])
        faces = np.asarray(surface.TRIV)
    except (OSError, ValueError, KeyError, AttributeError, NotImplementedError, MatReadError) as error:
        raise FormatError(
            f"{path}: not a shape ({error}); expected a MATLAB file before version 7.3 with a struct 'surface' of "
            "X, Y, Z and TRIV"
        ) from error
    return Mesh(vertices, _from(1, path, faces))


def _from(first: int, path: Path, indices: AnyArray) -> IntArray:
    """Turn indices that count from ``first`` into integers from 0."""
    bad = np.flatnonzero(~(indices >= first) | (indices != np.rint(indices)))
    if len(bad):
        raise FormatError(
            f"{path}: entries {some(bad)} are not whole numbers from {first}, from where indices count in such a file; "
            "write it again by that rule, or use the original"
        )
    return indices.astype(np.int64) - first


def _read_table(path: Path, columns: int = 1) -> FloatArray:
    """Numbers of a text file, (rows, at least ``columns``); ``#`` and ``%`` start comments, commas are blanks."""
    try:
        lines = (
            path.read_text(encoding="utf-8", errors="replace")
            .replace(",", " ")
            .replace("%", "#")
            .splitlines()
        )
        rows = [line for line in lines if line.split("#")[0].strip()]
        table = np.loadtxt(rows, dtype=np.float64, ndmin=2) if rows else np.zeros((0, columns))
    except (OSError, ValueError) as error:
        raise _unreadable(path, error) from error
    if table.shape[1] < columns or not len(table):
        raise FormatError(
            f"{path}: {len(table)} rows of {table.shape[1]} numbers, expected rows of {columns}; copy or export it again"
        )
    return table


def _unreadable(path: Path, error: Exception) -> FormatError:
    return FormatError(f"{path}: cannot be read ({error}); see docs/benchmarks.md for what such a file holds")
