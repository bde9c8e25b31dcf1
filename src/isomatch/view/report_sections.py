"""The sections of a report below its 3D view, as HTML: quality, alternatives, how the map was found."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from importlib.metadata import PackageNotFoundError, version
from platform import python_version
from typing import Any

from isomatch.correspondence import Correspondence
from isomatch.matching import Alternative, MatchResult
from isomatch.settings import MatchSettings
from isomatch.surfaces import Mesh
from isomatch.view.alternatives import told_of_all, told_of_alternative
from isomatch.view.measures import quality_measures
from isomatch.view.page import SIDES
from isomatch.view.picture import png
from isomatch.view.stills import draw_map

STILL_WIDTH = 640  # pixels of the picture of an alternative
_HOW_TO_CHOOSE = (
    "Where DIR is the folder that <code>isomatch match</code> wrote, <code>isomatch choose DIR 1</code> refines "
    "alternative 1, measures it and makes it the map."
)
LIBRARIES = ("numpy", "scipy", "numba", "robust_laplacian", "matplotlib")


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
    heads = "".join(
        f'<th scope="col">{name}</th>' for name in ("region", "area", "vertex", "other image", "reason")
    )
    rows = "".join(
        f'<tr><th scope="row">{number}</th><td class="number">{region.area:.1%}</td>'
        f'<td class="number" data-is="vertex">{region.vertices[0]}</td>'
        f'<td class="number" data-is="other image">{"" if region.rival is None else region.rival[0]}</td>'
        f"<td>{escape(region.reason)}</td></tr>"
        for number, region in enumerate(result.regions, 1)
    )
    return (
        "<section><h2>Regions of doubt</h2><p>Where the map may be wrong; the colour “doubt” shows the regions. The "
        "vertex is the most doubtful one of its region; the other image is where another map sends it.</p>"
        f'<table class="quality"><thead><tr>{heads}</tr></thead><tbody>{rows}</tbody></table></section>'
    )


def table_against(result: MatchResult) -> str:
    """Make a table of the measures that speak against the map; nothing if there are none."""
    rows = quality_rows(result, only_against=True)
    return f"<section><h2>What speaks against it</h2>{_table_of_measures(rows)}</section>" if rows else ""


def table_of_quality(result: MatchResult) -> str:
    """Make a table of all measures."""
    return (
        "<p>Computed without ground truth. A violated bound is evidence against the map.</p>"
        + _table_of_measures(quality_rows(result))
    )


def _table_of_measures(rows: str) -> str:
    heads = "".join(f'<th scope="col">{name}</th>' for name in ("measure", "value", "bound", "meaning"))
    return f'<table class="quality"><thead><tr>{heads}</tr></thead><tbody>{rows}</tbody></table>'


def pictures_of_alternatives(
    source: Mesh, target: Mesh, result: MatchResult, others: Sequence[Alternative]
) -> str:
    """Draw other maps side by side, and say what they are; nothing if there are none."""
    if not others:
        return ""
    figures = "".join(
        f'<figure><img src="{png(drawn(source, target, other.map, ("", ""), STILL_WIDTH))}" '
        f'alt="Alternative {i}"><figcaption title="found by {escape(other.origin)}"><strong>Alternative {i}</strong> '
        f"{escape(told_of_alternative(source, target, result, other))}</figcaption></figure>"
        for i, other in enumerate(others, 1)
    )
    return (
        f"<section><h2>Alternatives</h2><p>{escape(told_of_all(result))} {_HOW_TO_CHOOSE}</p>"
        f'<div class="stills">{figures}</div></section>'
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
    return (
        table("Run", run)
        + table("Seconds", seconds)
        + table("Settings", _everyday(result.config) | result.config.changed())
    )


def table(title: str, rows: Mapping[str, object]) -> str:
    """Make a table of two columns."""
    body = "".join(
        f'<tr><th scope="row">{escape(str(name))}</th><td>{escape(str(value))}</td></tr>'
        for name, value in rows.items()
    )
    return f"<section><h2>{escape(title)}</h2><table><tbody>{body}</tbody></table></section>"


def paragraphs(lines: Iterable[str]) -> str:
    """Set each line in small print."""
    return "".join(f'<p class="soft">{escape(line)}</p>' for line in lines)


def sentence(text: str) -> str:
    """Begin with a capital."""
    return text[:1].upper() + text[1:]


def drawn(source: Mesh, target: Mesh, shown: Correspondence, titles: tuple[str, str], width: int) -> bytes:
    """Draw a map as PNG."""
    return draw_map(source, target, shown, titles=titles, width=width).png()


def versions() -> dict[str, str]:
    """Versions of Python and of the libraries that decide numbers."""
    return {"python": python_version(), **{name: _version(name) for name in LIBRARIES}}


def _version(distribution: str) -> str:
    try:
        return version(distribution)
    except PackageNotFoundError:
        return "not installed"


def _everyday(settings: MatchSettings) -> dict[str, Any]:
    """Select the settings that are not those of a single stage, and not left open."""
    everyday = settings.to_dict().items()
    return {name: value for name, value in everyday if value is not None and not isinstance(value, dict)}
