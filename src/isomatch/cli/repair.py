"""``isomatch repair``: mend a mesh and write index maps between the old and the new vertices."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

import isomatch
from isomatch.cli.outputs import claimed_files
from isomatch.cli.terminal import say
from isomatch.storage.array_file import write_arrays


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
        Mesh: any surface file, such as .ply, .obj or .vtp.
    output : Path
        File for the repaired mesh.
    force : bool
        Replace existing files.
    """
    index = output.with_suffix(".index.npz")
    with claimed_files(output, index, force=force):
        repaired = isomatch.repair(isomatch.read_mesh(file))
        indices = ("vertex_index", "new_index", "face_index")
        write_arrays(index, {name: getattr(repaired, name) for name in indices})
        isomatch.write_mesh(output, repaired.mesh)
    for change in repaired.changes or ("nothing to repair",):
        say(change)
    say(f"wrote {output}, {index}")
