"""Cumulative curves of benchmark runs: a row of panels for each set."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from isomatch.lab.evaluation.ledger import set_label
from isomatch.lab.evaluation.methods import METHODS
from isomatch.lab.evaluation.princeton import LIMIT, THRESHOLDS
from isomatch.lab.evaluation.published_curves import PublishedCurve
from isomatch.storage.files import replaced
from isomatch.values.arrays import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLOURS = (  # Petroff 2021: ten colours that the colour-blind can distinguish
    "#3f90da", "#ffa90e", "#bd1f01", "#94a4a2", "#832db6", "#a96b59", "#e76300", "#b9ac70", "#717581", "#92dadd",
)  # fmt: skip
DASHES = ((0, (1, 1.5)), (0, (6, 1.5, 1, 1.5)))  # of published curves: the ten colours in each style
DIRECT, EITHER, CONTINUED = "direct truth", "one flip allowed for each pair", "started from another map"
OURS = "isomatch"
Panel = dict[str, tuple[FloatArray, int]]
"""Mean curve and number of pairs of each method."""


def draw_curves(rows: list[dict[str, Any]], published: Sequence[PublishedCurve], out: Path) -> None:
    """Write ``curves.png`` and ``curves.svg``.

    Each set, and each damage to it, has a panel of its methods against the direct truth; one against the better of direct
    and mirrored truth for each pair, if that differs; and one of methods started from the maps of others, shown as thin
    lines, if there are any.
    """
    from matplotlib.figure import Figure

    good = [row | {"set": set_label(row)} for row in rows if "curve" in row]
    sets = {name: _panels([row for row in good if row["set"] == name]) for name in _distinct(good, "set")}
    if not sets:
        return
    kinds = [kind for kind in (DIRECT, EITHER, CONTINUED) if any(kind in panels for panels in sets.values())]
    families = dict.fromkeys(_family(method) for method in _distinct(good, "method") if method != OURS)
    colours = {family: COLOURS[i % len(COLOURS)] for i, family in enumerate(families)}
    figure = Figure((7.2 * len(kinds), 5.2 * len(sets)), layout="constrained")
    grid = figure.subplots(len(sets), len(kinds), squeeze=False)
    for ((name, panels), kind), axes in zip(product(sets.items(), kinds), grid.ravel()):
        axes.set_axis_off()
        if kind in panels:
            published_set = {DIRECT: name, EITHER: f"{name}_AllowingFlips"}.get(kind)
            others = [curve for curve in published if curve.set_name == published_set]
            _draw(axes, panels[kind], others, colours, kind == CONTINUED)
            at_landmarks = any(row["set"] == name and row.get("judged_at") == "landmarks" for row in good)
            axes.set_title(f"{name}{', at landmarks' * at_landmarks}: {kind}", fontsize="medium")
    for suffix in ("png", "svg"):
        with replaced(out / f"curves.{suffix}") as file:
            figure.savefig(file, format=suffix, dpi=110)


def _distinct(rows: list[dict[str, Any]], key: str) -> list[str]:
    return list(dict.fromkeys(row[key] for row in rows))


def _family(method: str) -> str:
    """Name of a method without its hints and its continuation."""
    return method.partition("+")[0].removesuffix("_5pt")


def _panels(rows: list[dict[str, Any]]) -> dict[str, Panel]:
    """Curves of one set, by kind of panel."""
    panels: dict[str, Panel] = {DIRECT: {}, EITHER: {}, CONTINUED: {}}
    for method in _distinct(rows, "method"):
        members = [row for row in rows if row["method"] == method]
        direct, either = (np.mean([row[key] for row in members], axis=0) for key in ("curve", "curve_either"))
        if "+" in method:
            panels[CONTINUED][method] = (direct, len(members))
        else:
            panels[DIRECT][method], panels[EITHER][method] = (direct, len(members)), (either, len(members))
    if panels[CONTINUED]:
        bases = {method.partition("+")[0] for method in panels[CONTINUED]} | {OURS}
        panels[CONTINUED] |= {method: panel for method, panel in panels[DIRECT].items() if method in bases}
    if all(np.array_equal(panels[DIRECT][method][0], panels[EITHER][method][0]) for method in panels[DIRECT]):
        panels[EITHER] = {}
    return {kind: panel for kind, panel in panels.items() if panel}


def _draw(
    axes: Axes, panel: Panel, others: Sequence[PublishedCurve], colours: dict[str, str], continued: bool
) -> None:
    """Draw one panel, best curve first in the legend: solid lines for methods with landmarks, dotted for others."""
    for name, (curve, count) in sorted(panel.items(), key=lambda item: -float(item[1][0].mean())):
        base, plus, _ = name.partition("+")
        given_landmarks = name == OURS or base not in METHODS or METHODS[base].n_landmarks
        axes.plot(
            THRESHOLDS,
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
            other.errors, 100 * other.shares, linestyle=dashes, color=colour, linewidth=1.1, label=label
        )
    axes.set_axis_on()
    axes.set(
        xlabel="geodesic error / √(target area)", xlim=(0, LIMIT), ylabel="correspondences, %", ylim=(0, 101)
    )
    axes.grid(alpha=0.3)
    legend = axes.legend(
        loc="center left", bbox_to_anchor=(1, 0.5), fontsize="x-small", title="method (pairs)"
    )
    for text in legend.get_texts():
        text.set_parse_math(False)  # a dollar sign in the name of a published curve does not start a formula
