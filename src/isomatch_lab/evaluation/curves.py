"""Curves of errors: their panels, and published curves beside them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from isomatch._core.arrays import FloatArray
from isomatch._core.files import replaced
from isomatch.evaluation import CURVE_LIMIT, THRESHOLDS
from isomatch_lab.evaluation.ledger import set_label
from isomatch_lab.evaluation.methods import METHODS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
from functools import partial
from typing import NoReturn

from isomatch._core.array_file import Archive
from isomatch._core.arrays import AnyArray
from isomatch._core.errors import FormatError, MissingFileError

COLOURS = (  # Petroff 2021: ten colours that the colour-blind can distinguish
    "#3f90da", "#ffa90e", "#bd1f01", "#94a4a2", "#832db6", "#a96b59", "#e76300", "#b9ac70", "#717581", "#92dadd",
)  # fmt: skip
DASHES = ((0, (1, 1.5)), (0, (6, 1.5, 1, 1.5)))  # dashes of published curves; each style uses all ten colours
# titles of panels, by how errors are measured and where maps come from
DIRECT, FLIPPED, CONTINUED = "direct truth", "one flip allowed for each pair", "started from another map"
OURS = "isomatch"  # name of our method in rows
PANEL, PER_ROW = (5.4, 4.6), 2  # inches of a panel with its legend, legible on a phone; panels in a row
Panel = dict[str, tuple[FloatArray, int]]
"""Mean curve and number of pairs of each method."""


@dataclass(frozen=True, eq=False)
class CurvePanel:
    """The curves of one set, against one kind of truth."""

    title: str
    curves: Panel  # mean curve and number of pairs of each method
    published: Sequence[PublishedCurve]
    colours: dict[str, str]  # colour of each family of methods
    continued: bool  # whether methods were started from the maps of others, and are shown as thin lines

    def draw(self, axes: Axes) -> None:
        """Draw the panel, with its legend below it."""
        _draw(axes, self.curves, self.published, self.colours, self.continued)
        axes.set_title(self.title, fontsize="medium")

    def svg(self) -> bytes:
        """Draw the panel alone."""
        from matplotlib.figure import Figure

        figure, drawn = Figure(PANEL, layout="constrained"), BytesIO()
        self.draw(figure.subplots())
        figure.savefig(drawn, format="svg")
        return drawn.getvalue()


def curve_panels(rows: list[dict[str, Any]], published: Sequence[PublishedCurve]) -> list[CurvePanel]:
    """Give the panels of benchmark rows: of each set, and of each damage to it."""
    good = [row | {"set": set_label(row)} for row in rows if "curve" in row]
    families = dict.fromkeys(_family(method) for method in _distinct(good, "method") if method != OURS)
    colours = {family: COLOURS[i % len(COLOURS)] for i, family in enumerate(families)}
    panels = []
    # up to three panels for each set: errors against the direct truth; against the better of direct and mirrored
    # truth for each pair, if that differs; and methods started from the maps of others, if there are any
    for name in _distinct(good, "set"):
        members = [row for row in good if row["set"] == name]
        at_landmarks = any(row.get("judged_at") == "landmarks" for row in members)
        for kind, panel in _panels(members).items():
            published_set = {DIRECT: name, FLIPPED: f"{name}_AllowingFlips"}.get(kind)
            others = [curve for curve in published if curve.set_name == published_set]
            title = f"{name}{', at landmarks' * at_landmarks}: {kind}"
            panels.append(CurvePanel(title, panel, others, colours, kind == CONTINUED))
    return panels


def draw_curves(panels: Sequence[CurvePanel], out: Path) -> None:
    """Write ``curves.png`` and ``curves.svg``, with all panels; nothing if there are none."""
    from matplotlib.figure import Figure

    if not panels:
        return
    per_row = min(len(panels), PER_ROW)
    n_rows = -(-len(panels) // per_row)
    figure = Figure((PANEL[0] * per_row, PANEL[1] * n_rows), layout="constrained")
    grid = figure.subplots(n_rows, per_row, squeeze=False).ravel()
    for axes in grid:
        axes.set_axis_off()
    for axes, panel in zip(grid, panels):
        panel.draw(axes)
    for suffix in ("png", "svg"):
        with replaced(out / f"curves.{suffix}") as file:
            figure.savefig(file, format=suffix, dpi=150)


def _distinct(rows: list[dict[str, Any]], key: str) -> list[str]:
    return list(dict.fromkeys(row[key] for row in rows))


def _family(method: str) -> str:
    """Name of a method without its priors and its continuation."""
    return method.partition("+")[0].removesuffix("_5pt")


def _panels(rows: list[dict[str, Any]]) -> dict[str, Panel]:
    """Curves of one set, by kind of panel."""
    panels: dict[str, Panel] = {DIRECT: {}, FLIPPED: {}, CONTINUED: {}}
    for method in _distinct(rows, "method"):
        members = [row for row in rows if row["method"] == method]
        direct, either = (np.mean([row[key] for row in members], axis=0) for key in ("curve", "curve_either"))
        if "+" in method:
            panels[CONTINUED][method] = (direct, len(members))
        else:
            panels[DIRECT][method], panels[FLIPPED][method] = (direct, len(members)), (either, len(members))
    if panels[CONTINUED]:
        bases = {method.partition("+")[0] for method in panels[CONTINUED]} | {OURS}
        panels[CONTINUED] |= {method: panel for method, panel in panels[DIRECT].items() if method in bases}
    if all(np.array_equal(panel[0], panels[FLIPPED][method][0]) for method, panel in panels[DIRECT].items()):
        panels[FLIPPED] = {}
    return {kind: panel for kind, panel in panels.items() if panel}


def _draw(
    axes: Axes, panel: Panel, others: Sequence[PublishedCurve], colours: dict[str, str], continued: bool
) -> None:
    """Draw one panel, best curve first in the legend: solid lines for methods with landmarks, dotted for others."""
    for name, (curve, count) in sorted(panel.items(), key=lambda item: -float(item[1][0].mean())):
        base, plus, _ = name.partition("+")
        given_landmarks = name == OURS or base not in METHODS or METHODS[base].n_landmarks
        axes.plot(
            100 * THRESHOLDS,
            100 * curve,
            linestyle=("--" if given_landmarks else "-.") if plus else "-" if given_landmarks else ":",
            color=colours.get(_family(name), "black"),
            linewidth=2.6 if name == OURS else 0.7 if continued and not plus else 1.6,
            zorder=3 if name == OURS else 2,
            label=f"{name} ({count})" if plus or not continued or name == OURS else None,
        )
    for other, (dashes, colour) in zip(others, product(DASHES, COLOURS)):
        label = f"{other.method} (published)"
        axes.plot(
            100 * other.errors, 100 * other.shares, linestyle=dashes, color=colour, linewidth=1.1, label=label
        )
    axes.set_axis_on()
    axes.set(
        xlabel="geodesic error × 100 / √area",
        xlim=(0, 100 * CURVE_LIMIT),
        ylabel="correspondences, %",
        ylim=(0, 101),
    )
    axes.grid(alpha=0.3)
    legend = axes.legend(
        loc="upper center",
        bbox_to_anchor=(0.5, -0.17),
        fontsize=9,
        title="method (pairs)",
        ncols=2,
        frameon=False,
    )
    for text in legend.get_texts():
        text.set_parse_math(False)  # a dollar sign in the name of a published curve does not start a formula


@dataclass(frozen=True, eq=False)
class PublishedCurve:
    """A published cumulative curve of errors.

    Parameters
    ----------
    set_name, method : str
        The set that was matched, and the method.
    errors : (q,) array of float
        Geodesic error / √area, ascending.
    shares : (q,) array of float
        Share of correspondences within each error, from 0 to 1.
    """

    set_name: str
    method: str
    errors: FloatArray
    shares: FloatArray


def read_published_curves(folder: str | Path) -> list[PublishedCurve]:
    """Read all curves of a folder.

    Parameters
    ----------
    folder : path_like
        Holds ``.npz`` archives with two arrays for each curve: ``set|method|x``, errors, and ``set|method|y``, percent.

    Returns
    -------
    list of PublishedCurve
        In the order of the file names; of several curves of one set and method, the first.

    Raises
    ------
    MissingFileError
        If there is no curve in the folder.
    FormatError
        If a file cannot be read.
    """
    curves: dict[tuple[str, str], PublishedCurve] = {}
    for path in sorted(Path(folder).glob("*.npz")):
        with Archive.opened(path, partial(_refuse, path)) as stored:
            arrays = stored.read_all(stored.names)
        for key, errors in arrays.items():
            if key.count("|") == 2 and key.endswith("|x"):
                name, method, _ = key.split("|")
                shares = arrays.get(f"{name}|{method}|y")
                if shares is None or not _is_curve(errors, shares):
                    _refuse(path, f"{key} has no array of percent, of the same length, that goes with it")
                curves.setdefault((name, method), PublishedCurve(name, method, errors, shares / 100))
    if not curves:
        raise MissingFileError(
            f"{folder}: no published curves; expected .npz files with arrays 'set|method|x' (errors) and "
            "'set|method|y' (percent)"
        )
    return list(curves.values())


def _is_curve(errors: AnyArray, shares: AnyArray) -> bool:
    return errors.shape == shares.shape and all(
        values.ndim == 1 and values.dtype.kind in "fiu" and np.isfinite(values).all()
        for values in (errors, shares)
    )


def _refuse(path: Path, problem: str) -> NoReturn:
    raise FormatError(f"{path}: cannot be read as curves ({problem}); repair or remove it")
