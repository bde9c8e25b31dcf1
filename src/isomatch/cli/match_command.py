"""``isomatch match`` and ``choose``: match two files, and continue with an alternative."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from cyclopts import Parameter

import isomatch
from isomatch import matching
from isomatch._core.errors import InputError, LandmarkError, MapError, MeshError, NotConvergedError
from isomatch._core.files import write_text
from isomatch._core.texts import json_text
from isomatch.cli.inputs import (
    ConfigFile,
    Details,
    Force,
    Output,
    Rounded,
    Seed,
    Surface,
    naming_files,
    read_config,
    read_functions,
    read_initial_map,
    read_landmarks,
    read_outcomes,
    read_surface,
)
from isomatch.cli.outputs import claimed_files, notes_on, require_writable, say_wrapped, write_wrapped
from isomatch.cli.results import (
    BACK_REMOVED,
    RESULT,
    Earlier,
    Inputs,
    ResultFolder,
    described,
    match_again,
    say_files,
    say_result,
)
from isomatch.cli.terminal import TALK, Talk, part, say, say_rows
from isomatch.io import Attribute, files_beside, with_structure_of
from isomatch.settings import Hypotheses, Orientation, RefinementName, Resolution, Start


@Parameter(name="*")
@dataclass(frozen=True)
class Priors:
    """What is known of a map before the match.

    Args:
        landmarks: Pairs: on each line two 0-based vertex indices (source, target) or two positions (x y z x y z),
            separated by commas or blanks, or a table with the columns source, target; # starts a comment. With
            --target-landmarks, the points marked on the source.
        target_landmarks: The points marked on the target: .mrk.json or .fcsv of 3D Slicer, .pp of MeshLab, or text.
            Points of both files are joined by name, or in order if no name is shared.
        pin: Largest error of a landmark, in √area: the map is bent around landmarks with a larger
            one. 0 enforces all exactly.
        hypotheses: Whether automatic maps compete with the priors (all, the default), or are only reported as
            alternatives (given).
        initial_map: A map to start from: a text file with one target vertex per line (-1: unknown), an .npy, .mat or
            map.npz.
        function: Name of a scalar or a colour of the points that means the same in both files, such as thickness: it
            takes part in search and refinement. May be given several times.
        via: Surface file of a complete shape, if both shapes are parts of such a shape: they are
            matched through it. Given twice: a complete shape of the source's kind, then one of the
            target's.
    """

    landmarks: Path | None = None
    target_landmarks: Path | None = None
    pin: float | None = None
    hypotheses: Hypotheses | None = None
    initial_map: Path | None = None
    function: list[str] | None = None
    via: list[Path] | None = None

    def read(self, ends: tuple[Path, Path], shapes: tuple[Surface, Surface]) -> dict[str, Any]:
        """Read the files, as arguments of `isomatch.match`."""
        pairs = read_landmarks(self.landmarks, self.target_landmarks, ends)
        counts, names = [shape.n_vertices for shape in shapes], self.function
        functions = tuple(map(read_functions, ends, (names, names), counts)) if names else None
        first = read_initial_map(self.initial_map, shapes[1])
        given = {"landmarks": pairs, "initial_map": first, "functions": functions}
        return given | ({"via": tuple(map(read_surface, self.via))} if self.via else {})


@Parameter(name="*")
@dataclass(frozen=True)
class SearchOptions:
    """How a map is searched and refined.

    Args:
        refinement: How the map is refined: joint (default), smooth, laplace_icp (similar to the paper), or none.
        orientation: Whether the map preserves orientation: preserve (default), reverse (a mirror image), or any.
        start: "pose" if the meshes are roughly aligned in space, which gives a first map; otherwise auto (default).
        resolution: On how many vertices large meshes are matched: auto (default), full, or fast. The map is of all
            vertices.
    """

    refinement: RefinementName | None = None
    orientation: Orientation | None = None
    start: Start | None = None
    resolution: Resolution | None = None
    config: ConfigFile = None


PRIORS, SEARCH_OPTIONS = Priors(), SearchOptions()  # defaults of `match`: no options given


def match(
    source: Path,
    target: Path,
    /,
    *,
    output: Output,
    priors: Priors = PRIORS,
    search: SearchOptions = SEARCH_OPTIONS,
    both: bool = False,
    fail_on: str | None = None,
    report: Annotated[bool, Parameter(name="--report", negative="--no-report", show_default=False)] = True,
    as_mesh: Path | None = None,
    seed: Seed = 0,
    rounded: Rounded = False,
    force: Force = False,
    details: Details = False,
    talk: Talk = TALK,
) -> None:
    """Match two shapes: find the target point of every source vertex.

    Args:
        source: Mesh to map from: any surface file, such as .ply, .obj or .vtp. Points without faces are a point cloud.
        target: Mesh to map to.
        output: Folder for map.npz, map.txt, result.json, map.png, report.html, and alternative_1.npz … for isomatch
            choose; with --both also map_back.npz. Without a map, picker.html.
        both: Also find the map of the other direction, map_back.npz; both together take about 1.3 times as long as one.
        fail_on: Outcomes that make the exit code 4, after all files are written: low-confidence, mirror-image,
            symmetry-ambiguous, priors-contradicted, partial, converged; several with commas. With
            --both, the outcome of either direction counts.
        report: Whether to write report.html.
        as_mesh: Surface file to write: the source, with its faces and all that its file carries, in the shape of the
            target, in the target's coordinates and frame.
    """
    failing_outcomes = read_outcomes(fail_on)
    if both and priors.via:
        message = "--via finds the map of one direction; match the other by a second command, without --both"
        raise InputError(message)
    folder, ends = ResultFolder(output, report=report, both=both), (source, target)
    options: dict[str, Any] = {**vars(search), **vars(priors), "landmarks": None, "target_landmarks": None}
    chosen = {name: x for name, x in options.items() if x is not None and hasattr(isomatch.Config, name)}
    config = replace(read_config(search.config) or isomatch.Config(), **chosen)
    command = match_again(*ends, **options, output=output, seed=seed, both=both, as_mesh=as_mesh)
    with talk.progress() as tell:
        tell("reading", 0.0)
        shapes = read_surface(source), read_surface(target)
        hints = priors.read(ends, shapes)
        pairs = hints["landmarks"]
        files = {name: getattr(priors, name) for name in ("landmarks", "target_landmarks", "initial_map")}
        facts = {name.replace("_", " "): str(path) for name, path in files.items() if path is not None}
        inputs = Inputs(*ends, command, [] if pairs is None else pairs.tolist(), facts, hints["initial_map"])
        assets, side_files = _read_for_wrapping(as_mesh, ends, shapes, rounded)
        with folder.claimed(force), claimed_files(as_mesh, *side_files, force=force):
            run: Callable[..., Any] = isomatch.match_both if both else isomatch.match
            try:
                with naming_files(source=source, target=target):
                    results = run(*shapes, **hints, config=config, seed=seed, progress=part(tell, 0.05, 0.85))
            except (LandmarkError, MapError, NotConvergedError) as error:
                raise folder.write_picker(shapes, error, inputs) from error
            result, back = results if both else (results, None)
            tell("writing", 0.85)
            record = folder.write(shapes, result, inputs, back=(back.map, described(back)) if back else None)
            if as_mesh is not None:
                wrapped, errors = isomatch.wrap(result.map, *shapes), result.expected_error
                record["as_mesh"] = {
                    **write_wrapped(as_mesh, assets[0], assets[1].frame, wrapped, errors, rounded),
                    "files_beside": list(map(str, side_files)),
                    "notes": notes_on(dict(zip(ends, assets))),
                }
                write_text(output / RESULT, json_text(record))
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
        if (outcome := matched.outcome) in failing_outcomes:
            raise NotConvergedError(
                f"the outcome is {outcome.name.lower().replace('_', '-')}; the files are in {output}. {outcome.advice}"
            )


def _read_for_wrapping(
    as_mesh: Path | None, ends: tuple[Path, Path], shapes: tuple[Surface, Surface], rounded: bool
) -> tuple[list[isomatch.Asset], list[Path]]:
    """Read the assets for ``--as-mesh`` and name the files beside it; none without it."""
    if as_mesh is None:
        return [], []
    for path, shape in zip(ends, shapes):
        if not isinstance(shape, isomatch.Mesh):
            raise MeshError(f"{path}: has no faces, which --as-mesh needs; give a mesh, or leave it out")
    require_writable(as_mesh, shapes[1], rounded)
    assets = [isomatch.read_asset(ends[0]), isomatch.read_asset(ends[1], sound=False)]
    assets[0] = with_structure_of(*assets)
    measured = Attribute("expected_error", "point", "scalar", np.zeros(len(assets[0].points)))
    return assets, list(files_beside(as_mesh, assets[0].with_attributes(measured)))


def choose(folder: Path, number: int, /, *meshes: Path, details: Details = False, talk: Talk = TALK) -> None:
    """Make an alternative the map: refine and measure it, and replace the files of the result.

    The former map becomes alternative 1, and the other alternatives follow. A map of the other direction is removed;
    the file of --as-mesh stays what it was.

    Args:
        folder: Folder that isomatch match wrote.
        number: Number of the alternative in the report, from 1.
        meshes: Source and target, if they are not where they were, as seen from the folder or from here.
    """
    earlier = Earlier.read(folder, *meshes)
    inputs, landmarks = earlier.inputs, earlier.inputs.landmarks or None
    with talk.progress() as tell, earlier.folder.claimed(force=True):
        tell("reading", 0.0)
        shapes, progress = earlier.surfaces(), part(tell, 0.05, 0.85)
        with naming_files(source=inputs.source, target=inputs.target):
            former = earlier.result(*shapes)
            result = matching.continue_with(former, number, *shapes, landmarks, progress)
        tell("writing", 0.85)
        had_back = earlier.folder.has_back
        record = earlier.folder.write(shapes, result, replace(inputs, facts={"chosen": result.notes[0]}))

    def summary() -> None:
        say_result(result, details)
        say_rows(("note", note) for note in [*([BACK_REMOVED] if had_back else []), *earlier.mesh_left])
        say_files(record)

    talk.result(record, summary)
