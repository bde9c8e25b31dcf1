"""The report of a match in one HTML file: outcome, pictures, a 3D view, quality, alternatives, settings."""

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

from isomatch._files import write_text
from isomatch.correspondence import Correspondence
from isomatch.matching import Alternative, MatchResult, MatchSettings, Outcome
from isomatch.surfaces import Mesh
from isomatch.view import lighting
from isomatch.view.measures import quality_measures
from isomatch.view.scene import scene_of
from isomatch.view.stills import WIDTH, draw_map

STILL_WIDTH = 640  # pixels of the picture of an alternative
MOST_ALTERNATIVES = 4
LIBRARIES = ("numpy", "scipy", "numba", "robust_laplacian", "matplotlib")

# safe for the colour-blind (Okabe & Ito); the text states the outcome as well
_COLOURS = {Outcome.CONVERGED: "#0072b2", Outcome.LOW_CONFIDENCE: "#d55e00"}
_UNDECIDED = "#e69f00"
_SIDES = ("source", "target")
_HELPED_BY_LANDMARKS = (Outcome.HINTS_CONTRADICTED, Outcome.SYMMETRY_AMBIGUOUS, Outcome.LOW_CONFIDENCE)


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

    Raises
    ------
    UnwritableFileError
        If the file cannot be written.

    Notes
    -----
    A shape of more than 30 000 vertices is simplified in the 3D view, and the report says so; pictures and numbers are
    those of the full shape. The size is about 75 bytes per shown vertex, plus the pictures.
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
        notes=_paragraphs(map(_sentence, result.notes or ["Nothing was repaired, left out or replaced."])),
        run=_run(result, facts or {}),
        scene=json.dumps(scene).replace("<", "\\u003c"),  # so that no text in it can end the element
        **_lights(),
        script=(room / "report.js").read_text(encoding="utf-8"),
    )
    write_text(Path(path), page)


def _lights() -> dict[str, str]:
    """Give the shader the same lights as the still pictures."""
    directions = {"key": lighting.KEY_LIGHT, "fill": lighting.FILL_LIGHT}
    strengths = {"ambient": lighting.AMBIENT, "key_strength": lighting.KEY, "fill_strength": lighting.FILL}
    numbers = {**strengths, "gloss": lighting.GLOSS, "sharpness": lighting.SHARPNESS}
    return {name: ", ".join(map(str, direction)) for name, direction in directions.items()} | {
        name: str(float(number)) for name, number in numbers.items()
    }


def _advice(outcome: Outcome) -> str:
    if outcome is Outcome.CONVERGED:
        return f"{outcome.advice} No outcome is a proof, so look at the picture."
    return outcome.advice


def _remarks(scene: Mapping[str, Any], result: MatchResult) -> list[str]:
    """Explain what the view leaves out, and how to give landmarks if they would help."""
    remarks = []
    if not result.map.matched.all():
        remarks.append(f"Grey: {(~result.map.matched).sum():,} source vertices without an image.")
    for side in _SIDES:
        used, shown = scene[side]["n_used"], scene[side]["n_shown"]
        if shown < used:
            remarks.append(
                f"In 3D the {side} is simplified to {shown:,} of its {used:,} vertices; pictures and numbers are those "
                "of the full shape."
            )
    if result.outcome in _HELPED_BY_LANDMARKS:
        remarks.append(
            "To give landmarks, click a point on the source in 3D, then the corresponding point on the target. Three to "
            "five pairs are enough. Save them below, and match again with --landmarks landmarks.txt."
        )
    return remarks


def _quality(result: MatchResult) -> str:
    rows = []
    for measure, number, against in quality_measures(result):
        verdict = " (violated)" if against else ""
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
        f'<div class="stills">{figures}</div>' if others else "<p>No other map was left to compare with.</p>"
    )


def _run(result: MatchResult, facts: Mapping[str, object]) -> str:
    run = {
        **facts,
        "winning start": result.origin,
        "selected for": result.reason,
        "geodesic engine": result.engine,
        "seed": result.seed,
        **{f"{side} onto itself": found for side, found in zip(_SIDES, result.symmetries) if found},
        "python": python_version(),
        **{name: _version(name) for name in LIBRARIES},
    }
    seconds = {stage: f"{spent:.2f}" for stage, spent in result.timings.items()}
    return (
        _table("Run", run)
        + _table("Seconds", seconds)
        + _table("Settings", _everyday(result.config) | result.config.changed())
    )


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
    """Draw a map as PNG."""
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


def _everyday(settings: MatchSettings) -> dict[str, Any]:
    """Select the settings that are not those of a single stage, and not left open."""
    everyday = settings.to_dict().items()
    return {name: value for name, value in everyday if value is not None and not isinstance(value, dict)}
