"""``isomatch match``: match two files and write a folder with their map."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

import isomatch
from isomatch.cli.inputs import naming_files, read_config, read_initial_map
from isomatch.cli.outputs import ResultFolder, say_files, say_result
from isomatch.cli.terminal import progress, say_json
from isomatch.matching import Hypotheses, Orientation, Refinement, Resolution, Start


def match(
    source: Path,
    target: Path,
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    landmarks: Path | None = None,
    target_landmarks: Path | None = None,
    pin: float | None = None,
    hypotheses: Hypotheses | None = None,
    initial_map: Path | None = None,
    refinement: Refinement | None = None,
    orientation: Orientation | None = None,
    start: Start | None = None,
    resolution: Resolution | None = None,
    config: Path | None = None,
    seed: int = 0,
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
        Pairs: on each line two 0-based vertex indices (source, target) or two positions (x y z x y z), separated by
        commas or blanks, or a table with the columns source, target; # starts a comment. With --target-landmarks, the
        points marked on the source.
    target_landmarks : Path
        The points marked on the target: .mrk.json or .fcsv of 3D Slicer, .pp of MeshLab, or text. Points of both files
        are joined by name, or in order if no name is shared.
    pin : float
        Landmarks hold: the map is bent around those farther off than this, in √area; 0 holds all exactly.
    initial_map : Path
        A map to start from: a text file with one 0-based target index per line (-1: unknown), or a map.npz.
    hypotheses : str
        Whether automatic maps compete with the hints (all, the default), or only rivals of them are reported (given).
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
        "pin": pin,
        "hypotheses": hypotheses,
        "resolution": resolution,
    }
    settings = replace(settings, **{name: value for name, value in options.items() if value is not None})
    if landmarks is None and target_landmarks is not None:
        raise isomatch.LandmarkError("--target-landmarks needs --landmarks with the points of the source")
    with progress() as stage:
        stage("reading")
        shapes = isomatch.read_mesh(source), isomatch.read_mesh(target)
        pairs = None if landmarks is None else isomatch.read_landmarks(landmarks, *shapes, target_landmarks)
        first = None if initial_map is None else read_initial_map(initial_map, shapes[1].n_vertices)
        with folder.claimed(force):
            with naming_files(source=source, target=target):
                result = isomatch.match(
                    *shapes, landmarks=pairs, initial_map=first, config=settings, seed=seed, progress=stage
                )
            stage("writing")
            given = {
                "source": source,
                "target": target,
                "landmarks": landmarks,
                "target landmarks": target_landmarks,
                "initial map": initial_map,
            }
            record = folder.write(
                *shapes,
                result,
                names=(source.name, target.name),
                titles=(f"source: {source.name}", f"target: {target.name}"),
                facts={what: str(path) for what, path in given.items() if path is not None},
                more={"source": str(source), "target": str(target)},
            )
    if json:
        say_json(record)
        return
    say_result(result)
    say_files(folder.files)
