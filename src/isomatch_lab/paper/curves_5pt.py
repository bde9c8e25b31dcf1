"""Figure 5: methods that are all given the same five true landmarks."""

from __future__ import annotations

from typing import Any

from isomatch_lab.paper import princeton_curves
from isomatch_lab.paper.item import Item, Reproduction, Setting, Verdict

METHODS: dict[str, tuple[str, dict[str, Any]]] = {  # label and style of the curve of each method
    "isomatch": ("isomatch, automatic", {"color": "black", "linestyle": "-", "lw": 1.2}),
    "gdd_post": ("GDD-5pt + post", {"color": "#D55E00", "linestyle": "-", "lw": 2}),
    "gdd": ("GDD-5pt", {"color": "#E69F00", "linestyle": "-", "lw": 2}),
    "phi": ("Φ-5pt", {"color": "#56B4E9", "linestyle": "--", "lw": 1.5}),
    "functional_maps_5pt": ("functional maps", {"color": "#0072B2", "linestyle": "--", "lw": 1.5}),
    "sgmds_5pt": ("SGMDS", {"color": "#009E73", "linestyle": "-.", "lw": 1.5}),
    "sgf_5pt": ("Spectral-GF", {"color": "#CC79A7", "linestyle": ":", "lw": 2}),
}
METHODS_BELOW = ("functional_maps_5pt", "sgmds_5pt")  # methods whose curves the paper shows below ours


def make(setting: Setting) -> Reproduction:
    """Run all methods and compare their curves."""
    curves, facts = princeton_curves.measure_curves(setting, tuple(METHODS))
    verdicts = [_above("gdd_post", other, curves) for other in METHODS_BELOW]
    figure = princeton_curves.draw(curves, METHODS, facts)
    return Reproduction(figure, princeton_curves.table(curves), verdicts, facts)


def _above(above: str, below: str, curves: princeton_curves.Curves) -> Verdict:
    """Compare two curves: whether one is nowhere below the other."""
    lead, name, error = princeton_curves.least_lead(curves, above, below)
    sets = dict.fromkeys(name for name, _ in curves)
    areas = "; ".join(
        f"{set_name}: area {princeton_curves.area(curves[set_name, above]):.3f} against "
        f"{princeton_curves.area(curves[set_name, below]):.3f}"
        for set_name in sets
    )
    return Verdict(
        f"{METHODS[above][0]} lies above {METHODS[below][0]}, from the same five points, everywhere on [0, 0.25]",
        f"its least lead is {lead:+.1f} %, on {name} at {error:.4f}; {areas}",
        lead >= 0.0,
    )


ITEM = Item("figure 5", "Princeton curves, five true landmarks given", make)
