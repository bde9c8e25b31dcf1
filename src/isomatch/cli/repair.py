"""``isomatch repair``: mend a mesh and write index maps between the old and the new vertices."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, cast

from cyclopts import Parameter

import isomatch
from isomatch.assets import FORMATS
from isomatch.cli.outputs import claimed_files, say_left_out
from isomatch.cli.terminal import say
from isomatch.storage.array_file import write_arrays
from isomatch.values.arrays import IntArray


def repair(
    file: Path,
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    force: bool = False,
) -> None:
    """Mend a mesh: weld vertices, remove unusable faces and vertices, and orient the faces outward.

    Colours, labels, texture coordinates, weights and all else that the file carries are kept. Where values differ at
    vertices that are welded, the first is.

    Writes the repaired mesh and, next to it, NAME.index.npz with vertex_index (original vertex of each new vertex),
    new_index (new vertex of each original vertex, -1 if removed) and face_index (original face of each new face).

    Parameters
    ----------
    file : Path
        Mesh: any surface file, such as .ply, .obj or .vtp.
    output : Path
        File for the repaired mesh.
    force : bool
        Replace existing files.
    """
    index = output.with_suffix(".index.npz")
    with claimed_files(output, index, force=force):
        repaired = isomatch.repair(_whole(file, output))
        asset = cast(isomatch.Asset, repaired.asset)
        indices = {"vertex_index": repaired.vertex_index, "new_index": repaired.new_index}
        write_arrays(index, indices | {"face_index": cast(IntArray, repaired.polygon_index)})
        left = [attribute.name for attribute in isomatch.write_asset(output, asset)]
    for change in repaired.changes or ("nothing to repair",):
        say(change)
    say_left_out(left, output)
    say(f"wrote {output}, {index}")


def _whole(file: Path, output: Path) -> Path | isomatch.Asset:
    """Return the file, or its parts as one surface if the output has no parts, so that they are welded too."""
    mesh_format = FORMATS.get(output.suffix.lower())
    if mesh_format is None or mesh_format.has_parts or file.suffix.lower() not in (".glb", ".gltf"):
        return file
    return replace(isomatch.read_asset(file, sound=False).placed, parts=(), document=None)
