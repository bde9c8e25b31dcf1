"""``isomatch collect export``: surfaces and maps of a collection for other programs."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Literal

from isomatch import cohort
from isomatch.cli.inputs import Force, Rounded
from isomatch.cli.outputs import require_writable
from isomatch.cli.terminal import TALK, Talk, say


def export(
    folder: Path,
    to: Path,
    /,
    *,
    format: str = ".ply",
    maps: Literal["npz", "txt", "none"] = "npz",
    rounded: Rounded = False,
    force: Force = False,
    talk: Talk = TALK,
) -> None:
    """Write the shapes in the topology of the template, and the maps, for other programs.

    Args:
        folder: The folder of a collection.
        to: Folder for meshes, maps, a file for each direction, and pairs.csv.
        format: Suffix of the meshes, such as .ply (default), .obj, .vtp or .glb; or none.
        maps: npz (default): image vertices, and precise images in triangles; txt: the image vertex of each vertex on a
            line; or none.
    """
    meshes = None if format == "none" else f".{format.removeprefix('.')}"
    if meshes:
        require_writable(Path(f"mesh{meshes}"))
    collection = cohort.Collection.open(folder)
    left_out = sorted({*collection.names} - {*cohort.surfaces_written(collection)}) if meshes else []
    written, lost, suffix = Counter[str](), Counter[str](), None if maps == "none" else f".{maps}"
    with talk.progress() as tell:
        for path, left in cohort.export(collection, to, meshes, suffix, force, rounded):
            written[path.parent.name] += 1
            lost.update(left)
            tell(f"written: {path.name}", 1.0)
    counts = {"meshes": written["meshes"], "maps": written["maps"]}
    result = {"folder": str(to), **counts, "left_out": left_out, "not_kept": dict(lost)}

    def summary() -> None:
        say(f"wrote {written['meshes']} meshes and {written['maps']} maps to {to}")
        for name, count in lost.items():
            say(f"not in {count} of the meshes: {name}; a {meshes} file has no place for it")
        if left_out:
            say(f"not in the topology of the template, see shapes.csv: {', '.join(left_out)}", "bold red")

    talk.result(result, summary)
