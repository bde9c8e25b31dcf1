"""Settings of the match of shapes far from isometric."""

from __future__ import annotations

from dataclasses import dataclass

from isomatch.values.settings import Settings, setting


@dataclass(frozen=True)
class ElasticSettings(Settings):
    """Settings of the match of shapes that are far from isometric.

    Parameters
    ----------
    n_coordinates : int
        Canonical coordinates of each shape.
    forgiven : float
        Relative difference of two distances, in units of the average, that costs nothing.
    inside, soft : float
        Two terms of the cost, see `IntervalCost`.
    width, apart : int, float
        Partial assignments that the beam search keeps, and the mean distance, in √area, by which they differ.
    n_starts, n_plain_starts : int
        Best assignments of the points of either shape, and those without that weight where both have mirror images.
    same_map : float
        Mean distance, in √area, by which coarse fits that are fitted finely differ.
    normal_weight, fine_normal_weight, score_normal_weight : float
        Weights of normals beside canonical coordinates: in the coarse fit, in the fine fit, and in the misfit that
        scores it.
    """

    n_coordinates: int = setting(8, "Ezuz et al. 2019", least=3)
    forgiven: float = setting(0.3, "chosen on pairs of animals, not one by one", least=0, most=1)
    inside: float = setting(0.1, "docs/robustness.md, other species", least=0)
    soft: float = setting(0.2, "chosen, not measured", least=0)
    width: int = setting(600, "chosen on pairs of animals, not one by one", least=1)
    apart: float = setting(0.12, "parts.apart", least=0)
    n_starts: int = setting(60, "docs/robustness.md, other species", least=1)
    n_plain_starts: int = setting(30, "docs/robustness.md, other species", least=0)
    same_map: float = setting(0.05, "search.same_map", least=0)
    normal_weight: float = setting(0.05, "chosen on pairs of animals, not one by one", least=0)
    fine_normal_weight: float = setting(0.15, "docs/robustness.md, other species", least=0)
    score_normal_weight: float = setting(0.0, "docs/robustness.md, other species", least=0)
