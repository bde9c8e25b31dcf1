"""Settings of the match of shapes far from isometric."""

from __future__ import annotations

from dataclasses import dataclass

from isomatch.errors import SettingError
from isomatch.values.settings import Settings, setting


@dataclass(frozen=True)
class ElasticSettings(Settings):
    """Settings of the match of shapes that are far from isometric.

    Parameters
    ----------
    n_coordinates : int
        Canonical coordinates of each shape.
    n_anchors, n_candidates : int
        Points of one shape that a start assigns, and points of the other among which their images are sought.
    forgiven : float
        Relative difference of two distances, in units of the average, that costs nothing.
    inside, most_cost, soft : float
        The other terms of the cost, see `IntervalCost`.
    signature_cost, remoteness_cost : float
        Weights of the signatures, and of the share of the area that is less remote, in the cost of a single image.
    aside_cost, most_aside : float
        Weight of the distance from the mirror image in that cost, and the bound of that distance, in average distances.
    width, apart : int, float
        Partial assignments that the beam search keeps, and the mean distance, in √area, by which they differ.
    n_starts, n_plain_starts : int
        Best assignments of the points of either shape, and those without that weight where both have mirror images.
    n_coarse : int
        Samples of each shape in the coarse fit.
    coarse_functions, coarse_smoothness, coarse_iterations : tuple of int, tuple of float, int
        Laplace–Beltrami functions and smoothness of each step of the coarse fit, and its iterations. The smoothness
        multiplies the Dirichlet energy: its root is the length, in √area, over which a map is smoothed.
    fine_functions, fine_smoothness, fine_iterations : tuple of int, tuple of float, int
        The same of the fine fit.
    free_functions : int
        From so many functions on, maps need not exchange mirror images.
    n_contenders, same_map : int, float
        Coarse fits that are fitted finely, and the mean distance, in √area, by which they differ.
    signature_weight, normal_weight, fine_normal_weight, score_normal_weight : float
        Weights of signatures and normals beside canonical coordinates, and those of normals in the fine fit and in the
        misfit that scores it.
    landmark_weight : float
        Weight of a landmark, in samples.
    least_orientation : float
        Mean cosine between normals from which a coarse fit is followed up.
    asymmetry_exponent, asymmetry_unit : float
        Score of a coarse fit = misfit × (unit + asymmetry) to this power.
    stretch_exponent : float
        Score of a fine fit = misfit × stretch to this power.
    mirror_starts, mirror_forgiven : int, float
        ``n_starts`` and ``forgiven`` in the search for the mirror image of one shape.
    mirror_misfit, mirror_orientation : float
        Misfit up to which, and orientation from which, a map of a shape to itself is its mirror image.
    """

    n_coordinates: int = setting(8, "Ezuz et al. 2019", least=3)
    n_anchors: int = setting(12, "chosen on pairs of animals, not one by one", least=4)
    n_candidates: int = setting(150, "chosen: spacing 0.09, less than apart", least=20)
    forgiven: float = setting(0.3, "chosen on pairs of animals, not one by one", least=0, most=1)
    inside: float = setting(0.1, "docs/robustness.md, other species", least=0)
    most_cost: float = setting(0.6, "chosen on pairs of animals, not one by one", least=0)
    soft: float = setting(0.2, "chosen, not measured", least=0)
    signature_cost: float = setting(0.1, "chosen on pairs of animals, not one by one", least=0)
    remoteness_cost: float = setting(0.5, "chosen on pairs of animals, not one by one", least=0)
    aside_cost: float = setting(1.0, "chosen: as much as the average distance; not measured", least=0)
    most_aside: float = setting(1.0, "chosen: as much as the average distance; not measured", least=0)
    width: int = setting(600, "chosen on pairs of animals, not one by one", least=1)
    apart: float = setting(0.12, "parts.apart", least=0)
    n_starts: int = setting(60, "docs/robustness.md, other species", least=1)
    n_plain_starts: int = setting(30, "docs/robustness.md, other species", least=0)
    n_coarse: int = setting(300, "chosen: enough for 30 functions", least=50)
    coarse_functions: tuple[int, ...] = setting((20, 30), "chosen: limbs, but no details", least=4)
    coarse_smoothness: tuple[float, ...] = setting((0.01, 0.007), "chosen with coarse_functions", least=0)
    coarse_iterations: int = setting(4, "chosen, not measured", least=1)
    fine_functions: tuple[int, ...] = setting(
        (40, 70, 100, 150, 200), "Melzi et al. 2019, in larger steps", least=4
    )
    fine_smoothness: tuple[float, ...] = setting(
        (0.01, 0.005, 0.0025, 0.001, 0.0005), "chosen: halved as functions double", least=0
    )
    fine_iterations: int = setting(2, "docs/robustness.md, other species", least=1)
    free_functions: int = setting(100, "chosen: details may differ from side to side", least=4)
    n_contenders: int = setting(6, "docs/robustness.md, other species", least=1)
    same_map: float = setting(0.05, "search.same_map", least=0)
    signature_weight: float = setting(0.05, "chosen on pairs of animals, not one by one", least=0)
    normal_weight: float = setting(0.05, "chosen on pairs of animals, not one by one", least=0)
    fine_normal_weight: float = setting(0.15, "docs/robustness.md, other species", least=0)
    score_normal_weight: float = setting(0.0, "docs/robustness.md, other species", least=0)
    landmark_weight: float = setting(30.0, "chosen, not measured", least=0)
    least_orientation: float = setting(0.3, "selection.orientation_threshold", least=-1, most=1)
    asymmetry_exponent: float = setting(0.25, "chosen on pairs of animals, not one by one", least=0)
    asymmetry_unit: float = setting(0.1, "chosen on pairs of animals, not one by one", least=1e-6)
    stretch_exponent: float = setting(0.03, "docs/robustness.md, other species", least=0)
    mirror_starts: int = setting(24, "chosen, not measured", least=1)
    mirror_forgiven: float = setting(
        0.1, "chosen: a shape is nearly isometric to its mirror image", least=0, most=1
    )
    mirror_misfit: float = setting(0.26, "chosen on pairs of animals, not one by one", least=0)
    mirror_orientation: float = setting(0.5, "chosen on pairs of animals, not one by one", least=0, most=1)

    def __post_init__(self) -> None:
        super().__post_init__()
        for stage in ("coarse", "fine"):
            functions, smoothness = (getattr(self, f"{stage}_{what}") for what in ("functions", "smoothness"))
            if len(functions) != len(smoothness):
                raise SettingError(
                    f"{stage}_functions has {len(functions)} steps, {stage}_smoothness {len(smoothness)}; give as many"
                )
