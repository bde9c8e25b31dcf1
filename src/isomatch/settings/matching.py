"""Settings of the stages of a match: search, selection, refinement, parts, elastic shapes, outcome."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

from isomatch._core.errors import SettingError
from isomatch._core.settings import Settings, setting

# A reason such as "6 err by 10 % more" says how the mean error changes with another value: lab/benchmarks.md, what
# each part contributes, and sensitivity. Lower scores, energies and residuals are better.

# √area; a target vertex is covered up to this distance from an image; chosen: the spacing of search vertices.
COVERAGE_RADIUS = 0.05
# √area, one length for each step of a registration; a shape moves rigidly over shorter lengths; chosen.
BENDING_LENGTHS = (0.3, 0.25, 0.2, 0.17, 0.14, 0.11, 0.09, 0.075, 0.06, 0.05)


@dataclass(frozen=True)
class SearchSettings(Settings):
    """Settings of first maps and of the search among them."""

    rank: int = setting(30, "50 are no better on 50 pairs", least=4)
    """Number of descriptor columns that are compared."""
    start_columns: int = setting(20, "10 and 30 gain nothing", least=4)
    """Number of leading descriptor columns that are aligned by a few points, as landmarks or extremities."""
    near_rigid: float = setting(0.05, "bones of one kind have 0.034 to 0.043", least=0)
    """Mean distance of two shapes after a rigid motion, in √area, up to which nearest points are a first map."""
    off_diagonal: tuple[float, ...] = setting((0.01, 0.001, 0.0001), "error 4.3 → 2.6: lab/paper.md", least=0)
    """Penalties on mixing descriptor columns; all are tried for landmarks, the first one for extremities."""
    ridge: float = setting(0.001, "0.0001 and 0.01 do as well", least=0)
    """Penalty on every entry of the matrix that aligns descriptor columns, see `alignments_from_points`."""
    extremity_counts: tuple[int, ...] = setting((4, 5, 6), "one count errs by 1 % more", least=1)
    """Numbers of extremities of one shape that are assigned together."""
    n_candidate_extremities: int = setting(7, "6 err by 10 % more, 8 do as well", least=1)
    """Number of extremities of a shape among which the images of the other shape's are chosen."""
    assignments: int = setting(8, "8 contain the right map on 86 of 86 pairs", least=1)
    """Number of best assignments of extremities that are kept for each of ``extremity_counts`` and direction."""
    eccentricity_weight: float = setting(0.3, "0 and 1 do as well", least=0)
    """Weight of differences of average distance in the cost of an assignment; mutual distances have 1."""
    start_steps: int = setting(12, "6 err by 6 % more, 24 do as well", least=1)
    """Iterations of closest points from a first map by extremities."""
    flip_steps: int = setting(4, "2 and 8 gain nothing", least=1)
    """Iterations of closest points from a flipped map."""
    unchanged: float = setting(0.99, "0.95 errs by 2 % more, 1 does as well", least=0, most=1)
    """Share of unchanged images from which an iteration of closest points has converged."""
    compare_every: int = setting(2, "1 and 4 do as well", least=1)
    """Iterations of closest points between two comparisons of the maps, which drop repeated ones."""
    same_start: float = setting(0.02, "chosen: half the spacing of 400 samples", least=0)
    """Mean distance of images, in √area, below which two starts are one."""
    same_map: float = setting(0.05, "chosen: the spacing of 400 samples", least=0)
    """Mean distance of images, in √area, below which two converged maps are one."""
    n_hypotheses: int = setting(14, "12 contain the right map on 86 of 86 pairs", least=1)
    """Largest number of hypotheses, which are maps that compete."""
    flipped: int = setting(3, "without flips, 15 of 124 pairs fail", least=0)
    """Number of best hypotheses that are flipped: the sign of a Laplace–Beltrami function is changed."""
    flipped_functions: int = setting(20, "12 err by 7 % more, 30 by 4 %", least=0)
    """Number of leading Laplace–Beltrami functions whose signs are flipped."""
    flip_landmarks: bool = setting(True, "error of one pair 7.9 % of √area without, 4.2 with: lab/paper.md")
    """Whether flips of the map from landmarks are tried if no automatic hypotheses compete."""


@dataclass(frozen=True)
class SelectionSettings(Settings):
    """Settings of the choice among hypotheses."""

    normal_functions: int = setting(40, "20 and 80 do as well", least=4)
    """Number of Laplace–Beltrami functions that smooth the surfaces whose normals are compared."""
    curvature_exponent: float = setting(2.0, "1 chooses right on 86 pairs, too, but narrowly", least=0)
    """Exponent: the energy of a map is descriptor residual × curvature difference ** curvature_exponent."""
    orientation_threshold: float = setting(0.3, "right maps on 50 pairs have above 0.54", least=0, most=1)
    """Mean cosine between normals above which a map preserves the orientation."""
    mirrored_energy: float = setting(0.75, "chosen: lopsided shapes have up to 0.52", least=0)
    """Energy over the least one, below which a map of the orientation not allowed is refined to compare it."""
    energy_limit: float = setting(3.0, "1.5 and 6 do as well", least=1)
    """Energy over the least one, up to which hypotheses are refined and compared again."""
    most_contenders: int = setting(4, "6 give no other map: decisions.md, refinement cost", least=1)
    """Largest number of hypotheses that are refined."""
    extension_functions: int = setting(50, "25 do as well, 100 err by 4 % more", least=4)
    """Number of functions through which a hypothesis is extended to further vertices."""
    spectral_residual_limit: float = setting(1.15, "1.05 and 1.3 do as well", least=1)
    """Spectral residual over the least one, above which a map is given up after a stage of the refinement."""
    same_map: float = setting(0.02, "chosen: half of what one turned limb makes", least=0)
    """Mean distance of images, in √area, up to which two refined maps are the same."""
    energy_exponent: float = setting(0.25, "with 0, 3 of 124 pairs get worse maps, 1 a better one", least=0)
    """Exponent: the score of a refined map is spectral residual × energy ** energy_exponent."""
    runner_up_distance: float = setting(0.15, "one turned limb makes less, a turned body more", least=0)
    """Mean distance of images, in √area, above which two maps are different, not variants of one."""
    descriptor_weight: float = setting(1.5, "decisions.md, descriptor weight", least=0)
    """Costs of two maps are compared after exp(weight × difference of their mean descriptor distances)."""
    most_alternatives: int = setting(2, "chosen", least=0)
    """Largest number of alternatives in the result."""


_sizes = partial(setting, least=4, empty=True)  # sizes of the steps of a stage; an empty stage is left out


@dataclass(frozen=True)
class RefinementSettings(Settings):
    """Settings of the refinements."""

    sizes_without_positions: tuple[int, ...] = _sizes(
        (20, 25, 30, 35, 40, 45, 50), "as in Melzi et al. 2019; decisions.md, refinement steps"
    )
    """Functions in each step of the first stage of the joint refinement, without positions and normals."""
    sizes_with_positions: tuple[int, ...] = _sizes((50, 75, 100), "in one step, 9 of 124 pairs fail")
    """Functions in each step of the second stage, with positions and normals."""
    final_sizes: tuple[int, ...] = _sizes((125, 150), "200 gain nothing: decisions.md, refinement cost")
    """Functions in each step of the last stage, with positions and normals, of the maps that fit best."""
    sizes_of_parts: tuple[int, ...] = _sizes((70, 100, 140), "7 % less error: decisions.md, refinement steps")
    """Functions in each further step, without positions, for the map of a part."""
    sizes_again: tuple[int, ...] = _sizes((20, 30, 50, 80, 130), "decisions.md, second refinement")
    """Functions in the steps that refine a map once more if it ties with the best; the lower score stays."""
    polished_sizes: tuple[int, ...] = setting((100, 150), "chosen", least=4)
    """Functions in the steps that polish the map of a large mesh on more vertices."""
    position_unit: float = setting(0.08, "error on 9 pairs 2.06 % of √area, with 0.3 2.14", least=1e-6)
    """Distance between positions, in √area, that counts as one unit of the spectral coordinates."""
    normal_weight: float = setting(0.3, "0.15 errs by 4 % more, 0.6 does as well", least=0)
    """Root mean square of normals as further coordinates."""
    function_weight: float = setting(0.2, "docs/priors.md, known functions", least=0)
    """Root mean square, as further coordinates, of functions known on both shapes (see `match`)."""
    registration_steps: int = setting(3, "4 gain nothing: decisions.md, refinement cost", least=0)
    """Steps of the non-rigid registration that ends "joint"."""
    laplace_steps_at_once: int = setting(0, "all at once errs more: lab/paper.md", least=0)
    """If above 0, most iterations of "laplace_icp" as in the paper: all functions at once, F orthogonal."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not (self.sizes_without_positions or self.sizes_with_positions or self.final_sizes):
            raise SettingError(
                "the three stages of the joint refinement are all empty; give one of them a size"
            )

    @property
    def rounds(self) -> list[tuple[tuple[int, ...], bool]]:
        """Sizes of the rounds of the joint refinement, and whether each has positions and normals."""
        sizes = self.sizes_without_positions, self.sizes_with_positions, self.final_sizes
        return [stage for stage in zip(sizes, (False, True, True)) if stage[0]]

    @property
    def last_step(self) -> tuple[tuple[int, ...], bool]:
        """Size of the last step of the joint refinement, which measures every map; whether it has positions."""
        with_positions = (*self.sizes_with_positions, *self.final_sizes)
        return (with_positions or self.sizes_without_positions)[-1:], bool(with_positions)


@dataclass(frozen=True)
class PartSettings(Settings):
    """Settings of the match of a part to a whole."""

    hopeless: float = setting(3.0, "such maps end above 3.8 × the best score: lab/robustness.md", least=1)
    """Score over the best one above which a map is dropped, after the short refinement and before bending."""
    long_boundary: float = setting(0.15, "complete bodies have up to 0.08, without a limb 0.2", least=0)
    """Length of a piece of the boundary, in √area, above which a shape may be a part."""
    close_holes: bool = setting(True, "wins or leads on 21 of 116 parts: decisions.md, strategies that pay")
    """Whether the shapes are also matched with their holes closed, as complete ones."""
    little_missing: float = setting(0.85, "decisions.md, part first or second", least=0)
    """Share of the whole's area from which a part is first matched as complete, with its holes closed."""
    most_there: float = setting(0.6, "chosen", least=0)
    """The share of ``little_missing`` if few distances are known, see ``little_trusted``."""
    bending: tuple[float, ...] = setting(BENDING_LENGTHS, "chosen: coarse to fine", least=1e-3)
    """Lengths, in √area of the whole, below which the part moves rigidly when it is bent, see `RigidRegistration`."""
    boundary_tolerance: float = setting(0.04, "1.2 % of true images are farther", least=0)
    """Largest distance, in √area, of a vertex of the whole that is matched to the boundary of the bent part."""
    surface_tolerance: float = setting(0.1, "five views err by 4.3 % of √area, with 0.04 by 9.0", least=0)
    """Largest distance, in √area, to other points of the bent part, or to all if few distances are known."""
    n_bent_vertices: int = setting(1000, "2000 err by 3 % less in 1.2 × the time", least=50)
    """Number of vertices of the bent part while contenders are compared."""
    n_settled: int = setting(3, "lab/robustness.md, parts", least=0)
    """Number of best maps from which the part is bent, to refine the map from the bent part."""
    poor_doubt: float = setting(8.5e-5, "31 of 40 right maps have less, wrong ones ≥ 1.8e-4", least=0)
    """Doubt of a map (see `Quality`) above which it is not sure."""
    little_trusted: float = setting(0.15, "lab/robustness.md, parts", least=0, most=1)
    """Share of known distances between anchors on the whole, below which a sure map needs ``clear_lead``."""
    clear_lead: float = setting(2.0, "1.10 to 1.39 beside wrong maps: lab/robustness.md", least=1)
    """Score of the best alternative over the map's own, from which a map is sure if few distances are known."""
    descriptor_weight: float = setting(6.0, "decisions.md, cost of a part", least=0)
    """`SelectionSettings.descriptor_weight` where parts, or roughly refined maps, are compared."""
    n_common: int = setting(8, "chosen", least=1)
    """Number of likeliest common regions of two overlapping parts that are refined."""
    sure_common: float = setting(0.5, "wrong maps have up to 0.44: decisions.md, two parts", least=0)
    """Least evidence for a sure common region: area that looks alike, less what lacks an image."""
    tie: float = setting(1.2, "chosen on cuts and holes, with the other bounds", least=1)
    """Score of an alternative over the map's own, below which the map is not sure."""
    poor_via: float = setting(0.03, "wrong maps have 0.033 or more: decisions.md, by way of a whole", least=0)
    """Cost by `verify` above which a composed map is not sure."""


@dataclass(frozen=True)
class ElasticSettings(Settings):
    """Settings of the match of shapes that are far from isometric."""

    min_spectral_residual: float = setting(0.54, "decisions.md, elastic outcome", least=0)
    """Spectral residual of the best isometric map above which a map that lets limbs stretch is sought."""
    n_coordinates: int = setting(8, "Ezuz et al. 2019", least=3)
    """Number of canonical coordinates of each shape."""
    distance_tolerance: float = setting(0.3, "chosen on pairs of animals, not one by one", least=0, most=1)
    """Share by which a distance may change at a lower cost (``tolerance`` of `IntervalCost`)."""
    deviation_weight: float = setting(0.1, "best start 10 % of √area off, with 0.3 12 %", least=0)
    """Weight of a change of a distance, beside what exceeds ``distance_tolerance`` (``inside`` of `IntervalCost`)."""
    n_starts: int = setting(60, "decisions.md, elastic starts", least=1)
    """Number of best assignments of either shape's points that are tried."""
    bending: tuple[float, ...] = setting(BENDING_LENGTHS, "chosen: coarse to fine", least=1e-3)
    """Lengths, in √area, below which either shape moves rigidly when it is bent onto the other."""
    n_bent_vertices: int = setting(1000, "chosen as for parts", least=100)
    """Number of vertices of the bent shapes while contenders are compared."""
    most_scaled: float = setting(2.0, "chosen: half to twice the size", least=1)
    """Factor by which a piece of a shape may grow or shrink at no cost (`RigidRegistration`)."""


@dataclass(frozen=True)
class OutcomeSettings(Settings):
    """Bounds of the measures that decide the outcome."""

    coverage_radius: float = setting(COVERAGE_RADIUS, "chosen: the spacing of the search vertices", least=0)
    """Largest distance along edges, in √area, of a covered target vertex from an image."""
    tie: float = setting(1.25, "5 right maps of 63 are flagged: decisions.md, descriptor weight", least=1)
    """Score of an alternative over the map's own, below which the map is not sure."""
    elastic_tie: float = setting(1.15, "chosen: decisions.md, descriptor bounds", least=1)
    """The bound ``tie`` between shapes far from isometric, whose spectral residuals are nearly equal."""
    mirror_tie: float = setting(1.5, "lab/benchmarks.md, confidence", least=1)
    """The bound ``tie`` for a map of the other orientation, if both are allowed: poses alone may differ as much."""
    mirror_image: float = setting(0.6, "lopsided creatures up to 0.52, bodies from 0.67", least=0, most=1)
    """Score of a map of the orientation not allowed, over the map's own, below which it fits clearly better."""
    max_counted_growth: float = setting(4.0, "chosen: torn faces must not outweigh all others", least=1)
    """Ratio of the squared lengths of an edge's image and the edge; larger ones count as this in the stretch."""
    poor_spectral_residual: float = setting(0.66, "set on FAUST and creatures: lab/benchmarks.md", least=0)
    """`Quality.spectral_residual` above which a map is poor."""
    poor_residual: float = setting(0.38, "set on FAUST and creatures: lab/benchmarks.md", least=0)
    """`Quality.residual` above which a map is poor."""
    poor_stretch: float = setting(1.2, "lab/benchmarks.md, confidence", least=1)
    """`Quality.stretch` above which a map is poor."""
    poor_bending: float = setting(1.7e-3, "a wrong map has 2.3e-3: decisions.md, elastic outcome", least=0)
    """`Quality.bending_cost` above which a map is poor, for shapes far from isometric."""
    poor_far_residual: float = setting(0.45, "a wrong map has 0.59: decisions.md, elastic outcome", least=0)
    """`Quality.residual` above which a map is poor, for shapes far from isometric."""
    poor_far_descriptor_distance: float = setting(0.465, "right ≤ 0.46: decisions.md, individuals", least=0)
    """`Quality.descriptor_distance` above which a map is poor, for shapes far from isometric."""
    poor_descriptor_distance: float = setting(0.42, "wrong ≥ 0.44: decisions.md, descriptor bounds", least=0)
    """Bound: further strategies are tried unless the mean descriptor distance is well below this."""
    doubtful_descriptor_distance: float = setting(0.65, "right maps but one ≤ 0.54, wrong ≥ 0.78", least=0)
    """Mean descriptor distance around a vertex, above the map's median, from which its image is doubtful."""
    doubtful_area: float = setting(0.02, "chosen: a forearm of a body", least=0, most=1)
    """Share of the surface above which a region of doubtful images lowers the outcome."""
    torn_growth: float = setting(0.1, "0.07 to 0.15 do as well: lab/benchmarks.md", least=0)
    """Growth of an edge, in √area, above which the map tears it."""
    poor_torn_off: float = setting(0.005, "half a hand; right maps have up to 0.2 %", least=0)
    """`Quality.torn_off`, a share of the area, above which a map is poor."""
    poor_orientation: float = setting(0.65, "chosen", least=-1, most=1)
    """`Quality.orientation`, a mean cosine of normals, below which a map is poor."""
    contradiction: float = setting(0.1, "right priors have up to 0.05, wrong ones 0.12", least=0)
    """Distance of images from where priors ask for them, in √area, above which they contradict the map."""
    out_of_pose: float = setting(0.25, "a turn by 40° makes 0.22, by 90° 0.29: docs/priors.md", least=0)
    """Mean distance of images from the nearest points in space, in √area, above which the pose misleads."""
    large_component: float = setting(0.05, "chosen: a hand has 1 %, a head 8 % of a body", least=0, most=1)
    """Share of area or vertices above which a component without a partner makes a match partial."""
