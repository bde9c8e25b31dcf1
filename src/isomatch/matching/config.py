"""Every setting of a match: the everyday ones, and those of each stage, in frozen objects that are passed down."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, Protocol, Self

from isomatch._files import opened
from isomatch._settings import Settings, setting
from isomatch.bases import Weighting
from isomatch.errors import FormatError, SettingError
from isomatch.geodesics import engine_names

Orientation = Literal["preserve", "reverse", "any"]
Refinement = Literal["none", "laplace_icp", "joint", "smooth"]
Hypotheses = Literal["all", "given"]
DistanceUnit = Literal["average", "user"]
Start = Literal["auto", "pose"]
Resolution = Literal["auto", "full", "fast"]
PartRole = Literal["auto", "source", "target", "both", "none"]
Scale = Literal["auto", "same", "area", "free"]


class MatchSettings(Protocol):
    """What the settings of every method, `match` or a baseline, have in common."""

    @property
    def orientation(self) -> Orientation:
        """Whether the map should preserve the orientation of the faces."""

    def to_dict(self) -> dict[str, Any]:
        """Return the settings as plain values."""

    def changed(self) -> dict[str, Any]:
        """Return the settings that differ from their defaults."""


LARGEST_FILE = 2**14  # bytes; all settings together take a fifth of it


@dataclass(frozen=True)
class PreparationSettings(Settings):
    """Fine settings of `prepare`: extremities, signatures and curvature of one shape.

    Parameters
    ----------
    extremity_spacing : float
        Extremities nearer to each other than this, in √area, count as one: fingers must not displace hands.
    n_extremities : int
        Most extremities of a shape.
    signature_functions, signature_step : int
        Laplace–Beltrami functions of the wave kernel signature, and which of its hundred energies are kept: every fifth.
    curvature_functions : tuple of int
        Functions of the smoothed surfaces whose signed mean curvatures are part of the signatures.
    wave_weight, curvature_weight : float
        Root mean square of either part of the signatures.
    energy_curvature_functions : int
        Functions of the smoothed surface whose curvature the energy of a map compares.
    graph_average_distance : float
        Average distance between two points of a graph of unit size, in place of an area.
    distance_unit : {"average", "user"}
        Unit in which distances of two shapes are compared: the average distance of each, or that of the user.
    block_diagonal : bool
        Whether descriptor columns of different sign are never mixed by an alignment.
    sheet_distance : float
        Sheets that are glued together, such as limbs that touch in a scan, are separated where they are at least so far
        apart along the surface, in √area; ``inf`` leaves them together.
    least_component, most_components : float, int
        Share of the area from which a component of a mesh, beside the largest, is matched by itself, and how many such
        components at most.
    """

    extremity_spacing: float = setting(
        0.25, "changed with others: at 0.15, thumbs displaced heads or feet on 4 of 50 pairs", least=0
    )
    n_extremities: int = setting(8, "docs/benchmarks.md, sensitivity: 7 to 12 the same map", least=0)
    signature_functions: int = setting(100, "Aubry et al. 2011 use 100 to 300", least=3)
    signature_step: int = setting(
        5,
        "docs/benchmarks.md, sensitivity; the filters are seven energies wide, so neighbours repeat each other",
        least=1,
    )
    curvature_functions: tuple[int, ...] = setting(
        (50, 100, 200), "docs/benchmarks.md, sensitivity; coarse to fine, by doubling", least=4
    )
    wave_weight: float = setting(0.6, "measured on 9 pairs: 0.6 2.43, 0.8 2.41", least=0)
    curvature_weight: float = setting(0.4, "measured on 9 pairs: 0.4 2.43, 0.6 2.70", least=0)
    energy_curvature_functions: int = setting(
        100, "docs/benchmarks.md, sensitivity; the middle of curvature_functions", least=4
    )
    graph_average_distance: float = setting(0.75, "about that of animals and people of unit area", least=1e-6)
    distance_unit: DistanceUnit = setting("average", "docs/paper.md, deviations: distances in mesh units")
    block_diagonal: bool = setting(True, "docs/paper.md, deviations: C not block-diagonal")
    sheet_distance: float = setting(0.1, "docs/robustness.md, touching limbs", least=0)
    least_component: float = setting(0.001, "an eye has a thousandth of the area of a body", least=1e-6)
    most_components: int = setting(12, "chosen: each takes as long as a small match", least=0)


@dataclass(frozen=True)
class LevelSettings(Settings):
    """Sizes of the levels on which large meshes are matched.

    Parameters
    ----------
    matched, polished : int
        Vertices on which shapes are matched, and on which the map is then polished.
    fast_matched, fast_polished : int
        The same with ``resolution="fast"``.
    spared : float
        A mesh of up to so many times these sizes is not decimated.
    """

    matched: int = setting(5000, "docs/performance.md, resolution", least=200)
    polished: int = setting(16000, "docs/performance.md, resolution", least=200)
    fast_matched: int = setting(2500, "docs/performance.md, resolution", least=200)
    fast_polished: int = setting(5000, "docs/performance.md, resolution", least=200)
    spared: float = setting(1.25, "chosen: less is hardly faster", least=1)

    def __post_init__(self) -> None:
        super().__post_init__()
        for kind in ("", "fast_"):
            matched, polished = getattr(self, f"{kind}matched"), getattr(self, f"{kind}polished")
            if polished < matched:
                raise SettingError(
                    f"{kind}polished = {polished} is below {kind}matched = {matched}; a map is polished on more vertices"
                )


@dataclass(frozen=True)
class SymmetrySettings(Settings):
    """Settings of the search for symmetries of one shape.

    Parameters
    ----------
    n_samples : int
        Samples among which symmetries are searched.
    n_anchors : int
        Samples, far from each other, that determine a map of the shape onto itself.
    beam : int
        Partial assignments of anchors that are kept.
    most : int
        Most assignments that are followed up; 0 searches for no symmetries.
    steps : int
        Iterations of closest points from each.
    generators : int
        Symmetries whose products are tried too.
    least_moved, same_map : float
        Mean distances, in √area, from which a map is not the identity, and from which two maps differ.
    largest_residual : float
        Misfit of the distance descriptors, in units of √(average distance / number of search vertices), up to which a
        map is a symmetry: their spacing alone makes about 2.4.
    least_orientation : float
        Mean cosine between normals, of either sign, from which it is one.
    near, exact : float
        Residuals, over the largest of a symmetry, up to which a map serves in products, and up to which its orientation
        need not be clear, as of one-sided surfaces.
    """

    n_samples: int = setting(200, "chosen: spacing 0.08, less than same_map", least=20)
    n_anchors: int = setting(
        5, "three points determine an isometry of a surface, two more its errors", least=3
    )
    beam: int = setting(60, "docs/benchmarks.md, symmetry", least=1)
    most: int = setting(24, "docs/benchmarks.md, symmetry", least=0)
    steps: int = setting(12, "docs/benchmarks.md, symmetry", least=1)
    generators: int = setting(6, "docs/benchmarks.md, symmetry", least=0)
    least_moved: float = setting(
        0.15, "selection.rival_distance: less is a variant, not another map", least=0
    )
    same_map: float = setting(0.1, "the spacing of n_samples", least=0)
    largest_residual: float = setting(3.2, "docs/benchmarks.md, symmetry", least=0)
    least_orientation: float = setting(0.7, "docs/benchmarks.md, symmetry", least=0, most=1)
    near: float = setting(1.5, "docs/benchmarks.md, symmetry", least=1)
    exact: float = setting(0.75, "docs/benchmarks.md, symmetry", least=0, most=1)


@dataclass(frozen=True)
class SearchSettings(Settings):
    """Settings of first maps and of the search among them.

    Parameters
    ----------
    rank : int
        Descriptor columns while hypotheses are compared; the others only sharpen a map already found.
    start_columns : int
        Leading columns that a few points determine.
    off_diagonal : tuple of float
        Penalties on mixing columns, each tried for landmarks; extremities take the first. See `alignments_from_points`.
    ridge : float
        Penalty on every entry of the alignment.
    extremity_counts : tuple of int
        Numbers of extremities of one shape that are assigned together.
    n_candidate_extremities : int
        Extremities of the other shape they may be assigned to.
    assignments : int
        Best assignments that are kept for each count and direction.
    eccentricity_weight : float
        Weight of differences of average distance, against those of mutual distances, in the cost of an assignment.
    start_steps, hint_steps, flip_steps : int
        Iterations of closest points from extremities, from hints, and after flips.
    unchanged : float
        Share of unchanged images at which an iteration has converged.
    compare_every : int
        Iterations between comparisons of the maps under way.
    same_start, same_map : float
        Mean distance of images, in √area, below which two starts, and two converged maps, are one.
    n_hypotheses : int
        Most hypotheses.
    flipped : int
        Best hypotheses whose flips are tried.
    flipped_functions : int
        Leading Laplace–Beltrami functions whose sign is flipped.
    flip_landmarks : bool
        Whether flips of the map from landmarks are tried too, where no automatic hypotheses compete. Landmarks at
        extremities leave the front and the back of a thin body undecided.
    """

    rank: int = setting(30, "measured on 50 pairs: p = 60 and k = 30 as good as p = 100 and k = 50", least=4)
    start_columns: int = setting(20, "docs/benchmarks.md, sensitivity", least=4)
    off_diagonal: tuple[float, ...] = setting(
        (0.01, 0.001, 0.0001),
        "docs/paper.md: the two further ones take centaur5–centaur2 from 4.3 to 2.6",
        least=0,
    )
    ridge: float = setting(0.001, "docs/benchmarks.md, sensitivity", least=0)
    extremity_counts: tuple[int, ...] = setting(
        (4, 5, 6), "ablation: one set of extremities (cat4–cat9)", least=1
    )
    n_candidate_extremities: int = setting(7, "docs/benchmarks.md, sensitivity", least=1)
    assignments: int = setting(
        8, "docs/benchmarks.md, sensitivity; with flips, the right map was found on 86 of 86 pairs", least=1
    )
    eccentricity_weight: float = setting(0.3, "docs/benchmarks.md, sensitivity", least=0)
    start_steps: int = setting(12, "docs/benchmarks.md, sensitivity", least=1)
    hint_steps: int = setting(8, "most maps change little afterwards", least=1)
    flip_steps: int = setting(4, "docs/benchmarks.md, sensitivity", least=1)
    unchanged: float = setting(0.99, "docs/benchmarks.md, sensitivity", least=0, most=1)
    compare_every: int = setting(2, "docs/benchmarks.md, sensitivity", least=1)
    same_start: float = setting(
        0.02, "docs/benchmarks.md, sensitivity; half the spacing of 400 samples", least=0
    )
    same_map: float = setting(0.05, "docs/benchmarks.md, sensitivity; the spacing of 400 samples", least=0)
    n_hypotheses: int = setting(
        14, "measured: the right map was among the best 12 on 86 of 86 pairs", least=1
    )
    flipped: int = setting(3, "ablation: no flips", least=0)
    flipped_functions: int = setting(20, "ablation: no flips", least=0)
    flip_landmarks: bool = setting(
        True, "docs/paper.md: victoria12–victoria23 from landmarks, 7.9 without, 4.2 with"
    )


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


@dataclass(frozen=True)
class SelectionSettings(Settings):
    """Settings of the choice among hypotheses.

    Parameters
    ----------
    sizes : tuple of int
        Functions in the upsampling that precedes the judgement of a hypothesis.
    normal_functions : int
        Functions of the smoothed surfaces whose normals are compared.
    curvature_exponent : float
        Energy = descriptor residual × curvature mismatch to this power.
    orientation_threshold : float
        Mean cosine between normals above which a map counts as orientation-preserving.
    energy_limit : float
        Energy, against the least, up to which a hypothesis is refined and compared again.
    most_contenders : int
        Most hypotheses that are refined.
    same_energy : float
        Energy, against the least, up to which orientation decides among maps that agree with landmarks.
    landmark_slack : float
        Hypotheses whose landmark error exceeds the smallest by more than this, in √area, are dropped.
    extension_functions : int
        Functions through which a hypothesis is extended to further vertices.
    misfit_limit : float
        Misfit after a stage of the refinement, against the least, from which a map is given up.
    same_map : float
        Mean distance between images, in √area, up to which two refined maps are one: less than one turned limb.
    energy_exponent : float
        Score of a refined map = misfit × energy to this power.
    energy_noise, misfit_noise, score_noise : float
        Energies, misfits and scores below these are equal: two triangulations of one surface differ as much. Otherwise
        one of the symmetric maps between two copies of a mesh would seem better than the others.
    rival_distance : float
        Mean distance between images, in √area, from which a refined map is a rival and not a variant of the winner.
    clearly_better : float
        Score of the winner, over that of another map, from which that map counts as a rival whatever the hints say.
    most_alternatives : int
        Most alternatives in the result.
    """

    sizes: tuple[int, ...] = setting(
        tuple(range(20, 51, 5)), "Melzi et al. 2019: grow in steps of 5", least=4
    )
    normal_functions: int = setting(40, "docs/benchmarks.md, sensitivity", least=4)
    curvature_exponent: float = setting(
        2.0, "measured on 86 pairs: 2 and 1 choose right, 2 by a wider margin", least=0
    )
    orientation_threshold: float = setting(
        0.3, "measured on 50 pairs: right maps above 0.54, mixed or mirrored ones below 0.3", least=0, most=1
    )
    energy_limit: float = setting(3.0, "docs/benchmarks.md, sensitivity", least=1)
    most_contenders: int = setting(6, "ablation: no contest (victoria1–victoria2, cat10–cat3)", least=1)
    same_energy: float = setting(1.5, "a mixture of both sides fits worse than either", least=1)
    landmark_slack: float = setting(0.05, "the spacing of the search vertices", least=0)
    extension_functions: int = setting(50, "docs/benchmarks.md, sensitivity; the last of sizes", least=4)
    misfit_limit: float = setting(
        1.15,
        "docs/benchmarks.md, sensitivity; well above the tie at 1.05 that the outcome looks for",
        least=1,
    )
    same_map: float = setting(
        0.02, "docs/benchmarks.md, sensitivity; half of the displacement by one turned limb", least=0
    )
    energy_exponent: float = setting(0.25, "ablation: contest decided by misfit alone", least=0)
    energy_noise: float = setting(
        0.012, "docs/benchmarks.md, symmetry: 0.002 to 0.06 between triangulations", least=0
    )
    misfit_noise: float = setting(
        0.25, "docs/benchmarks.md, symmetry: 0.26 to 0.35 between triangulations", least=0
    )
    score_noise: float = setting(
        0.04, "docs/benchmarks.md, symmetry: 0.04 to 0.09 between triangulations", least=0
    )
    rival_distance: float = setting(0.15, "more than noise or one limb, less than a turned body", least=0)
    clearly_better: float = setting(1.15, "docs/benchmarks.md, confidence", least=1)
    most_alternatives: int = setting(2, "what a report can show beside the map", least=0)


@dataclass(frozen=True)
class RefinementSettings(Settings):
    """Settings of the refinements.

    Parameters
    ----------
    sizes_without_positions, sizes_with_positions, final_sizes : tuple of int
        Functions in the steps of the three stages of the joint refinement; positions and normals take part in the last
        two. After each stage, maps that fit much worse than the best are given up.
    polished_sizes : tuple of int
        Functions in the steps that polish the map of a large mesh, on more vertices.
    position_unit : float
        Misfit of positions, in √area, that counts as one unit of the spectral coordinates.
    normal_weight : float
        Weight of normals.
    registration_steps, smooth_registration_steps : int
        Steps of the non-rigid registration that ends "joint", and that ends "smooth".
    distance_steps : int
        Iterations of the plain descriptor alignment on the refinement vertices; two on all vertices follow.
    laplace_first : tuple of int
        Functions from which "laplace_icp" grows; each is tried.
    laplace_choice : int
        Functions at which the best of these is chosen.
    laplace_step : int
        Functions added in each step.
    laplace_steps_at_once : int
        If above 0, "laplace_icp" takes all functions from the start, with an orthogonal functional map and at most so
        many iterations: the paper as it is written.
    pin_slope, pin_width : float, (float, float)
        Width of the bump by which the map follows landmarks that are held, over the distance by which they are moved; and
        the least and the greatest width, in √area.
    """

    sizes_without_positions: tuple[int, ...] = setting(
        (20, 40, 70, 100, 140), "Melzi et al. 2019, in larger steps", least=4, empty=True
    )
    sizes_with_positions: tuple[int, ...] = setting(
        (50, 75, 100), "ablation: no positions and normals", least=4, empty=True
    )
    final_sizes: tuple[int, ...] = setting(
        (125, 150, 200), "ablation: no positions and normals", least=4, empty=True
    )
    polished_sizes: tuple[int, ...] = setting((100, 150, 200), "docs/performance.md, resolution", least=4)
    position_unit: float = setting(0.08, "measured on 9 pairs: 0.08 2.06, 0.15 2.11, 0.3 2.14", least=1e-6)
    normal_weight: float = setting(0.3, "docs/benchmarks.md, sensitivity", least=0)
    registration_steps: int = setting(4, "ablation: no registration", least=0)
    smooth_registration_steps: int = setting(8, "docs/benchmarks.md, smoothness", least=0)
    distance_steps: int = setting(15, "chosen, not measured", least=0)
    laplace_first: tuple[int, ...] = setting(
        (15, 20, 30, 40), "docs/paper.md: the best of four heals most", least=2
    )
    laplace_choice: int = setting(50, "chosen: as many as the rank", least=2)
    laplace_step: int = setting(5, "Melzi et al. 2019", least=1)
    laplace_steps_at_once: int = setting(0, "docs/paper.md, deviations: at once heals less", least=0)

    pin_slope: float = setting(2.0, "docs/hints.md: 1.5 to 3 alike; steeper turns faces over", least=1)
    pin_width: tuple[float, ...] = setting((0.1, 0.2), "docs/hints.md", least=0.01)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not (self.sizes_without_positions or self.sizes_with_positions or self.final_sizes):
            raise SettingError(
                "the three stages of the joint refinement are all empty; give one of them a size"
            )


@dataclass(frozen=True)
class PartSettings(Settings):
    """Settings of the match of a part to a whole.

    Parameters
    ----------
    n_anchors : int
        Distance columns of the part, whose images a start consists of.
    n_posts : int
        Boundary vertices through which paths may leave the part.
    n_candidates : int
        Vertices of the whole among which the images of the first anchors are sought.
    n_placed : int
        Anchors that are assigned by the beam search; the others are trilaterated.
    width, apart : int, float
        Partial assignments that the beam search keeps, and the mean distance, in √area, by which they differ.
    led_apart : float
        The same with landmarks, between which maps differ less.
    signature_cost : float
        Weight of the signatures in the beam search.
    radii : tuple of float
        Radii of the balls, in √area, whose areas are compared in the beam search.
    n_trilaterated, n_starts, n_mirrored : int
        Best assignments that are completed; best of these; the same with mirror images.
    n_varied : int
        Best maps after the short refinement that are composed with maps of the whole onto itself.
    n_contenders : int
        Best starts that are refined to the end, after a short refinement of all.
    function_ratio : float
        The part gets as many functions as have eigenvalues up to this times the largest of the whole that is used:
        a boundary needs more functions than the share of the area says.
    n_rough : int
        Vertices of the part in the short refinement.
    sizes : tuple of int
        Functions of the whole in the short refinement.
    largest_unit_change, unit_step : float
        Most that the unit of the files may be off, as a factor, and the ratio of the units that are tried.
    unit_cost : float
        Cost of a start in another unit than that of the files: this times the square of the logarithm of their ratio.
    least_share : float
        Least area of a part over that of the whole, where the units of the files say nothing.
    most_cost, soft : float
        Of `IntervalCost`, in √(area of the part).
    stress_exponent : float
        Score of a refined map = misfit × stress to this power × √(local stress × curvature mismatch).
    near, most_ratio : (float, float), float
        Distances along the part, in its √area, whose ratios to those of the images are compared, and the largest
        logarithm that counts.
    long_boundary : float
        Length of the boundary, in √area, from which a shape may be a part.
    close : bool
        Also match the shapes with their holes closed, as complete ones.
    closed_score : float
        The map with the holes closed is returned if less than this, over the score of the best map of a part, speaks
        against it.
    cover : float
        Area of the whole that is matched to a part, over that of the part: those vertices that are nearest to images.
    poor_misfit, poor_stress : float
        Values above which a map is poor.
    poor_orientation, least_trusted : float
        Values below which it is: of the orientation, and of the share of pairs of anchors whose distance on the whole is
        known.
    tie : float
        Score of a rival, against the map returned, below which nothing decides between them.
    """

    n_anchors: int = setting(50, "chosen on cuts and holes; docs/robustness.md", least=8)
    n_posts: int = setting(60, "chosen on cuts and holes; docs/robustness.md", least=4)
    n_candidates: int = setting(300, "chosen on cuts and holes; docs/robustness.md", least=20)
    n_placed: int = setting(16, "chosen on cuts and holes; docs/robustness.md", least=4)
    width: int = setting(1000, "chosen on cuts and holes; docs/robustness.md", least=1)
    apart: float = setting(0.12, "without it, all would be variants of one", least=0)
    led_apart: float = setting(0.04, "docs/robustness.md: a twisted body between right limbs", least=0)
    signature_cost: float = setting(0.25, "chosen on cuts and holes; docs/robustness.md", least=0)
    radii: tuple[float, ...] = setting(
        (0.1, 0.15, 0.22, 0.32, 0.45, 0.65, 0.9), "by factors of about √2", least=0
    )
    n_trilaterated: int = setting(80, "chosen on cuts and holes; docs/robustness.md", least=1)
    n_starts: int = setting(16, "chosen on cuts and holes; docs/robustness.md", least=1)
    n_mirrored: int = setting(24, "chosen on cuts and holes; docs/robustness.md", least=1)
    n_varied: int = setting(4, "chosen on cuts and holes; docs/robustness.md", least=0)
    n_contenders: int = setting(8, "chosen on cuts and holes; docs/robustness.md", least=1)
    function_ratio: float = setting(1.75, "chosen on cuts and holes; docs/robustness.md", least=1)
    sizes: tuple[int, ...] = setting((20, 40, 70), "chosen on cuts and holes; docs/robustness.md", least=4)
    n_rough: int = setting(500, "chosen on cuts and holes; docs/robustness.md", least=50)
    largest_unit_change: float = setting(
        1.4, "FAUST remeshed: bodies of one person differ by up to 1.2", least=1
    )
    unit_step: float = setting(1.1, "tolerance of the intervals", least=1.01)
    unit_cost: float = setting(0.05, "docs/robustness.md: views", least=0)
    least_share: float = setting(0.1, "views show 16 % and more", least=0.01, most=1)
    most_cost: float = setting(0.6, "chosen on cuts and holes; docs/robustness.md", least=0)
    soft: float = setting(0.18, "chosen on cuts and holes; docs/robustness.md", least=0)
    stress_exponent: float = setting(0.25, "chosen on cuts and holes; docs/robustness.md", least=0)
    near: tuple[float, ...] = setting((0.08, 0.3), "chosen on cuts and holes; docs/robustness.md", least=0)
    most_ratio: float = setting(0.7, "a factor of two", least=0)
    long_boundary: float = setting(0.5, "complete bodies up to 0.2, cuts from 1.3", least=0)
    close: bool = setting(True, "docs/robustness.md: holes closed")
    closed_score: float = setting(1.35, "chosen on cuts and holes; docs/robustness.md", least=0)
    cover: float = setting(
        1.1, "a vertex left unmatched by mistake costs more than one matched by mistake", least=0
    )
    poor_misfit: float = setting(0.37, "chosen on cuts and holes; docs/robustness.md", least=0)
    poor_stress: float = setting(0.03, "chosen on cuts and holes; docs/robustness.md", least=0)
    poor_orientation: float = setting(0.7, "chosen on cuts and holes; docs/robustness.md", least=-1, most=1)
    least_trusted: float = setting(0.07, "chosen on cuts and holes; docs/robustness.md", least=0, most=1)
    tie: float = setting(1.1, "chosen on cuts and holes; docs/robustness.md", least=1)


@dataclass(frozen=True)
class ComponentSettings(Settings):
    """Settings of the match of shapes of several components.

    Parameters
    ----------
    rival_area, most_rivals : float, int
        Area, over that of the largest component, from which another one may be the partner of the other shape's largest,
        and how many are tried at most.
    spectrum_functions, same_spectrum : int, float
        Eigenvalues that are compared, and the mean difference of their logarithms, above the least, up to which a pair of
        such components is tried.
    falloff : float
        Power of the distance by which less is said about a point by the vertices of the component that carries it.
    most_apart : float
        Distance of a component from where it is carried to, over the sum of its √area and its distance from those that
        carry it, from which it is no partner.
    most_length_ratio : float
        √area of one over that of the other from which they are no partners.
    same_place : float
        Mean distance between a component that is carried along rigidly and its partner, in √area, up to which it fits.
    held : float
        Distance of a component from those that carry it, over its √area, up to which its place tells how it is turned.
    """

    rival_area: float = setting(0.5, "hemispheres differ by less, clothes by more", least=0, most=1)
    most_rivals: int = setting(3, "chosen: nine matches at most", least=1)
    spectrum_functions: int = setting(20, "halves of creatures: poses 0.03, other halves 0.13", least=1)
    same_spectrum: float = setting(0.1, "halves of creatures: poses 0.03, other halves 0.13", least=0)
    falloff: float = setting(4.0, "chosen: sums over a surface converge from 2 on", least=0)
    most_apart: float = setting(0.7, "one eye is 0.9 from the other", least=0)
    most_length_ratio: float = setting(1.4, "parts.largest_unit_change", least=1.01)
    held: float = setting(1.0, "chosen: a thing farther away than its own size may turn by itself", least=0)
    same_place: float = setting(0.02, "chosen: half the spacing of the search vertices", least=0)


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
    width, apart : int, float
        Partial assignments that the beam search keeps, and the mean distance, in √area, by which they differ.
    n_starts : int
        Best assignments of the points of either shape.
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
    signature_weight, normal_weight : float
        Weights of signatures and normals beside canonical coordinates.
    landmark_weight : float
        Weight of a landmark, in samples.
    least_orientation : float
        Mean cosine between normals from which a coarse fit is followed up.
    curvature_exponent, asymmetry_exponent, asymmetry_unit : float
        Score of a map = misfit × stretch × curvature mismatch to the first power × (unit + asymmetry) to the second.
    mirror_starts, mirror_forgiven : int, float
        ``n_starts`` and ``forgiven`` in the search for the mirror image of one shape.
    mirror_misfit, mirror_orientation : float
        Misfit up to which, and orientation from which, a map of a shape to itself is its mirror image.
    """

    n_coordinates: int = setting(8, "Ezuz et al. 2019", least=3)
    n_anchors: int = setting(12, "docs/robustness.md, other species", least=4)
    n_candidates: int = setting(150, "chosen: spacing 0.09, less than apart", least=20)
    forgiven: float = setting(0.3, "docs/robustness.md, other species", least=0, most=1)
    inside: float = setting(0.1, "docs/robustness.md, other species", least=0)
    most_cost: float = setting(0.6, "docs/robustness.md, other species", least=0)
    soft: float = setting(0.2, "chosen, not measured", least=0)
    signature_cost: float = setting(0.1, "docs/robustness.md, other species", least=0)
    remoteness_cost: float = setting(0.5, "docs/robustness.md, other species", least=0)
    width: int = setting(600, "docs/robustness.md, other species", least=1)
    apart: float = setting(0.12, "parts.apart", least=0)
    n_starts: int = setting(60, "docs/robustness.md, other species", least=1)
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
    signature_weight: float = setting(0.05, "docs/robustness.md, other species", least=0)
    normal_weight: float = setting(0.05, "docs/robustness.md, other species", least=0)
    landmark_weight: float = setting(30.0, "chosen, not measured", least=0)
    least_orientation: float = setting(0.3, "selection.orientation_threshold", least=-1, most=1)
    curvature_exponent: float = setting(0.5, "selection: curvature² to the power energy_exponent", least=0)
    asymmetry_exponent: float = setting(0.25, "docs/robustness.md, other species", least=0)
    asymmetry_unit: float = setting(0.1, "docs/robustness.md, other species", least=1e-6)
    mirror_starts: int = setting(24, "chosen, not measured", least=1)
    mirror_forgiven: float = setting(
        0.1, "chosen: a shape is nearly isometric to its mirror image", least=0, most=1
    )
    mirror_misfit: float = setting(0.26, "docs/robustness.md, other species", least=0)
    mirror_orientation: float = setting(0.5, "docs/robustness.md, other species", least=0, most=1)

    def __post_init__(self) -> None:
        super().__post_init__()
        for stage in ("coarse", "fine"):
            functions, smoothness = (getattr(self, f"{stage}_{what}") for what in ("functions", "smoothness"))
            if len(functions) != len(smoothness):
                raise SettingError(
                    f"{stage}_functions has {len(functions)} steps, {stage}_smoothness {len(smoothness)}; give as many"
                )


@dataclass(frozen=True)
class OutcomeSettings(Settings):
    """Bounds of the measures that make an outcome.

    Parameters
    ----------
    coverage_radius : float
        A target vertex this near to an image along edges, in √area, is covered.
    normal_functions : int
        Functions of the smoothed surfaces whose normals are compared.
    tie : float
        Score of a rival, against the map returned, below which nothing decides between them.
    mirror_tie : float
        The same for a map of the other side where either is allowed; the poses alone may differ as much.
    torn : float
        Squared length of the image of an edge, over its own, above which it counts no more: the edge is torn.
    poor_misfit, poor_residual, poor_stretch : float
        Values above which a map is poor.
    poor_orientation : float
        Value below which a map is poor.
    contradiction : float
        Distance from the images that hints ask for, in √area, from which they are contradicted: the mean of the
        landmarks, or the median of an initial map, which may be wrong in places.
    error_scale, error_radius : float
        Factor of the expected error at a vertex, and radius over which it is spread, in √area.
    rival_exponent : float
        A rival whose score is r times that of the map is right with chance 1 / (1 + r^exponent).
    many_rotations : int
        Rotations that both shapes have from which no automatic map is told from another: balls and discs.
    out_of_pose : float
        Mean distance of the images from the nearest points in space, in √area, from which ``start="pose"`` misleads.
    large_component : float
        Share of the area, or of the vertices in components of at least 50, left out from which the match is partial; and
        such a share of one component from which the match is no surer than it.
    """

    coverage_radius: float = setting(0.05, "the spacing of the search vertices", least=0)
    normal_functions: int = setting(60, "chosen with poor_orientation", least=4)
    tie: float = setting(1.15, "docs/benchmarks.md, confidence", least=1)
    mirror_tie: float = setting(1.5, "docs/benchmarks.md, confidence: either side", least=1)
    torn: float = setting(4.0, "docs/benchmarks.md, confidence", least=1)
    poor_misfit: float = setting(
        0.66, "set on FAUST and creatures; checked in docs/benchmarks.md, confidence", least=0
    )
    poor_residual: float = setting(
        0.38, "set on FAUST and creatures; checked in docs/benchmarks.md, confidence", least=0
    )
    poor_stretch: float = setting(1.2, "docs/benchmarks.md, confidence", least=1)
    poor_orientation: float = setting(0.65, "docs/benchmarks.md, confidence", least=-1, most=1)
    contradiction: float = setting(0.1, "docs/benchmarks.md, contradicted hints", least=0)
    error_scale: float = setting(
        0.32, "mean error of faust_r and creatures: benchmarks/vertex_confidence.py", least=0
    )
    error_radius: float = setting(0.08, "0.05 to 0.14 tried: benchmarks/vertex_confidence.py", least=0)
    rival_exponent: float = setting(16.0, "one in ten at the bound of a tie", least=0)
    many_rotations: int = setting(11, "discs and balls have 11 to 40, bodies 0 to 6 at any setting", least=1)
    out_of_pose: float = setting(0.25, "docs/hints.md: up to 0.22 turned by 40°, from 0.29 by 90°", least=0)
    large_component: float = setting(0.05, "a hand is 1 %, a head 8 % of a body", least=0, most=1)


@dataclass(frozen=True)
class Config(Settings):
    """Settings of `prepare` and `match`; the defaults are those that the benchmarks recommend.

    Parameters
    ----------
    n_columns : int
        Number p of distance columns for each shape.
    rank : int
        Rank k of the distance basis, and length of the descriptor.
    n_functions : int
        Laplace–Beltrami functions for each shape.
    weights : {"area", "uniform"}
        Inner product of the distance basis; the paper uses "uniform".
    engine : str, optional
        How geodesic distances are computed, by a name of `engine_names`; by default fast marching on meshes, Dijkstra on
        point clouds and graphs.
    n_search : int
        Vertices of each shape on which hypotheses are tried and compared.
    n_refine : int
        Source vertices on which the refinement iterates before its last, full step.
    hypotheses : {"all", "given"}
        Choose among automatic hypotheses and those given, or only among those given and flips of the map from landmarks.
        With "all", an automatic one wins where it fits better than the hints; of maps that tie, the one nearest to the
        hints wins, even if it is a mirror image.
    search_rivals : bool, optional
        With ``hypotheses="given"``: whether automatic hypotheses are searched all the same, as rivals, so that the
        quality reports when one of them fits better. It takes as long as an automatic match. By default they are for
        the refinements "joint" and "smooth", and not for those of the paper.
    refinement : {"none", "laplace_icp", "joint", "smooth"}
        After the alignment of distance descriptors: nothing (the paper's plain method); post-processing like the
        paper's; or spectral upsampling joint with signatures, positions and normals. "smooth" is "joint" with more
        steps, for a map that is smooth and nearly one to one.
    orientation : {"preserve", "reverse", "any"}
        Whether the map preserves the orientation of the faces, reverses it (a mirror image), or does whichever fits
        better.
    start : {"auto", "pose"}
        Whether shapes are roughly aligned in space, so that the map to nearest points is a hypothesis too: that of the
        shapes as they are, and that of both centred and scaled to equal area. Of maps that fit equally well, the one
        nearest to it wins. With ``hypotheses="given"``, no others may win but those from hints.
    pin : float, optional
        Landmarks hold: those farther from their targets than this, in √area, are moved there, and the map around follows
        smoothly. 0 holds all exactly. By default they only lead.
    part : {"auto", "source", "target", "both", "none"}
        Which shape is a part of the other, or whether both are parts. "auto" takes shapes with a long boundary for parts.
        Parts are matched where automatic hypotheses, a joint refinement and the orientation "preserve" are asked for,
        without hints or with landmarks.
    scale : {"auto", "same", "area", "free"}
        Units of a part and a whole: near those of the files, exactly those, such that both have the same area, or
        anything. Complete shapes are always scaled to the same area.
    resolution : {"auto", "full", "fast"}
        "auto" matches large meshes on fewer vertices, polishes the map on more and carries it to all; "full" uses all
        vertices throughout; "fast" uses still fewer than "auto". Maps always name the user's vertices.
    preparation : PreparationSettings
    levels : LevelSettings
    symmetry : SymmetrySettings
    search : SearchSettings
    anchors : AnchorSettings
    selection : SelectionSettings
    refining : RefinementSettings
    parts : PartSettings
    components : ComponentSettings
    elastic : ElasticSettings
    outcome : OutcomeSettings
        Fine settings of each stage.

    Examples
    --------
    >>> Config(rank=30, n_columns=60).search.n_hypotheses
    14
    >>> Config.from_dict({"rank": 30, "search": {"n_hypotheses": 20}}).search.n_hypotheses
    20
    """

    n_columns: int = setting(100, "Shamai & Kimmel 2017: p = 2 k", least=8)
    rank: int = setting(50, "Shamai & Kimmel 2017: k = 50", least=4)
    n_functions: int = setting(200, "Melzi et al. 2019: 200 functions at 5 000 vertices", least=20)
    weights: Weighting = setting("area", "docs/paper.md, deviations: area weights")
    engine: str | None = setting(
        None, "docs/benchmarks.md, engines: fast marching is most accurate for its time"
    )
    n_search: int = setting(400, "measured: 400 as good as 600 on 17 pairs; 300 fails on 2 of 50", least=100)
    n_refine: int = setting(
        1000, "measured on 50 pairs: 1.63 against 1.59 with all vertices, twice as fast", least=100
    )
    hypotheses: Hypotheses = setting(
        "all", "a hint can be wrong; an automatic hypothesis that fits better wins"
    )
    search_rivals: bool | None = setting(None, "the paper's methods search for none, and cost accordingly")
    refinement: Refinement = setting(
        "joint",
        "docs/benchmarks.md, ablation, earlier: none 2.9, laplace_icp 2.5, joint 1.5",
    )
    orientation: Orientation = setting(
        "preserve",
        "docs/benchmarks.md, ablation, earlier: either orientation fails on 3 of 14",
    )
    start: Start = setting("auto", "shapes need not be aligned")
    pin: float | None = setting(None, "landmarks lead; clicked ones are no more exact than the map", least=0)
    part: PartRole = setting("auto", "docs/robustness.md: a cut or a hole is found by its boundary")
    scale: Scale = setting("auto", "FAUST remeshed: bodies of one person differ by up to 1.2")
    resolution: Resolution = setting("auto", "docs/performance.md, resolution")
    preparation: PreparationSettings = setting(PreparationSettings())
    levels: LevelSettings = setting(LevelSettings())
    symmetry: SymmetrySettings = setting(SymmetrySettings())
    search: SearchSettings = setting(SearchSettings())
    anchors: AnchorSettings = setting(AnchorSettings())
    selection: SelectionSettings = setting(SelectionSettings())
    refining: RefinementSettings = setting(RefinementSettings())
    parts: PartSettings = setting(PartSettings())
    components: ComponentSettings = setting(ComponentSettings())
    elastic: ElasticSettings = setting(ElasticSettings())
    outcome: OutcomeSettings = setting(OutcomeSettings())

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.engine is not None and self.engine not in engine_names():
            raise SettingError(
                f"engine = {self.engine!r} is not one of {', '.join(map(repr, engine_names()))}"
            )
        if self.n_refine < 2 * self.n_functions:
            raise SettingError(
                f"n_refine = {self.n_refine} is below 2 n_functions = {2 * self.n_functions}: too few for the fit"
            )
        if self.rank > self.n_columns:
            raise SettingError(f"rank = {self.rank} exceeds n_columns = {self.n_columns}")
        most = max(*self.selection.sizes, self.selection.extension_functions, self.search.flipped_functions)
        if most > self.n_search // 2:
            raise SettingError(
                f"n_search = {self.n_search} is below 2 × {most}, the functions fitted on the search vertices; ask for "
                "more vertices, or fewer functions in search.flipped_functions, selection.sizes or "
                "selection.extension_functions"
            )

    @classmethod
    def from_file(cls, path: str | Path) -> Self:
        """Read settings from a TOML file, stages as tables.

        Raises
        ------
        FormatError
            If the file is missing (`MissingFileError`) or is not TOML.
        SettingError
            If a setting is unknown, or its value is not allowed.
        """
        with opened(Path(path)) as file:
            text = file.read(LARGEST_FILE + 1)
        if len(text) > LARGEST_FILE:
            raise FormatError(
                f"{path}: more than {LARGEST_FILE} bytes are not settings; give a TOML file of settings"
            )
        try:
            values = tomllib.loads(text.decode("utf-8"))
        except (ValueError, RecursionError) as error:  # no text, no TOML, or nested too deeply
            raise FormatError(f"{path}: not a TOML file ({error}); correct it or write it again") from None
        try:
            return cls.from_dict(values)
        except SettingError as error:
            raise SettingError(f"{path}: {error}") from None

    @property
    def looks_further(self) -> bool:
        """Whether maps of other kinds, of parts or elastic ones, are sought where they seem to be called for."""
        return self.refinement in ("joint", "smooth") and self.orientation == "preserve"

    @property
    def searches_rivals(self) -> bool:
        """Whether automatic hypotheses are searched as rivals of those given."""
        return self.refinement in ("joint", "smooth") if self.search_rivals is None else self.search_rivals

    def differs_in_preparation(self, other: Config) -> str | None:
        """Name the first setting of `prepare` in which two configurations differ; None if there is none."""
        names = (
            "n_columns",
            "rank",
            "n_functions",
            "weights",
            "engine",
            "n_search",
            "n_refine",
            "resolution",
            "preparation",
            "levels",
            "symmetry",
        )
        return next((name for name in names if getattr(self, name) != getattr(other, name)), None)

    def for_size(self, n: int) -> Self:
        """Reduce what a shape of n vertices cannot provide."""
        columns = min(self.n_columns, n // 2)
        rank = min(self.rank, columns // 2 if columns < self.n_columns else self.rank)
        return replace(self, n_columns=columns, rank=rank, n_functions=max(20, min(self.n_functions, n // 4)))
