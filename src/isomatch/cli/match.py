"""``isomatch match``: match two files and write a folder with their map."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

import isomatch
from isomatch.cli.inputs import naming_files, read_config, read_initial_map, read_landmarks
from isomatch.cli.outputs import (
    ResultFolder,
    claimed_files,
    say_files,
    say_result,
    say_wrapped,
    write_wrapped,
)
from isomatch.cli.terminal import progress, say_json
from isomatch.matching import Orientation, Refinement, Resolution, Start


def match(
    source: Path,
    target: Path,
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    landmarks: Path | None = None,
    initial_map: Path | None = None,
    refinement: Refinement | None = None,
    orientation: Orientation | None = None,
    start: Start | None = None,
    resolution: Resolution | None = None,
    config: Path | None = None,
    seed: int = 0,
    as_mesh: Path | None = None,
    json: bool = False,
    force: bool = False,
) -> None:
    """Match two meshes: find the target point of every source vertex.

    Parameters
    ----------
    source : Path
        Mesh to map from: .off, .obj, .ply or .stl.
    target : Path
        Mesh to map to.
    output : Path
        Folder for map.npz, map.txt, result.json, map.png and report.html.
    landmarks : Path
        Text file with two columns of 0-based vertex indices (source, target), separated by a comma or blanks; # starts
        a comment.
    initial_map : Path
        A map to start from: a text file with one 0-based target index per line (-1: unknown), or a map.npz.
    refinement : str
        How the map is refined: joint (default), smooth, laplace_icp (similar to the paper), or none.
    orientation : str
        Whether the map preserves orientation: preserve (default), reverse (a mirror image), or any.
    start : str
        "pose" if the meshes are roughly aligned in space, which gives a first map; otherwise auto (default).
    resolution : str
        On how many vertices large meshes are matched: auto (default), full, or fast. The map is of all vertices.
    config : Path
        TOML file with these and all other settings; see isomatch.Config. Options given here take precedence.
    seed : int
        Seed of the sampling and of the eigensolver.
    as_mesh : Path
        Surface file to write: the source, with its faces and all that its file carries, in the shape of the target.
    json : bool
        Print a single JSON object and nothing else.
    force : bool
        Replace an existing result in the folder.
    """
    folder = ResultFolder(output)
    settings = read_config(config) or isomatch.Config()
    options: dict[str, Any] = {
        "refinement": refinement,
        "orientation": orientation,
        "start": start,
        "resolution": resolution,
    }
    settings = replace(settings, **{name: value for name, value in options.items() if value is not None})
    pairs = None if landmarks is None else read_landmarks(landmarks)
    with progress() as stage:
        stage("reading")
        shapes = isomatch.read_mesh(source), isomatch.read_mesh(target)
        first = None if initial_map is None else read_initial_map(initial_map, shapes[1].n_vertices)
        with folder.claimed(force), claimed_files(as_mesh, force=force):
            with naming_files(source=source, target=target):
                result = isomatch.match(
                    *shapes, landmarks=pairs, initial_map=first, config=settings, seed=seed, progress=stage
                )
            shared = None
            if as_mesh is not None:
                stage("mending the mesh")
                wrapped = isomatch.wrap(result.map, *shapes)
                shared = write_wrapped(as_mesh, source, wrapped)
            stage("writing")
            given = {"source": source, "target": target, "landmarks": landmarks, "initial map": initial_map}
            record = folder.write(
                *shapes,
                result,
                names=(source.name, target.name),
                titles=(f"source: {source.name}", f"target: {target.name}"),
                facts={what: str(path) for what, path in given.items() if path is not None},
                more={
                    "source": str(source),
                    "target": str(target),
                    **({"as_mesh": shared} if shared else {}),
                },
            )
    if json:
        say_json(record)
        return
    say_result(result)
    if shared:
        say_wrapped(shared)
    say_files(folder.files)
