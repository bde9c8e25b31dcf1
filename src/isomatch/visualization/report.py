"""The report of a match in one HTML file: outcome, pictures, a 3D view, quality, alternatives, settings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from html import escape
from pathlib import Path

from numpy.typing import ArrayLike

from isomatch._core.errors import MapError
from isomatch._core.files import write_text
from isomatch.correspondence import Correspondence
from isomatch.matching import Judgement, MatchResult, Outcome
from isomatch.surfaces import Mesh
from isomatch.visualization.pair_page import (
    GIVEN,
    SIDES,
    details_of,
    maps_of,
    open_questions_of,
    page_of,
    pairs_on,
    pairs_shown,
    paragraphs,
    parts_of,
    sentence,
    simplified,
    table,
    tables_of_run,
    title_of,
    versions,
)
from isomatch.visualization.picture import png
from isomatch.visualization.plots import SEEN, WIDTH, draw_map
from isomatch.visualization.scene import layers_of, scene_of, user_layers
from isomatch.visualization.summary import outcome_colour
from isomatch.visualization.viewer import template

COMMAND = "isomatch match SOURCE TARGET -o DIR --landmarks landmarks.txt"

VERDICTS = {
    "right": Outcome.CONVERGED,
    "doubtful": Outcome.SYMMETRY_AMBIGUOUS,
    "wrong": Outcome.LOW_CONFIDENCE,
}  # a verdict is shown in the colour of this outcome
DIFFERENCE = "distance from the given map"
_HELPED_BY_LANDMARKS = (Outcome.PRIORS_CONTRADICTED, Outcome.SYMMETRY_AMBIGUOUS, Outcome.LOW_CONFIDENCE)


def write_report(
    path: str | Path,
    source: Mesh,
    target: Mesh,
    result: MatchResult,
    *,
    names: tuple[str, str] = SIDES,
    picture: str | Path | None = None,
    facts: Mapping[str, object] | None = None,
    layers: Mapping[str, ArrayLike] | None = None,
    landmarks: ArrayLike | None = None,
    command: str = COMMAND,
    given: Correspondence | None = None,
    said: Mapping[str, str] | None = None,
) -> None:
    """Write the report of a match: one HTML file that loads nothing from the network.

    Parameters
    ----------
    path : path_like
        File to write; an existing file is replaced.
    source, target : Mesh
        The two matched shapes.
    result : MatchResult
        Result of `match` for them.
    names : (str, str)
        Names of the two shapes, such as their file names.
    picture : path_like, optional
        PNG file of `draw_map` to embed; by default it is drawn, and if empty there is none.
    facts : mapping of str to object, optional
        Additional rows for the table about the run.
    layers : mapping of str to (n_source,) array_like of float, optional
        Further values to be shown as colours, such as errors; ``nan`` is grey. Positions, stretch and what the result
        knows (expected error, descriptor distance, doubt) are always there.
    landmarks : (q, 2) array_like of int, optional
        Pairs (source vertex, target vertex) with which the list of landmarks begins; pairs with
        vertices that the shapes lack are left out.
    command : str
        Command that matches again with the saved landmarks, to be copied.
    given : Correspondence, optional
        The map that the match started from, or another one to be compared; it can be shown like the alternatives.
    said : mapping of str to str, optional
        ``headline``, ``sureness``, ``advice`` and ``colour``, which replace those in the result.

    Raises
    ------
    DescriptorError
        If a layer does not have one number for each source vertex, or has the name of one that is always there.
    LandmarkError
        If landmarks are not pairs of integers.
    UnwritableFileError
        If the file cannot be written.

    Notes
    -----
    The 3D view shows the source as it lies in its file. Pictures turn it by the rotation that the map implies, under
    which even a map that exchanges front and back looks right. A shape of more than 30 000 vertices is simplified in the
    3D view, and the report says so; pictures and numbers describe the full shape. The size is about 75 bytes per
    shown vertex and 30 for each alternative, plus the pictures.
    """
    pairs = pairs_on(landmarks, source, target)
    every = layers_of(result) | user_layers(layers or {}, source.n_vertices)
    open_questions = open_questions_of(source, target, result)
    scene = scene_of(
        source, target, maps_of(result, given), layers=every, landmarks=pairs_shown(pairs, open_questions)
    )
    titles = title_of("source", names[0]), title_of("target", names[1])
    if picture is None:
        still = png(draw_map(source, target, result.map, titles=titles, width=WIDTH).png())
    else:
        still = png(Path(picture).read_bytes()) if picture else ""
    helped = result.outcome in _HELPED_BY_LANDMARKS
    page = page_of(
        (source, target),
        names,
        scene,
        pairs,
        **(parts_of(scene, result) | {name: escape(text) for name, text in (said or {}).items()}),
        picture=f'<img src="{still}" alt="{SEEN.format("Source", "target")}">' if still else "",
        picking=" checked" if helped else "",
        landmarks=_list(command, shown=helped or bool(len(pairs))),
        details=details_of(source, target, result, open_questions, given),
        run=tables_of_run(result, facts or {}),
    )
    write_text(Path(path), page)


def write_judgement(
    path: str | Path, source: Mesh, target: Mesh, judgement: Judgement, *, names: tuple[str, str] = SIDES
) -> None:
    """Write a page of isomatch's own map beside the one that was judged, with the regions in which they differ.

    Parameters
    ----------
    path, source, target, names
        As for `write_report`.
    judgement : Judgement
        What `judge` found with its own map.

    Raises
    ------
    MapError
        If the judgement has no map of isomatch's own, as it was made with a reference.
    UnwritableFileError
        If the file cannot be written.
    """
    if judgement.result is None:
        raise MapError(
            "the map was judged by a reference; judge it without, for a page of isomatch's own map"
        )
    notes = str(judgement), *judgement.result.notes
    # the page shows isomatch's own map, so the map that was given is the other one
    regions = tuple(
        replace(region, runner_up=judgement.map.vertices[region.vertices]) for region in judgement.regions
    )
    result = replace(judgement.result, regions=regions, notes=notes)
    write_report(
        path,
        source,
        target,
        result,
        names=names,
        facts={GIVEN: str(judgement)},
        layers={DIFFERENCE: judgement.distance},
        given=judgement.map,
        said={
            "headline": sentence(f"{judgement}."),
            "sureness": f"“The map” is isomatch's own. The colour “{DIFFERENCE}” shows where {GIVEN} differs from it.",
            "advice": "",
            "colour": outcome_colour(VERDICTS[judgement.verdict]),
        },
    )


def write_landmark_picker(
    path: str | Path,
    source: Mesh,
    target: Mesh,
    reason: str,
    *,
    names: tuple[str, str] = SIDES,
    facts: Mapping[str, object] | None = None,
    landmarks: ArrayLike | None = None,
    command: str = COMMAND,
) -> None:
    """Write the report of a match without a map: the reason, and both shapes to pick landmarks.

    ``reason`` is the text of the error; the other parameters are as for `write_report`.
    """
    pairs = pairs_on(landmarks, source, target)
    scene = scene_of(source, target, {}, landmarks=pairs)
    page = page_of(
        (source, target),
        names,
        scene,
        pairs,
        colour=outcome_colour(Outcome.LOW_CONFIDENCE),
        headline="No map was found",
        advice=escape(sentence(reason.rstrip(".")) + "."),
        plain="Pick landmarks below.",
        remarks=paragraphs(simplified(scene)),
        picking=" checked",
        landmarks=_list(command, shown=True),
        run=table("Run", {**(facts or {}), **versions()}),
    )
    write_text(Path(path), page)


def _list(command: str, *, shown: bool) -> str:
    """Make the list of landmarks, with the command that matches again."""
    unpicked = "" if shown else " hidden"
    return template("landmarks.html").substitute(unpicked=unpicked, command=escape(command))
