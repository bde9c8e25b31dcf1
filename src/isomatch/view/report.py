"""One file that tells how a match went: outcome, pictures, a view to turn, quality, alternatives, settings."""

from __future__ import annotations

import json
from base64 import b64encode
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from importlib.metadata import PackageNotFoundError, version
from importlib.resources import files
from io import BytesIO
from pathlib import Path
from platform import python_version
from string import Template
from typing import Any

from isomatch.correspondence import Correspondence
from isomatch.matching import Alternative, MatchResult, Outcome
from isomatch.surfaces import Mesh
from isomatch.view import raster
from isomatch.view.measures import taken
from isomatch.view.scene import scene_of
from isomatch.view.stills import WIDTH, draw_map

STILL_WIDTH = 640  # pixels of the picture of an alternative
MOST_ALTERNATIVES = 4
LIBRARIES = ("numpy", "scipy", "numba", "robust_laplacian", "matplotlib")

# distinct also to the colour-blind (Okabe & Ito); the words say it too
_COLOURS = {Outcome.CONVERGED: "#0072b2", Outcome.LOW_CONFIDENCE: "#d55e00"}
_UNDECIDED = "#e69f00"
_SIDES = ("source", "target")
_HINTED = (Outcome.SYMMETRY_AMBIGUOUS, Outcome.LOW_CONFIDENCE)  # landmarks help


def write_report(
    path: str | Path,
    source: Mesh,
    target: Mesh,
    result: MatchResult,
    *,
    names: tuple[str, str] = _SIDES,
    picture: str | Path | None = None,
    facts: Mapping[str, object] | None = None,
) -> None:
    """Write the report of a match: one HTML file that needs no network.

    Parameters
    ----------
    path : path_like
        File to write; an existing one is replaced.
    source, target : Mesh
        The two shapes that were matched.
    result : MatchResult
        What `match` returned for them.
    names : (str, str)
        What to call the two shapes, such as their files.
    picture : path_like, optional
        PNG file of `draw_map` to put in; by default it is drawn.
    facts : mapping of str to object, optional
        Further rows for the table of the run.

    Notes
    -----
    A shape of more than 30 000 vertices is thinned out in the view that can be turned, and the report says so;
    pictures and numbers are of the whole. About 75 bytes for each vertex shown, beside the pictures.
    """
    others = result.alternatives[:MOST_ALTERNATIVES]
    maps = {"returned": result.map}
    maps |= {f"alternative {i}": other.map for i, other in enumerate(others, 1)}
    scene = scene_of(source, target, maps)
    titles = _title("source", names[0]), _title("target", names[1])
    still = (
        _drawn(source, target, result.map, titles, WIDTH) if picture is None else Path(picture).read_bytes()
    )
    room = files("isomatch.view")
    page = Template((room / "report.html").read_text(encoding="utf-8")).substitute(
        title=escape(f"isomatch: {names[0]} → {names[1]}"),
        colour=_COLOURS.get(result.outcome, _UNDECIDED),
        headline=escape(_sentence(result.outcome.value)),
        advice=escape(_advice(result.outcome)),
        pair=escape(" → ".join(f"{n} ({m.n_vertices:,} vertices)" for n, m in zip(names, (source, target)))),
        picture=_png(still),
        source_name=escape(titles[0]),
        target_name=escape(titles[1]),
        maps="".join(f"<option>{escape(name)}</option>" for name in maps),
        remarks=_paragraphs(_remarks(scene, result)),
        quality=_quality(result),
        alternatives=_alternatives(source, target, others),
        notes=_paragraphs(map(_sentence, result.notes or ["Nothing was mended, left out or replaced."])),
        run=_run(result, facts or {}),
        scene=json.dumps(scene).replace("<", "\\u003c"),  # so that no text in it ends the element
        **_lights(),
        script=(room / "report.js").read_text(encoding="utf-8"),
    )
    Path(path).write_text(page, encoding="utf-8")


def _lights() -> dict[str, str]:
    """Write the lights of the still pictures as numbers of the shader."""
    directions = {"key": raster.KEY_LIGHT, "fill": raster.FILL_LIGHT}
    strengths = {"ambient": raster.AMBIENT, "key_strength": raster.KEY, "fill_strength": raster.FILL}
    numbers = {**strengths, "gloss": raster.GLOSS, "sharpness": raster.SHARPNESS}
    return {name: ", ".join(map(str, direction)) for name, direction in directions.items()} | {
        name: str(float(number)) for name, number in numbers.items()
    }


def _advice(outcome: Outcome) -> str:
    if outcome is Outcome.CONVERGED:
        return f"{outcome.advice} No outcome is a proof: look at the picture once."
    return outcome.advice


def _remarks(scene: Mapping[str, Any], result: MatchResult) -> list[str]:
    """Tell what to know about the view, and how to give landmarks where they help."""
    remarks = []
    if not result.map.matched.all():
        remarks.append(f"Grey: {(~result.map.matched).sum():,} source vertices without an image.")
    for side in _SIDES:
        used, shown = scene[side]["n_used"], scene[side]["n_shown"]
        if shown < used:
            remarks.append(
                f"In 3D the {side} is thinned out to {shown:,} of its {used:,} vertices; pictures and numbers are of "
                "the whole."
            )
    if result.outcome in _HINTED:
        remarks.append(
            "To give landmarks: in 3D, click a point of the source, then its right place on the target; three to five "
            "times. Save them below, and match again with --landmarks landmarks.txt."
        )
    return remarks


def _quality(result: MatchResult) -> str:
    rows = []
    for measure, number, against in taken(result):
        verdict = " (not kept)" if against else ""
        rows.append(
            f'<tr{" class=against" if against else ""}><th scope="row">{escape(measure.name)}</th>'
            f'<td class="number">{escape(measure.value(number))}</td>'
            f'<td class="bound">{escape(measure.bound + verdict)}</td><td>{escape(measure.meaning)}</td></tr>'
        )
    return "".join(rows)


def _alternatives(source: Mesh, target: Mesh, others: Sequence[Alternative]) -> str:
    figures = "".join(
        f'<figure><img src="{_png(_drawn(source, target, other.map, _SIDES, STILL_WIDTH))}" '
        f'alt="Alternative {i}"><figcaption>Alternative {i}, from {escape(other.origin)}: energy {other.energy:.3g}, '
        f"orientation {other.orientation:.2f}</figcaption></figure>"
        for i, other in enumerate(others, 1)
    )
    return (
        f'<div class="stills">{figures}</div>' if others else "<p>No different map was left to compare.</p>"
    )


def _run(result: MatchResult, facts: Mapping[str, object]) -> str:
    run = {
        **facts,
        "winning start": result.origin,
        "geodesic engine": result.engine,
        "seed": result.seed,
        "python": python_version(),
        **{name: _version(name) for name in LIBRARIES},
    }
    seconds = {stage: f"{spent:.2f}" for stage, spent in result.timings.items()}
    return _table("Run", run) + _table("Seconds", seconds) + _table("Settings", result.config.to_dict())


def _table(title: str, rows: Mapping[str, object]) -> str:
    body = "".join(
        f'<tr><th scope="row">{escape(str(name))}</th><td>{escape(str(value))}</td></tr>'
        for name, value in rows.items()
    )
    return f"<section><h2>{escape(title)}</h2><table><tbody>{body}</tbody></table></section>"


def _paragraphs(lines: Iterable[str]) -> str:
    return "".join(f'<p class="soft">{escape(line)}</p>' for line in lines)


def _title(side: str, name: str) -> str:
    return side if name == side else f"{side}: {name}"


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:]


def _drawn(source: Mesh, target: Mesh, shown: Correspondence, titles: tuple[str, str], width: int) -> bytes:
    """PNG of a map."""
    still = BytesIO()
    draw_map(source, target, shown, still, titles=titles, width=width)
    return still.getvalue()


def _png(data: bytes) -> str:
    return "data:image/png;base64," + b64encode(data).decode("ascii")


def _version(distribution: str) -> str:
    try:
        return version(distribution)
    except PackageNotFoundError:
        return "not installed"
