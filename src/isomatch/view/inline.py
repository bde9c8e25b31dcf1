"""The report's view inside a notebook; with anywidget, landmarks that are clicked there come back to Python."""

from __future__ import annotations

from functools import cache
from html import escape
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from isomatch.loading.first_use import package
from isomatch.matching import MatchResult, Outcome
from isomatch.surfaces import Surface
from isomatch.values.arrays import IntArray
from isomatch.values.cached import cached_property
from isomatch.view.layers import known_layers
from isomatch.view.page import (
    maps_of,
    page_of,
    pairs_on,
    remarks_on,
    template,
    text_of,
    told_of,
)
from isomatch.view.points import drawable
from isomatch.view.report_sections import paragraphs
from isomatch.view.scene import scene_of

SANDBOX = "allow-scripts allow-downloads"  # the page reaches neither the notebook nor anything else
FETCHED = "After <code>view = result.show()</code>, what you click is in <code>view.landmarks</code> at once:"
STATIC = (
    "To have the pairs that you click in Python, install <code>isomatch[notebook]</code> and show the result again. "
    "Until then, save the list and read it:"
)
MATCH_AGAIN = "match(source, target, landmarks=view.landmarks)"
MATCH_SAVED = 'match(source, target, landmarks=read_landmarks("landmarks.txt", source, target))'
EXTRA = "notebook"
WHAT = "bringing clicked landmarks to Python"


class ResultView:
    """What `MatchResult.show` returns: the report's view, which a notebook shows as the last line of a cell.

    Parameters
    ----------
    page : str
        The page as HTML; it loads nothing from elsewhere.
    pairs : (q, 2) array of int
        Landmarks with which its list begins.
    height : int
        Height in pixels of the page.
    """

    def __init__(self, page: str, pairs: IntArray, height: int) -> None:
        self._page, self._pairs, self._height = page, pairs.tolist(), height

    def __repr__(self) -> str:
        return "ResultView, which a notebook shows where it is the last line of a cell"

    @property
    def landmarks(self) -> IntArray:
        """(q, 2) whole pairs (source vertex, target vertex) in the list, as `match` takes them.

        Raises
        ------
        MissingDependencyError
            If anywidget is not installed, so that clicks do not come back.
        """
        return np.array(self.widget.pairs, dtype=np.int64).reshape(-1, 2)

    @cached_property
    def widget(self) -> Any:
        """The widget, for layouts of ipywidgets and for ``observe(function, "pairs")``; errors as for ``landmarks``."""
        return _widget_class()(page=self._page, pairs=self._pairs, height=self._height)

    def _repr_mimebundle_(self, **options: Any) -> Any:
        """Give the widget where there is one, and the page alone for notebooks that are kept or exported without it."""
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
    maps = maps_of(result)
    scene = scene_of(source, target, maps, layers=known_layers(result), landmarks=pairs)
    told, command = (FETCHED, MATCH_AGAIN) if clicks_return() else (STATIC, MATCH_SAVED)
    panel = template("inline_landmarks.html").substitute(told=told, command=escape(command))
    page = page_of(
        (source, target),
        ("source", "target"),
        scene,
        pairs,
        style=text_of("inline.css"),
        work=f"<script>\n{text_of('inline.js')}</script>",
        **told_of(result),
        picture="",
        plain="Points of the same colour correspond.",
        maps="".join(f"<option>{name}</option>" for name in maps),
        remarks=paragraphs(remarks_on(scene, result)),
        picking="" if result.outcome is Outcome.CONVERGED else " checked",
        landmarks=panel,
        details="",
        run="",
    )
    return ResultView(page, pairs, height)


def clicks_return() -> bool:
    """Whether anywidget is installed, by which clicks come back to Python."""
    return find_spec("anywidget") is not None


@cache
def _widget_class() -> Any:
    traitlets, base = package("traitlets", EXTRA, WHAT), package("anywidget", EXTRA, WHAT).AnyWidget

    class PageWidget(base):  # type: ignore[misc, valid-type]
        """The page in a frame; ``pairs`` follows the list of landmarks in it."""

        _esm = text_of("widget.js")
        page = traitlets.Unicode().tag(sync=True)
        height = traitlets.Int().tag(sync=True)
        pairs = traitlets.List().tag(sync=True)

    return PageWidget
