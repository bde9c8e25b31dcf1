"""Settings of the stages of a match: search, selection, refinement, parts, elastic shapes, outcome."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

from isomatch._core.errors import SettingError
from isomatch._core.settings import Settings, setting

# Target vertices within this distance of an image, in √area along edges, are covered; the search
# vertices lie as far from each other.
COVERAGE_RADIUS = 0.05
# A shape that is registered resists stretching at these lengths, in √area, one for each step.
BENDING_LENGTHS = (0.3, 0.25, 0.2, 0.17, 0.14, 0.11, 0.09, 0.075, 0.06, 0.05)


@dataclass(frozen=True)
class SearchSettings(Settings):
    """Settings of first maps and of the search among them.

    Parameters
    ----------
    rank, start_columns : int
        Descriptor columns that are compared, and leading columns that a few points determine.
    near_rigid : float
        Aligned shapes up to this mean distance, in √area, are also matched by `poses_between`.
    off_diagonal, ridge : tuple of float, float
        Penalties of `alignments_from_points` on mixed columns (all are tried for landmarks, the
        first for extremities), and on every entry.
    extremity_counts, n_candidate_extremities : tuple of int, int
        Numbers of extremities of one shape that are assigned together; candidates on the other.
    assignments, eccentricity_weight : int, float
        Best assignments kept for each count and direction; weight of differences of average
        distance in their cost, relative to differences of mutual distances.
    start_steps, flip_steps, compare_every, unchanged : int, int, int, float
        Iterations of closest points from extremities, and after flips; iterations between two
        comparisons of the maps; share of unchanged images at which an iteration has converged.
    same_start, same_map : float
        Mean distance of images, in √area, below which two starts, or two converged maps, are one.
    n_hypotheses, flipped, flipped_functions : int
        Largest number of hypotheses; number of the best that are flipped, and of leading
        Laplace–Beltrami functions whose signs are flipped.
    flip_landmarks : bool
        Whether flips of the map from landmarks are tried if no automatic hypotheses compete.
    """

    rank: int = setting(30, "measured on 50 pairs: p = 60 and k = 30 as good as p = 100 and k = 50", least=4)
    start_columns: int = setting(20, "lab/benchmarks.md, sensitivity", least=4)
    near_rigid: float = setting(0.05, "bones of one kind: 0.034 to 0.043; other poses: from 0.047", least=0)
    off_diagonal: tuple[float, ...] = setting((0.01, 0.001, 0.0001), "lab/paper.md, centaur5", least=0)
    ridge: float = setting(0.001, "lab/benchmarks.md, sensitivity", least=0)
    extremity_counts: tuple[int, ...] = setting((4, 5, 6), "ablation: one set of extremities", least=1)
    n_candidate_extremities: int = setting(7, "lab/benchmarks.md, sensitivity", least=1)
    assignments: int = setting(8, "lab/benchmarks.md, sensitivity: the right map on 86 of 86", least=1)
    eccentricity_weight: float = setting(0.3, "lab/benchmarks.md, sensitivity", least=0)
    start_steps: int = setting(12, "lab/benchmarks.md, sensitivity", least=1)
    flip_steps: int = setting(4, "lab/benchmarks.md, sensitivity", least=1)
    unchanged: float = setting(0.99, "lab/benchmarks.md, sensitivity", least=0, most=1)
    compare_every: int = setting(2, "lab/benchmarks.md, sensitivity", least=1)
    same_start: float = setting(0.02, "sensitivity; half the spacing of 400 samples", least=0)
    same_map: float = setting(0.05, "sensitivity; the spacing of 400 samples", least=0)
    n_hypotheses: int = setting(14, "the right map was among the best 12 on 86 of 86 pairs", least=1)
    flipped: int = setting(3, "ablation: no flips", least=0)
    flipped_functions: int = setting(20, "ablation: no flips", least=0)
    flip_landmarks: bool = setting(True, "lab/paper.md: victoria12–victoria23, 7.9 without, 4.2 with")


@dataclass(frozen=True)
class SelectionSettings(Settings):
    """Settings of the choice among hypotheses.

    Parameters
    ----------
    normal_functions, extension_functions : int
        Functions of the smoothed surfaces whose normals are compared, and those through which a
        hypothesis is extended to further vertices.
    curvature_exponent, energy_exponent : float
        Energy = descriptor residual × curvature difference to the power of the first; score of a
        refined map = spectral residual × energy to the power of the second.
    orientation_threshold : float
        Mean cosine between normals above which a map preserves the orientation.
    energy_limit, mirrored_energy, most_contenders : float, float, int
        Hypotheses with an energy up to this multiple of the least are refined and compared again,
        up to the second if their orientation is not allowed; the largest number of them.
    spectral_residual_limit : float
        A map is given up after a stage of the refinement if its spectral residual reaches this
        multiple of the least.
    same_map, runner_up_distance : float
        Mean distance between images, in √area, up to which two refined maps are the same (less than
        one turned limb makes), and from which they are different maps, not variants of one.
    descriptor_weight : float
        The costs of two maps are compared after a factor exp(weight × difference of their mean
        descriptor distances).
    most_alternatives : int
        Largest number of alternatives in the result.
    """

    normal_functions: int = setting(40, "lab/benchmarks.md, sensitivity", least=4)
    curvature_exponent: float = setting(2.0, "on 86 pairs 2 and 1 choose right, 2 by a wider margin", least=0)
    orientation_threshold: float = setting(0.3, "50 pairs: right ones above 0.54", least=0, most=1)
    mirrored_energy: float = setting(0.75, "lopsided creatures up to 0.52; bodies from 0.42", least=0)
    energy_limit: float = setting(3.0, "lab/benchmarks.md, sensitivity", least=1)
    most_contenders: int = setting(4, "decisions.md, refinement cost: no other map than by 6", least=1)
    extension_functions: int = setting(50, "lab/benchmarks.md, sensitivity; as in the search", least=4)
    spectral_residual_limit: float = setting(1.15, "lab/benchmarks.md, sensitivity; as outcome.tie", least=1)
    same_map: float = setting(0.02, "lab/benchmarks.md, sensitivity; half of one turned limb", least=0)
    energy_exponent: float = setting(0.25, "ablation: model selection by spectral residual alone", least=0)
    runner_up_distance: float = setting(0.15, "more than noise or one limb, less than a turned body", least=0)
    descriptor_weight: float = setting(1.5, "decisions.md, descriptor weight", least=0)
    most_alternatives: int = setting(2, "what a report can show beside the map", least=0)


_sizes = partial(setting, least=4, empty=True)  # A stage without sizes is left out.


@dataclass(frozen=True)
class RefinementSettings(Settings):
    """Settings of the refinements.

    Parameters
    ----------
    sizes_without_positions, sizes_with_positions, final_sizes : tuple of int
        Functions in the steps of the three stages of the joint refinement; the last two have
        positions and normals. After each stage, maps that fit much worse than the best are dropped.
    sizes_of_parts, polished_sizes : tuple of int
        Functions in further steps, without positions, for the map of a part, and in those that
        polish the map of a large mesh on more vertices.
    sizes_again : tuple of int
        Functions in the steps that refine once more a map that ties with the best, with positions
        and normals if the earlier stages end with them, and with the same last step. The map of
        lower score stays.
    position_unit : float
        Distance between positions, in √area, that counts as one unit of the spectral coordinates.
    normal_weight, function_weight : float
        Weights of normals, and of functions known on both shapes (see `match`), relative to their
        root mean square.
    registration_steps, laplace_steps_at_once : int
        Steps of the non-rigid registration that ends "joint"; if above 0, the largest number of
        iterations of "laplace_icp" as in the paper: all functions at once, F orthogonal.
    """

    sizes_without_positions: tuple[int, ...] = _sizes(
        (20, 25, 30, 35, 40, 45, 50), "Melzi et al. 2019; decisions.md, refinement steps"
    )
    sizes_with_positions: tuple[int, ...] = _sizes((50, 75, 100), "ablation")
    final_sizes: tuple[int, ...] = _sizes((125, 150), "ablation")
    sizes_of_parts: tuple[int, ...] = _sizes((70, 100, 140), "decisions.md, refinement steps")
    sizes_again: tuple[int, ...] = _sizes((20, 30, 50, 80, 130), "decisions.md, second refinement")
    polished_sizes: tuple[int, ...] = setting((100, 150), "chosen", least=4)
    position_unit: float = setting(0.08, "measured on 9 pairs: 0.08 2.06, 0.15 2.11, 0.3 2.14", least=1e-6)
    normal_weight: float = setting(0.3, "lab/benchmarks.md, sensitivity", least=0)
    function_weight: float = setting(0.2, "docs/priors.md, known functions", least=0)
    registration_steps: int = setting(3, "decisions.md, refinement cost", least=0)
    laplace_steps_at_once: int = setting(0, "lab/paper.md, deviations: at once heals less", least=0)

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
    """Settings of the match of a part to a whole.

    Parameters
    ----------
    hopeless : float
        A map is dropped if its score reaches this multiple of the best, after the short refinement,
        which keeps two, and before settling.
    long_boundary : float
        A shape may be a part if a piece of its boundary is longer than this, in √area.
    close : bool
        Also match the shapes with their holes closed, as complete ones.
    little_missing, most_there : float
        A part with at least this share of the area of the whole, in the units of the files, is
        first matched with its holes closed, and if that is sure, from that map; the second share
        applies if few distances are known (``little_trusted``).
    bending, n_bent_vertices : tuple of float, int
        Lengths, in √area of the whole, at which the part resists stretching when it is bent onto
        the whole, see `RigidRegistration`; number of its vertices while contenders are
        compared.
    n_settled : int
        Number of best maps that are settled: the part is bent, its map refined from the bent part,
        and so on.
    rim, off : float
        A vertex of the whole is matched to the boundary of a part, or to its other points, up to
        these distances, in √area. If hardly any distance on the whole is known, the second one
        applies to both.
    poor_doubt, poor_via : float
        A map is not sure if its doubt (see `Quality`) is above the first, or if it is composed and
        its cost by `verify` is above the second.
    little_trusted, clear : float
        A map is not sure if the share of pairs of anchors with a known distance on the whole is
        below the first, unless the score of its best alternative is at least the second times its
        own.
    descriptor_weight : float
        As `SelectionSettings.descriptor_weight`, for parts, and for roughly refined maps.
    n_common, sure_common : int, float
        For two overlapping parts: number of likeliest common regions that are refined; how much
        more alike than at random the parts must look in the best region for it to be sure.
    tie : float
        A map is not sure if the score of an alternative is below this multiple of its own.
    """

    hopeless: float = setting(3.0, "lab/robustness.md, parts", least=1)
    long_boundary: float = setting(0.15, "complete bodies up to 0.08, without a limb from 0.2", least=0)
    close: bool = setting(True, "decisions.md, strategies that pay")
    little_missing: float = setting(0.85, "decisions.md, part first or second", least=0)
    most_there: float = setting(0.6, "decisions.md, two parts", least=0)
    bending: tuple[float, ...] = setting(BENDING_LENGTHS, "lab/robustness.md, parts", least=1e-3)
    rim: float = setting(0.04, "lab/robustness.md, parts", least=0)
    off: float = setting(0.1, "lab/robustness.md, parts", least=0)
    n_bent_vertices: int = setting(1000, "lab/robustness.md, parts", least=50)
    n_settled: int = setting(3, "lab/robustness.md, parts", least=0)
    poor_doubt: float = setting(8.5e-5, "lab/robustness.md, parts, how the bound was set", least=0)
    little_trusted: float = setting(0.15, "lab/robustness.md, parts", least=0, most=1)
    clear: float = setting(2.0, "lab/robustness.md, parts", least=1)
    descriptor_weight: float = setting(6.0, "decisions.md, cost of a part", least=0)
    n_common: int = setting(8, "decisions.md, two parts", least=1)
    sure_common: float = setting(0.5, "decisions.md, two parts", least=0)
    tie: float = setting(1.2, "chosen on cuts and holes, not one by one", least=1)
    poor_via: float = setting(0.03, "decisions.md, by way of a whole", least=0)


@dataclass(frozen=True)
class ElasticSettings(Settings):
    """Settings of the match of shapes that are far from isometric.

    Parameters
    ----------
    sought : float
        A map that lets limbs stretch is sought if the spectral residual of the best map that keeps
        distances reaches this.
    n_coordinates, n_starts : int
        Canonical coordinates of each shape; best assignments of the points of either.
    forgiven, inside : float
        Difference of two distances, in units of the average, that costs nothing; a term of
        `IntervalCost`.
    bending, n_bent_vertices
        As in `PartSettings`, for both shapes.
    most_scaled : float
        A piece of the source may grow or shrink by this factor at no cost (`RigidRegistration`).
    """

    sought: float = setting(0.54, "decisions.md, elastic outcome: when limbs are taken to stretch", least=0)
    n_coordinates: int = setting(8, "Ezuz et al. 2019", least=3)
    forgiven: float = setting(0.3, "chosen on pairs of animals, not one by one", least=0, most=1)
    inside: float = setting(0.1, "decisions.md, elastic starts", least=0)
    n_starts: int = setting(60, "decisions.md, elastic starts", least=1)
    bending: tuple[float, ...] = setting(BENDING_LENGTHS, "decisions.md, elastic steps", least=1e-3)
    n_bent_vertices: int = setting(1000, "decisions.md, elastic steps", least=100)
    most_scaled: float = setting(2.0, "decisions.md, elastic steps: half and twice the size", least=1)


@dataclass(frozen=True)
class OutcomeSettings(Settings):
    """Bounds of the measures that decide the outcome.

    Parameters
    ----------
    coverage_radius : float
        Target vertices within this distance of an image, in √area along edges, are covered.
    tie, look_tie, mirror_tie : float
        A map is not sure if the score of an alternative is below this multiple of its own: in
        general; between shapes far from isometric, whose spectral residuals are nearly equal; and
        for maps of either side if both are allowed, as poses alone may differ as much.
    mirror_image : float
        A map of the orientation that is not allowed fits clearly better if its score is below this
        multiple of the score of the map returned.
    torn, torn_apart : float
        Largest ratio of the squared lengths of an edge's image and of the edge that counts;
        difference of both lengths, in √area, from which the map tears the edge.
    poor_spectral_residual, poor_residual, poor_stretch, poor_torn_off, poor_orientation : float
        A map is poor above these values of its `Quality`, and below the last.
    poor_bending, poor_far_residual, poor_far_descriptor_distance : float
        The same for shapes far from isometric: bending cost, residual and descriptor distance.
    poor_descriptor_distance : float
        A map is sure only if its mean descriptor distance is well below this; see `Quality`.
    doubtful_descriptor_distance, doubtful_area : float
        The image of a vertex is doubtful if the mean descriptor distance around it exceeds the
        median of the map by the first; a region of doubtful images lowers the outcome if its share
        of the surface reaches the second.
    contradiction : float
        Priors are contradicted if images lie this far, in √area, from where priors ask for them:
        the mean of landmarks (for a part the median), or the median of an initial map.
    out_of_pose : float
        ``start="pose"`` misleads if the mean distance of the images from the nearest points in
        space reaches this, in √area.
    large_component : float
        Share of the area, or of the vertices, from which a component without a partner makes a
        match partial, and an unsure one makes it unsure.
    """

    coverage_radius: float = setting(COVERAGE_RADIUS, "the spacing of the search vertices", least=0)
    tie: float = setting(1.25, "decisions.md, descriptor weight", least=1)
    look_tie: float = setting(1.15, "decisions.md, descriptor bounds", least=1)
    mirror_tie: float = setting(1.5, "lab/benchmarks.md, confidence: either side", least=1)
    mirror_image: float = setting(0.6, "lopsided creatures up to 0.52; bodies from 0.67", least=0, most=1)
    torn: float = setting(4.0, "chosen: a few torn faces must not outweigh all others", least=1)
    poor_spectral_residual: float = setting(0.66, "FAUST and creatures; lab/benchmarks.md", least=0)
    poor_residual: float = setting(0.38, "FAUST and creatures; lab/benchmarks.md, confidence", least=0)
    poor_stretch: float = setting(1.2, "lab/benchmarks.md, confidence", least=1)
    poor_bending: float = setting(1.7e-3, "decisions.md, elastic outcome", least=0)
    poor_far_residual: float = setting(0.45, "decisions.md, elastic outcome", least=0)
    poor_far_descriptor_distance: float = setting(0.465, "decisions.md, individuals", least=0)
    poor_descriptor_distance: float = setting(0.42, "decisions.md, descriptor bounds", least=0)
    doubtful_descriptor_distance: float = setting(0.65, "lab/benchmarks.md, regions of doubt", least=0)
    doubtful_area: float = setting(0.02, "a forearm of a body", least=0, most=1)
    torn_apart: float = setting(0.1, "0.07 to 0.15 do as well: lab/benchmarks.md, confidence", least=0)
    poor_torn_off: float = setting(0.005, "half a hand; right maps have at most 0.2 %", least=0)
    poor_orientation: float = setting(0.65, "chosen, not measured", least=-1, most=1)
    contradiction: float = setting(0.1, "lab/benchmarks.md, contradicted priors", least=0)
    out_of_pose: float = setting(0.25, "docs/priors.md, the pose: 0.22 at 40°, 0.29 at 90°", least=0)
    large_component: float = setting(0.05, "a hand is 1 %, a head 8 % of a body", least=0, most=1)
