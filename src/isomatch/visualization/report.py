"""The page of two shapes and their map, in one HTML file: the report, and what other pages share with it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from html import escape
from pathlib import Path
from platform import python_version
from string import ascii_uppercase
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from isomatch._core import machine
from isomatch._core.arrays import IntArray, array_of
from isomatch._core.errors import LandmarkError, MapError
from isomatch._core.files import write_text
from isomatch.correspondence import UNMATCHED, Correspondence
from isomatch.matching import DoubtfulRegion, Judgement, MatchResult, Outcome, Question, questions
from isomatch.surfaces import Mesh
from isomatch.visualization import viewer
from isomatch.visualization.measures import quality_measures
from isomatch.visualization.picture import png
from isomatch.visualization.plots import MAP_TEXT, WIDTH, draw_map
from isomatch.visualization.scene import Layer, layers_of, scene_of, user_layers
from isomatch.visualization.summary import (
    describe_alternative,
    describe_alternatives,
    describe_difference,
    outcome_colour,
    summary_of,
)

# command, shown on a page, by which the user matches again with the landmarks saved from that page
MATCH_COMMAND = "isomatch match SOURCE TARGET -o DIR --landmarks landmarks.txt"
SIDES = ("source", "target")  # names of shapes that have no other name
GIVEN = "the map that was given"  # name of the map that a match started from, or that was judged
DIFFERENCE = "distance from the given map"  # name of the layer of colours that shows this distance
OUTCOME_OF_VERDICT = {  # verdict of `judge`: outcome in whose colour a page shows the verdict
    "right": Outcome.CONVERGED,
    "doubtful": Outcome.SYMMETRY_AMBIGUOUS,
    "wrong": Outcome.LOW_CONFIDENCE,
}
# outcomes for which a page asks for landmarks
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
    command: str = MATCH_COMMAND,
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
    pairs, shown = pairs_on(landmarks, source, target), shown_maps(source, target, result, given)
    every_layer = layers_of(result) | user_layers(layers or {}, source.n_vertices)
    if picture is None:
        titles = title_of("source", names[0]), title_of("target", names[1])
        still = draw_map(source, target, result.map, titles=titles, width=WIDTH).png()
    else:
        still = Path(picture).read_bytes() if picture else b""
    details = viewer.template("details.html").substitute(
        against=_section("What speaks against it", table_of_quality(result, only_against=True)),
        regions=_table_of_regions(result),
        others=_pictures_of_others(source, target, result, shown[1:]),
        quality=table_of_quality(result),
        notes=notes_of(result),
    )
    helped = result.outcome in _HELPED_BY_LANDMARKS
    page = page_of_result(
        (source, target),
        names,
        result,
        pairs,
        shown,
        every_layer,
        **{name: escape(text) for name, text in (said or {}).items()},
        picture=f'<img src="{png(still)}" alt="{MAP_TEXT.format("Source", "target")}">' if still else "",
        picking=" checked" if helped else "",
        landmarks=_list(command, shown=helped or bool(len(pairs))),
        details=details,
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
        message = "the map was judged by a reference; judge it without, for a page of isomatch's own map"
        raise MapError(message)
    notes = str(judgement), *judgement.result.notes
    # The page shows isomatch's own map; as the other map of each region, it shows the map that was given.
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
            "colour": outcome_colour(OUTCOME_OF_VERDICT[judgement.verdict]),
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
    command: str = MATCH_COMMAND,
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
    return viewer.template("landmarks.html").substitute(unpicked=unpicked, command=escape(command))


MOST_ALTERNATIVES = 4  # largest number of alternatives of a result that a page shows; chosen
MIN_TURN_DEGREES = 0.1  # degrees; if the map turns the source by less, the page does not mention it; chosen


class ShownMap(NamedTuple):
    """A map that a page shows: its name, what it was found by, and how it differs from the map of the result."""

    name: str
    map: Correspondence
    origin: str = ""
    about: str = ""


def shown_maps(
    source: Mesh, target: Mesh, result: MatchResult, given: Correspondence | None = None
) -> list[ShownMap]:
    """List the map of a result, the alternatives that are shown, and the map that was given."""
    shown = [ShownMap("the map", result.map, result.origin)]
    for i, other in enumerate(result.alternatives[:MOST_ALTERNATIVES], 1):
        about = describe_alternative(source, target, result, other)
        shown.append(ShownMap(f"alternative {i}", other.map, other.origin, about))
    if given:
        shown.append(ShownMap(GIVEN, given, "", describe_difference(source, target, result.map, given)))
    return shown


def page_of_result(
    shapes: tuple[Mesh, Mesh],
    names: tuple[str, str],
    result: MatchResult,
    pairs: IntArray,
    shown: Iterable[ShownMap],
    layers: Mapping[str, Layer],
    **parts: str,
) -> str:
    """Make the page of a result with its questions; ``parts`` are as for `page_of`."""
    asked = open_questions_of(*shapes, result)
    answers = [(question.vertex, place) for question in asked for place in question.places]
    kept = np.concatenate([pairs, np.array(answers, dtype=np.int64).reshape(-1, 2)])
    maps = {name: correspondence for name, correspondence, *_ in shown}
    scene = scene_of(*shapes, maps, layers=layers, landmarks=kept)
    summary = summary_of(result)
    parts = {
        "colour": outcome_colour(result.outcome),
        "headline": escape(summary.headline),
        "sureness": escape(summary.sureness),
        "advice": escape(summary.advice_in_python),
        "plain": "Points of the same colour correspond.",
        "maps": "".join(f"<option>{name}</option>" for name in maps),
        "remarks": paragraphs(_remarks_on(scene, result)),
        **parts,
        "details": list_of_questions(asked) + parts.get("details", ""),
    }
    return page_of(shapes, names, scene, pairs, **parts)


# Parts of the page's template that are empty if not given; only a page that a server sends has ``policy`` and ``kind``.
_OPTIONAL_PARTS = ("sureness", "policy", "kind", "work", "picture", "plain", "maps", "details", "run")


def page_of(
    shapes: tuple[Mesh, Mesh],
    names: tuple[str, str],
    scene: Mapping[str, Any],
    pairs: IntArray,
    *,
    style: str = "",
    **parts: str,
) -> str:
    """Fill the template of a page; ``parts`` are HTML, and missing parts are empty."""
    # The browser stores the list of landmarks under this key; the stored list begins with the given pairs.
    kept = {"shapes": [mesh.content_hash for mesh in shapes], "landmarks": pairs.tolist()}
    titles = [title_of(side, name) for side, name in zip(SIDES, names)]
    given = dict.fromkeys(_OPTIONAL_PARTS, "") | parts
    if given["sureness"]:
        given["sureness"] = f'<p id="sureness">{given["sureness"]}</p>\n'
    body = viewer.template("report.html").substitute(
        **given,
        stage=viewer.stage_of(titles, "Both shapes in 3D", given["picture"]),
        pair=escape(" → ".join(f"{n} ({m.n_vertices:,} vertices)" for n, m in zip(names, shapes))),
        given=viewer.script_json(kept),
        scripts=viewer.scripts_of(scene, viewer.text_of("landmarks.js"), viewer.text_of("report.js")),
    )
    root = f' style="--sign: {given["colour"]}"'
    title = f"isomatch: {names[0]} → {names[1]}"
    return viewer.html_page(title, body, style=style, policy=given["policy"], root=root, kind=given["kind"])


def pairs_on(landmarks: ArrayLike | None, source: Mesh, target: Mesh) -> IntArray:
    """Return the landmarks (q, 2) with vertices that both shapes have."""
    none = np.zeros((0, 2), dtype=np.int64)
    pairs = array_of(none if landmarks is None else landmarks, "landmarks", LandmarkError)
    if pairs.ndim != 2 or pairs.shape[1] != 2 or pairs.dtype.kind not in "iu":
        raise LandmarkError(
            f"landmarks have shape {pairs.shape} and type {pairs.dtype}; expected rows (source vertex, target vertex)"
        )
    inside = (pairs >= 0) & (pairs < [source.n_vertices, target.n_vertices])
    return np.asarray(pairs[inside.all(axis=1)], dtype=np.int64)


def _remarks_on(scene: Mapping[str, Any], result: MatchResult) -> list[str]:
    """Explain what the view leaves out, and how it turns the source."""
    remarks = simplified(scene)
    if not result.map.matched.all():
        remarks.insert(0, f"Grey: {(~result.map.matched).sum():,} source vertices without an image.")
    angle = np.degrees(np.arccos(np.clip((np.trace(np.reshape(scene["filed"], (3, 3))) - 1) / 2, -1, 1)))
    if angle > MIN_TURN_DEGREES:
        remarks.append(
            f"In 3D the source lies as in its file. The map implies that it faces like the target after a turn of "
            f"{angle:.0f}°; “turned by the map” and the pictures show it so. Where shapes lie alike in their files, look "
            "at both: turned by the map, even a map that exchanges front and back looks right."
        )
    return remarks


def simplified(scene: Mapping[str, Any]) -> list[str]:
    """Say which shape is drawn with fewer vertices than it has."""
    return [
        f"In 3D the {side} is simplified to {shown:,} of its {used:,} vertices; pictures and numbers are those of the "
        "full shape."
        for side in SIDES
        if (shown := scene[side]["n_shown"]) < (used := scene[side]["n_used"])
    ]


def title_of(side: str, name: str) -> str:
    """Name a shape by its side and its file."""
    return side if name == side else f"{side}: {name}"


STILL_WIDTH = 640  # pixels across the picture of an alternative; chosen
_HOW_TO_CHOOSE = (  # advice above the pictures of alternatives
    "Where DIR is the folder that <code>isomatch match</code> wrote, <code>isomatch choose DIR 1</code> refines "
    "alternative 1, measures it and makes it the map."
)
LIBRARIES = ("numpy", "scipy", "numba", "robust_laplacian", "matplotlib")  # a page shows their versions


def _section(title: str, content: str) -> str:
    """Make a section; nothing if it has no content."""
    return f"<section><h2>{escape(title)}</h2>{content}</section>" if content else ""


def table_of_quality(result: MatchResult, *, only_against: bool = False) -> str:
    """Make a table of the measures with their bounds, or of those that speak against the map; nothing without any."""
    rows = "".join(
        f'<tr{" class=against" if against else ""}><th scope="row">{escape(measure.name)}</th>'
        f'<td class="number">{escape(measure.value(number))}</td>'
        f'<td class="bound">{escape(measure.bound)}{" (violated)" if against else ""}</td>'
        f"<td>{escape(measure.meaning)}</td></tr>"
        for measure, number, against in quality_measures(result)
        if against or not only_against
    )
    return _headed_table(rows, "measure", "value", "bound", "meaning")


def _other_image_of(region: DoubtfulRegion) -> str:
    """Write where another map sends the first vertex of a region; empty if there is none."""
    image = UNMATCHED if region.runner_up is None else int(region.runner_up[0])
    return "" if image == UNMATCHED else str(image)


def _table_of_regions(result: MatchResult) -> str:
    """Make a table of the regions where the map may be wrong; nothing if there are none."""
    rows = "".join(
        f'<tr><th scope="row">{number}</th><td class="number">{region.area:.1%}</td>'
        f'<td class="number" data-is="vertex">{region.vertices[0]}</td>'
        f'<td class="number" data-is="other image">{_other_image_of(region)}</td>'
        f"<td>{escape(region.reason)}</td></tr>"
        for number, region in enumerate(result.regions, 1)
    )
    introduction = (
        "<p>Where the map may be wrong; the colour “doubt” shows the regions. The vertex is the most doubtful one of its "
        "region; the other image is where another map sends it.</p>"
    )
    table = _headed_table(rows, "region", "area", "vertex", "other image", "reason")
    return _section("Regions of doubt", table and introduction + table)


def _headed_table(rows: str, *columns: str) -> str:
    """Make a table of rows, which are HTML; nothing if there are none."""
    heads = "".join(f'<th scope="col">{name}</th>' for name in columns)
    table = f'<table class="quality"><thead><tr>{heads}</tr></thead><tbody>{rows}</tbody></table>'
    return table if rows else ""


def open_questions_of(source: Mesh, target: Mesh, result: MatchResult) -> tuple[Question, ...]:
    """Return the questions that a page asks: none where the map is sure."""
    return () if result.outcome.is_called_right else questions(source, target, result)


def list_of_questions(open_questions: Sequence[Question]) -> str:
    """Ask where points of the source are; a button for each place adds a landmark. Nothing if there are no questions."""

    def button(vertex: int, place: int | str, text: str, more: str = "") -> str:
        return f'<button type="button" class="small" data-pair="{vertex},{place}"{more}>{text}</button>'

    rows = "".join(
        f"<li>Point {number} (vertex {question.vertex}) "
        + "".join(
            button(question.vertex, place, letter, f' data-map="{k}"') + " "
            for letter, place, k in zip(ascii_uppercase, question.places, question.maps)
        )
        + button(question.vertex, "?", "elsewhere")
        + "</li>"
        for number, question in enumerate(open_questions, 1)
    )
    introduction = (
        "<p>Where are these points? Each letter is the place by one of the maps; point at it to see both ends, and click "
        "the right one, which shows its map. Then match again with these landmarks.</p>"
    )
    return _section("Questions that decide", rows and f'{introduction}<ol class="asked">{rows}</ol>')


def _pictures_of_others(source: Mesh, target: Mesh, result: MatchResult, others: Sequence[ShownMap]) -> str:
    """Draw the given map and the alternatives, and describe them."""
    figures = "".join(
        f'<figure><img src="{png(draw_map(source, target, other, titles=("", ""), width=STILL_WIDTH).png())}" '
        f'alt="{sentence(name)}"><figcaption title="found by {escape(origin or "you")}">'
        f"<strong>{sentence(name)}</strong> {escape(about)}</figcaption></figure>"
        for name, other, origin, about in sorted(others, key=lambda shown: shown.name != GIVEN)
    )
    advice = f"<p>{escape(describe_alternatives(result))} {_HOW_TO_CHOOSE}</p>" if result.alternatives else ""
    return _section("Other maps", figures and f'{advice}<div class="stills">{figures}</div>')


def tables_of_run(result: MatchResult, facts: Mapping[str, object]) -> str:
    """Tell how the map was found: facts, seconds and settings."""
    run = {
        "outcome": result.outcome.value,
        **facts,
        "winning start": result.origin,
        "selected for": result.reason,
        "geodesic engine": result.engine,
        "seed": result.seed,
        **{f"{side} onto itself": symmetry for side, symmetry in zip(SIDES, result.symmetries) if symmetry},
        **versions(),
    }
    seconds = {stage: f"{spent:.2f}" for stage, spent in result.timings.items()}
    # We show the settings of the whole match that have a value, and the changed settings of the stages.
    every = result.config.to_dict().items()
    everyday = {name: x for name, x in every if x is not None and not isinstance(x, dict)}
    settings = everyday | result.config.changed()
    return table("Run", run) + table("Seconds", seconds) + table("Settings", settings)


def notes_of(result: MatchResult) -> str:
    """Say what was repaired, left out or replaced."""
    return paragraphs(map(sentence, result.notes or ["Nothing was repaired, left out or replaced."]))


def table(title: str, rows: Mapping[str, object]) -> str:
    """Make a section with a table of two columns."""
    return _section(title, viewer.html_table(rows.items()))


def paragraphs(lines: Iterable[str]) -> str:
    """Set each line in small print."""
    return "".join(f'<p class="soft">{escape(line)}</p>' for line in lines)


def sentence(text: str) -> str:
    """Begin with a capital."""
    return text[:1].upper() + text[1:]


def versions() -> dict[str, str]:
    """Return the versions of Python and of the libraries that affect numbers."""
    return {"python": python_version(), **machine.versions(LIBRARIES)}
