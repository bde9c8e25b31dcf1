"""The page of two shapes and their maps in 3D, and the sections below it: what all pages share."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from platform import python_version
from string import ascii_uppercase
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from isomatch._core import machine
from isomatch._core.arrays import IntArray, array_of
from isomatch._core.errors import LandmarkError
from isomatch.correspondence import Correspondence
from isomatch.matching import MatchResult, Outcome, Question, questions
from isomatch.surfaces import Mesh
from isomatch.visualization.measures import quality_measures
from isomatch.visualization.picture import png
from isomatch.visualization.plots import draw_map
from isomatch.visualization.summary import (
    describe_alternative,
    describe_alternatives,
    describe_given_map,
    outcome_colour,
    summary_of,
)
from isomatch.visualization.viewer import (
    html_page,
    html_table,
    script_json,
    scripts_of,
    stage_of,
    template,
    text_of,
)

MOST_ALTERNATIVES = 4
MIN_TURN_DEGREES = 0.1  # a smaller turn of the source is not mentioned
SIDES = ("source", "target")
GIVEN = "the map that was given"  # name of the map that a match started from, or that was judged
# parts that a page may have; a served page has a kind and adds to the content security policy
_OPTIONAL_PARTS = ("policy", "kind", "work", "picture", "plain", "maps", "picking", "details", "run")


def page_of(
    shapes: tuple[Mesh, Mesh],
    names: tuple[str, str],
    scene: Mapping[str, Any],
    pairs: IntArray,
    *,
    style: str = "",
    sureness: str = "",
    **parts: str,
) -> str:
    """Fill the template of a page; ``parts`` are HTML, and missing parts are empty."""
    # the browser keeps the list of landmarks by this key; the list begins with the pairs
    kept = {"shapes": [mesh.content_hash for mesh in shapes], "landmarks": pairs.tolist()}
    titles = [title_of(side, name) for side, name in zip(SIDES, names)]
    given = dict.fromkeys(_OPTIONAL_PARTS, "") | parts
    body = template("report.html").substitute(
        **given,
        stage=stage_of(titles, "Both shapes in 3D", given["picture"]),
        sureness=f'<p id="sureness">{sureness}</p>\n' if sureness else "",
        pair=escape(" → ".join(f"{n} ({m.n_vertices:,} vertices)" for n, m in zip(names, shapes))),
        given=script_json(kept),
        scripts=scripts_of(scene, text_of("landmarks.js"), text_of("report.js")),
    )
    root = f' style="--sign: {given["colour"]}"'
    title = f"isomatch: {names[0]} → {names[1]}"
    return html_page(title, body, style=style, policy=given["policy"], root=root, kind=given["kind"])


def parts_of(scene: Mapping[str, Any], result: MatchResult) -> dict[str, str]:
    """Describe the outcome and what the view shows of the result: parts of `page_of`."""
    summary = summary_of(result)
    return {
        "colour": outcome_colour(result.outcome),
        "headline": escape(summary.headline),
        "sureness": escape(summary.sureness),
        "advice": escape(summary.advice_in_python),
        "plain": "Points of the same colour correspond.",
        "maps": "".join(f"<option>{shown['name']}</option>" for shown in scene["maps"]),
        "remarks": paragraphs(_remarks_on(scene, result)),
    }


def maps_of(result: MatchResult, given: Correspondence | None = None) -> dict[str, Correspondence]:
    """Name the map of a result, the alternatives that are shown, and the map that was given."""
    others = enumerate(result.alternatives[:MOST_ALTERNATIVES], 1)
    maps = {"the map": result.map} | {f"alternative {i}": other.map for i, other in others}
    return maps | ({GIVEN: given} if given else {})


def pairs_on(landmarks: ArrayLike | None, source: Mesh, target: Mesh) -> IntArray:
    """Return the landmarks (q, 2) with vertices that both shapes have."""
    pairs = array_of(
        np.zeros((0, 2), dtype=np.int64) if landmarks is None else landmarks, "landmarks", LandmarkError
    )
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


STILL_WIDTH = 640  # pixels of the picture of an alternative
_HOW_TO_CHOOSE = (
    "Where DIR is the folder that <code>isomatch match</code> wrote, <code>isomatch choose DIR 1</code> refines "
    "alternative 1, measures it and makes it the map."
)
_OF_MEASURES = ("measure", "value", "bound", "meaning")
LIBRARIES = ("numpy", "scipy", "numba", "robust_laplacian", "matplotlib")


def details_of(
    source: Mesh,
    target: Mesh,
    result: MatchResult,
    open_questions: Sequence[Question],
    given: Correspondence | None,
) -> str:
    """Make the sections below the view: questions, what speaks against the map, other maps, all measures, and notes."""
    return template("details.html").substitute(
        questions=list_of_questions(open_questions),
        against=table_against(result),
        regions=table_of_regions(result),
        alternatives=pictures_of_others(source, target, result, given),
        quality=table_of_quality(result),
        notes=notes_of(result),
    )


def quality_rows(result: MatchResult, *, only_against: bool = False) -> str:
    """Make a row for each measure, with its bound; or only for those that speak against the map."""
    rows = []
    for measure, number, against in quality_measures(result):
        if only_against and not against:
            continue
        verdict = " (violated)" if against else ""
        rows.append(
            f'<tr{" class=against" if against else ""}><th scope="row">{escape(measure.name)}</th>'
            f'<td class="number">{escape(measure.value(number))}</td>'
            f'<td class="bound">{escape(measure.bound + verdict)}</td><td>{escape(measure.meaning)}</td></tr>'
        )
    return "".join(rows)


def table_of_regions(result: MatchResult) -> str:
    """Make a table of the regions where the map may be wrong; nothing if there are none."""
    if not result.regions:
        return ""
    rows = "".join(
        f'<tr><th scope="row">{number}</th><td class="number">{region.area:.1%}</td>'
        f'<td class="number" data-is="vertex">{region.vertices[0]}</td>'
        f'<td class="number" data-is="other image">{"" if region.runner_up is None else region.runner_up[0]}</td>'
        f"<td>{escape(region.reason)}</td></tr>"
        for number, region in enumerate(result.regions, 1)
    )
    return (
        "<section><h2>Regions of doubt</h2><p>Where the map may be wrong; the colour “doubt” shows the regions. The "
        "vertex is the most doubtful one of its region; the other image is where another map sends it.</p>"
        f"{_headed_table(rows, 'region', 'area', 'vertex', 'other image', 'reason')}</section>"
    )


def open_questions_of(source: Mesh, target: Mesh, result: MatchResult) -> tuple[Question, ...]:
    """Return the questions that a page asks: none where the map is sure."""
    return () if result.outcome in (Outcome.CONVERGED, Outcome.PARTIAL) else questions(source, target, result)


def pairs_shown(pairs: IntArray, open_questions: Iterable[Question]) -> IntArray:
    """Add the pairs of all possible answers to landmarks (q, 2), to show their vertices."""
    answers = [(question.vertex, place) for question in open_questions for place in question.places]
    return np.concatenate([pairs, np.array(answers, dtype=np.int64).reshape(-1, 2)])


def list_of_questions(open_questions: Sequence[Question]) -> str:
    """Ask where points of the source are; a button for each place adds a landmark."""
    if not open_questions:
        return ""
    rows = "".join(
        f"<li>Point {number} (vertex {question.vertex}) "
        + "".join(
            f'<button type="button" class="small" data-pair="{question.vertex},{place}" data-map="{k}">{letter}</button> '
            for letter, place, k in zip(ascii_uppercase, question.places, question.maps)
        )
        + f'<button type="button" class="small" data-pair="{question.vertex},?">elsewhere</button></li>'
        for number, question in enumerate(open_questions, 1)
    )
    return (
        "<section><h2>Questions that decide</h2><p>Where are these points? Each letter is the place by one of the maps; "
        "point at it to see both ends, and click the right one, which shows its map. Then match again with these "
        "landmarks.</p>"
        f'<ol class="asked">{rows}</ol></section>'
    )


def table_against(result: MatchResult) -> str:
    """Make a table of the measures that speak against the map; nothing if there are none."""
    rows = quality_rows(result, only_against=True)
    measures = _headed_table(rows, *_OF_MEASURES)
    return f"<section><h2>What speaks against it</h2>{measures}</section>" if rows else ""


def table_of_quality(result: MatchResult) -> str:
    """Make a table of all measures."""
    introduction = "<p>Computed without ground truth. A violated bound is evidence against the map.</p>"
    return introduction + _headed_table(quality_rows(result), *_OF_MEASURES)


def _headed_table(rows: str, *columns: str) -> str:
    heads = "".join(f'<th scope="col">{name}</th>' for name in columns)
    return f'<table class="quality"><thead><tr>{heads}</tr></thead><tbody>{rows}</tbody></table>'


def pictures_of_others(source: Mesh, target: Mesh, result: MatchResult, given: Correspondence | None) -> str:
    """Draw the given map and the alternatives, and describe them."""
    others = [
        (f"Alternative {i}", other.map, describe_alternative(source, target, result, other), other.origin)
        for i, other in enumerate(result.alternatives[:MOST_ALTERNATIVES], 1)
    ]
    advice = f"<p>{escape(describe_alternatives(result))} {_HOW_TO_CHOOSE}</p>" if others else ""
    if given:
        others.insert(0, (sentence(GIVEN), given, describe_given_map(source, target, result, given), "you"))
    figures = "".join(
        f'<figure><img src="{png(draw_map(source, target, other, titles=("", ""), width=STILL_WIDTH).png())}" '
        f'alt="{name}"><figcaption title="found by {escape(origin)}"><strong>{name}</strong> {escape(about)}'
        "</figcaption></figure>"
        for name, other, about, origin in others
    )
    return (
        f'<section><h2>Other maps</h2>{advice}<div class="stills">{figures}</div></section>' if others else ""
    )


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
    # settings of the whole match that have a value; changed settings of the stages are added below
    every = result.config.to_dict().items()
    everyday = {name: x for name, x in every if x is not None and not isinstance(x, dict)}
    settings = everyday | result.config.changed()
    return table("Run", run) + table("Seconds", seconds) + table("Settings", settings)


def notes_of(result: MatchResult) -> str:
    """Say what was repaired, left out or replaced."""
    return paragraphs(map(sentence, result.notes or ["Nothing was repaired, left out or replaced."]))


def table(title: str, rows: Mapping[str, object]) -> str:
    """Make a section with a table of two columns."""
    return f"<section><h2>{escape(title)}</h2>{html_table(rows.items())}</section>"


def paragraphs(lines: Iterable[str]) -> str:
    """Set each line in small print."""
    return "".join(f'<p class="soft">{escape(line)}</p>' for line in lines)


def sentence(text: str) -> str:
    """Begin with a capital."""
    return text[:1].upper() + text[1:]


def versions() -> dict[str, str]:
    """Return the versions of Python and of the libraries that affect numbers."""
    return {"python": python_version(), **machine.versions(LIBRARIES)}
