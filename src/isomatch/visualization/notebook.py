"""What notebooks show: the representation of each object, and the report's view with landmarks that can be clicked."""

from __future__ import annotations

import logging
import re
from collections.abc import Iterable, Mapping, Sequence
from functools import cache, singledispatch
from html import escape
from importlib.util import find_spec
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from isomatch._core.arrays import IntArray
from isomatch._core.cached import cached_property
from isomatch._core.errors import MapError, MeshError
from isomatch._core.first_use import install_command, package
from isomatch._core.stage_timer import notebook_shell
from isomatch.correspondence import Correspondence
from isomatch.matching import BothDirections, MatchResult, Outcome, Quality
from isomatch.settings import Config
from isomatch.shapes import PreparedShape
from isomatch.spectral import DistanceBasis, LaplaceBasis
from isomatch.surfaces import Graph, Mesh, PointCloud, Surface, unsound_faces
from isomatch.visualization.measures import MEASURES, quality_measures
from isomatch.visualization.picture import SHARPNESS
from isomatch.visualization.plots import draw_map, drawable, plot_surface, scale_for_drawing
from isomatch.visualization.report import SIDES, page_of_result, pairs_on, shown_maps
from isomatch.visualization.scene import layers_of
from isomatch.visualization.summary import HEADLINES, outcome_colour, summary_of
from isomatch.visualization.viewer import html_table, template, text_of

logger = logging.getLogger(__name__)
# width of a picture of two shapes, and of one, in pixels of the page; chosen
PAIR_WIDTH, ALONE_WIDTH = 880, 380
_LINE = "1px solid rgba(128,128,128,.35)"  # line below a row of a table, visible on light and dark pages
_CELL = f"text-align:left;vertical-align:top;padding:.2em 1.2em .2em 0;border:0;border-bottom:{_LINE};white-space:normal"


@singledispatch
def html_of(thing: object) -> str:
    """Represent an object of isomatch as HTML, as notebooks show it.

    Parameters
    ----------
    thing : object
        A surface, basis, prepared shape, map, result, outcome, quality or configuration; of anything else, its ``repr``.

    Returns
    -------
    str
        One element with its styles in place; every text of the user is escaped. Nothing is loaded from elsewhere.

    Examples
    --------
    >>> from isomatch import Outcome
    >>> "no problems were found" in html_of(Outcome.CONVERGED)
    True
    """
    return _card(repr(thing))


@html_of.register
def _(outcome: Outcome) -> str:
    return _verdict(outcome, HEADLINES[outcome], outcome.advice)


@html_of.register
def _(quality: Quality) -> str:
    known = [(MEASURES[name], number) for name, number in vars(quality).items() if not np.isnan(number)]
    rows = [(measure.name, measure.value(number), measure.unit) for measure, number in known]
    return _card("Quality", _table(rows, ("measure", "value", "to compare with")))


@html_of.register
def _(result: MatchResult) -> str:
    n_source, n_target = result.map.shape
    summary = summary_of(result)
    unmatched = int((~result.map.matched).sum())
    rows: dict[str, object] = {
        "map": f"{n_source:,} → {n_target:,} vertices",
        "unmatched": f"{unmatched:,} source vertices, grey in the picture" if unmatched else "",
        **{f"region of doubt {number}": str(region) for number, region in enumerate(result.regions, 1)},
        "notes": "; ".join(result.notes),
    }
    origin = {
        "first map from": result.origin,
        "chosen by": result.reason,
        "geodesic engine": result.engine,
        "seed": result.seed,
        "settings changed": _list_settings(result.config.changed()),
        "seconds": f"{result.timings['total']:.2f}" if "total" in result.timings else "",
    }
    measures = list(quality_measures(result))
    against = [measure.name for measure, _, against in measures if against]
    finding = f"against the map: {', '.join(against)}" if against else "none is against the map"
    values = [(m.name, m.value(x), m.bound + " (violated)" * is_bad, m.unit) for m, x, is_bad in measures]
    table = _table(values, ("measure", "value", "bound", "to compare with"))
    return _card(
        "",
        _verdict(result.outcome, summary.headline, summary.sureness, summary.advice_in_python),
        _pair_picture(result.map),
        _table(rows.items()),
        _fold(f"{len(measures)} measures of quality, {finding}", table),
        _fold("How it was found", _table(origin.items())),
    )


@html_of.register
def _(both: BothDirections) -> str:
    return _card("", *(f"<p><b>{name}</b></p>{html_of(result)}" for name, result in both._asdict().items()))


@html_of.register
def _(correspondence: Correspondence) -> str:
    return _card(repr(correspondence), _pair_picture(correspondence))


@html_of.register(Mesh)
@html_of.register(PointCloud)
def _(surface: Mesh | PointCloud) -> str:
    return _card(repr(surface), _alone_picture(surface))


@html_of.register
def _(shape: PreparedShape) -> str:
    rows: dict[str, object] = {
        "shape": repr(shape.surface),
        "body that is matched": f"{shape.body!r}, {shape.share:.1%} of the area",
        "distances": f"rank {shape.distances.rank}, {len(shape.column_vertices)} columns by {shape.distances.engine}",
        "functions": f"{len(shape.laplace.values)} of the Laplacian",
        "further components": len(shape.others) or "",
        "settings changed": _list_settings(shape.requested.changed()),
        "notes": "; ".join(shape.notes),
        "seconds": f"{shape.seconds:.2f}",
    }
    return _card("PreparedShape", _alone_picture(shape.surface), _table(rows.items()))


@html_of.register
def _(basis: DistanceBasis) -> str:
    error = "not known: no columns were held out"
    if basis.held_out:
        n_columns = len(basis.held_out.vertices)
        error = f"{basis.error_estimate():.2%} of the distances, on {n_columns} columns held out"
    method = f"{basis.method}, from {len(basis.samples)} columns by {basis.engine}"
    return _basis_card(basis, {"rank": basis.rank, "method": method}, error=error)


@html_of.register
def _(basis: LaplaceBasis) -> str:
    values = f"up to {basis.values[-1]:.3g} / squared mesh units"
    return _basis_card(basis, {"functions": basis.vectors.shape[1], "eigenvalues": values})


def _basis_card(basis: DistanceBasis | LaplaceBasis, rows: Mapping[str, object], **more: str) -> str:
    n, size = len(basis.vectors), basis.vectors.nbytes
    size_text = f"{size / 2**20:,.1f} MiB, where the matrix of all would take {8 * n * n / 2**20:,.0f}"
    notes = "; ".join(basis.notes)
    rows = {"points": f"{n:,}", **rows, "size": size_text, **more, "notes": notes}
    return _card(type(basis).__name__, _table(rows.items()))


@html_of.register
def _(config: Config) -> str:
    default, settings = Config(), config.to_dict()
    changed = [(name, value, attrgetter(name)(default)) for name, value in config.changed().items()]
    stages = {name: settings.pop(name) for name in list(settings) if isinstance(settings[name], Mapping)}
    settings |= {f"{stage}.{name}": x for stage, fields in stages.items() for name, x in fields.items()}
    summary = "<p>All settings have their defaults.</p>"
    if changed:
        summary = _table(changed, ("changed", "value", "default"))
    return _card("Config", summary, _fold("All settings", _table(settings.items())))


def _verdict(outcome: Outcome, headline: str, *texts: str) -> str:
    """Show texts about an outcome beside a bar in its colour."""
    return (
        f'<div style="border-left:.35em solid {outcome_colour(outcome)};padding:.1em 0 .1em .8em;margin:.4em 0">'
        f"<b>{escape(headline)}</b> <code>Outcome.{outcome.name}</code>"
        f"{''.join(f'<br>{escape(text)}' for text in texts if text)}</div>"
    )


def _pair_picture(correspondence: Correspondence) -> str:
    try:
        surfaces = correspondence.surfaces()
    except MapError:
        return "<p>To see it, give the surfaces, which are no longer in use: <code>.plot(source, target)</code></p>"
    source, target = map(_drawable_part, surfaces)
    if source is None or target is None:
        return ""
    picture = draw_map(source, target, correspondence, titles=("", ""), width=SHARPNESS * PAIR_WIDTH)
    titles = "".join(f'<span style="width:50%">{side}</span>' for side in ("source", "target"))
    image = picture.html(transparent=True)
    return f'{image}<div style="display:flex;text-align:center;opacity:.75">{titles}</div>'


def _alone_picture(surface: Surface) -> str:
    mesh = _drawable_part(surface)
    return plot_surface(mesh, width=SHARPNESS * ALONE_WIDTH).html(transparent=True) if mesh else ""


def _drawable_part(surface: Surface) -> Mesh | None:
    """Return a surface without faces that cannot be drawn; None if nothing is left."""
    if isinstance(surface, Graph):
        return None
    mesh = drawable(surface)
    unsound = unsound_faces(mesh.vertices, mesh.faces).any
    if unsound.any():
        vertices = np.where(np.isfinite(mesh.vertices), mesh.vertices, 0.0)
        mesh = Mesh(vertices, mesh.faces[~unsound])
    try:
        scale_for_drawing(mesh, "")
    except MeshError:
        return None
    return mesh


def _card(title: str, *parts: str) -> str:
    head = f"<p><b>{escape(title)}</b></p>" if title else ""
    return f'<div style="max-width:{PAIR_WIDTH}px;line-height:1.5">{head}{"".join(parts)}</div>'


def _table(rows: Iterable[Sequence[object]], heads: Sequence[str] = ()) -> str:
    """Make a table with its styles in place; rows without a text are left out."""
    table = "color:inherit;border-collapse:collapse;margin:.4em 0;font-size:.95em;font-variant-numeric:tabular-nums"
    styles = {"table": table, "td": _CELL, "th": f"{_CELL};font-weight:400;opacity:.75"}
    known = [row for row in rows if row[1] != ""]
    styled = html_table(known, heads).replace("<tr>", '<tr style="background:none">')
    return re.sub(r"<(table|td|th)\b", lambda tag: f'{tag[0]} style="{styles[tag[1]]}"', styled)


def _fold(title: str, content: str) -> str:
    return f'<details style="margin:.3em 0"><summary style="cursor:pointer">{escape(title)}</summary>{content}</details>'


def _list_settings(settings: Mapping[str, Any]) -> str:
    return ", ".join(f"{name} = {value!r}" for name, value in settings.items())


SANDBOX = "allow-scripts allow-downloads"  # permissions of the page's frame, which cannot reach the notebook
HOW_TO_USE_CLICKS = (  # what to do with clicked landmarks, and how to match again with them
    "After <code>view = result.show()</code>, what you click is in <code>view.landmarks</code> at once:"
)
HOW_TO_SAVE_CLICKS = (  # how to save clicked landmarks where anywidget is not installed
    f"To have clicked pairs in Python: <code>{install_command('notebook')}</code>, and show the result again. "
    "Until then, save the list and read it:"
)
# call that matches with the clicked landmarks
MATCH_AGAIN = "match(source, target, landmarks=view.landmarks)"
# call that matches with a saved list of landmarks
MATCH_SAVED = 'match(source, target, landmarks=read_landmarks("landmarks.txt", source, target))'
EXTRA, FEATURE = "notebook", "bringing clicked landmarks to Python"  # the extra with anywidget; its use


class ResultView:
    """What `MatchResult.show` returns: the report's view, which a notebook shows as the last line of a cell."""

    def __init__(self, page: str, pairs: IntArray, height: int) -> None:
        self._page, self._pairs, self._height = page, pairs.tolist(), height

    def __repr__(self) -> str:
        return "ResultView, which a notebook shows where it is the last line of a cell"

    @property
    def landmarks(self) -> IntArray:
        """(q, 2) whole pairs (source vertex, target vertex) in the list, as `match` takes them.

        `MissingDependencyError` if anywidget is not installed, so that clicks do not come back.
        """
        return np.array(self.widget.pairs, dtype=np.int64).reshape(-1, 2)

    @cached_property
    def widget(self) -> Any:
        """The widget, for layouts of ipywidgets and for ``observe(function, "pairs")``; errors as for ``landmarks``."""
        return _widget_class()(page=self._page, pairs=self._pairs, height=self._height)

    def _repr_mimebundle_(self, **options: Any) -> Any:
        """Return the widget, if anywidget is installed, and the page for exported notebooks."""
        shown = self.widget._repr_mimebundle_(**options) if clicks_return() else {}
        data, about = shown if isinstance(shown, tuple) else (shown, {})
        return {"text/plain": repr(self), **(data or {}), "text/html": self._repr_html_()}, about

    def _repr_html_(self) -> str:
        return (
            f'<iframe srcdoc="{escape(self._page)}" sandbox="{SANDBOX}" title="Both shapes in 3D" '
            f'style="width:100%;height:{self._height}px;border:0"></iframe>'
        )


def show_result(
    result: MatchResult,
    source: Surface,
    target: Surface,
    *,
    landmarks: ArrayLike | None = None,
    height: int = 720,
) -> ResultView:
    """Make the view of a result for a notebook, see `MatchResult.show`."""
    source, target = drawable(source), drawable(target)
    pairs = pairs_on(landmarks, source, target)
    if notebook_shell() is None:
        logger.warning(
            "this view is for notebooks; isomatch.visualization.write_report('report.html', source, target, result) "
            "writes it as a page for a browser"
        )
    instructions, command = HOW_TO_SAVE_CLICKS, MATCH_SAVED
    if clicks_return():
        instructions, command = HOW_TO_USE_CLICKS, MATCH_AGAIN
    page = page_of_result(
        (source, target),
        SIDES,
        result,
        pairs,
        shown_maps(source, target, result),
        layers_of(result),
        style=text_of("inline.css"),
        work=f"<script>\n{text_of('inline.js')}</script>",
        picking="" if result.outcome is Outcome.CONVERGED else " checked",
        landmarks=template("inline_landmarks.html").substitute(told=instructions, command=escape(command)),
    )
    return ResultView(page, pairs, height)


def clicks_return() -> bool:
    """Whether anywidget is installed, by which clicks come back to Python."""
    return find_spec("anywidget") is not None


@cache
def _widget_class() -> Any:
    traitlets, base = package("traitlets", EXTRA, FEATURE), package("anywidget", EXTRA, FEATURE).AnyWidget

    class PageWidget(base):  # type: ignore[misc, valid-type]
        """The page in a frame; ``pairs`` follows the list of landmarks in it."""

        _esm = text_of("widget.js")
        page = traitlets.Unicode().tag(sync=True)
        height = traitlets.Int().tag(sync=True)
        pairs = traitlets.List().tag(sync=True)

    return PageWidget
