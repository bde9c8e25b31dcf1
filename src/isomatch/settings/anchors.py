"""Settings of first maps of shapes without limbs."""

from __future__ import annotations

from dataclasses import dataclass

from isomatch.values.settings import Settings, setting


@dataclass(frozen=True)
class AnchorSettings(Settings):
    """Settings of first maps where a shape has too few extremities, or both have a long boundary.

    Parameters
    ----------
    apart : float
        Mean distance, in units of the average distance, by which partial assignments that are kept differ.
    n_starts : int
        Best assignments that become first maps.
    eccentricity_weight : float
        Weight of differences of average distance in the cost of an assignment.
    n_hypotheses : int
        Most hypotheses: the residuals of round shapes tell little, so many are kept until curvature has been compared.
    """

    apart: float = setting(
        0.15, "chosen, near selection.rival_distance; 0.1 with 80 starts is no better", least=0
    )
    n_starts: int = setting(48, "chosen: of the most that extremities give", least=1)
    eccentricity_weight: float = setting(0.3, "as search.eccentricity_weight", least=0)
    n_hypotheses: int = setting(40, "docs/robustness.md, shapes without limbs", least=1)
