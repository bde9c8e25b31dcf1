"""The report of a match in one HTML file: outcome, pictures, a 3D view, quality, alternatives, settings."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from pathlib import Path

from numpy.typing import ArrayLike

from isomatch.matching import MatchResult, Outcome
from isomatch.storage.files import write_text
from isomatch.surfaces import Mesh
from isomatch.view.layers import known_layers, user_layers
from isomatch.view.outcome_colours import outcome_colour
from isomatch.view.page import (
    MOST_ALTERNATIVES,
    SIDES,
    maps_of,
    page_of,
    pairs_on,
    remarks_on,
    simplified,
    template,
    title_of,
    told_of,
)
from isomatch.view.picture import png
from isomatch.view.report_sections import (
    drawn,
    paragraphs,
    pictures_of_alternatives,
    sentence,
    table,
    table_against,
    table_of_quality,
    table_of_regions,
    tables_of_run,
    versions,
)
from isomatch.view.scene import scene_of
from isomatch.view.stills import WIDTH

COMMAND = "isomatch match SOURCE TARGET -o DIR --landmarks landmarks.txt"

_HELPED_BY_LANDMARKS = (Outcome.HINTS_CONTRADICTED, Outcome.SYMMETRY_AMBIGUOUS, Outcome.LOW_CONFIDENCE)


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
        Names of the two shapes, such as those of their files.
    picture : path_like, optional
        PNG file of `draw_map` to embed; by default it is drawn.
    facts : mapping of str to object, optional
        Additional rows for the table about the run.
    layers : mapping of str to (n_source,) array_like of float, optional
        Values at the source's vertices by name, such as errors or a confidence, that can be shown as colours; ``nan`` is
        grey. Positions, the stretch of the edges and, where they are known, the expected error, the mismatch and the
        regions of doubt are always there.
    landmarks : (q, 2) array_like of int, optional
        Pairs (source vertex, target vertex) with which the list of landmarks begins; pairs of vertices that the shapes
        do not have are left out.
    command : str
        Command that matches again with the saved landmarks, to be copied.

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
    3D view, and the report says so; pictures and numbers are those of the full shape. The size is about 75 bytes per
    shown vertex and 30 for each alternative, plus the pictures.
    """
    maps = maps_of(result)
    pairs = pairs_on(landmarks, source, target)
    scene = scene_of(
        source,
        target,
        maps,
        layers=known_layers(result) | user_layers(layers or {}, source.n_vertices),
        landmarks=pairs,
    )
    titles = title_of("source", names[0]), title_of("target", names[1])
    if picture is None:
        still = png(drawn(source, target, result.map, titles, WIDTH))
    else:
        still = png(Path(picture).read_bytes()) if picture else ""
    helped = result.outcome in _HELPED_BY_LANDMARKS
    details = template("details.html").substitute(
        against=table_against(result),
        regions=table_of_regions(result),
        alternatives=pictures_of_alternatives(
            source, target, result, result.alternatives[:MOST_ALTERNATIVES]
        ),
        quality=table_of_quality(result),
        notes=paragraphs(map(sentence, result.notes or ["Nothing was repaired, left out or replaced."])),
    )
    page = page_of(
        (source, target),
        names,
        scene,
        pairs,
        **told_of(result),
        picture=f'<img src="{still}" alt="Source on the left, target on the right; points of the same colour '
        'correspond.">'
        if still
        else "",
        plain="Points of the same colour correspond.",
        maps="".join(f"<option>{escape(name)}</option>" for name in maps),
        remarks=paragraphs(remarks_on(scene, result)),
        picking=" checked" if helped else "",
        landmarks=_list(command, shown=helped or bool(len(pairs))),
        details=details,
        run=tables_of_run(result, facts or {}),
    )
    write_text(Path(path), page)


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
    """Write the report of a match that found no map: both shapes in 3D, to pick landmarks for another match.

    Parameters
    ----------
    reason : str
        Why no map was found.
    path, source, target, names, facts, landmarks, command
        As for `write_report`.

    Raises
    ------
    LandmarkError
        If landmarks are not pairs of integers.
    UnwritableFileError
        If the file cannot be written.
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
        picture="",
        plain="Pick landmarks below.",
        maps="",
        remarks=paragraphs(simplified(scene)),
        picking=" checked",
        landmarks=_list(command, shown=True),
        details="",
        run=table("Run", {**(facts or {}), **versions()}),
    )
    write_text(Path(path), page)


def _list(command: str, *, shown: bool) -> str:
    """Make the list of landmarks, with the command that matches again."""
    unpicked = "" if shown else " hidden"
    return template("landmarks.html").substitute(unpicked=unpicked, command=escape(command))
