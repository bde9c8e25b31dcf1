"""Numbers of matching that no user sets: each with its unit, what it bounds, and why it has this value.

A share is a fraction from 0 to 1. The mean cosine of normals compares the target with its copy that a map
draws on the source: it is near 1 if the map keeps the orientation of the faces, near −1 for a mirror image.
Less cost (energy, residual, score) is better. The reason for a value is a measurement, a paper, or "chosen":
for first maps that stretch, on pairs of animals; for a part, on SHREC'16 cuts and holes and on single views;
for two parts, on parts in SHREC'16. Numbers that studies vary are settings, see `isomatch.settings`. Words:

- A *part* is a mesh of a piece of a surface, the *whole* a mesh of all of it; the *body* is the surface of
  which two parts show pieces. The *unit* of a part is √area of the part over √area of the whole. A distance
  on the whole between two points of a part lies between two bounds; it is *known* if they nearly agree.
- *Samples* are vertices far from each other; *search vertices* and *refinement vertices* are the first
  ``n_search`` and ``n_refine``. *Anchors* are a few points of the source; an *assignment* gives each an image
  among some *candidate points* of the target. A beam search keeps the cheapest partial assignments.
- A search begins with *first maps* (for a part, *starts*: images of all anchors). A *hypothesis* is a first
  map of the search vertices after iterative closest points, a *candidate* a hypothesis after upsampling.
- A *region* of the source and its images grow from an anchor, the *root*. An anchor that joins adds to the
  *gain*, 1 if its distances agree exactly. *Trilateration* places other points by distances from the anchors.
- *Functions* are the first Laplace–Beltrami eigenfunctions. The *descriptor distance* of two points compares
  balls of several radii around them, which are unknown where they cross the boundary.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class MapDistanceParameters:
    """Distances between images of the same vertices under two maps, which say whether the maps differ."""

    # Largest mean distance over vertices, in √area of the target, between the images under two maps that are
    # the same map up to details; chosen: equal to search.same_map
    same_map: float = 0.05
    # Largest distance, in √area of the target, between two images of one vertex that are at the same place;
    # chosen: above the error of right maps, below the width of a limb
    other_place: float = 0.08
    # Largest mean distance over vertices, in √area of the target, between the images under two maps of a
    # part, or maps by two strategies, that are variants of one map; chosen on SHREC'16 cuts and holes
    other_map: float = 0.12
    # Largest distance, in √area of the target, between two images of one vertex that are on the same limb;
    # chosen: twice selection.runner_up_distance
    other_limb: float = 0.3


@dataclass(frozen=True)
class TiesParameters:
    """Differences between two maps that are too small to say which map is right."""

    # Largest energy of a map over the least one of the maps that agree with landmarks, up to which it
    # precedes maps of the unwanted orientation; chosen: a map that mixes both sides of a shape fits worse
    same_energy_ratio: float = 1.5
    # Least share of vertices whose images under a map and under the best map are farther apart than
    # MAP_DISTANCE.other_limb, from which the map exchanges limbs; the wrong map horse7–horse14 has 0.08
    exchanged_share: float = 0.05
    # Largest score of a map that exchanges limbs over the score of the best map, up to which it is the
    # runner-up; 1.002 where the best map horse7–horse14 is wrong, at least 1.059 for 111 right best maps
    exchanged_ratio: float = 1.05
    # Largest difference, in √area of the target, between the errors of two maps at priors, up to which both
    # agree equally well with the priors; chosen: the spacing of the search vertices
    landmark_slack: float = 0.05
    # Largest score of the best map that agrees with priors over the score of another map, up to which the
    # priors exclude the other map as runner-up; lab/benchmarks.md, confidence
    clearly_better_ratio: float = 1.15
    # Least energy, to which lower energies are raised, so that symmetric maps between two copies of a mesh
    # tie; maps between two triangulations of one surface have 0.002 to 0.06: lab/benchmarks.md, symmetry
    energy_noise: float = 0.012
    # Least spectral residual, to which lower ones are raised, so that symmetric maps between copies tie; maps
    # between two triangulations of one surface have 0.26 to 0.35: lab/benchmarks.md, symmetry
    spectral_residual_noise: float = 0.25
    # Least score, to which lower scores are raised, so that symmetric maps between copies tie; maps between
    # two triangulations of one surface have 0.04 to 0.09: lab/benchmarks.md, symmetry
    score_noise: float = 0.04
    # Least cost by `verify`, to which lower costs are raised, so that symmetric maps between copies tie;
    # turns of a flat ring onto itself cost up to 5e-6, maps between two poses 3e-4 and more
    cost_noise: float = 1e-5
    # Least share of vertices on which two maps differ, from which descriptor distances on these vertices are
    # compared to choose between the maps; chosen: 10 of 1000 vertices
    min_region_share: float = 0.01


@dataclass(frozen=True)
class ScreeningParameters:
    """Hypotheses of complete shapes become candidates, and the best map is sure or searched further."""

    # Number of iterations of closest points that improve a first map from priors; chosen: most maps change
    # little in further iterations
    n_prior_steps: int = 8
    # Largest number of hypotheses for shapes without limbs; chosen above search.n_hypotheses, because
    # residuals tell little before curvature is compared: lab/robustness.md, shapes without limbs
    max_hypotheses_without_limbs: int = 40
    # Numbers of functions in the steps from a hypothesis to a candidate; steps of 5 as in Melzi et al. 2019
    upsampling_sizes: tuple[int, ...] = (20, 25, 30, 35, 40, 45, 50)
    # Factor of outcome.poor_spectral_residual, poor_residual and poor_descriptor_distance; a map is sure only
    # if its measures are below these products; decisions.md, given up and tried again
    sure_fraction: float = 0.75
    # Largest number of maps of the unwanted orientation that are refined only for comparison; chosen
    max_mirrored: int = 3
    # Least number of rotations of each shape onto itself, from which both shapes are round, and no map found
    # without priors is sure; discs and balls have 11 to 40, human bodies at most 6
    min_rotations_of_round: int = 11


@dataclass(frozen=True)
class AnchorsParameters:
    """First maps of complete shapes without limbs: a beam search assigns anchors (`starts_from_anchors`)."""

    n_anchors: int = 6  # number of anchors on the source; chosen: three determine an isometry, three test it
    # Number of search vertices of the target, the first ones, that are candidate points of the anchors;
    # chosen as in the search for symmetries
    n_candidates: int = 200
    # Weight, in the cost of an assignment, of the distance between the signatures of an anchor and its image;
    # errors of distances, in average distances, have weight 1; lab/robustness.md, shapes without limbs
    signature_weight: float = 0.25
    beam_width: int = 200  # largest number of partial assignments that the beam search keeps; chosen
    # Least mean distance over anchors, in average distances of the target, between the images under two
    # assignments that are both kept; chosen: 0.1 is no better
    same_assignment_distance: float = 0.15
    # Number of assignments of least cost that become first maps; chosen: 8 assignments for each of 3 numbers
    # of extremities and 2 directions give as many for shapes with limbs
    n_starts: int = 48
    # Number of functions that improve a first map; chosen as the first of SCREENING.upsampling_sizes
    n_relaxation_functions: int = 20
    # Number of steps that improve a first map by functions; lab/robustness.md, shapes without limbs
    n_relaxation_steps: int = 10


@dataclass(frozen=True)
class StrategyParameters:
    """Strategies vary the shapes (cap holes, cut touching limbs apart) and compare their maps."""

    # Least number of hypotheses that are flipped if holes are capped; with 3, the map mesh018–mesh014 errs by
    # 30 %
    n_flipped: int = 6
    # Largest number of times that the shape with more handles is cut along creases and matched, after the
    # first time only along creases that the map before tears; decisions.md, strategies that pay
    max_crease_cuts: int = 3
    # Largest distance, in √area of the other shape, between the images of both sides of a crease; beyond it,
    # the map tears the crease, and limbs are taken to touch there; chosen
    self_contact_distance: float = 0.1
    # Largest fraction of parts.poor_doubt that the doubt of a map of a part reaches, up to which no other
    # strategy is tried; the map of a mirror image had 0.94
    final_doubt_fraction: float = 0.5
    # Largest cost by `verify` of a poor isometry of two parts over the least cost of other maps, up to which
    # it is searched from the target, too; on 20 pairs, costs up to 5 times the least fell to 0.54 of them at
    # best
    hopeless_cost_ratio: float = 2.5


@dataclass(frozen=True)
class ElasticSearchParameters:
    """First maps of shapes whose limbs stretch, and coarse fits of smooth maps in canonical coordinates."""

    # Number of samples of each shape in a coarse fit of smooth maps; chosen: enough for 30 functions
    n_coarse_samples: int = 300
    signature_weight: float = 0.05  # weight (a factor) of signatures beside canonical coordinates; chosen
    # Weight (a factor) of normals beside canonical coordinates in a coarse fit; chosen
    normal_weight: float = 0.05
    landmark_weight: float = 30.0  # weight of a landmark in a fit, where each sample has weight 1; chosen
    n_anchors: int = 12  # number of anchors on the source; chosen
    # Number of samples of the target that are candidate points, besides its extremities; chosen: the samples
    # are 0.09 √area apart
    n_candidates: int = 150
    beam_width: int = 600  # largest number of partial assignments that the beam search keeps; chosen
    # Least mean distance over anchors, in average distances, between the images under two assignments that
    # are both kept by the beam search; chosen: equal to MAP_DISTANCE.other_map, as for parts
    same_assignment_distance: float = 0.12
    # Largest error of a distance in an assignment, in average distances; larger errors are lowered to this
    # (``most`` of `IntervalCost`); chosen
    max_distance_cost: float = 0.6
    # Length, in average distances, that is added to a distance before its error is divided by the sum, so
    # that short distances do not dominate (``soft`` of `IntervalCost`); chosen
    short_distance: float = 0.2
    # Weight, in the cost of an assignment, of the difference in remoteness between an anchor and its image:
    # the share of the area with a lower average distance than the vertex; chosen
    remoteness_weight: float = 0.5
    # Weight, in the cost of an assignment, of the difference between the signatures of an anchor and its
    # image over the mean difference among all anchors and candidate points; chosen
    anchor_signature_weight: float = 0.1
    # Weight, in the cost of an assignment, of the difference between two distances, in average distances: of
    # an anchor from its mirror image, and of its image from its own mirror image; chosen
    mirror_distance_weight: float = 1.0
    # Largest distance of a point from its mirror image, in average distances; longer distances are lowered to
    # this before anchors and images are compared by it; chosen
    max_mirror_distance: float = 1.0
    # Number of assignments in each direction that ignore mirror images, and become further first maps if both
    # shapes have mirror images; decisions.md, elastic starts
    n_plain_starts: int = 30
    # Largest spectral residual of the best map of a shape to its mirror image that is used; chosen
    max_mirror_spectral_residual: float = 0.26
    # Least mean cosine of normals of a map of a shape to its mirror image that is used; chosen
    min_mirror_orientation: float = 0.5
    # Number of assignments, in each direction, that become first maps of a shape to its mirror image; chosen
    n_mirror_starts: int = 24
    # Largest relative change of a distance at a low cost between a shape and its mirror image; chosen below
    # elastic.distance_tolerance, because both are nearly isometric
    forgiven_of_mirror: float = 0.1
    # Largest number of maps of a shape to its mirror image that are kept, for each of three steps of the
    # coarse fit; decisions.md, elastic choice
    n_mirror_maps_kept: tuple[int, ...] = (12, 4, 4)
    # Largest number of maps that are kept, for each of three steps of the coarse fit; the shapes are bent by
    # the last ones; decisions.md, elastic choice
    n_maps_kept: tuple[int, ...] = (90, 40, 8)
    # Length, in √area, added to the asymmetry of a map, which is the mean distance, in canonical coordinates,
    # of images of mirror images from mirror images of images; chosen: shapes are asymmetric, too
    asymmetry_unit: float = 0.1
    # Exponent e in the score of a coarse fit: spectral residual × (asymmetry + asymmetry_unit)^e; chosen
    asymmetry_exponent: float = 0.25
    # Least mean cosine of normals of a map after a step of the coarse fit; maps with less are dropped;
    # chosen: equal to selection.orientation_threshold
    min_orientation: float = 0.3


@dataclass(frozen=True)
class ElasticFitParameters:
    """Shapes whose limbs stretch are bent onto each other by the best maps; images are nearest points."""

    # Largest score of a map over the least score after the first half of the steps of elastic.bending; maps
    # with more are dropped; decisions.md, elastic choice
    hopeless_ratio: float = 1.5
    # Weight (a factor) of normals beside canonical coordinates when smooth maps are fitted at the refinement
    # vertices; decisions.md, elastic steps
    fine_normal_weight: float = 0.15
    # Largest cost over the least cost, up to which the map nearest to a given initial map wins; chosen
    prior_tie_ratio: float = 1.1
    # Number of lengths at the start of elastic.bending that the final bending skips; chosen: the best map
    # comes from shapes that were bent by them
    n_skipped_lengths: int = 2
    # Lengths, in √area of the target, one for each step of the bending at full resolution; pieces of the
    # source that are shorter than this move almost rigidly; chosen
    full_lengths: tuple[float, ...] = (0.05, 0.04, 0.03)
    # Length, in √area, of normals as coordinates beside positions of the bent shapes, so that sheets near
    # each other in space are told apart; chosen
    normal_weight: float = 0.05
    # Weight, in 1 / √area, of positions of bent shapes beside functions and signatures; 10 to 20 do alike;
    # without positions, the error is 3.16 % of √area instead of 2.9: decisions.md, elastic steps
    position_weight: float = 15.0
    # Exponent of the score that multiplies the cost by `verify`, as both measure the bending with independent
    # errors; with 0.1 to 1.5 the same maps win in 23 pairs, with 0 a wrong one in dog_02–cow_03
    score_exponent: float = 0.5
    # Largest stretch, as mean |log(edge length bent / at rest)|, of both shapes bent by an isometric map that
    # fits, up to which no elastic map is sought; decisions.md, elastic outcome
    max_isometric_stretch: float = 0.085
    # Largest stretch (see max_isometric_stretch) of both shapes bent by an isometric map that fits and wins
    # against elastic maps, up to which this map is returned unchanged; decisions.md, elastic outcome
    max_isometric_stretch_of_winner: float = 0.105


@dataclass(frozen=True)
class PartUnitParameters:
    """Bounds of distances on the whole, signatures of a part, and the units that are tried or measured."""

    # Largest error of a distance on the whole, in √area of the part; larger errors are lowered to this
    # (``most`` of `IntervalCost`); chosen
    max_distance_cost: float = 0.6
    # Length, in √area of the part, that is added to a distance before its error is divided by the sum, so
    # that short distances do not dominate (``soft`` of `IntervalCost`); chosen
    short_distance: float = 0.18
    # Number of samples of the boundary at which paths on the whole can leave the part; chosen
    n_boundary_vertices: int = 60
    n_anchors: int = 50  # number of anchors on the part, besides landmarks; chosen
    # Least share of the pairs of anchors whose distances are known; below it, scale = "auto" keeps the unit
    # of the files if it is plausible; chosen
    min_known_share: float = 0.07
    # Largest ratio of neighbouring units that are tried; chosen: a true unit is then within 5 % of one
    unit_step_ratio: float = 1.1
    # Least area of a part over the area of the whole; if the files have no plausible unit, no smaller part is
    # tried; single views show 0.16 and more
    min_area_share: float = 0.1
    # Largest ratio of a tried unit to the unit of the files, or of the latter to the former; remeshed bodies
    # of one person in FAUST have up to 1.2
    max_unit_ratio: float = 1.4
    # Largest unit of a part as a ratio; larger measured units are lowered to it; chosen: 1 plus errors
    max_unit: float = 1.05
    # Difference between the logarithms of neighbouring units, to which measured units are rounded; chosen
    unit_spacing: float = 0.02
    known_ratio: float = 0.97  # least ratio of the lower to the upper bound of a known distance; chosen
    # Least distance between two anchors, in √area of the part, by which the unit is measured; chosen, because
    # shorter distances are mostly noise
    min_distance: float = 0.3
    # Least number of known distances between anchors or samples, each counted twice, from which the unit is
    # measured; with fewer, the unit is left as it is; chosen
    min_known_distances: int = 40
    # Approximate ratio of neighbouring radii of the balls around points of a part that are computed;
    # descriptors at radii in between are interpolated; chosen
    radius_step_ratio: float = 1.25
    # Number of energies, evenly spaced logarithms of eigenvalues, of wave kernel signatures; chosen
    n_energies: int = 20
    # Distance of a vertex from the boundary of a part, in 1 / √λ for the eigenvalue λ of an energy, at which
    # its wave kernel signature has 63 % of its full weight, which is 0 at the boundary; chosen
    boundary_reach: float = 4.0
    # Distance of a vertex from the boundary of a part, in 1 / √λ for the last eigenvalue λ that smooths the
    # surface, at which its curvature has 63 % of its full weight, which is 0 at the boundary; chosen
    curvature_boundary_reach: float = 3.0


@dataclass(frozen=True)
class PartSearchParameters:
    """Starts of a part: a beam search assigns anchors, and regions grow from roots far from the boundary."""

    n_assigned_anchors: int = 16  # number of anchors that the beam search assigns to candidate points; chosen
    n_candidates: int = 300  # number of samples of the whole that are candidate points; chosen
    beam_width: int = 1000  # largest number of partial assignments that the beam search keeps; chosen
    # If landmarks are given, two assignments are both kept only if the distance between their images, mean over
    # anchors, is at least this, in √area of the whole; else MAP_DISTANCE.other_map; chosen on a twisted body
    same_assignment_with_landmarks: float = 0.04
    n_trilaterated: int = 80  # number of assignments of least cost that trilateration extends; chosen
    n_starts: int = 16  # largest number of distinct starts from trilateration; chosen
    # Largest number of distinct starts after starts have been added that are composed with maps of the whole
    # onto itself, for example left to right; chosen
    n_starts_with_composed: int = 24
    signature_weight: float = 0.25  # weight, in an assignment, of differences between signatures; chosen
    # Radii, in √area of the whole, of the balls whose areas are compared; chosen: factors of about √2
    ball_radii: tuple[float, ...] = (0.1, 0.15, 0.22, 0.32, 0.45, 0.65, 0.9)
    # Share by which the area of a ball is allowed to violate its bounds at no cost; chosen
    ball_tolerance: float = 0.15
    # Largest violation of a bound on the area of a ball, over the mean area; it is cut off there; chosen
    max_ball_cost: float = 0.7
    # Cost of a unit for each squared logarithm of its ratio to the unit of the files; chosen, not measured
    unit_change_weight: float = 0.05
    n_roots: int = 24  # number of anchors, farthest from the boundary, from which regions grow; chosen
    # Number of candidate points, of least descriptor distance, from which each root grows regions; chosen
    n_root_candidates: int = 24
    max_grown_regions: int = 60  # largest number of grown regions, of most gain, extended to starts; chosen
    n_starts_from_regions: int = 12  # largest number of distinct starts from regions; chosen
    # Length, in √area of the whole, in the weight 1 / (near_distance + d) of distances d in regions; chosen
    near_distance: float = 0.2
    # Largest mean cost of an anchor's distances, beyond which its joining would lower the gain; chosen
    max_distance_cost: float = 0.3
    # Factor by which an anchor's descriptor distance, less the neutral one, lowers the gain; chosen
    descriptor_gain: float = 2.0
    # Neutral descriptor distance, which speaks neither for nor against an image; right images have about 0.4,
    # random images about 0.8
    neutral_descriptor_distance: float = 0.6
    # Number of radii for which the neutral descriptor distance counts in the mean over known radii; chosen
    neutral_weight: float = 1.0


@dataclass(frozen=True)
class PartFitParameters:
    """Maps of a part are refined roughly, the best ones then to the end, also by bending the part."""

    # Ratio of the last eigenvalue used on the part to the last one used on the whole; chosen: a boundary
    # needs more functions than the share of the area suggests
    function_ratio: float = 1.75
    extra_functions: int = 3  # number of functions beyond the last one that function_ratio allows; chosen
    # Largest distance from a landmark that is a coordinate, in √area of the whole; longer distances are
    # lowered to this: lab/robustness.md, parts
    landmark_reach: float = 0.3
    # Least distance between two samples, in √area of the part, by which the unit of a map is measured; chosen
    min_near_distance: float = 0.08
    # Largest distance between two samples, in √area of the part, that measures the unit of a map; chosen
    max_near_distance: float = 0.3
    n_rough_vertices: int = 500  # largest number of vertices of the part in the rough refinement; chosen
    # Numbers of functions of the whole in the steps of the rough refinement; chosen
    rough_sizes: tuple[int, ...] = (20, 40, 70)
    # Number of functions of the whole by which a start is extended to the vertices of the rough refinement,
    # and the whole smoothed before normals are compared under rough maps; chosen
    n_rough_normal_functions: int = 40
    # Number of functions that smooth the whole where normals are compared under fine maps; chosen
    n_fine_normal_functions: int = 60
    # Largest number of functions by which a map of the refinement vertices is extended to anchors; chosen
    n_anchor_functions: int = 200
    # Number of times that the part is bent by a map and the map refined again; lab/robustness.md, parts
    n_bending_rounds: int = 2
    # Exponent of the stress (mean cost of distances between images of anchors) in the cost of a map; with
    # 0.15 to 0.4 the same maps win: decisions.md, cost of a part
    stress_exponent: float = 0.25
    # Least mean cosine of normals of a rough map, by whose root its cost is divided; lower cosines are raised
    # to this; chosen
    min_orientation: float = 0.1
    n_composed: int = 4  # number of distinct rough maps composed with maps of the whole onto itself; chosen
    # Largest number of distinct rough maps, of least cost, that are refined to the end; chosen
    n_contenders: int = 8
    # Number of lengths at the end of parts.bending by which the best map bends the part at full resolution;
    # with 3 or 10, the errors of four parts are no smaller
    n_final_lengths: int = 5


@dataclass(frozen=True)
class SeedsParameters:
    """Common regions of two parts grow from anchors, and trilateration extends them to all samples."""

    n_samples: int = 600  # largest number of samples of each part that regions have; chosen
    max_landmarks: int = 50  # largest number of landmarks in this search; the refinement uses all; chosen
    # Ratio of √area of the body, which is unknown, to the root mean square of √area of both parts; chosen
    body_ratio: float = 1.25
    # Largest ratio of √area of both parts in the files' units, else their areas are taken as equal; chosen
    max_length_ratio: float = 4.0
    # Radii, in √area of the body, of balls for descriptor distances; chosen: smaller balls are noise, larger
    # ones cross the boundary
    moment_radii: tuple[float, ...] = (0.06, 0.09, 0.13, 0.18, 0.24)
    # A ball counts as known if it reaches beyond the boundary by at most this, in √area of the body; chosen
    max_overhang: float = 0.02
    # Neutral descriptor distance, which speaks neither for nor against a candidate point; chosen
    neutral_moment_distance: float = 0.25
    # Number of radii for which neutral_moment_distance counts in the mean over known radii; chosen
    neutral_moment_weight: float = 1.5
    # Neutral difference between the logarithms of the areas of balls around anchor and candidate; chosen
    neutral_area_difference: float = 0.15
    # Largest difference between the logarithms of areas of balls; larger ones are lowered to it; chosen
    max_area_difference: float = 1.0
    # Number of radii for which neutral_area_difference counts in the mean over known radii; chosen
    neutral_area_weight: float = 2.0
    moment_weight: float = 0.6  # weight of the descriptor distance in the cost of a candidate point; chosen
    # Weight of differences between logarithms of areas in the cost of a candidate point; chosen
    area_weight: float = 0.5
    # Largest difference of a descriptor, in standard deviations; larger ones are lowered to it; chosen
    max_descriptor_distance: float = 2.0
    neutral_descriptor_distance: float = 0.5  # descriptor distance where no radius is known; chosen
    # Number of radii for which neutral_descriptor_distance counts in the mean over known radii; chosen
    neutral_descriptor_weight: float = 0.5
    # Length, in √area of the body, in the weight exp(−(d / smoothing_length)²) of a neighbour at distance d
    # in local means of ranks and descriptor distances; chosen
    smoothing_length: float = 0.12
    rank_offset: int = 3  # number added to ranks, which begin at 0, so that −log(rank) is finite; chosen
    # Least mean −log(rank / number of samples) near a sample that is evidence; the rank of an image orders
    # all samples of the target by descriptor distance; random images have 1: decisions.md, two parts
    chance_surprise: float = 1.2
    # Length m, in √area of the body: a sample should have an image if its distance from a sample of the
    # region, plus m, is less than the distance of the latter's image from the boundary; chosen
    min_visible_margin: float = 0.05
    # Largest distance, in √area of the body, of a target sample from the images that cover it; chosen
    uncovered_distance: float = 0.08
    left_out_weight: float = 1.0  # weight of the area that should have an image and has none; chosen
    # Number of nearest samples of a sample, whose winding around it is compared with their images'; chosen
    n_neighbours: int = 8
    n_anchors: int = 56  # number of anchors, the first samples of the source; chosen
    n_candidates: int = 300  # number of candidate points, the first samples of the target; chosen
    n_roots: int = 40  # number of anchors, farthest from the boundary, from which regions grow; chosen
    n_root_candidates: int = 30  # number of candidate points, of least cost, tried for each root; chosen
    # Length, in √area of the body, in the weight 1 / (near_distance + d) of distances d in regions; chosen
    near_distance: float = 0.2
    # Largest mean cost of the distances of an anchor that joins a region, by `IntervalCost`; chosen
    max_distance_cost: float = 0.09
    beam_width: int = 4  # largest number of variants of a region that are kept while it grows; chosen
    # Least distance, in √area of the body, between an anchor's images in two variants of a region; chosen
    same_variant_distance: float = 0.12
    # Factors by which the cost of a candidate point, less neutral_moment_distance, lowers the gain; regions
    # grow once with each factor; chosen
    descriptor_gains: tuple[float, ...] = (2.0, 0.5)
    # Largest mean distance over anchors, in √area of the body, of images in regions that are one; chosen
    same_region_distance: float = 0.1
    min_common_anchors: int = 3  # least number of anchors in both of two regions that are one; chosen
    # Least share of a region's samples that are also in a better region, if both have the same map; chosen
    same_map_overlap: float = 0.7
    max_screened: int = 400  # largest number of grown regions, of most gain, extended to samples; chosen
    # For each step of the extension: number of samples, number of rounds of trilateration, and largest number
    # of regions that are kept; chosen
    extensions: tuple[tuple[int, int, int], ...] = ((150, 1, 80), (300, 2, 30))
    # Largest mean cost of the distances of a sample that joins a region, without landmarks; chosen
    max_sample_cost: float = 0.06
    # Largest mean cost of the distances of a sample that joins a region, if landmarks are given; chosen
    max_sample_cost_with_landmarks: float = 0.12
    # Largest distance, in √area of the body, between a sample of a region and the place to which
    # trilateration sends its image back; chosen
    max_round_trip: float = 0.12
    # Length t, in √area of the body, in the weight 1 / (t + d)² of a distance d in trilateration; chosen
    trilateration_distance: float = 0.15
    # Largest number of samples that place others while a region is extended to some samples; chosen
    n_first_anchors: int = 50
    # Largest number of samples that place others when a region is extended to all samples; chosen
    n_next_anchors: int = 90
    min_accepted: int = 8  # least number of samples of a region while it is extended; chosen
    min_samples: int = 25  # least number of samples of a region in the end; chosen
    # Least mean sign of small triangles of a region: 1 if images keep the winding, −1 otherwise; chosen
    min_orientation: float = 0.2


@dataclass(frozen=True)
class TwoPartsParameters:
    """Each region that two parts have in common is refined as a part of the target, and grows again."""

    # For each round, in which the best regions grow again and are refined: number of these regions, largest
    # mean cost of a sample, and whether they are refined roughly; chosen
    rounds: tuple[tuple[int, float, bool], ...] = ((4, 0.05, True), (2, 0.045, False))
    # Largest distance, in √area of the body, of a vertex of a region from the samples in the region; chosen
    region_margin: float = 0.05
    # Largest distance, in √area of the target, from a landmark to its image, if the landmark holds; chosen
    landmark_tolerance: float = 0.1
    # Largest descriptor distance of a sample that places others when its region grows again; chosen
    max_descriptor_distance: float = 0.6
    # Largest distance, in √area of the target, of a vertex of the bent region from its nearest point on the
    # target, up to which the vertex is in common; chosen
    surface_tolerance: float = 0.04
    # The largest distance in place of surface_tolerance if the point is on the target's boundary; chosen
    boundary_tolerance: float = 0.02
    # Largest number of functions in the rough refinement; chosen: they rank regions as all functions do
    n_rough_functions: int = 100
    # Number of last lengths of parts.bending for the best region at full resolution; chosen
    n_final_lengths: int = 3


@dataclass(frozen=True)
class ComponentsParameters:
    """Components of two shapes become partners; maps of the largest ones carry the others along."""

    # Largest number of components of each shape that are tried as partners; chosen: nine matches at most
    max_runners_up: int = 3
    # Least area of a tried component over the largest's; hemispheres of brains have more, clothes have less
    min_runner_up_area: float = 0.5
    n_eigenvalues: int = 20  # largest number of first eigenvalues that are compared; chosen
    # Largest mean difference between the logarithms of the eigenvalues of two components, less the least such
    # mean, up to which they are tried as partners; two poses differ by 0.03, two halves by 0.13
    same_spectrum_difference: float = 0.1
    # Largest mean distance over vertices, in √area of the partner, of a rigidly carried component from the
    # partner, up to which its nearest points are the map; chosen: half the spacing of the samples
    same_place_distance: float = 0.02
    # Largest distance between the centres of a carried component and its partner, in √area of the partner ×
    # (1 + g), where g is the distance of the latter from what carries it, in its √area; two eyes have 0.9
    max_carried_distance: float = 0.7
    # Largest ratio of √area of two partners; chosen: equal to PART_UNIT.max_unit_ratio
    max_length_ratio: float = 1.4
    # Largest distance of the centre of a component from the surface that carries it, in √area of the
    # component, up to which it is held and cannot turn by itself; chosen
    max_held_distance: float = 1.0


@dataclass(frozen=True)
class HeldLandmarksParameters:
    """A map is bent until its landmarks hold: each shifts the images around it by a bump (a heat kernel)."""

    # Width of a bump over the shift of its landmark; 1.5 to 3 do alike: docs/priors.md, exact landmarks
    width_per_shift: float = 2.0
    min_width: float = 0.1  # least width of a bump, in √area of the source; docs/priors.md, exact landmarks
    max_width: float = 0.2  # largest width of a bump, in √area of the source; docs/priors.md, exact landmarks
    min_weight: float = 0.02  # least weight with which a landmark moves a vertex; chosen
    # Least singular value of the kernel matrix of landmarks that is inverted; landmarks so near each other
    # that they have a lower one move together; chosen
    min_singular_value: float = 0.1
    function_weight: float = 0.3  # factor, in √area, of functions of unit gradient beside positions; chosen
    n_functions: int = 20  # number of functions beside positions, to separate nearby sheets; chosen


@dataclass(frozen=True)
class ErrorsParameters:
    """Expected errors of a map, regions in which it is doubtful, and questions that would decide."""

    # Exponent of the ratio of the scores of two maps in the odds that the worse one is right; chosen: at the
    # ratio outcome.tie, it is right once in 10
    runner_up_exponent: float = 10.0
    # Radius of smoothing of errors, in √area; isomatch_lab.studies.vertex_confidence tried 0.05 to 0.14
    smoothing_radius: float = 0.08
    # Scale, a factor, of the local estimates of errors, with which their mean is the mean error on FAUST
    # (remeshed) and the creatures; isomatch_lab.studies.vertex_confidence
    error_scale: float = 0.32
    # Least share of a region's vertices for which a reason of doubt holds, if it is named; chosen
    min_reason_share: float = 0.25
    # Least share of the surroundings of a vertex with known values, from which their mean is known; chosen
    min_known_share: float = 0.5
    # Least share of the source's area that a region of doubt covers if the result lists it; chosen: half a hand
    min_region_area: float = 0.005
    # Expected error, over √area of a region that looks unlike its images; lab/benchmarks.md, regions of doubt
    unlike_error: float = 0.5
    max_named_landmarks: int = 5  # largest number of contradicted landmarks, worst first, in a note; chosen
    # Number of functions that smooth surfaces for their normals; chosen with outcome.poor_orientation
    n_normal_functions: int = 60
    # Number of vertices, far from each other, among which questions choose; chosen
    n_question_vertices: int = 400
    # Least distance, in √area of the target, of images that people can tell apart; chosen: two hands
    other_place: float = 0.1
    # Largest distance, in √area of its shape, up to which a question gains value: the distance between the
    # images, and the distance of the vertex from those asked before; chosen
    question_distance: float = 0.3


@dataclass(frozen=True)
class ExchangeParameters:
    """The best map takes regions from maps that a search from the target finds, if its cost falls.

    See decisions.md, both sides.
    """

    max_maps_from_target: int = 2  # largest number of tied maps that the search from the target gives; chosen
    # Largest distance, in √area of the target, of two images at the same place; chosen: two thirds of a limb
    other_place: float = 0.1
    min_region_area: float = 0.01  # least share of the source's area in an exchanged region; chosen
    # Largest share of the source's area in an exchanged region; chosen: a larger one makes another map
    max_region_area: float = 0.4
    max_regions: int = 6  # largest number of regions in which two maps differ that are tried; chosen
    # Largest descriptor distance of a region under the other map over that under the present map, up to which
    # the region is tried; right limbs have 1.09, hopeless ones 2.7
    max_unlikeness_ratio: float = 1.25
    # Largest cost of a map after an exchange over its cost before, up to which the exchange is kept; chosen
    max_cost_ratio: float = 0.97
    max_exchanges: int = 4  # largest number of exchanges, one after the other; chosen
    n_coarse_vertices: int = 400  # number of bent vertices in the first cost of an exchange; chosen
    n_compared_vertices: int = 60  # approximate number of a region's vertices that are compared; chosen
    # Least share of a region's images under the other map that lie within other_place / 2 of images of a
    # second region under the present map, from which both regions are exchanged together; chosen
    min_overlap: float = 0.3


@dataclass(frozen=True)
class SymmetricParameters:
    """The best map is composed with near-symmetries, and turned over (a half turn), as both may fit as well.

    See decisions.md, individuals.
    """

    # Largest energy of a composed map over the best map's, up to which it is refined; in 60 pairs of
    # SHREC'07, composed maps that fit as well have 0.97 to 1.26, and 1.4 in two bodies with a bump
    max_energy_ratio: float = 1.75
    # Largest score of a composed map over the best map's after the first round, up to which it is refined on;
    # composed maps that fit as well have 0.97 to 1.12, people turned front to back 1.12 to 1.34
    max_first_score_ratio: float = 1.2
    # Least mean distance over vertices, in √area of the target, between the images under a composed map and
    # the best map; half turns of ants have 0.24, maps that turn only a trunk at most 0.2
    min_turned_distance: float = 0.2
    # Numbers of functions in the steps of the refinement that makes a half turn; chosen
    half_turn_sizes: tuple[int, ...] = (10, 15, 20)
    # Largest spectral residual of a half turn over the best map's after the steps of half_turn_sizes, up to
    # which it is refined; ants have 0.84 to 1.06, people of FAUST at least 1.13, animals at least 1.3
    max_half_turn_residual_ratio: float = 1.1
    max_maps: int = 4  # largest number of distinct composed maps that are refined; chosen
    # Largest cost by `verify` of a composed map over the best map's, up to which both fit equally well; right
    # maps of ants cost at most 1.46 × their half turns, wrong maps of animals at least 1.59 × right ones
    max_cost_ratio: float = 1.5
    # Largest cost by `verify` of a half turn over the best map's, up to which both fit equally well; right
    # maps of ants cost at most 1.89 × their half turns, half turns of people at least 1.93 × right maps
    max_half_turn_cost_ratio: float = 1.9


@dataclass(frozen=True)
class JudgingParameters:
    """Bounds by which `judge` calls a map of any tool right, doubtful or wrong, beside a reference map."""

    # Largest share of the source's area that a map sends elsewhere than the reference, up to which it agrees
    # with the reference; chosen: a hand
    min_region_area: float = 0.01
    # Largest cost of a map that agrees with the reference over the cost of the reference, up to which the map
    # is right; above it, the map is doubtful; right maps known at 300 points have 2.6 to 21
    max_right_ratio: float = 25.0
    # Largest cost of a map that disagrees with the reference over the cost of the reference, up to which the
    # map is doubtful; above it, the map is wrong; a limb shifted by half its width has 1.33
    min_wrong_ratio: float = 1.25
    # Least number of different images over the number of vertices; below it, the distances of all vertices
    # with the same image are lowered to the least of them; chosen
    coarse_image_share: float = 0.25
    # Largest mean distance of a map from the reference composed with a symmetry over its mean distance from
    # the reference, up to which it exchanges sides; chosen
    exchanged_ratio: float = 0.5
    max_regions: int = 5  # largest number of regions, largest first, that are named; chosen


@dataclass(frozen=True)
class SpectralParameters:
    """The refinements of Shamai & Kimmel 2017: plain alignment of distance descriptors, and "laplace_icp"."""

    # Numbers of functions of the first functional maps; the best of these maps is kept; lab/paper.md
    first_sizes: tuple[int, ...] = (15, 20, 30, 40)
    choice_size: int = 50  # number of functions of these maps when the best is chosen; chosen as the rank
    size_step: int = 5  # number of functions that are added in each step; Melzi et al. 2019
    # Number of iterations of plain alignment on refinement vertices, before two on all vertices; chosen
    n_distance_steps: int = 15


MAP_DISTANCE = MapDistanceParameters()  # wherever the images under two maps are compared
TIES = TiesParameters()  # wherever the energies, costs and priors of two maps are compared
SCREENING = ScreeningParameters()  # hypotheses and candidates of complete shapes
ANCHORS = AnchorsParameters()  # first maps of complete shapes without limbs
STRATEGY = StrategyParameters()  # variants of the shapes, and the choice among maps of several strategies
ELASTIC_SEARCH = ElasticSearchParameters()  # first maps and coarse fits of shapes whose limbs stretch
ELASTIC_FIT = ElasticFitParameters()  # bending of shapes whose limbs stretch
PART_UNIT = PartUnitParameters()  # distances, signatures and unit of a part of a whole
PART_SEARCH = PartSearchParameters()  # starts of a part of a whole
PART_FIT = PartFitParameters()  # refinement of maps of a part of a whole
SEEDS = SeedsParameters()  # search for regions that two parts have in common
TWO_PARTS = TwoPartsParameters()  # refinement of regions that two parts have in common
COMPONENTS = ComponentsParameters()  # partners among the components of two shapes
HELD_LANDMARKS = HeldLandmarksParameters()  # bending of a map until landmarks hold
ERRORS = ErrorsParameters()  # expected errors, regions of doubt, and questions to the user
EXCHANGE = ExchangeParameters()  # exchange of regions between maps found from either shape
JUDGING = JudgingParameters()  # verdicts of `judge` on a map of any tool
SYMMETRIC = SymmetricParameters()  # comparison of a map with its compositions with near-symmetries
SPECTRAL = SpectralParameters()  # refinements of Shamai & Kimmel 2017
