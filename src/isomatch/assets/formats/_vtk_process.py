"""VTK files, read in a process of their own by VTK or meshio: what a file declares can make them crash or fill memory."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from isomatch.assets.formats import _vtk_reader
from isomatch.assets.formats._reading import damaged, on_disk, reading
from isomatch.assets.formats._vtk_reader import ARRAYS, DISK, ENDED, PROBLEM
from isomatch.errors import FormatError, UnwritableFileError
from isomatch.loading.first_use import package
from isomatch.runtime.memory import room_for
from isomatch.values.arrays import AnyArray

# time that a file may take, and more for large ones; a triangle takes 0.5 s, a million points in 20 MB of VTP 1.9 s
SECONDS, BYTES_A_SECOND = 60.0, 1e6


@dataclass
class PolyData:
    """What VTK found, under the names that PyVista has for it."""

    points: AnyArray
    faces: AnyArray
    n_verts: int
    n_lines: int
    n_strips: int
    n_polys: int
    point_data: Mapping[str, AnyArray]
    cell_data: Mapping[str, AnyArray]


@dataclass
class Block:
    """Cells of one type."""

    type: str
    data: AnyArray


@dataclass
class Grid:
    """What meshio found, under its names."""

    points: AnyArray
    cells: list[Block]
    point_data: Mapping[str, AnyArray]
    cell_data: Mapping[str, list[AnyArray]]


def polygons_of(data: bytes, name: str, suffix: str) -> PolyData:
    """Read polygons by VTK; `FormatError` if it complains, crashes or needs far more memory than the file."""
    package("vtkmodules", "vtk", f"a {suffix} file of polygons")
    stored = _read_by("vtk", data, name, suffix, "polygons")
    fields = {key: int(stored[key]) for key in ("n_verts", "n_lines", "n_strips", "n_polys")}
    return PolyData(
        stored["points"],
        stored["faces"],
        **fields,
        point_data=_named(stored, "point"),
        cell_data=_named(stored, "cell"),
    )


def grid_of(data: bytes, name: str, suffix: str) -> Grid:
    """Read an unstructured grid by meshio, with the same errors."""
    package(f"meshio{suffix}", "io", f"a {suffix} file")
    stored = _read_by("meshio", data, name, suffix, "triangles, quads or polygons")
    cells = [Block(kind, stored[f"cells_{i}"]) for i, kind in enumerate(stored["types"].tolist())]
    cell_data = {
        key: np.split(values, np.cumsum([len(block.data) for block in cells])[:-1])
        for key, values in _named(stored, "cell").items()
    }
    return Grid(stored["points"], cells, _named(stored, "point"), cell_data)


def _read_by(reader: str, data: bytes, name: str, suffix: str, what: str) -> dict[str, AnyArray]:
    what = f"a {suffix} file of {what}"
    with reading(name, what), on_disk(data, suffix) as path:
        room = str(room_for(len(data)))
        # -P: nothing in the working folder is imported
        command = [sys.executable, "-P", "-m", _vtk_reader.__name__, reader, str(path), room]
        modules = os.pathsep.join(filter(None, sys.path))
        environment = {**os.environ, "PYTHONPATH": modules}
        limit = SECONDS + len(data) / BYTES_A_SECOND
        try:
            ended = subprocess.run(command, env=environment, capture_output=True, check=False, timeout=limit)
        except subprocess.TimeoutExpired:
            raise FormatError(
                f"{name}: reading took more than {limit:.0f} s and was ended; try again when the machine is less busy, "
                "or export it in another format"
            ) from None
        if ended.returncode == DISK:
            raise UnwritableFileError(
                f"{path.parent.parent}: what {name} holds cannot be written there; make room, or set TMPDIR to another "
                "folder"
            )
        problem = path.with_name(PROBLEM)
        if problem.exists() or ended.returncode:
            raise damaged(name, what, problem.read_text(encoding="utf-8") if problem.exists() else ENDED)
        with np.load(path.with_name(ARRAYS)) as stored:
            return dict(stored)


def _named(stored: Mapping[str, AnyArray], domain: str) -> dict[str, AnyArray]:
    names = stored[f"{domain}_names"].tolist()
    return {name: stored[f"{domain}_{i}"] for i, name in enumerate(names)}
