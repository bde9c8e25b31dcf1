"""Settings of the stages of a match: search, selection, refinement, parts, elastic shapes, outcome."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

from isomatch._core.errors import SettingError
from isomatch._core.settings import Settings, setting

# Sources with two values, such as "6 err by 10 % more", are from docs/dev/lab/benchmarks.md, sensitivity, or
# contributions. Scores, energies and residuals are better if they are lower.

# Largest distance along edges, in √area, of a covered target vertex from an image; the spacing of search vertices.
COVERAGE_RADIUS = 0.05
# Lengths, in √area, below which a shape that is registered moves rigidly, one for each step; chosen.
BENDING_LENGTHS = (0.3, 0.25, 0.2, 0.17, 0.14, 0.11, 0.09, 0.075, 0.06, 0.05)


@dataclass(frozen=True)
class SearchSettings(Settings):
    """Settings of first maps and of the search among them.

    Parameters
    ----------
    rank, start_columns : int
        Number of descriptor columns that are compared; number of leading columns that are aligned by a
        few points.
    near_rigid : float
        Shapes that a rigid motion brings to this mean distance, in √area, are also matched by nearest points.
    off_diagonal, ridge : tuple of float, float
        Penalties of `alignments_from_points` on mixed columns (all are tried for landmarks, the
        first for extremities), and on every entry.
    extremity_counts, n_candidate_extremities : tuple of int, int
        Numbers of extremities of one shape that are assigned together; number of extremities of the
        other shape among which their images are chosen.
    assignments, eccentricity_weight : int, float
        Number of best assignments that are kept for each count and direction; weight, in their cost, of
        differences of average distance relative to differences of mutual distances.
    start_steps, flip_steps, compare_every, unchanged : int, int, int, float
        Iterations of closest points from extremities, and after flips; iterations between two
        comparisons of the maps; share of unchanged images at which an iteration has converged.
    same_start, same_map : float
        Mean distance of images, in √area, below which two starts, or two converged maps, are one.
    n_hypotheses, flipped, flipped_functions : int
        Largest number of hypotheses; number of best hypotheses that are flipped; number of leading
        Laplace–Beltrami functions whose signs are flipped.
    flip_landmarks : bool
        Whether flips of the map from landmarks are tried if no automatic hypotheses compete.
    """

    rank: int = setting(30, "basis vectors; 50 are no better on 50 pairs", least=4)
    start_columns: int = setting(20, "columns that a few points determine; 10 or 30 gain nothing", least=4)
    near_rigid: float = setting(0.05, "√area; bones of one kind have 0.034 to 0.043", least=0)
    off_diagonal: tuple[float, ...] = setting((0.01, 0.001, 0.0001), "penalties; lab/paper.md", least=0)
    ridge: float = setting(0.001, "penalty on every entry; 0.0001 and 0.01 do as well", least=0)
    extremity_counts: tuple[int, ...] = setting((4, 5, 6), "extremities; one count errs by 1 % more", least=1)
    n_candidate_extremities: int = setting(7, "extremities; 6 err by 10 % more, 8 do as well", least=1)
    assignments: int = setting(8, "assignments kept; they hold the right map on 86 of 86 pairs", least=1)
    eccentricity_weight: float = setting(0.3, "relative to mutual distances; 0 and 1 do as well", least=0)
    start_steps: int = setting(12, "iterations; 6 err by 6 % more, 24 do as well", least=1)
    flip_steps: int = setting(4, "iterations; 2 and 8 gain nothing", least=1)
    unchanged: float = setting(0.99, "share of images; 0.95 errs by 2 % more", least=0, most=1)
    compare_every: int = setting(2, "iterations; 1 and 4 do as well", least=1)
    same_start: float = setting(0.02, "√area, mean; half the spacing of 400 samples", least=0)
    same_map: float = setting(0.05, "√area, mean; the spacing of 400 samples", least=0)
    n_hypotheses: int = setting(14, "hypotheses; the right one was among 12 on 86 of 86 pairs", least=1)
    flipped: int = setting(3, "hypotheses; without flips, 15 of 124 pairs fail", least=0)
    flipped_functions: int = setting(20, "functions; 12 err by 7 % more, 30 by 4 %", least=0)
    flip_landmarks: bool = setting(True, "one pair errs by 7.9 % of √area without, 4.2 with: lab/paper.md")


@dataclass(frozen=True)
class SelectionSettings(Settings):
    """Settings of the choice among hypotheses.

    Parameters
    ----------
    normal_functions, extension_functions : int
        Number of Laplace–Beltrami functions that smooth the surfaces whose normals are compared; number
        of functions through which a hypothesis is extended to further vertices.
    curvature_exponent, energy_exponent : float
        The energy is descriptor residual × curvature difference ** curvature_exponent; the score of a
        refined map is spectral residual × energy ** energy_exponent.
    orientation_threshold : float
        Mean cosine between normals above which a map preserves the orientation.
    energy_limit, most_contenders : float, int
        Hypotheses with an energy up to this multiple of the least energy are refined; their largest number.
    mirrored_energy : float
        A hypothesis whose orientation is not allowed is refined for comparison below this multiple of it.
    spectral_residual_limit : float
        A map is given up after a stage of the refinement if its spectral residual exceeds this
        multiple of the least one.
    same_map, runner_up_distance : float
        Mean distance between images, in √area, up to which two refined maps are the same (less than
        one turned limb makes), and above which they are different maps, not variants of one.
    descriptor_weight : float
        The ratio of the costs of two maps is multiplied by exp(weight × difference of their mean
        descriptor distances).
    most_alternatives : int
        Largest number of alternatives in the result.
    """

    normal_functions: int = setting(40, "functions; 20 and 80 do as well", least=4)
    curvature_exponent: float = setting(2.0, "1 chooses right on 86 pairs, too, but narrowly", least=0)
    orientation_threshold: float = setting(0.3, "mean cosine; right maps have above 0.54", least=0, most=1)
    mirrored_energy: float = setting(0.75, "× least energy; lopsided shapes ≤ 0.52, bodies ≥ 0.42", least=0)
    energy_limit: float = setting(3.0, "× least energy; 1.5 and 6 do as well", least=1)
    most_contenders: int = setting(4, "hypotheses; 6 do as well: decisions.md, refinement cost", least=1)
    extension_functions: int = setting(50, "functions; 25 do as well, 100 err by 4 % more", least=4)
    spectral_residual_limit: float = setting(1.15, "× least residual; 1.05 and 1.3 do as well", least=1)
    same_map: float = setting(0.02, "√area, mean; half of what one turned limb makes", least=0)
    energy_exponent: float = setting(0.25, "with 0, 3 of 124 pairs get worse maps, 1 a better one", least=0)
    runner_up_distance: float = setting(0.15, "√area, mean; one limb makes less, a turned body more", least=0)
    descriptor_weight: float = setting(1.5, "fewer wrong maps: decisions.md, descriptor weight", least=0)
    most_alternatives: int = setting(2, "alternatives; what a report can show beside the map", least=0)


_sizes = partial(setting, least=4, empty=True)  # A stage without sizes is left out.


@dataclass(frozen=True)
class RefinementSettings(Settings):
    """Settings of the refinements.

    Parameters
    ----------
    sizes_without_positions, sizes_with_positions, final_sizes : tuple of int
        Numbers of functions in the steps of the three stages of the joint refinement; the last two have
        positions and normals. After each stage, maps that fit much worse than the best are dropped.
    sizes_of_parts, polished_sizes : tuple of int
        Numbers of functions in the further steps, without positions, that refine the map of a part, and
        in the steps that polish the map of a large mesh on more vertices.
    sizes_again : tuple of int
        Numbers of functions in the steps that refine a map once more if it ties with the best, with
        positions and normals if the earlier stages end with them, and with the same last step. The map
        of lower score stays.
    position_unit : float
        Distance between positions, in √area, that counts as one unit of the spectral coordinates.
    normal_weight, function_weight : float
        Root mean squares of normals, and of functions known on both shapes (see `match`), as spectral
        coordinates.
    registration_steps, laplace_steps_at_once : int
        Steps of the non-rigid registration that ends "joint"; if above 0, the largest number of
        iterations of "laplace_icp" as in the paper: all functions at once, F orthogonal.
    """

    sizes_without_positions: tuple[int, ...] = _sizes(
        (20, 25, 30, 35, 40, 45, 50), "functions in each step; decisions.md, refinement steps"
    )
    sizes_with_positions: tuple[int, ...] = _sizes((50, 75, 100), "functions; one step: 9 of 124 pairs fail")
    final_sizes: tuple[int, ...] = _sizes((125, 150), "200 gain nothing: decisions.md, refinement cost")
    sizes_of_parts: tuple[int, ...] = _sizes((70, 100, 140), "7 % less error: decisions.md, refinement steps")
    sizes_again: tuple[int, ...] = _sizes((20, 30, 50, 80, 130), "few functions let turned limbs loose")
    polished_sizes: tuple[int, ...] = setting((100, 150), "functions; chosen", least=4)
    position_unit: float = setting(0.08, "√area; errors in % of √area: 2.06, with 0.3 2.14", least=1e-6)
    normal_weight: float = setting(0.3, "× root mean square; 0.15 errs by 4 % more", least=0)
    function_weight: float = setting(0.2, "× root mean square; docs/priors.md, known functions", least=0)
    registration_steps: int = setting(3, "steps; 4 gain nothing: decisions.md, refinement cost", least=0)
    laplace_steps_at_once: int = setting(0, "0: functions grow, which errs less: lab/paper.md", least=0)

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
        A map is dropped if its score exceeds this multiple of the best score, after the short refinement,
        which keeps two, and before the part is bent.
    long_boundary : float
        A shape may be a part if a piece of its boundary is longer than this, in √area.
    close_holes : bool
        Whether the shapes are also matched with their holes closed, as complete ones.
    little_missing, most_there : float
        A part with at least this share of the area of the whole, in the units of the files, is
        first matched with its holes closed, and if that is sure, from that map; the second share
        applies if few distances are known (``little_trusted``).
    bending, n_bent_vertices : tuple of float, int
        Lengths, in √area of the whole, below which the part moves rigidly when it is bent onto the
        whole, see `RigidRegistration`; number of its vertices while contenders are compared.
    n_settled : int
        Number of best maps from which the part is bent, to refine the map from the bent part.
    boundary_tolerance, surface_tolerance : float
        A vertex of the whole is matched to the boundary of the bent part, or to its other points, up to
        these distances, in √area. If hardly any distance on the whole is known, the second one
        applies to both.
    poor_doubt, poor_via : float
        A map is not sure if its doubt (see `Quality`) is above ``poor_doubt``, or if it is composed and
        its cost by `verify` is above ``poor_via``.
    little_trusted, clear_lead : float
        A map is not sure if the share of pairs of anchors with a known distance on the whole is below
        ``little_trusted``, unless the score of its best alternative is at least ``clear_lead`` times its own.
    descriptor_weight : float
        As `SelectionSettings.descriptor_weight`, for parts, and for roughly refined maps.
    n_common, sure_common : int, float
        For two overlapping parts: number of likeliest common regions that are refined; least evidence for
        the best one (weighed area that looks alike, less what lacks an image) from which it is sure.
    tie : float
        A map is not sure if the score of an alternative is below this multiple of its own.
    """

    hopeless: float = setting(3.0, "× best score; such maps end above 3.8 ×: lab/robustness.md", least=1)
    long_boundary: float = setting(0.15, "√area; complete bodies ≤ 0.08, without a limb ≥ 0.2", least=0)
    close_holes: bool = setting(True, "wins on 21 of 116 parts: decisions.md, strategies that pay")
    little_missing: float = setting(0.85, "share of area: decisions.md, part first or second", least=0)
    most_there: float = setting(0.6, "share of the area, where few distances are known; chosen", least=0)
    bending: tuple[float, ...] = setting(BENDING_LENGTHS, "√area, coarse to fine; chosen", least=1e-3)
    boundary_tolerance: float = setting(0.04, "√area; 1.2 % of true images are farther", least=0)
    surface_tolerance: float = setting(0.1, "√area; views err by 4.3 % of √area, not by 9.0", least=0)
    n_bent_vertices: int = setting(1000, "vertices; 2000 err by 3 % less in 1.2 × the time", least=50)
    n_settled: int = setting(3, "maps of least cost: lab/robustness.md, parts", least=0)
    poor_doubt: float = setting(8.5e-5, "31 of 40 right maps have less, wrong ones ≥ 1.8e-4", least=0)
    little_trusted: float = setting(0.15, "share of known distances; lab/robustness.md", least=0, most=1)
    clear_lead: float = setting(2.0, "× own score; 1.10 to 1.39 beside wrong maps", least=1)
    descriptor_weight: float = setting(6.0, "fewer wrong views: decisions.md, cost of a part", least=0)
    n_common: int = setting(8, "regions; chosen", least=1)
    sure_common: float = setting(0.5, "evidence; wrong maps ≤ 0.44: decisions.md, two parts", least=0)
    tie: float = setting(1.2, "× own score; chosen on cuts and holes, with the other bounds", least=1)
    poor_via: float = setting(0.03, "verified cost; wrong ≥ 0.033: decisions.md, by way of a whole", least=0)


@dataclass(frozen=True)
class ElasticSettings(Settings):
    """Settings of the match of shapes that are far from isometric.

    Parameters
    ----------
    min_spectral_residual : float
        A map that lets limbs stretch is sought if the spectral residual of the best map that keeps
        distances exceeds this, or if that map is poor.
    n_coordinates, n_starts : int
        Number of canonical coordinates of each shape; number of best assignments of either shape's points.
    distance_tolerance, deviation_weight : float
        Share by which a distance may change at a lower cost; weight of the whole change, relative to what
        exceeds this share (``tolerance`` and ``inside`` of `IntervalCost`).
    bending, n_bent_vertices
        As in `PartSettings`, for both shapes.
    most_scaled : float
        A piece of a shape may grow or shrink by this factor at no cost (`RigidRegistration`).
    """

    min_spectral_residual: float = setting(0.54, "set on species: decisions.md, elastic outcome", least=0)
    n_coordinates: int = setting(8, "canonical coordinates; Ezuz et al. 2019", least=3)
    distance_tolerance: float = setting(0.3, "share of a distance; chosen on animals", least=0, most=1)
    deviation_weight: float = setting(0.1, "the best starts err by 10, with 0.3 by 12 % of √area", least=0)
    n_starts: int = setting(60, "assignments; best errs by 10 %: decisions.md, elastic starts", least=1)
    bending: tuple[float, ...] = setting(BENDING_LENGTHS, "√area, coarse to fine; chosen", least=1e-3)
    n_bent_vertices: int = setting(1000, "vertices; chosen as for parts", least=100)
    most_scaled: float = setting(2.0, "factor, and its inverse; decisions.md, elastic steps", least=1)


@dataclass(frozen=True)
class OutcomeSettings(Settings):
    """Bounds of the measures that decide the outcome.

    Parameters
    ----------
    coverage_radius : float
        Target vertices within this distance of an image, in √area along edges, are covered.
    tie, elastic_tie, mirror_tie : float
        A map is not sure if the score of an alternative is below this multiple of its own: in
        general; between shapes far from isometric, whose spectral residuals are nearly equal; and
        for maps of either orientation if both are allowed, as poses alone may differ as much.
    mirror_image : float
        A map of the orientation that is not allowed fits clearly better if its score is below this
        multiple of the score of the map returned.
    max_counted_growth : float
        Ratio of the squared lengths of an edge's image and of the edge; larger ratios count as this in the stretch.
    torn_growth : float
        The map tears an edge if its image is longer than the edge by more than this, in √area.
    poor_spectral_residual, poor_residual, poor_stretch, poor_torn_off, poor_orientation : float
        A map is poor above these values of its `Quality`; below the value if it is the orientation.
    poor_bending, poor_far_residual, poor_far_descriptor_distance : float
        The same for shapes far from isometric: bending cost, residual and descriptor distance.
    poor_descriptor_distance : float
        A match tries no further strategies only if the mean descriptor distance is well below this.
    doubtful_descriptor_distance, doubtful_area : float
        The image of a vertex is doubtful if the mean descriptor distance around it exceeds the median of
        the map by the first value; a region of doubtful images lowers the outcome if its share of the
        surface exceeds the second.
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

    coverage_radius: float = setting(COVERAGE_RADIUS, "√area; the spacing of the search vertices", least=0)
    tie: float = setting(1.25, "× score; 5 right of 63 are flagged: decisions.md, descriptor weight", least=1)
    elastic_tie: float = setting(1.15, "× own score, chosen: decisions.md, descriptor bounds", least=1)
    mirror_tie: float = setting(1.5, "× own score, if either side may win; lab/benchmarks.md", least=1)
    mirror_image: float = setting(0.6, "× own score; lopsided shapes ≤ 0.52, bodies ≥ 0.67", least=0, most=1)
    max_counted_growth: float = setting(4.0, "squared; chosen: torn faces must not outweigh all", least=1)
    poor_spectral_residual: float = setting(0.66, "set on FAUST and creatures: lab/benchmarks.md", least=0)
    poor_residual: float = setting(0.38, "set on FAUST and creatures: lab/benchmarks.md", least=0)
    poor_stretch: float = setting(1.2, "squared ratio; lab/benchmarks.md, confidence", least=1)
    poor_bending: float = setting(1.7e-3, "a wrong map has 2.3e-3: decisions.md, elastic outcome", least=0)
    poor_far_residual: float = setting(0.45, "a wrong map has 0.59: decisions.md, elastic outcome", least=0)
    poor_far_descriptor_distance: float = setting(0.465, "right ≤ 0.46: decisions.md, individuals", least=0)
    poor_descriptor_distance: float = setting(0.42, "right ≥ 0.38: decisions.md, descriptor bounds", least=0)
    doubtful_descriptor_distance: float = setting(0.65, "right maps but one ≤ 0.54, wrong ≥ 0.78", least=0)
    doubtful_area: float = setting(0.02, "share of the surface; a forearm of a body", least=0, most=1)
    torn_growth: float = setting(0.1, "√area; 0.07 to 0.15 do as well: lab/benchmarks.md", least=0)
    poor_torn_off: float = setting(0.005, "share of the area; half a hand, right maps have ≤ 0.2 %", least=0)
    poor_orientation: float = setting(0.65, "mean cosine between normals; chosen", least=-1, most=1)
    contradiction: float = setting(0.1, "√area; right priors ≤ 0.05, wrong ≥ 0.12: benchmarks.md", least=0)
    out_of_pose: float = setting(0.25, "√area; turned by 40° 0.22, by 90° 0.29: docs/priors.md", least=0)
    large_component: float = setting(0.05, "share of the area; a hand has 1 %, a head 8 %", least=0, most=1)
