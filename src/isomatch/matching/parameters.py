"""Numbers of matching that no user sets: each with its unit, what it bounds, and why it has this value.

A share is a fraction from 0 to 1. A cosine of normals compares normals of the target with those of the
source laid on it by a map: it is near −1 for a mirror image. The reason for a value is a measurement, a
paper, or "chosen". Numbers that studies vary are settings, see `isomatch.settings`, such as
``search.same_map`` or ``parts.poor_doubt``; the numbers of `verify` stand in its module.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class MapDistanceParameters:
    """Distances between the images of two maps, from which the maps are the same or differ."""

    # √area, mean over vertices; maps whose images are nearer are one map up to details; as search.same_map
    same_map: float = 0.05
    # √area; images of one vertex farther apart are at different places; chosen: above the error of right
    # maps, below the width of a limb
    other_place: float = 0.08
    # √area, mean; maps of parts, or of two strategies, farther apart are different; chosen on cuts and holes
    other_map: float = 0.12
    # √area; images of one vertex farther apart are on different limbs; twice selection.runner_up_distance
    other_limb: float = 0.3


@dataclass(frozen=True)
class TiesParameters:
    """Differences between two maps that are too small to decide between them."""

    # energy over the least; of maps that agree with landmarks, one of the wanted orientation is preferred up
    # to this ratio; chosen: a map that mixes both sides fits worse than either
    same_energy_ratio: float = 1.5
    # share of vertices; a map near the winner on average still exchanges limbs if it sends this share farther
    # than MAP_DISTANCE.other_limb from the winner's images; in the wrong map of horse7–horse14, it is 0.08
    exchanged_share: float = 0.05
    # score over the winner's, up to which a map that exchanges limbs is a runner-up; it is 1.002 for the
    # wrong map of horse7–horse14, and at least 1.059 for 111 right maps
    exchanged_ratio: float = 1.05
    # √area; landmark errors that differ by less are equal; chosen: the spacing of the search vertices
    landmark_slack: float = 0.05
    # score of the winner over the score of a map, from which this map is a runner-up whatever priors say:
    # lab/benchmarks.md, confidence
    clearly_better_ratio: float = 1.15
    # energies below this count as this: otherwise, of symmetric maps between copies of a mesh, one would seem
    # better; two triangulations of a surface differ by 0.002 to 0.06: lab/benchmarks.md, symmetry
    energy_noise: float = 0.012
    # spectral residuals below this count as this; two triangulations of one surface have 0.26 to 0.35:
    # lab/benchmarks.md, symmetry
    spectral_residual_noise: float = 0.25
    # scores below this count as this; two triangulations of one surface have 0.04 to 0.09: lab/benchmarks.md,
    # symmetry
    score_noise: float = 0.04
    # costs by `verify` below this count as this; turns of a flat ring onto itself cost up to 5e-6, maps
    # between poses 3e-4 and more
    cost_noise: float = 1e-5
    # share of vertices; maps that differ on less are not compared by descriptors; chosen: 10 of 1000
    min_region_share: float = 0.01


@dataclass(frozen=True)
class ScreeningParameters:
    """Hypotheses and candidates of complete shapes."""

    # iterations of closest points that improve a hypothesis from priors; chosen: more change most maps little
    n_prior_steps: int = 8
    # hypotheses that a round shape keeps; more than search.n_hypotheses, as residuals tell little before
    # curvature is compared: lab/robustness.md, shapes without limbs
    max_hypotheses_without_limbs: int = 40
    # functions in the steps by which a hypothesis' functional map grows; steps of 5 as in Melzi et al. 2019
    upsampling_sizes: tuple[int, ...] = (20, 25, 30, 35, 40, 45, 50)
    # fraction of the bounds outcome.poor_…, below which residuals and descriptor distance make a map sure:
    # decisions.md, given up and tried again
    sure_fraction: float = 0.75
    max_mirrored: int = 3  # maps of the orientation not allowed that are refined, only for comparison; chosen
    # rotations onto itself from which a shape is round, so that no automatic map is told from the others;
    # discs and balls have 11 to 40, bodies at most 6
    min_rotations_of_round: int = 11
    # distance after the next rigid motion over the best one's, from which two shapes are alike after one motion;
    # bones of one kind have 1.25 to 2.4, teddies 1.0 to 1.2
    min_pose_ratio: float = 1.2
    # the same ratio for the nearest reflection; bodies with two like sides have 0.95 to 1.05, mirror images 0.7
    min_mirrored_pose_ratio: float = 0.9
    # length of a principal axis over the next shorter one's, below which a shape may be turned by any angle;
    # kneecaps have 1.06 and more
    min_axis_ratio: float = 1.05
    # √area, mean over points, normals included, below which distances of two shapes are equal; chosen: 400
    # points of a copy with other vertices have 0.02
    min_pose_distance: float = 0.01


@dataclass(frozen=True)
class AnchorsParameters:
    """First maps of shapes without limbs, from anchors: points far from each other."""

    n_anchors: int = 6  # points of the source that are assigned; chosen: three fix an isometry, three test it
    # search vertices of the target among which the images of anchors are sought; chosen, as for symmetries
    n_candidates: int = 200
    # weight of the distance between the signatures of an anchor and its image, beside errors of distances in
    # average distances: lab/robustness.md, shapes without limbs
    signature_weight: float = 0.25
    beam_width: int = 200  # partial assignments that the beam search keeps; chosen
    # average distances, mean; assignments whose images are nearer are one; chosen: 0.1 is no better
    same_assignment_distance: float = 0.15
    n_starts: int = 48  # best assignments that become first maps; chosen: as many as extremities give at most
    # functions in which a first map is relaxed; chosen: the first of SCREENING.upsampling_sizes
    n_relaxation_functions: int = 20
    n_relaxation_steps: int = 10  # times that a first map is relaxed; lab/robustness.md, shapes without limbs


@dataclass(frozen=True)
class StrategyParameters:
    """Variants of the shapes, and the choice between strategies."""

    n_flipped: int = 6  # best hypotheses flipped if holes are capped; with 3, mesh018–mesh014 errs by 30 %
    # cuts along creases, at most, if one shape has more handles: decisions.md, strategies that pay
    max_crease_cuts: int = 3
    # √area; a crease is cut as a self-contact if the images of its two sides are farther apart; chosen
    self_contact_distance: float = 0.1
    # doubt over parts.poor_doubt, up to which a part's map ends the search; a mirrored map had 0.94
    final_doubt_fraction: float = 0.5
    # cost of `verify` over the least, above which a poor isometry of two parts is not searched from both sides;
    # on 20 pairs, such a search lowered costs within 5 times the least to 0.54 of them at best
    hopeless_cost_ratio: float = 2.5


@dataclass(frozen=True)
class ElasticSearchParameters:
    """First maps of shapes whose limbs stretch, and their coarse fit; chosen on pairs of animals."""

    n_coarse_samples: int = 300  # samples of each shape in the coarse fit; chosen: enough for 30 functions
    signature_weight: float = 0.05  # weight of signatures beside canonical coordinates in the fit; chosen
    normal_weight: float = 0.05  # weight of normals beside canonical coordinates in the coarse fit; chosen
    landmark_weight: float = 30.0  # number of samples that a landmark counts as; chosen
    n_anchors: int = 12  # points of the source that are assigned to candidates on the target; chosen
    # samples of the target that are candidates beside extremities, 0.09 √area apart; chosen on animals
    n_candidates: int = 150
    beam_width: int = 600  # partial assignments that the beam search keeps; chosen on animals
    # average distances, mean over anchors; assignments whose images are nearer are one; chosen, as for parts
    same_assignment_distance: float = 0.12
    # average distances; a larger error of a distance counts as this: `most` of `IntervalCost`; chosen
    max_distance_cost: float = 0.6
    # average distances; added to the distance that divides an error: `soft` of `IntervalCost`; chosen
    short_distance: float = 0.2
    # weight, in the assignment, of the difference in remoteness (the share of the area that is less remote)
    # of an anchor and its image; chosen on animals
    remoteness_weight: float = 0.5
    # weight in the assignment of the relative difference between signatures of anchor and image; chosen
    anchor_signature_weight: float = 0.1
    # weight, in the assignment, of the difference between the distances of an anchor and of its image from
    # their mirror images; chosen
    mirror_distance_weight: float = 1.0
    # average distances; a longer distance of a point from its mirror image counts as this; chosen
    max_mirror_distance: float = 1.0
    # further starts that ignore mirror images, where both shapes have them: decisions.md, elastic starts
    n_plain_starts: int = 30
    # spectral residual up to which a map of a shape to its mirror image is used to find mirror images; chosen
    max_mirror_spectral_residual: float = 0.26
    # mean cosine of normals below which a map of a shape to its mirror image is left out; chosen on animals
    min_mirror_orientation: float = 0.5
    n_mirror_starts: int = 24  # assignments that become first maps of a shape to its mirror image; chosen
    # share by which distances may change at little cost between a shape and its mirror image; chosen below
    # elastic.distance_tolerance, as both are nearly isometric
    forgiven_of_mirror: float = 0.1
    # maps to the mirror image that are kept after each coarse step: decisions.md, elastic choice
    n_mirror_maps_kept: tuple[int, ...] = (12, 4, 4)
    # coarse fits that are kept after each step; the last ones are bent: decisions.md, elastic choice
    n_maps_kept: tuple[int, ...] = (90, 40, 8)
    # distance in canonical coordinates, added to a map's asymmetry, as shapes are asymmetric too; chosen
    asymmetry_unit: float = 0.1
    # exponent, in the score of a map, of its asymmetry plus asymmetry_unit; chosen on animals
    asymmetry_exponent: float = 0.25
    # mean cosine of normals below which a coarse fit is dropped; as selection.orientation_threshold
    min_orientation: float = 0.3


@dataclass(frozen=True)
class ElasticFitParameters:
    """The bending of shapes whose limbs stretch, and the images taken from the bent shapes."""

    # score over the least one, above which a map is given up after half of elastic.bending: decisions.md,
    # elastic choice
    hopeless_ratio: float = 1.5
    # weight of normals beside canonical coordinates in the last smooth fit: decisions.md, elastic steps
    fine_normal_weight: float = 0.15
    # cost over the least one, up to which the map wins that agrees best with an initial map; chosen
    prior_tie_ratio: float = 1.1
    # first lengths of elastic.bending that the final bending skips, as they bent the winner before; chosen
    n_skipped_lengths: int = 2
    # √area; lengths over which the winner resists stretching when it is bent in full resolution; chosen
    full_lengths: tuple[float, ...] = (0.05, 0.04, 0.03)
    normal_weight: float = 0.05  # √area; length of normals beside positions, to separate sheets; chosen
    # 1 / √area; weight of positions of the bent shapes beside functions and signatures; 10 to 20 do alike,
    # without positions the error is 3.16, not 2.9 % of √area: decisions.md, elastic steps
    position_weight: float = 15.0
    # exponent of the score, by which the cost of `verify` is multiplied, as both measure the bending with
    # independent errors; 0.1 to 1.5 select alike in 23 pairs, 0 selects a wrong map in one, dog_02–cow_03
    score_exponent: float = 0.5
    # mean |log(edge length bent / at rest)|; no elastic map is sought if an isometric map that fits stretches
    # both shapes less: decisions.md, elastic outcome
    max_isometric_stretch: float = 0.085
    # mean |log(edge length bent / at rest)|; an isometric map that fits, and wins against elastic ones, is
    # kept below this: decisions.md, elastic outcome
    max_isometric_stretch_of_winner: float = 0.105


@dataclass(frozen=True)
class PartUnitParameters:
    """A part and a whole in common units; chosen on shapes with cuts and holes."""

    # √area of the part; a larger error of a distance counts as this: `most` of `IntervalCost`; chosen
    max_distance_cost: float = 0.6
    # √area of the part, added to the distance that divides an error: `soft` of `IntervalCost`; chosen
    short_distance: float = 0.18
    n_boundary_vertices: int = 60  # samples of the boundary, at which paths may leave the part; chosen
    n_anchors: int = 50  # points of the part, beside landmarks, whose images make up a start; chosen
    # share of the pairs of anchors; with fewer known distances, scale = "auto" keeps the files' unit; chosen
    min_known_share: float = 0.07
    # ratio of consecutive units that are tried; chosen: a true unit is within 5 % of one of them
    unit_step_ratio: float = 1.1
    # share of the whole's area of the smallest part that is tried if the files' units say nothing; single
    # views show 0.16 and more
    min_area_share: float = 0.1
    # largest ratio of a tried unit to the files' unit; remeshed bodies of a person in FAUST have up to 1.2
    max_unit_ratio: float = 1.4
    # √area of the part over the whole's; larger units are lowered to this; chosen: errors of measurement
    max_unit: float = 1.05
    unit_spacing: float = 0.02  # spacing, in the logarithm, of the units to which units are rounded; chosen
    # lower over upper bound of a distance, from which the distance counts as known; chosen on cuts and holes
    known_ratio: float = 0.97
    # √area of the part; shorter distances, mostly noise, do not measure the unit; chosen on cuts and holes
    min_distance: float = 0.3
    # known distances that measure the unit, at least; with fewer it stays; chosen on cuts and holes
    min_known_distances: int = 40
    radius_step_ratio: float = 1.25  # ratio of radii between which ball signatures are interpolated; chosen
    n_energies: int = 20  # energies of the wave signatures, evenly spaced logarithms of eigenvalues; chosen
    # 1 / √(eigenvalue of its energy); distance from a boundary at which a wave signature has 63 % of its
    # weight, which is 0 at the boundary; chosen on cuts and holes
    boundary_reach: float = 4.0
    # 1 / √(last eigenvalue); distance from a boundary at which the curvature of a surface smoothed to some
    # functions has 63 % of its weight; chosen on cuts and holes
    curvature_boundary_reach: float = 3.0


@dataclass(frozen=True)
class PartSearchParameters:
    """First maps of a part; chosen on shapes with cuts and holes, and on single views."""

    n_assigned_anchors: int = 16  # anchors that the beam search assigns to points of the whole; chosen
    n_candidates: int = 300  # samples of the whole that are candidates beside its extremities; chosen
    beam_width: int = 1000  # partial assignments that the beam search keeps; chosen on cuts and holes
    # √area, mean; with landmarks, assignments whose images are nearer are one; chosen on a twisted body
    same_assignment_with_landmarks: float = 0.04
    n_trilaterated: int = 80  # assignments of least cost that trilateration completes; chosen
    n_starts: int = 16  # completed assignments of least cost that become starts; chosen on cuts and holes
    # starts in all, with those composed with maps of the whole onto itself; chosen on cuts and holes
    n_starts_with_composed: int = 24
    signature_weight: float = 0.25  # weight of differences of signatures in the assignment; chosen
    # √area of the whole; radii of the balls whose areas are compared; chosen: factors of about √2
    ball_radii: tuple[float, ...] = (0.1, 0.15, 0.22, 0.32, 0.45, 0.65, 0.9)
    # share of a bound by which the area of a ball may exceed it at no cost; chosen on cuts and holes
    ball_tolerance: float = 0.15
    # error of the area of a ball over the mean area; a larger one counts as this; chosen on cuts and holes
    max_ball_cost: float = 0.7
    # cost of a unit other than the files' unit, per squared logarithm of their ratio; chosen, not measured
    unit_change_weight: float = 0.05
    n_roots: int = 24  # anchors from which regions are grown; chosen on single views
    n_root_candidates: int = 24  # most similar candidates that are tried for each root; chosen
    max_grown_regions: int = 60  # regions of most gain that are completed; chosen on single views
    n_starts_from_regions: int = 12  # starts that are made from regions; chosen on single views
    # √area of the whole; distances d have the weight 1 / (near_distance + d); chosen
    near_distance: float = 0.2
    # mean cost of its distances at which an anchor adds nothing to a region; chosen on single views
    max_distance_cost: float = 0.3
    # weight of an anchor's descriptor distance, less the neutral one; distances count at most 1; chosen
    descriptor_gain: float = 2.0
    # descriptor distance that speaks neither for an image nor against it; right images have about 0.4, random
    # ones about 0.8
    neutral_descriptor_distance: float = 0.6
    # number of known radii that the neutral descriptor distance counts as; chosen on single views
    neutral_weight: float = 1.0


@dataclass(frozen=True)
class PartFitParameters:
    """The refinement of maps of a part; chosen on shapes with cuts and holes."""

    # last eigenvalue used on the part over the one on the whole, as a boundary needs more functions than the
    # share of the area suggests; chosen on cuts and holes
    function_ratio: float = 1.75
    extra_functions: int = 3  # functions of the part that are used beyond that eigenvalue; chosen
    # √area; longer distances from landmarks, as coordinates, count as this: lab/robustness.md, parts
    landmark_reach: float = 0.3
    # √area of the part; shorter distances do not measure the unit of a map; chosen on cuts and holes
    min_near_distance: float = 0.08
    # √area of the part; longer distances do not measure the unit of a map; chosen on cuts and holes
    max_near_distance: float = 0.3
    n_rough_vertices: int = 500  # vertices of the part that the rough refinement maps; chosen
    rough_sizes: tuple[int, ...] = (20, 40, 70)  # functions of the whole in each rough step; chosen
    # functions that smooth the whole where normals under rough maps are compared; chosen on cuts and holes
    n_rough_normal_functions: int = 40
    # functions that smooth the whole where normals under fine maps are compared; chosen on cuts and holes
    n_fine_normal_functions: int = 60
    # functions of the whole through which a fine map gives the images of anchors; chosen on cuts and holes
    n_anchor_functions: int = 200
    # times that the part is bent by a map, and the map refined from the bent part: lab/robustness.md, parts
    n_bending_rounds: int = 2
    # exponent of the stress in the cost of a map; 0.15 to 0.4 choose alike: decisions.md, cost of a part
    stress_exponent: float = 0.25
    # mean cosine of normals, whose root divides the rough cost; a lower one counts as this; chosen
    min_orientation: float = 0.1
    # rough maps of least cost that are composed with maps of the whole onto itself; chosen on cuts and holes
    n_composed: int = 4
    n_contenders: int = 8  # rough maps of least cost that are refined to the end; chosen on cuts and holes
    # last lengths of parts.bending, which bend the best map in full; with 3 or 10, four parts err no less
    n_final_lengths: int = 5


@dataclass(frozen=True)
class SeedsParameters:
    """The search for regions that two parts of one body have in common; chosen on parts in SHREC'16."""

    n_samples: int = 600  # vertices of each part, at most, that are mapped; chosen
    max_landmarks: int = 50  # landmarks that the search uses, at most; the refinement uses all; chosen
    body_ratio: float = 1.25  # √area of the body over the root mean square of √area of both parts; chosen
    # ratio of √area of both parts in the files' units, above which areas are taken as equal; chosen
    max_length_ratio: float = 4.0
    # √area of the body; radii of compared balls; chosen: smaller are noise, larger cross the boundary
    moment_radii: tuple[float, ...] = (0.06, 0.09, 0.13, 0.18, 0.24)
    max_overhang: float = 0.02  # √area of the body by which a ball may cross a boundary and count; chosen
    # descriptor distance that speaks neither for an image nor against it; chosen on parts in SHREC'16
    neutral_moment_distance: float = 0.25
    neutral_moment_weight: float = 1.5  # number of radii that neutral_moment_distance counts as; chosen
    # difference in the logarithm of balls' areas that speaks neither for an image nor against it; chosen
    neutral_area_difference: float = 0.15
    # difference in the logarithm of balls' areas; a larger one counts as this; chosen on parts in SHREC'16
    max_area_difference: float = 1.0
    neutral_area_weight: float = 2.0  # number of areas that neutral_area_difference counts as; chosen
    moment_weight: float = 0.6  # weight of descriptor distances in the cost of a candidate; chosen
    # weight of differences between areas of balls in the cost of a candidate; chosen on parts in SHREC'16
    area_weight: float = 0.5
    # standard deviations; a larger difference of values counts as this; chosen on parts in SHREC'16
    max_descriptor_distance: float = 2.0
    neutral_descriptor_distance: float = 0.5  # descriptor distance where none is known; chosen
    neutral_descriptor_weight: float = 0.5  # number of radii that this distance counts as; chosen
    # √area of the body; in local means, a neighbour at distance d has the weight exp(−(d /
    # smoothing_length)²); chosen on parts in SHREC'16
    smoothing_length: float = 0.12
    rank_offset: int = 3  # rank of the best sample; above 0, so that −log(rank) is finite; chosen
    # mean −log of an image's rank (a share of samples) that counts as none; random images have 1:
    # decisions.md, two parts
    chance_surprise: float = 1.2
    # √area of the body; a sample needs an image if what the other part shows reaches farther past it; chosen
    min_visible_margin: float = 0.05
    # √area of the body; a sample of the target farther from all images is not covered; chosen
    uncovered_distance: float = 0.08
    # weight of the area that should have an image and has none, against the evidence; chosen
    left_out_weight: float = 1.0
    # nearest samples of a sample that form triangles, whose winding is compared; chosen on parts in SHREC'16
    n_neighbours: int = 8
    n_anchors: int = 56  # samples of the source over which regions grow; chosen on parts in SHREC'16
    n_candidates: int = 300  # samples of the target that may be images of anchors; chosen
    n_roots: int = 40  # anchors, the deepest inside, from which regions grow; chosen on parts in SHREC'16
    n_root_candidates: int = 30  # candidates of least cost that are tried for each root; chosen
    # √area of the body; a distance d has the weight 1 / (near_distance + d) in `grow_regions`; chosen
    near_distance: float = 0.2
    # mean cost of its distances above which an anchor gets no image in `grow_regions`; chosen
    max_distance_cost: float = 0.09
    beam_width: int = 4  # variants of a region that are kept while it grows in `grow_regions`; chosen
    # √area of the body; least distance of an anchor's images in two variants of a region; chosen
    same_variant_distance: float = 0.12
    # weights of a candidate's cost by descriptors and areas, where distances count at most 1; regions grow
    # with each weight; chosen on parts in SHREC'16
    descriptor_gains: tuple[float, ...] = (2.0, 0.5)
    # √area of the body, mean; regions whose images are nearer are one; chosen on parts in SHREC'16
    same_region_distance: float = 0.1
    min_common_anchors: int = 3  # anchors in common, without which two regions are different; chosen
    # share of one map's samples that both of two near maps must have to be one; chosen on parts in SHREC'16
    same_map_overlap: float = 0.7
    max_screened: int = 400  # regions of most gain that are extended to more samples, at most; chosen
    # for each step: samples to which regions are extended, rounds, and regions kept then; chosen
    extensions: tuple[tuple[int, int, int], ...] = ((150, 1, 80), (300, 2, 30))
    max_sample_cost: float = 0.06  # mean cost of its distances above which a sample is in no region; chosen
    # mean cost of distances above which a sample is in no region if landmarks are given; chosen on SHREC'16
    max_sample_cost_with_landmarks: float = 0.12
    # √area of the body; a sample whose image maps back farther from it is in no region; chosen
    max_round_trip: float = 0.12
    # √area of the body; a distance d has the weight 1 / (trilateration_distance + d)²; chosen
    trilateration_distance: float = 0.15
    # samples of a region, at most, that place the others while the region has some samples; chosen
    n_first_anchors: int = 50
    # samples of a region, at most, that place the others once the region has all samples; chosen on SHREC'16
    n_next_anchors: int = 90
    min_accepted: int = 8  # samples; a smaller region is dropped while it is extended; chosen
    min_samples: int = 25  # samples; a smaller region is dropped in the end; chosen on parts in SHREC'16
    # mean sign of its triangles (1, or −1 if inverted) below which a region is dropped; chosen on SHREC'16
    min_orientation: float = 0.2


@dataclass(frozen=True)
class TwoPartsParameters:
    """The refinement of regions that two parts have in common; chosen on parts in SHREC'16."""

    # for each round: best regions, largest mean cost of a sample, whether to refine roughly; chosen
    rounds: tuple[tuple[int, float, bool], ...] = ((4, 0.05, True), (2, 0.045, False))
    region_margin: float = 0.05  # √area of the body, by which a region reaches beyond its samples; chosen
    # √area of the target; a landmark holds if its image is nearer than this to where it should be; chosen
    landmark_tolerance: float = 0.1
    # descriptor distance from its image above which a sample does not place others; chosen on SHREC'16
    max_descriptor_distance: float = 0.6
    # √area of the target; a vertex of a bent region is in common up to this distance from the target; chosen
    surface_tolerance: float = 0.04
    # √area of the target; the same distance where the nearest point is on the target's boundary; chosen
    boundary_tolerance: float = 0.02
    n_rough_functions: int = 100  # functions of the rough refinement; chosen: they rank regions as all do
    n_final_lengths: int = 3  # last lengths of parts.bending, which bend the best region in full; chosen


@dataclass(frozen=True)
class ComponentsParameters:
    """Shapes of several components."""

    # largest components of each shape that are tried as partners of the other shape's largest one; chosen:
    # nine matches at most
    max_runners_up: int = 3
    # area over the largest component's, from which a component is tried as a partner of the largest; brain
    # hemispheres pass, clothes do not
    min_runner_up_area: float = 0.5
    n_eigenvalues: int = 20  # first eigenvalues whose logarithms are compared; chosen
    # mean difference in the logarithm of eigenvalues, beyond the least one, up to which partners are tried;
    # poses differ by 0.03, two halves by 0.13
    same_spectrum_difference: float = 0.1
    # √area, mean; a component that is carried along rigidly is matched so if it then lies this near to its
    # partner; chosen: half the spacing of the samples
    same_place_distance: float = 0.02
    # √area of the partner × (1 + its gap from the carrier); a component carried farther from another is no
    # partner; two eyes have 0.9
    max_carried_distance: float = 0.7
    max_length_ratio: float = 1.4  # ratio of √area up to which components are partners; chosen as for parts
    # √area of the component; one nearer to what carries it is held by it, and cannot turn by itself; chosen
    max_held_distance: float = 1.0


@dataclass(frozen=True)
class HeldLandmarksParameters:
    """Maps that are bent until landmarks hold."""

    # width of the bump moved by a landmark over its shift; 1.5 to 3 do alike: docs/priors.md, exact landmarks
    width_per_shift: float = 2.0
    min_width: float = 0.1  # √area; least width of the bump of a landmark: docs/priors.md, exact landmarks
    max_width: float = 0.2  # √area; largest width of the bump of a landmark: docs/priors.md, exact landmarks
    min_weight: float = 0.02  # weight below which a landmark does not move a vertex; chosen
    # singular value of the kernel between landmarks below which landmarks move together; chosen
    min_singular_value: float = 0.1
    function_weight: float = 0.3  # √area; weight of functions beside positions; chosen
    n_functions: int = 20  # functions beside positions, which separate sheets that are near in space; chosen


@dataclass(frozen=True)
class ErrorsParameters:
    """Expected errors, regions of doubt and questions."""

    # exponent of the ratio of scores in the odds of two maps; chosen: at the bound of a tie, 1 of 10 is right
    runner_up_exponent: float = 10.0
    # √area; radius that smooths expected errors; isomatch_lab.studies.vertex_confidence tried 0.05 to 0.14
    smoothing_radius: float = 0.08
    # factor of local errors with which their mean is the mean error of faust_r and creatures:
    # isomatch_lab.studies.vertex_confidence
    error_scale: float = 0.32
    min_reason_share: float = 0.25  # share of a region for which a reason of doubt must hold; chosen
    # share of a neighbourhood with known values, for its mean to be known; chosen
    min_known_share: float = 0.5
    min_region_area: float = 0.005  # share of the surface; smaller regions are not named; chosen: half a hand
    # mean error over √area of a region that looks unlike its images: lab/benchmarks.md, regions of doubt
    unlike_error: float = 0.5
    max_named_landmarks: int = 5  # contradicted landmarks, the worst, that a note names; chosen
    # functions that smooth the surfaces whose normals are compared; chosen with outcome.poor_orientation
    n_normal_functions: int = 60
    n_question_vertices: int = 400  # vertices, far from each other, that questions may ask for; chosen
    # √area of the target; a question separates two maps whose images are at least this far apart; chosen:
    # twice a hand
    other_place: float = 0.1
    question_distance: float = 0.3  # √area of the source; nearer questions say less; chosen


@dataclass(frozen=True)
class ExchangeParameters:
    """Maps found from the target, and regions that a map takes from others.

    See decisions.md, both sides.
    """

    max_maps_from_target: int = 2  # maps that contend, of those that tie in a search from the target; chosen
    # √area; images of one vertex farther apart are at different places; chosen: two thirds of a limb
    other_place: float = 0.1
    min_region_area: float = 0.01  # share of the area; a smaller region is not exchanged; chosen
    max_region_area: float = 0.4  # share of the area; a larger region makes another map; chosen
    max_regions: int = 6  # regions, the largest that differ from another map, that are tried; chosen
    # descriptor distance of a region under another map over the present map's, up to which it is tried; right
    # limbs have 1.09, hopeless ones 2.7
    max_unlikeness_ratio: float = 1.25
    max_cost_ratio: float = 0.97  # cost over the cost before, up to which an exchange is kept; chosen
    max_exchanges: int = 4  # exchanges that are made one after the other, at most; chosen
    n_coarse_vertices: int = 400  # vertices that are bent when a region is first verified; chosen
    n_compared_vertices: int = 60  # vertices of a region whose images are compared; chosen
    # share of the images of a region that are within half of other_place of another region's images, above
    # which both regions are exchanged together; chosen
    min_overlap: float = 0.3


@dataclass(frozen=True)
class SymmetricParameters:
    """Maps composed with near-symmetries, which may fit as well as the winner.

    See decisions.md, individuals.
    """

    # energy over the winner's, up to which a composed map is refined; on 60 pairs of SHREC'07, those that fit
    # as well have 0.97 to 1.26, and 1.4 in two bodies with a bump
    max_energy_ratio: float = 1.75
    # score over the winner's after the first round, up to which a composed map is refined to the end; those
    # that fit as well have 0.97 to 1.12, people front to back 1.12 to 1.34
    max_first_score_ratio: float = 1.2
    # √area, mean over vertices; a composed map farther from the winner turns the whole shape; half turns of
    # ants have 0.24, turned trunks at most 0.2
    min_turned_distance: float = 0.2
    # functions of the steps by which a map composed with a mirror image is turned over; chosen
    half_turn_sizes: tuple[int, ...] = (10, 15, 20)
    # spectral residual over the winner's after these steps, up to which the half turn is refined; ants have
    # 0.84 to 1.06, people at least 1.13, animals at least 1.3
    max_half_turn_residual_ratio: float = 1.1
    max_maps: int = 4  # composed maps of least energy that are refined; chosen
    # cost of `verify` over the winner's, up to which a composed map fits as well; right maps have at most
    # 1.46 of half turns of ants, wrong maps of animals at least 1.59 of right ones
    max_cost_ratio: float = 1.5
    # cost of `verify` over the winner's, up to which a half turn fits as well; right maps of ants have at
    # most 1.89 of half turns, half turns of people at least 1.93 of right maps
    max_half_turn_cost_ratio: float = 1.9


@dataclass(frozen=True)
class JudgingParameters:
    """A map of any tool beside a reference, see `judge`."""

    # share of the area; a map that sends no more elsewhere agrees with the reference; chosen: a hand
    min_region_area: float = 0.01
    # cost over the reference's, up to which a map that agrees with the reference is right, above it doubtful;
    # right maps known at 300 points have 2.6 to 21
    max_right_ratio: float = 25.0
    # cost over the reference's, above which a map that sends a region elsewhere is wrong, up to it doubtful;
    # a limb shifted by half its width has 1.33
    min_wrong_ratio: float = 1.25
    # different images over vertices; below, only the vertex nearest to each image is judged; chosen
    coarse_image_share: float = 0.25
    # mean distance from the reference composed with a symmetry over the one from the reference, below which a
    # map exchanges sides; chosen
    exchanged_ratio: float = 0.5
    max_regions: int = 5  # regions, the largest, that are named; chosen


@dataclass(frozen=True)
class SpectralParameters:
    """The refinements of the paper."""

    # functions with which functional maps begin to grow; the best of these maps is taken: lab/paper.md
    first_sizes: tuple[int, ...] = (15, 20, 30, 40)
    choice_size: int = 50  # functions of all of these maps when the best is chosen; chosen: equal to the rank
    size_step: int = 5  # functions that are added in each step: Melzi et al. 2019
    # iterations of the plain alignment on the refinement vertices; two on all vertices follow; chosen
    n_distance_steps: int = 15


MAP_DISTANCE = MapDistanceParameters()  # distances from which two maps are the same or differ
TIES = TiesParameters()  # differences too small to decide between two maps
SCREENING = ScreeningParameters()  # hypotheses and candidates of complete shapes
ANCHORS = AnchorsParameters()  # first maps of shapes without limbs
STRATEGY = StrategyParameters()  # variants of the shapes, and the choice between strategies
ELASTIC_SEARCH = ElasticSearchParameters()  # first maps of shapes whose limbs stretch, and their coarse fit
ELASTIC_FIT = ElasticFitParameters()  # the bending of shapes whose limbs stretch
PART_UNIT = PartUnitParameters()  # a part and a whole in common units
PART_SEARCH = PartSearchParameters()  # first maps of a part
PART_FIT = PartFitParameters()  # the refinement of maps of a part
SEEDS = SeedsParameters()  # the search for regions that two parts have in common
TWO_PARTS = TwoPartsParameters()  # the refinement of these regions
COMPONENTS = ComponentsParameters()  # shapes of several components
HELD_LANDMARKS = HeldLandmarksParameters()  # maps that are bent until landmarks hold
ERRORS = ErrorsParameters()  # expected errors, regions of doubt and questions
EXCHANGE = ExchangeParameters()  # maps found from the target, and regions that a map takes from others
JUDGING = JudgingParameters()  # a map of any tool beside a reference
SYMMETRIC = SymmetricParameters()  # maps composed with near-symmetries
SPECTRAL = SpectralParameters()  # the refinements of the paper
