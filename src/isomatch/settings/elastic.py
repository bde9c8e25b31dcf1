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
    inside : float
        A term of the cost, see `IntervalCost`.
    n_starts : int
        Best assignments of the points of either shape.
    """

    n_coordinates: int = setting(8, "Ezuz et al. 2019", least=3)
    forgiven: float = setting(0.3, "chosen on pairs of animals, not one by one", least=0, most=1)
    inside: float = setting(0.1, "docs/robustness.md, other species", least=0)
    n_starts: int = setting(60, "docs/robustness.md, other species", least=1)
