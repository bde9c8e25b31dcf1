"""``isomatch match``: match two files and write a folder with their map."""

from __future__ import annotations

import shlex
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

import isomatch
from isomatch import view
from isomatch.assets import files_beside
from isomatch.cli.inputs import naming_files, read_config, read_functions, read_outcomes, read_surface
from isomatch.cli.outputs import (
    ResultFolder,
    back_of,
    claimed_files,
    notes_on,
    refuse_outcomes,
    require_writable,
    say_files,
    say_result,
    say_wrapped,
    write_wrapped,
)
from isomatch.cli.terminal import TALK, Talk, json_text, part, say
from isomatch.errors import LandmarkError, MapError, NotConvergedError
from isomatch.settings import Hypotheses, Orientation, RefinementName, Resolution, Start
from isomatch.storage.files import write_text


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
    function: Annotated[list[str] | None, Parameter(negative=())] = None,
    refinement: RefinementName | None = None,
    orientation: Orientation | None = None,
    start: Start | None = None,
    resolution: Resolution | None = None,
    config: Path | None = None,
    both: bool = False,
    fail_on: str | None = None,
    report: Annotated[bool, Parameter(name="--report", negative="--no-report", show_default=False)] = True,
    as_mesh: Path | None = None,
    seed: int = 0,
    force: bool = False,
    details: Annotated[bool, Parameter(negative=())] = False,
    talk: Talk = TALK,
) -> None:
    """Match two shapes: find the target point of every source vertex.

    Parameters
    ----------
    source : Path
        Mesh to map from: any surface file, such as .ply, .obj or .vtp. Points without faces are a point cloud.
    target : Path
        Mesh to map to.
    output : Path
        Folder for map.npz, map.txt, result.json, map.png, report.html, and alternative_1.npz … for isomatch choose; with
        --both also map_back.npz. Without a map, picker.html.
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
        A map to start from: a text file with one target vertex per line (-1: unknown), an .npy, .mat or map.npz.
    hypotheses : str
        Whether automatic maps compete with the hints (all, the default), or are only reported as alternatives (given).
    function : list of str
        Name of a scalar or a colour of the points that means the same in both files, such as thickness: it takes part
        in search and refinement. May be given several times.
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
    both : bool
        Also find the map of the other direction, map_back.npz; both together take about 1.3 times as long as one.
    fail_on : str
        Outcomes that make the exit code 1, after all files are written: low-confidence, mirror-image,
        symmetry-ambiguous, hints-contradicted, partial, converged; several with commas. With --both, that of either
        direction counts.
    report : bool
        Whether to write report.html.
    as_mesh : Path
        Surface file to write: the source, with its faces and all that its file carries, in the shape of the target, in
        the target's coordinates and frame.
    seed : int
        Seed of the sampling and of the eigensolver.
    force : bool
        Replace an existing result in the folder.
    details : bool
        Print every measure too, with its bound, and the seconds of each stage.
    talk : Talk
        What is told.
    """
    refused = read_outcomes(fail_on)
    folder = ResultFolder(output, report=report, both=both)
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
    with talk.progress() as tell:
        tell("reading", 0.0)
        shapes = read_surface(source), read_surface(target)
        drawn = view.drawable(shapes[0]), view.drawable(shapes[1])
        pairs = None if landmarks is None else isomatch.read_landmarks(landmarks, *shapes, target_landmarks)
        n_target = shapes[1].n_vertices
        first: Any = None if initial_map is None else isomatch.Correspondence.load(initial_map, n_target)
        known = None
        if function:
            known = (
                read_functions(source, function, shapes[0].n_vertices),
                read_functions(target, function, shapes[1].n_vertices),
            )
        beside: tuple[Path, ...] = ()
        if as_mesh is not None:
            require_writable(as_mesh)
            _require_faces(**{str(source): shapes[0], str(target): shapes[1]})
            assets = isomatch.read_asset(source), isomatch.read_asset(target, sound=False)
            beside = files_beside(as_mesh, assets[0])
        with folder.claimed(force), claimed_files(as_mesh, *beside, force=force):
            inputs = {
                "source": source,
                "target": target,
                "landmarks": landmarks,
                "target landmarks": target_landmarks,
                "initial map": initial_map,
            }
            again = {**options, "output": output, "initial_map": initial_map, "config": config, "seed": seed}
            again |= {"function": function}
            again |= {"both": both or None, "as_mesh": as_mesh}
            shown: dict[str, Any] = {
                "names": (source.name, target.name),
                "facts": {what: str(path) for what, path in inputs.items() if path is not None},
                "landmarks": pairs,
                "command": with_landmarks(source, target, **again),
            }
            run: Callable[..., tuple[isomatch.MatchResult, isomatch.MatchResult | None]]
            run = isomatch.match_both if both else _one_way
            try:
                with naming_files(source=source, target=target):
                    result, back = run(
                        *shapes,
                        landmarks=pairs,
                        initial_map=first,
                        functions=known,
                        config=settings,
                        seed=seed,
                        progress=part(tell, 0.05, 0.85),
                    )
            except (LandmarkError, MapError, NotConvergedError) as error:
                raise folder.write_picker(*drawn, error, **shown) from error
            tell("writing", 0.85)
            titles = f"source: {source.name}", f"target: {target.name}"
            more: dict[str, Any] = {
                "source": str(source),
                "target": str(target),
                "match_again": shown["command"],
                "landmarks": [] if pairs is None else pairs.tolist(),
            }
            record = folder.write(
                *drawn, result, titles=titles, more=more, back=back_of(back) if back else None, **shown
            )
            if as_mesh is not None:
                wrapped = isomatch.wrap(result.map, *shapes)
                record["as_mesh"] = {
                    **write_wrapped(as_mesh, assets[0], assets[1].frame, wrapped, result.expected_error),
                    "files_beside": list(map(str, beside)),
                    "notes": notes_on(dict(zip((source, target), assets))),
                }
                write_text(folder.result, json_text(record))
        tell("done", 1.0)

    def summary() -> None:
        say_result(result, details)
        if back:
            say("back, from target to source", "bold")
            say_result(back, details)
        if as_mesh is not None:
            say_wrapped(record["as_mesh"])
        say_files(record)

    talk.result(record, summary)
    for matched in filter(None, (result, back)):
        refuse_outcomes(matched, refused, folder.folder)


def _one_way(source: Any, target: Any, **options: Any) -> tuple[isomatch.MatchResult, None]:
    return isomatch.match(source, target, **options), None


def _require_faces(**shapes: isomatch.Mesh | isomatch.PointCloud) -> None:
    for name, shape in shapes.items():
        if isinstance(shape, isomatch.PointCloud):
            raise isomatch.MeshError(
                f"{name}: has no faces, which --as-mesh needs; give a mesh, or leave it out"
            )


def with_landmarks(source: Path, target: Path, **options: Any) -> str:
    """Write the command that matches again with landmarks."""
    words = ["isomatch", "match", str(source), str(target)]
    for name, value in options.items():
        if value is not None and (name, value) != ("seed", 0):
            option = f"--{name.replace('_', '-')}"
            for each in value if isinstance(value, list) else [value]:
                words += [option, *([] if each is True else [str(each)])]
    return shlex.join([*words, "--landmarks", "landmarks.txt", "--force"])
