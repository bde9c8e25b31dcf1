"""Figure 7: geodesic distance descriptors started from the map of another method, compared with that method alone."""

from __future__ import annotations

from typing import Any

from isomatch_lab.paper import princeton_curves
from isomatch_lab.paper.item import RUNNERS_UP, Item, Reproduction, Setting, Verdict

BASELINES = {name: RUNNERS_UP[name] for name in ("sgmds_5pt", "functional_maps_5pt", "sgf_5pt")}
ALONE, PUBLISHED, OURS = "", "+gdd_post", "+isomatch"  # endings of names of methods, by what continues them
VARIANTS = {  # dashes, width and ending of the label of curves
    ALONE: (":", 1.5, ""),
    PUBLISHED: ("-", 2.0, " + GDD + post"),
    OURS: ("--", 1.0, " + GDD, our refinement"),
}
METHODS: dict[str, tuple[str, dict[str, Any]]] = {
    baseline + variant: (label + suffix, {"color": colour, "linestyle": dashes, "lw": width})
    for baseline, (label, colour) in BASELINES.items()
    for variant, (dashes, width, suffix) in VARIANTS.items()
}


def make(setting: Setting) -> Reproduction:
    """Run each method alone and as a start, and compare the areas under the curves."""
    curves, facts = princeton_curves.measure_curves(setting, tuple(METHODS))
    verdicts = [_better(baseline, curves) for baseline in BASELINES]
    figure = princeton_curves.draw(curves, METHODS, facts)
    return Reproduction(figure, princeton_curves.table(curves), verdicts, facts)


def _better(baseline: str, curves: princeton_curves.Curves) -> Verdict:
    """Compare the areas of a method alone and as a start: whether they grow on every set."""
    areas = {
        name: [princeton_curves.area(curves[name, baseline + variant]) for variant in VARIANTS]
        for name in dict.fromkeys(name for name, _ in curves)
    }
    listed = "; ".join(
        f"{name} {a:.3f} → {b:.3f} (our refinement {c:.3f})" for name, (a, b, c) in areas.items()
    )
    return Verdict(
        f"started from {BASELINES[baseline][0]}, descriptors and post-processing improve on it",
        f"area under the curve: {listed}",
        all(after > alone for alone, after, _ in areas.values()),
    )


ITEM = Item("figure 7", "Princeton curves of other methods, alone and as a start", make)
