"""Settings of the stages of a match: search, selection, refinement, parts, elastic shapes, outcome."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

from isomatch._core.errors import SettingError
from isomatch._core.settings import Settings, setting

# A reason such as "with 6, errors grow by 10 %" says how the mean error of maps changes with another value:
# lab/benchmarks.md, what each part contributes, and sensitivity. Lower scores, energies, residuals are better.

# A vertex of the target is covered if its distance along edges from the nearest image is at most this, in √area of
# the target; chosen: the spacing of 400 search vertices.
COVERAGE_RADIUS = 0.05
# Lengths, in √area of the surface onto which a shape is bent, one for each step of the bending; pieces of
# the shape that are shorter than this move almost rigidly; chosen: limbs move first, and details last.
BENDING_LENGTHS = (0.3, 0.25, 0.2, 0.17, 0.14, 0.11, 0.09, 0.075, 0.06, 0.05)


@dataclass(frozen=True)
class SearchSettings(Settings):
    """Settings of the search: closest points improve first maps to hypotheses, and the best of these are flipped."""

    rank: int = setting(30, "50 columns are no better on 50 pairs", least=4)
    """Number of leading columns of the distance descriptors that the search compares."""
    start_columns: int = setting(20, "10 and 30 gain nothing", least=4)
    """Number of leading descriptor columns that are aligned at a few points, such as landmarks or extremities."""
    near_rigid: float = setting(0.05, "two bones of one kind have 0.034 to 0.043", least=0)
    """Largest mean distance of nearest points after a rigid motion, in √area, if these points make a first map."""
    off_diagonal: tuple[float, ...] = setting(
        (0.01, 0.001, 0.0001), "the error of one pair falls from 4.3 to 2.6: lab/paper.md", least=0
    )
    """Penalties on mixing descriptor columns in an alignment: landmarks try each of them, extremities the first."""
    ridge: float = setting(0.001, "0.0001 and 0.01 do as well", least=0)
    """Penalty on every entry of the matrix that aligns descriptor columns, see `alignments_from_points`."""
    extremity_counts: tuple[int, ...] = setting((4, 5, 6), "with one count, errors grow by 1 %", least=1)
    """Numbers of extremities of one shape, the most remote ones, that an assignment sends to the other shape."""
    n_candidate_extremities: int = setting(7, "with 6, errors grow by 10 %; 8 do as well", least=1)
    """Number of extremities of one shape among which the images of the other shape's extremities are chosen."""
    assignments: int = setting(8, "the best 8 contain the right map on 86 of 86 pairs", least=1)
    """Number of assignments of least cost that are kept, for each number in ``extremity_counts`` and each direction."""
    eccentricity_weight: float = setting(0.3, "0 and 1 do as well", least=0)
    """Weight of differences in average distance in the cost of an assignment; mutual distances have weight 1."""
    start_steps: int = setting(12, "with 6, errors grow by 6 %; 24 do as well", least=1)
    """Number of iterations of closest points that improve a first map, for example one from extremities."""
    flip_steps: int = setting(4, "2 and 8 gain nothing", least=1)
    """Number of iterations of closest points that improve a flipped map."""
    unchanged: float = setting(0.99, "with 0.95, errors grow by 2 %; 1 does as well", least=0, most=1)
    """Least share of images that an iteration of closest points leaves unchanged, from which the map has converged."""
    compare_every: int = setting(2, "1 and 4 do as well", least=1)
    """Number of iterations of closest points between two comparisons of all maps, which drop repeated maps."""
    same_start: float = setting(0.02, "chosen: about half the spacing of 400 search vertices", least=0)
    """Least mean distance between the images under two first maps, in √area; if they are nearer, one is dropped."""
    same_map: float = setting(0.05, "chosen: the spacing of 400 search vertices", least=0)
    """Least mean distance between the images under two hypotheses, in √area; if they are nearer, one is dropped."""
    n_hypotheses: int = setting(14, "12 contain the right map on 86 of 86 pairs", least=1)
    """Largest number of hypotheses, which are different maps of the search vertices after iterative closest points."""
    flipped: int = setting(3, "without flips, 15 of 124 pairs fail", least=0)
    """Number of best hypotheses that are flipped: new maps begin with the sign of one eigenfunction changed."""
    flipped_functions: int = setting(20, "with 12, errors grow by 7 %, with 30 by 4 %", least=0)
    """Number of leading Laplace–Beltrami eigenfunctions whose signs are changed, one function at a time."""
    flip_landmarks: bool = setting(True, "error of one pair 7.9 % of √area without, 4.2 with: lab/paper.md")
    """Whether flips of the map from landmarks are tried if no automatic hypotheses compete."""


@dataclass(frozen=True)
class SelectionSettings(Settings):
    """Settings of the choice among hypotheses, and among the maps refined from them."""

    normal_functions: int = setting(40, "20 and 80 do as well", least=4)
    """Number of Laplace–Beltrami eigenfunctions that smooth the surfaces before their normals are compared."""
    curvature_exponent: float = setting(2.0, "with 1, right maps also win on 86 pairs, but narrowly", least=0)
    """Exponent: the energy of a map is descriptor residual × curvature difference ** curvature_exponent."""
    orientation_threshold: float = setting(0.3, "right maps on 50 pairs have more than 0.54", least=0, most=1)
    """Least mean cosine of the normals of the target and of its copy on the source, if a map keeps the orientation."""
    mirrored_energy: float = setting(0.75, "chosen: lopsided shapes have up to 0.52", least=0)
    """Largest energy of a map of the forbidden orientation over the least of others, up to which it is refined."""
    energy_limit: float = setting(3.0, "1.5 and 6 do as well", least=1)
    """Largest energy of a hypothesis over the least energy, up to which the hypothesis is refined."""
    most_contenders: int = setting(4, "with 6, the same maps win: decisions.md, refinement cost", least=1)
    """Largest number of hypotheses that are refined."""
    extension_functions: int = setting(50, "25 do as well; with 100, errors grow by 4 %", least=4)
    """Number of eigenfunctions by which a map of the search vertices is extended to other vertices."""
    spectral_residual_limit: float = setting(1.15, "1.05 and 1.3 do as well", least=1)
    """Largest spectral residual of a map over the least one after a stage of the refinement; others are dropped."""
    same_map: float = setting(0.02, "chosen: one limb turned in place makes twice as much", least=0)
    """Largest mean distance between the images under two refined maps, in √area, up to which they are the same map."""
    energy_exponent: float = setting(0.25, "with 0, 3 of 124 pairs get worse maps, 1 a better one", least=0)
    """Exponent: the score of a refined map is spectral residual × energy ** energy_exponent."""
    runner_up_distance: float = setting(0.15, "one turned limb makes less, a turned body more", least=0)
    """Largest mean distance between images under two maps, in √area, up to which they are variants of one map."""
    descriptor_weight: float = setting(1.5, "decisions.md, descriptor weight", least=0)
    """Weight w: the ratio of two maps' costs is multiplied by exp(w × difference of mean descriptor distances)."""
    most_alternatives: int = setting(2, "chosen", least=0)
    """Largest number of other maps, besides the best one, in the result."""


# numbers of functions in the steps of a stage of the refinement; an empty tuple leaves the stage out
_sizes = partial(setting, least=4, empty=True)


@dataclass(frozen=True)
class RefinementSettings(Settings):
    """Settings of the refinements; sizes are numbers of Laplace–Beltrami eigenfunctions, one for each step."""

    sizes_without_positions: tuple[int, ...] = _sizes(
        (20, 25, 30, 35, 40, 45, 50), "as in Melzi et al. 2019; decisions.md, refinement steps"
    )
    """Numbers of functions in the steps of the first joint stage, which uses neither positions nor normals."""
    sizes_with_positions: tuple[int, ...] = _sizes((50, 75, 100), "with one step, 9 of 124 pairs fail")
    """Numbers of functions in the steps of the second joint stage, with positions and normals."""
    final_sizes: tuple[int, ...] = _sizes((125, 150), "200 gain nothing: decisions.md, refinement cost")
    """Numbers of functions in the steps of the last joint stage, with positions and normals."""
    sizes_of_parts: tuple[int, ...] = _sizes(
        (70, 100, 140), "errors fall by 7 %: decisions.md, refinement steps"
    )
    """Numbers of functions in the steps that follow the first stage for the map of a part, without positions."""
    sizes_again: tuple[int, ...] = _sizes((20, 30, 50, 80, 130), "decisions.md, second refinement")
    """Numbers of functions in the steps that refine a map again if it ties with the best; the better of both is kept."""
    polished_sizes: tuple[int, ...] = setting((100, 150), "chosen", least=4)
    """Numbers of functions in the steps that polish the map of a large mesh on more vertices."""
    position_unit: float = setting(0.08, "the error on 9 pairs is 2.06 % of √area, with 0.3 2.14", least=1e-6)
    """Distance between positions, in √area, that weighs as much as the distance 1 in spectral coordinates."""
    normal_weight: float = setting(0.3, "with 0.15, errors grow by 4 %; 0.6 does as well", least=0)
    """Length to which unit normals are scaled as further coordinates, besides spectral coordinates."""
    function_weight: float = setting(0.2, "docs/priors.md, known functions", least=0)
    """Root mean square to which functions known on both shapes (see `match`) are scaled as further coordinates."""
    registration_steps: int = setting(3, "4 gain nothing: decisions.md, refinement cost", least=0)
    """Number of steps of the non-rigid registration at the end of the refinement "joint"."""
    laplace_steps_at_once: int = setting(0, "errors grow with all at once: lab/paper.md", least=0)
    """Largest number of iterations of "laplace_icp" as in the paper, with all functions at once; 0: in steps."""

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
    """Settings of the match of a part to a whole, of two overlapping parts, and of maps by way of other shapes."""

    hopeless: float = setting(3.0, "such maps end above 3.8 × the least cost: lab/robustness.md", least=1)
    """Largest cost of a map over the least one; beyond it, rough maps are dropped, and no part is bent by fine maps."""
    long_boundary: float = setting(0.15, "complete bodies have up to 0.08, those without a limb 0.2", least=0)
    """Largest length of the longest boundary loop of a complete shape, in √area; other shapes are taken for parts."""
    close_holes: bool = setting(True, "wins or leads on 21 of 116 parts: decisions.md, strategies that pay")
    """Whether the shapes are also matched with their holes closed, as complete ones."""
    little_missing: float = setting(0.85, "decisions.md, part first or second", least=0)
    """Least area of a part over the area of the whole, from which it is first matched as complete, holes closed."""
    most_there: float = setting(0.6, "chosen", least=0)
    """Least area of a part over the area of the whole in place of ``little_missing``, if few distances are known."""
    bending: tuple[float, ...] = setting(BENDING_LENGTHS, "chosen: coarse to fine", least=1e-3)
    """Lengths, in √area of the whole, one for each step of the bending; shorter pieces move almost rigidly."""
    boundary_tolerance: float = setting(0.04, "1.2 % of vertices with a true image are farther", least=0)
    """Largest distance, in √area, of a matched vertex of the whole from its point on the bent part's boundary."""
    surface_tolerance: float = setting(0.1, "the error of 5 views is 4.3 % of √area, with 0.04 9.0", least=0)
    """Largest distance, in √area, of a matched vertex of the whole from its point inside the bent part.

    It also holds for points on the boundary if few distances on the whole are known."""
    n_bent_vertices: int = setting(1000, "with 2000, errors fall by 3 % in 1.2 × the time", least=50)
    """Number of vertices of the part that are bent before the best map is chosen; then all are bent."""
    n_settled: int = setting(3, "lab/robustness.md, parts", least=0)
    """Number of best maps by which the part is bent, and which are then refined again from the bent part."""
    poor_doubt: float = setting(8.5e-5, "31 of 40 right maps have less, wrong maps at least 1.8e-4", least=0)
    """Largest doubt (see `Quality`) of the map of a part that is sure."""
    little_trusted: float = setting(0.15, "lab/robustness.md, parts", least=0, most=1)
    """Least share of known distances between points of a part; with fewer, a map is sure only with ``clear_lead``."""
    clear_lead: float = setting(2.0, "for wrong maps, it is 1.10 to 1.39: lab/robustness.md", least=1)
    """Least cost of the best different map over the map's, from which it is sure though few distances are known."""
    descriptor_weight: float = setting(6.0, "decisions.md, cost of a part", least=0)
    """Weight in place of `SelectionSettings.descriptor_weight` when maps of a part are compared, rough or fine."""
    n_common: int = setting(8, "chosen", least=1)
    """Largest number of regions that two parts have in common, by their evidence, that are refined."""
    sure_common: float = setting(0.5, "wrong maps have up to 0.44: decisions.md, two parts", least=0)
    """Least evidence for a sure common region: area that looks alike less area that lacks an image, over the body's."""
    tie: float = setting(1.2, "chosen on SHREC'16 cuts and holes, together with the other bounds", least=1)
    """Least cost of a different map over the cost of the map of a part; below it, the map is ambiguous."""
    poor_via: float = setting(0.03, "wrong maps have 0.033 or more: decisions.md, by way of a whole", least=0)
    """Largest cost by `verify` of a sure map that is composed by way of other shapes."""


@dataclass(frozen=True)
class ElasticSettings(Settings):
    """Settings of the match of shapes that are far from isometric: smooth maps bend each shape onto the other."""

    min_spectral_residual: float = setting(0.54, "decisions.md, elastic outcome", least=0)
    """Largest spectral residual of the best isometric map; above it, a map that lets limbs stretch is sought."""
    n_coordinates: int = setting(8, "as in Ezuz et al. 2019", least=3)
    """Number of canonical coordinates, in which straight distances are like distances along the surface."""
    distance_tolerance: float = setting(0.3, "chosen on pairs of animals, not one by one", least=0, most=1)
    """Share by which a distance is allowed to change at a low cost (``tolerance`` of `IntervalCost`)."""
    deviation_weight: float = setting(0.1, "the best start errs by 10 % of √area, with 0.3 by 12 %", least=0)
    """Weight of the whole change of a distance; its excess over the tolerance has weight 1 (see `IntervalCost`)."""
    n_starts: int = setting(60, "decisions.md, elastic starts", least=1)
    """Number of assignments of anchors, those of least cost, that become first maps in each direction."""
    bending: tuple[float, ...] = setting(BENDING_LENGTHS, "chosen: coarse to fine", least=1e-3)
    """Lengths, in √area, one for each step of the bending of both shapes; shorter pieces move almost rigidly."""
    n_bent_vertices: int = setting(1000, "chosen as for parts", least=100)
    """Number of vertices of each shape that are bent before the best map is chosen."""
    most_scaled: float = setting(2.0, "chosen: half to twice the size", least=1)
    """Factor by which a piece of a shape is allowed to grow or shrink at no cost (`RigidRegistration`)."""


@dataclass(frozen=True)
class OutcomeSettings(Settings):
    """Bounds on the measures of a map (see `Quality`) that decide whether it is sure, ambiguous, poor or partial."""

    coverage_radius: float = setting(COVERAGE_RADIUS, "chosen: the spacing of the search vertices", least=0)
    """Largest distance along edges, in √area, of a vertex of the target from the nearest image, if it is covered."""
    tie: float = setting(1.25, "5 right maps of 63 are flagged: decisions.md, descriptor weight", least=1)
    """Least score of a different map over the score of the map; below it, the map is ambiguous."""
    elastic_tie: float = setting(1.15, "chosen: decisions.md, descriptor bounds", least=1)
    """Least ratio, as ``tie``, for shapes far from isometric: all their maps have nearly equal spectral residuals."""
    mirror_tie: float = setting(1.5, "lab/benchmarks.md, confidence", least=1)
    """Least ratio, as ``tie``, for a map of the other orientation, if allowed: poses alone change scores as much."""
    mirror_image: float = setting(
        0.6, "lopsided creatures have up to 0.52, bodies from 0.67", least=0, most=1
    )
    """Least score of a map of the forbidden orientation over the map's; below it, the former fits clearly better."""
    max_counted_growth: float = setting(4.0, "chosen: torn faces must not outweigh all others", least=1)
    """Largest ratio of squared lengths, edge's image over edge, in `Quality.stretch`; larger ones are lowered to it."""
    poor_spectral_residual: float = setting(0.66, "set on FAUST and creatures: lab/benchmarks.md", least=0)
    """Largest `Quality.spectral_residual` of a map between nearly isometric shapes; a map with more is poor."""
    poor_residual: float = setting(0.38, "set on FAUST and creatures: lab/benchmarks.md", least=0)
    """Largest `Quality.residual` of a map between nearly isometric shapes; a map with more is poor."""
    poor_stretch: float = setting(1.2, "lab/benchmarks.md, confidence", least=1)
    """Largest `Quality.stretch` of a map between nearly isometric shapes; a map with more is poor."""
    poor_bending: float = setting(1.7e-3, "a wrong map has 2.3e-3: decisions.md, elastic outcome", least=0)
    """Largest `Quality.bending_cost` of a map between shapes far from isometric; a map with more is poor."""
    poor_far_residual: float = setting(0.45, "a wrong map has 0.59: decisions.md, elastic outcome", least=0)
    """Largest `Quality.residual` of a map between shapes far from isometric; a map with more is poor."""
    poor_far_descriptor_distance: float = setting(
        0.465, "right maps have at most 0.46: decisions.md, individuals", least=0
    )
    """Largest `Quality.descriptor_distance` of a map between shapes far from isometric; one with more is poor."""
    poor_descriptor_distance: float = setting(0.42, "chosen: decisions.md, descriptor bounds", least=0)
    """Bound on the mean descriptor distance: a map is sure, and ends the search, only below 0.75 of it."""
    doubtful_descriptor_distance: float = setting(
        0.65, "right maps but one have up to 0.54, wrong ones from 0.78", least=0
    )
    """Largest mean descriptor distance near a vertex, less the median of all, at which its image is not in doubt."""
    doubtful_area: float = setting(0.02, "chosen: a forearm of a body", least=0, most=1)
    """Largest share of the source's area in a region of doubtful images; a larger region lowers the outcome."""
    torn_growth: float = setting(0.1, "0.07 to 0.15 do as well: lab/benchmarks.md", least=0)
    """Largest length of an edge's image less the edge's own, each in √area of its shape, if the edge is not torn."""
    poor_torn_off: float = setting(0.005, "half a hand has this area; right maps have up to 0.002", least=0)
    """Largest `Quality.torn_off`, a share of the source's area, of a map; a map with more is poor."""
    poor_orientation: float = setting(0.65, "chosen", least=-1, most=1)
    """Least `Quality.orientation`, a mean cosine of normals, of a map; a map with less is poor."""
    contradiction: float = setting(0.1, "right priors have up to 0.05, wrong ones 0.12", least=0)
    """Largest distance, in √area, of images from where priors ask them to be; beyond it, they contradict each other."""
    out_of_pose: float = setting(0.25, "a turn by 40° makes 0.22, by 90° 0.29: docs/priors.md", least=0)
    """Largest mean distance of images from nearest points in space, in √area; beyond it, the pose misleads."""
    large_component: float = setting(0.05, "chosen: a hand has 1 %, a head 8 % of a body", least=0, most=1)
    """Largest share of a shape, by area or vertices, in a component without partner; above, a match is partial."""
