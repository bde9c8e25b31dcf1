"""``isomatch repair``: mend a mesh and write index maps between the old and the new vertices."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter

import isomatch
from isomatch.cli.terminal import say


def repair(
    file: Path,
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    force: bool = False,
) -> None:
    """Mend a mesh: weld vertices, remove unusable faces and vertices, and orient the faces outward.

    Writes the repaired mesh and, next to it, NAME.index.npz with vertex_index (original vertex of each new vertex),
    new_index (new vertex of each original vertex, -1 if removed) and face_index (original face of each new face).

    Parameters
    ----------
    file : Path
        Mesh: .off, .obj, .ply or .stl.
    output : Path
        File for the repaired mesh.
    force : bool
        Replace existing files.
    """
    index = output.with_suffix(".index.npz")
    for path in (output, index):
        if path.exists() and not force:
            raise isomatch.IsomatchError(
                f"{path}: already exists; choose another name with -o, or pass --force"
            )
    repaired = isomatch.repair(isomatch.read_mesh(file))
    isomatch.write_mesh(output, repaired.mesh)
    np.savez_compressed(
        index,
        vertex_index=repaired.vertex_index,
        new_index=repaired.new_index,
        face_index=repaired.face_index,
    )
    for change in repaired.changes or ("nothing to repair",):
        say(change)
    say(f"wrote {output}, {index}")
