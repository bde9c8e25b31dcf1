"""VTK: legacy files, and XML files of polygons (VTP) and of unstructured grids (VTU), read and written by VTK.

They are read in a separate process: a damaged file can make VTK crash or fill memory.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Mapping
from io import BytesIO

import numpy as np

from isomatch._core.arrays import AnyArray
from isomatch._core.errors import FormatError, MeshError
from isomatch._core.first_use import package
from isomatch._core.memory import room_for
from isomatch.io.asset import COMMENTS, SPACE, Asset, Frame
from isomatch.io.attribute import number_equal_names
from isomatch.io.formats._reading import damaged, on_disk, reading
from isomatch.io.libraries import ArrayDocument, is_attribute, named_attributes, polygons_of, to_pyvista

# A reader is ended after MAX_SECONDS, plus one second for each BYTES_PER_SECOND bytes of the file; chosen: a
# file of one triangle takes 0.5 s, a file of 20 MB 1.9 s.
MAX_SECONDS, BYTES_PER_SECOND = 60.0, 1e6
_END_MARK = "isomatch_end"  # name of a field at the end of a file, which shows that VTK read all of it
TITLE_BYTES = 255  # largest number of bytes of a legacy file's second line, its title, by the format
# Text that is added to a legacy file. If an array is too short, VTK reads on into this text, and then finds
# no field _END_MARK.
_END = b"\n\nFIELD isomatch 1\n%s 1 1 int\n0000\n" % _END_MARK.encode()
# what a message says if a reader ends without a message of its own
_ENDED_EARLY = "the reader came to an end over it, as where more is declared than the file holds"
_POLYGON_COUNT = {  # matches where a file declares its number of polygons
    ".vtk": re.compile(rb"(?im)^POLYGONS\s+(-?\d+)"),
    ".vtp": re.compile(rb"""\sNumberOfPolys\s*=\s*["'](\d+)"""),
}


def read(suffix: str, data: bytes, name: str) -> Asset:
    """Read the polygons of a file of this suffix, with all arrays on them and on their points."""
    what = f"a {suffix} file of polygons"
    package("vtkmodules", "vtk", what)
    if suffix != ".vtk" and b"</VTKFile" not in data:
        raise damaged(name, what, "it has no end, and is cut short")
    stored = _read_in_process(data + _END if suffix == ".vtk" else data, name, suffix, what)
    n_other_cells = dict(zip(stored["others"].tolist(), stored["counts"].tolist()))
    if suffix != ".vtu" and stored["is_polygons"]:
        declared = sum(map(int, _POLYGON_COUNT[suffix].findall(data.partition(b"<AppendedData")[0])))
        n_more = declared - len(stored["sizes"])  # version 5 of legacy files declares one polygon too many
        if n_more not in ((0, 1) if suffix == ".vtk" else (0,)):
            raise damaged(name, what, f"{len(stored['sizes'])} polygons, {declared} declared")
    if suffix == ".vtk" and _END_MARK not in (
        *stored["point_names"],
        *stored["cell_names"],
        *stored["field_names"],
    ):
        raise damaged(name, what, "it is cut short, or an array is shorter than declared")
    with reading(name, what):
        points, corners, sizes, rows = (stored[key] for key in ("points", "corners", "sizes", "rows"))
        strips = stored["strip_corners"], stored["strip_sizes"]
        cells = polygons_of(points, corners, sizes, rows, n_other_cells, strips)
        at_points, on_cells = _named_arrays(stored, "point"), _named_arrays(stored, "cell")
        arrays = [*at_points.items(), *on_cells.items()]
        skipped = [name for name, array in arrays if not is_attribute(array)]
        why = "it has neither numbers nor one text in a row"
        notes = (*cells.notes, *(f"the array {name!r} is left out: {why}" for name in skipped))
        named = [*named_attributes(at_points, "point"), *named_attributes(on_cells, "face", cells.rows)]
        attributes = number_equal_names(attribute for _, attribute in named)
        names = {(attribute.name, attribute.domain): name for attribute, (name, _) in zip(attributes, named)}
        fields = _named_arrays(stored, "field")
        fields = {name: fields[name] for name in fields if name not in (SPACE, COMMENTS)}
        document = ArrayDocument(names, fields)
        texts = dict(zip(stored["text_names"].tolist(), stored["texts"].tolist()))
        if suffix == ".vtk":  # the second line is a title
            texts[COMMENTS] = data.split(b"\n", 2)[1].decode(errors="replace")
        frame = Frame.of_named(texts)
        return Asset(cells.points, cells.polygons, attributes, (), document, notes, frame)


def _read_in_process(data: bytes, name: str, suffix: str, what: str) -> Mapping[str, AnyArray]:
    with reading(name, what), on_disk(data, suffix) as path:
        arguments = "isomatch.io.formats._vtk_reader", str(path), str(room_for(len(data)))
        command = [sys.executable, "-P", "-m", *arguments]  # -P: import nothing from the working folder
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
        limit = MAX_SECONDS + len(data) / BYTES_PER_SECOND
        try:
            ended = subprocess.run(command, env=environment, capture_output=True, timeout=limit)
        except subprocess.TimeoutExpired:
            problem = f"{name}: reading took more than {limit:.0f} s and was ended"
            remedy = "try again when the machine is less busy, or export it in another format"
            raise FormatError(f"{problem}; {remedy}") from None
        if ended.returncode:
            errors = ended.stderr.decode(errors="replace").strip().splitlines()
            raise damaged(name, what, errors[-1] if errors and ended.returncode > 0 else _ENDED_EARLY)
        with np.load(BytesIO(ended.stdout)) as stored:
            return dict(stored)


def _named_arrays(stored: Mapping[str, AnyArray], domain: str) -> dict[str, AnyArray]:
    names = enumerate(stored[f"{domain}_names"].tolist())
    return {name: stored[f"{domain}_{i}"] for i, name in names if name != _END_MARK}


def write(suffix: str, asset: Asset, binary: bool = True) -> bytes:
    """Write a file of this suffix, binary or text."""
    if suffix == ".vtu" and not len(asset.points):  # VTK would end the process
        raise MeshError("there are no points, and a VTU file without any cannot be read; write a .vtp file")
    mesh = to_pyvista(asset)
    if suffix == ".vtk":  # the title holds the frame of coordinates
        for name in (asset.frame or Frame()).named:
            mesh.field_data.pop(name, None)
    with on_disk(b"", suffix) as path:
        (mesh.cast_to_unstructured_grid() if suffix == ".vtu" else mesh).save(path, binary=binary)
        if suffix != ".vtk" or not (title := (asset.frame or Frame()).title(TITLE_BYTES)):
            return path.read_bytes()
        version, _, rest = path.read_bytes().split(b"\n", 2)
        return b"\n".join([version, title.encode(), rest])
