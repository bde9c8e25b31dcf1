"""Settings of first maps of shapes without limbs."""

from __future__ import annotations

from dataclasses import dataclass

from isomatch.values.settings import Settings, setting


@dataclass(frozen=True)
class AnchorSettings(Settings):
    """Settings of first maps where a shape has too few extremities, or both have a long boundary.

    Parameters
    ----------
    n_anchors : int
        Points of the source, far from each other, that are assigned.
    n_candidates : int
        Search vertices of the target among which their images are sought.
    beam, apart : int, float
        Partial assignments that are kept, and the mean distance, in units of the average distance, by which they differ.
    n_starts : int
        Best assignments that become first maps.
    eccentricity_weight, signature_weight : float
        Weights of differences of average distance and of signatures in the cost of an assignment.
    slide_functions, slide_steps : int
        Functions, and steps, by which signatures move a first map.
    n_hypotheses : int
        Most hypotheses: the residuals of round shapes tell little, so many are kept until curvature has been compared.
    """

    n_anchors: int = setting(6, "three points determine an isometry, three more its errors", least=3)
    n_candidates: int = setting(200, "as symmetry.n_samples", least=20)
    beam: int = setting(200, "chosen, not measured", least=1)
    apart: float = setting(
        0.15, "chosen, near selection.rival_distance; 0.1 with 80 starts is no better", least=0
    )
    n_starts: int = setting(48, "chosen: of the most that extremities give", least=1)
    eccentricity_weight: float = setting(0.3, "as search.eccentricity_weight", least=0)
    signature_weight: float = setting(0.25, "docs/robustness.md, shapes without limbs", least=0)
    slide_functions: int = setting(20, "the first of selection.sizes", least=4)
    slide_steps: int = setting(10, "docs/robustness.md, shapes without limbs", least=0)
    n_hypotheses: int = setting(40, "docs/robustness.md, shapes without limbs", least=1)
