"""``isomatch repair``: mend a mesh and write index maps between the old and the new vertices."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, cast

from cyclopts import Parameter

import isomatch
from isomatch.assets import FORMATS, as_written, files_beside
from isomatch.cli.outputs import claimed_files, notes_on, say_left_out, say_notes
from isomatch.cli.terminal import say
from isomatch.storage.array_file import write_arrays

_INDICES = ("vertex_index", "new_index", "polygon_index", "face_index")


def repair(
    file: Path,
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    outer: bool = False,
    opening: float = 0.1,
    force: bool = False,
) -> None:
    """Mend a mesh: weld vertices, remove unusable faces and vertices, and orient the faces outward.

    Colours, labels, texture coordinates, weights and all else that the file carries are kept. Where values differ at
    vertices that are welded, the first is.

    Writes the repaired mesh and, next to it, NAME.index.npz with vertex_index (original vertex of each new vertex),
    new_index (new vertex of each original vertex, -1 if removed), polygon_index (original face of each new face, which
    may have any number of corners) and face_index (the same of the triangles that they are cut into).

    Parameters
    ----------
    file : Path
        Mesh: any surface file, such as .ply, .obj or .vtp.
    output : Path
        File for the repaired mesh.
    outer : bool
        Keep only the outermost surface, without chambers that are closed or have small openings.
    opening : float
        With --outer: the smallest opening through which a chamber counts as outside, in √area.
    force : bool
        Replace existing files.
    """
    index = output.with_suffix(".index.npz")
    with claimed_files(output, index, force=force):
        repaired = isomatch.repair(_whole(file, output), outer=outer, opening=opening)
        asset = cast(isomatch.Asset, repaired.asset)
        beside = files_beside(output, asset)
        with claimed_files(*beside, force=force):
            left = [attribute.name for attribute in isomatch.write_asset(output, asset)]
        write_arrays(index, {name: getattr(repaired, name) for name in _INDICES})
    for change in repaired.changes:
        say(change)
    say_left_out(left, output)
    say_notes(notes_on({file: asset}))
    what = "wrote" if repaired.changes else "nothing to repair; wrote an unchanged copy:"
    say(f"{what} {', '.join(map(str, (output, *beside, index)))}")


def _whole(file: Path, output: Path) -> Path | isomatch.Asset:
    """Return the file, or its parts as one surface if the output has no parts, so that they are welded too."""
    mesh_format = FORMATS.get(output.suffix.lower())
    if mesh_format is None or mesh_format.has_parts or file.suffix.lower() not in (".glb", ".gltf"):
        return file
    shown, _ = as_written(output, isomatch.read_asset(file, sound=False))
    return replace(shown.placed, parts=(), document=shown.document)
