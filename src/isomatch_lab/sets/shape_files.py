"""Files of published sets: one shape from any of six formats, and lists of vertices."""

from __future__ import annotations

from functools import lru_cache, partial
from pathlib import Path
from typing import NoReturn

import numpy as np

from isomatch._core.array_file import Archive, read_mat
from isomatch._core.arrays import AnyArray, IntArray
from isomatch._core.errors import FormatError
from isomatch.evaluation import counted_from, read_numbers
from isomatch.io import read_mesh
from isomatch.surfaces import Mesh

SUFFIXES = (".mat", ".npz", ".obj", ".off", ".ply", ".vert")  # of files of shapes, preferred ones first


def shapes_in(path: Path) -> list[str]:
    """Names of the shapes in a file: the file's name, or the names of poses in an archive with common faces."""
    if path.suffix != ".npz":
        return [path.stem]
    with Archive.opened(path, partial(_refuse, path)) as stored:
        keys = stored.names
    if "faces" not in keys:
        return []
    return [path.stem] if "vertices" in keys else [key for key in keys if key != "faces"]


def read_shape(path: Path, name: str) -> Mesh:
    """Read one shape of a file, by its name there, see `shapes_in`."""
    # .off, .obj, .ply; .mat with a struct surface of X, Y, Z and TRIV; .vert with a .tri beside it, both text; .npz
    # with faces and vertices or poses. Indices count from 1 in .mat and .tri, from 0 in .npz
    if path.suffix == ".npz":
        data = arrays(path)
        return Mesh(data["vertices" if "vertices" in data else name], data["faces"])
    if path.suffix == ".mat":
        return _read_mat(path)
    if path.suffix == ".vert":
        triangles = path.with_suffix(".tri")
        return Mesh(
            read_numbers(path, 3)[:, :3], counted_from(1, triangles, read_numbers(triangles, 3)[:, :3])
        )
    return read_mesh(path)


def stored_indices(path: Path, key: str) -> IntArray:
    """Read vertices from an array of an archive, counted from 0."""
    indices = counted_from(0, path, arrays(path)[key])
    if indices.ndim != 1:
        _refuse(path, f"{key} has shape {indices.shape}, not one index for each known vertex")
    return indices


def read_landmarks(path: Path) -> tuple[IntArray, IntArray | None]:
    """Read landmarks (q,) and, if they are in the file, their mirror images."""
    # text with one landmark a line, its vertex and, optionally, the number of the landmark that is its mirror image; or
    # .npz with landmark_vertices and, optionally, symmetry_perm. Vertices and numbers count from 0
    if path.suffix == ".npz":
        archive = arrays(path)
        if "landmark_vertices" not in archive:
            raise FormatError(f"{path}: no landmarks in this archive; expected an array 'landmark_vertices'")
        columns = [
            stored_indices(path, key) for key in ("landmark_vertices", "symmetry_perm") if key in archive
        ]
        if len({len(column) for column in columns}) > 1:
            _refuse(path, "symmetry_perm and landmark_vertices differ in length")
        table = np.column_stack(columns)
    else:
        table = counted_from(0, path, read_numbers(path))
    vertices, number = table[:, 0], table[:, 1:2].ravel()
    if number.max(initial=-1) >= len(table):
        raise FormatError(
            f"{path}: a landmark is mirrored to number {number.max()}, but the last is {len(table) - 1}; correct the "
            "second column, which counts landmarks from 0"
        )
    return vertices, vertices[number] if len(number) else None


@lru_cache(maxsize=64)
def arrays(path: Path) -> dict[str, AnyArray]:
    """Read all arrays of an ``.npz`` archive."""
    with Archive.opened(path, partial(_refuse, path)) as stored:
        return stored.read_all(stored.names)


def _read_mat(path: Path) -> Mesh:
    expected = "a struct 'surface' of X, Y, Z and TRIV"
    try:
        surface = read_mat(path, "a shape", expected)["surface"]
        vertices = np.column_stack([surface.X, surface.Y, surface.Z])
        faces = np.asarray(surface.TRIV)
    except (LookupError, AttributeError, ValueError, TypeError) as error:
        if isinstance(error, FormatError):
            raise
        raise FormatError(f"{path}: not a shape ({error}); expected {expected}") from error
    return Mesh(vertices, counted_from(1, path, faces))


def _refuse(path: Path, problem: str) -> NoReturn:
    raise FormatError(
        f"{path}: cannot be read ({problem}); docs/dev/lab/benchmarks.md describes the contents of such a file"
    )
