"""Numbers of matching that no user sets: each with its unit, what it bounds, and why it has this value.

A share is a fraction from 0 to 1. A cosine of normals compares normals of the target with normals of the
source that a map lays on the target: it is near 1 if the map keeps the orientation of the faces, near −1
for a mirror image. The reason for a value is a measurement, a paper, or "chosen". Numbers that studies
vary are settings, see `isomatch.settings`, such as ``search.same_map`` or ``parts.poor_doubt``; the numbers
of `verify` stand in its module.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class MapDistanceParameters:
    """Distances between the images of two maps, from which the maps are the same or differ."""

    # √area of the target, mean over vertices; two maps whose images are nearer than this are one map up to
    # details; chosen as search.same_map
    same_map: float = 0.05
    # √area of the target; two images of one vertex that are farther apart are at different places; chosen:
    # above the error of right maps, below the width of a limb
    other_place: float = 0.08
    # √area of the target, mean over vertices; two maps of a part, or of two strategies, whose images are
    # farther apart are different maps; chosen on cuts and holes
    other_map: float = 0.12
    # √area of the target; two images of one vertex that are farther apart are on different limbs; chosen:
    # twice selection.runner_up_distance
    other_limb: float = 0.3


@dataclass(frozen=True)
class TiesParameters:
    """Differences between two maps that are too small to decide between them."""

    # energy of a map over the least energy of the maps that agree with landmarks; up to this ratio, a map of
    # the wanted orientation is preferred to one of less energy; chosen: a map that mixes both sides of a
    # shape fits worse than either map that does not
    same_energy_ratio: float = 1.5
    # share of vertices; a map that is near the best map on average still exchanges limbs if it sends at least
    # this share of the vertices farther than MAP_DISTANCE.other_limb from their images under the best map; it
    # is 0.08 for the wrong map of horse7–horse14
    exchanged_share: float = 0.05
    # score of a map that exchanges limbs over the best map's, up to which the former is the runner-up; it is
    # 1.002 where the best map of horse7–horse14 is wrong, at least 1.059 where 111 best maps are right
    exchanged_ratio: float = 1.05
    # √area of the target; two maps whose landmark errors differ by less agree equally well with the
    # landmarks; chosen: the spacing of the search vertices
    landmark_slack: float = 0.05
    # score of the best map that agrees with the priors over the score of another map; from this ratio, the
    # other map is the runner-up whatever the priors say: lab/benchmarks.md, confidence
    clearly_better_ratio: float = 1.15
    # energy; lower energies are raised to this, so that symmetric maps between two copies of a mesh tie; maps
    # between two triangulations of one surface have 0.002 to 0.06: lab/benchmarks.md, symmetry
    energy_noise: float = 0.012
    # spectral residual; lower ones are raised to this; maps between two triangulations of one surface have
    # 0.26 to 0.35: lab/benchmarks.md, symmetry
    spectral_residual_noise: float = 0.25
    # score; lower scores are raised to this; maps between two triangulations of one surface have 0.04 to
    # 0.09: lab/benchmarks.md, symmetry
    score_noise: float = 0.04
    # cost by `verify`; lower costs are raised to this; turns of a flat ring onto itself cost up to 5e-6, maps
    # between two poses 3e-4 and more
    cost_noise: float = 1e-5
    # share of vertices; maps that differ on fewer are not compared by descriptors; chosen: 10 of 1000
    # vertices
    min_region_share: float = 0.01


@dataclass(frozen=True)
class ScreeningParameters:
    """Hypotheses and candidates of complete shapes."""

    # iterations of closest points that improve a hypothesis from priors; chosen: more change most maps little
    n_prior_steps: int = 8
    # hypotheses, at most, for shapes without limbs; chosen above search.n_hypotheses, because residuals tell
    # little before curvature is compared: lab/robustness.md, shapes without limbs
    max_hypotheses_without_limbs: int = 40
    # numbers of functions by which the map of a hypothesis grows; steps of 5 as in Melzi et al. 2019
    upsampling_sizes: tuple[int, ...] = (20, 25, 30, 35, 40, 45, 50)
    # fraction of outcome.poor_spectral_residual, poor_residual and poor_descriptor_distance; a map is sure
    # only if its measures are below this fraction of them: decisions.md, given up and tried again
    sure_fraction: float = 0.75
    # maps of the forbidden orientation, at most, that are refined for comparison only; chosen
    max_mirrored: int = 3
    # rotations of a shape onto itself; if both shapes have at least this many, they are round, and no map
    # found without priors is sure; discs and balls have 11 to 40, bodies at most 6
    min_rotations_of_round: int = 11


@dataclass(frozen=True)
class AnchorsParameters:
    """First maps of shapes without limbs, from anchors: points far from each other."""

    # points of the source that are assigned; chosen: three determine an isometry, three more test it
    n_anchors: int = 6
    # search vertices of the target that may be images of anchors; chosen as for symmetries
    n_candidates: int = 200
    # weight of the distance between the signatures of an anchor and its image; errors of distances, in
    # average distances, have weight 1: lab/robustness.md, shapes without limbs
    signature_weight: float = 0.25
    beam_width: int = 200  # number of partial assignments that the beam search keeps; chosen
    # average distances of the target, mean over anchors; two assignments whose images are nearer are one;
    # chosen: 0.1 is no better
    same_assignment_distance: float = 0.15
    n_starts: int = 48  # best assignments that become first maps; chosen: as many as extremities give at most
    # functions by which a first map is relaxed; chosen: the first of SCREENING.upsampling_sizes
    n_relaxation_functions: int = 20
    n_relaxation_steps: int = 10  # times that a first map is relaxed; lab/robustness.md, shapes without limbs


@dataclass(frozen=True)
class StrategyParameters:
    """Variants of the shapes, and the choice between strategies."""

    # best hypotheses that are flipped if holes are capped; with 3, the map mesh018–mesh014 errs by 30 %
    n_flipped: int = 6
    # times, at most, that the shape with more handles is cut along creases and matched; after the first time,
    # only along creases that the map before tears: decisions.md, strategies that pay
    max_crease_cuts: int = 3
    # √area of the other shape; a map tears a crease if it sends its two sides farther apart; chosen
    self_contact_distance: float = 0.1
    # doubt of a part's map over parts.poor_doubt, up to which it ends the search; a mirrored map had 0.94
    final_doubt_fraction: float = 0.5
    # cost of `verify` over the least, above which a poor isometry of two parts is not searched from both sides;
    # on 20 pairs, such a search lowered costs within 5 times the least to 0.54 of them at best
    hopeless_cost_ratio: float = 2.5


@dataclass(frozen=True)
class ElasticSearchParameters:
    """First maps of shapes whose limbs stretch, and their coarse fit; chosen on pairs of animals."""

    n_coarse_samples: int = 300  # samples of each shape in the coarse fit; chosen: enough for 30 functions
    # weight of signatures among the coordinates of a fit, where canonical coordinates have weight 1; chosen
    signature_weight: float = 0.05
    # weight of normals among the coordinates of a coarse fit, where canonical ones have weight 1; chosen
    normal_weight: float = 0.05
    landmark_weight: float = 30.0  # number of samples for which a landmark counts in a fit; chosen
    n_anchors: int = 12  # points of the source that are assigned to candidates on the target; chosen
    # samples of the target that are candidates besides its extremities; chosen: they are 0.09 √area apart
    n_candidates: int = 150
    beam_width: int = 600  # number of partial assignments that the beam search keeps; chosen on animals
    # average distances, mean over anchors; assignments whose images are nearer are one; chosen as for parts
    same_assignment_distance: float = 0.12
    # average distances; larger errors of a distance are lowered to this (`most` of `IntervalCost`); chosen
    max_distance_cost: float = 0.6
    # average distances; added to the distance that divides its error (`soft` of `IntervalCost`); chosen
    short_distance: float = 0.2
    # weight, in an assignment, of the difference between the remoteness of an anchor and of its image, where
    # remoteness is the share of the area that is less remote; chosen on animals
    remoteness_weight: float = 0.5
    # weight, in an assignment, of the difference between signatures of anchor and image, over its mean;
    # chosen
    anchor_signature_weight: float = 0.1
    # weight, in an assignment, of the difference between the distances of an anchor and of its image from
    # their mirror images; chosen
    mirror_distance_weight: float = 1.0
    # average distances; longer distances of a point from its mirror image are lowered to this; chosen
    max_mirror_distance: float = 1.0
    # further starts each way, which ignore mirror images if there are any; decisions.md, elastic starts
    n_plain_starts: int = 30
    # spectral residual; if the best map of a shape to its mirror image has more, it is not used; chosen
    max_mirror_spectral_residual: float = 0.26
    # mean cosine of normals; maps of a shape to its mirror image with a lower one are left out; chosen
    min_mirror_orientation: float = 0.5
    n_mirror_starts: int = 24  # assignments that become first maps of a shape to its mirror image; chosen
    # share by which distances are allowed to change at a low cost between a shape and its mirror image;
    # chosen below elastic.distance_tolerance, as both are nearly isometric
    forgiven_of_mirror: float = 0.1
    # maps of a shape to its mirror image that are kept after each coarse step; decisions.md, elastic choice
    n_mirror_maps_kept: tuple[int, ...] = (12, 4, 4)
    # fits that are kept after each coarse step; after the last one, they are bent: decisions.md, elastic
    # choice
    n_maps_kept: tuple[int, ...] = (90, 40, 8)
    # √area, in canonical coordinates; added to the asymmetry of a map, as shapes are asymmetric, too; chosen
    asymmetry_unit: float = 0.1
    # exponent of (asymmetry + asymmetry_unit) in the score of a coarse fit; chosen on animals
    asymmetry_exponent: float = 0.25
    # mean cosine of normals; coarse fits below are dropped; chosen as selection.orientation_threshold
    min_orientation: float = 0.3


@dataclass(frozen=True)
class ElasticFitParameters:
    """The bending of shapes whose limbs stretch, and the images taken from the bent shapes."""

    # score of a map over the least score, above which the map is dropped after the first half of
    # elastic.bending; decisions.md, elastic choice
    hopeless_ratio: float = 1.5
    # weight of normals among the coordinates of the last smooth fit, where canonical ones have weight 1;
    # decisions.md, elastic steps
    fine_normal_weight: float = 0.15
    # cost of a map over the least cost, up to which the map wins that agrees best with an initial map; chosen
    prior_tie_ratio: float = 1.1
    # first lengths of elastic.bending that the final bending skips, as the best map was bent by them; chosen
    n_skipped_lengths: int = 2
    # √area of the target; shorter pieces are almost rigid when the source is bent at full resolution; chosen
    full_lengths: tuple[float, ...] = (0.05, 0.04, 0.03)
    # √area; length of normals beside positions, so that sheets near each other are separate; chosen
    normal_weight: float = 0.05
    # 1 / √area; weight of positions of the bent shapes beside functions and signatures; 10 to 20 do alike;
    # without positions the error is 3.16 % of √area instead of 2.9: decisions.md, elastic steps
    position_weight: float = 15.0
    # exponent of the score by which the cost of `verify` is multiplied, because both measure the bending with
    # independent errors; with 0.1 to 1.5 the same maps win in 23 pairs, with 0 a wrong one in dog_02–cow_03
    score_exponent: float = 0.5
    # mean |log(edge length bent / at rest)|; no elastic map is sought if an isometric map fits and stretches
    # both shapes less than this; decisions.md, elastic outcome
    max_isometric_stretch: float = 0.085
    # mean |log(edge length bent / at rest)|; an isometric map that fits, and wins against elastic maps, is
    # returned as it is if it stretches both shapes less than this; decisions.md, elastic outcome
    max_isometric_stretch_of_winner: float = 0.105


@dataclass(frozen=True)
class PartUnitParameters:
    """A part and a whole in common units; chosen on shapes with cuts and holes."""

    # √area of the part; larger errors of a distance are lowered to this (`most` of `IntervalCost`); chosen
    max_distance_cost: float = 0.6
    # √area of the part; added to the distance that divides its error (`soft` of `IntervalCost`); chosen
    short_distance: float = 0.18
    # samples of the boundary of a part, at which paths on the whole may leave the part; chosen
    n_boundary_vertices: int = 60
    n_anchors: int = 50  # points of the part, besides landmarks, whose images make a start; chosen
    # share of pairs of anchors with known distances; below it, scale = "auto" keeps the files' unit; chosen
    min_known_share: float = 0.07
    # ratio of a tried unit to the previous one; chosen: a true unit is then within 5 % of a tried one
    unit_step_ratio: float = 1.1
    # area of the part over the area of the whole; if the files' units say nothing, no smaller part is tried;
    # single views show 0.16 and more
    min_area_share: float = 0.1
    # ratio of a tried unit to the files' unit, at most; remeshed bodies of one person in FAUST have up to 1.2
    max_unit_ratio: float = 1.4
    # √area of the part over the whole's; larger units are lowered to this; chosen: 1 plus errors of
    # measurement
    max_unit: float = 1.05
    # logarithm of the ratio of neighbouring units, to which measured units are rounded; chosen
    unit_spacing: float = 0.02
    # lower bound of a distance over its upper bound, from which the distance counts as known; chosen
    known_ratio: float = 0.97
    # √area of the part; shorter distances, which are mostly noise, do not measure the unit; chosen
    min_distance: float = 0.3
    # known distances, at least, that measure the unit; with fewer, the unit stays; chosen on cuts and holes
    min_known_distances: int = 40
    # approximate ratio of neighbouring radii between which ball signatures are interpolated; chosen
    radius_step_ratio: float = 1.25
    # energies of the wave signatures, which are evenly spaced logarithms of eigenvalues; chosen
    n_energies: int = 20
    # distance in 1 / √λ, where λ is the eigenvalue at an energy; this far from the boundary of a part, a wave
    # signature has 63 % of its weight, which is 0 at the boundary; chosen on cuts and holes
    boundary_reach: float = 4.0
    # distance in 1 / √λ, where λ is the last eigenvalue by which the surface is smoothed; this far from the
    # boundary of a part, the curvature has 63 % of its weight, which is 0 at the boundary; chosen
    curvature_boundary_reach: float = 3.0


@dataclass(frozen=True)
class PartSearchParameters:
    """First maps of a part; chosen on shapes with cuts and holes, and on single views."""

    n_assigned_anchors: int = 16  # anchors that the beam search assigns to points of the whole; chosen
    n_candidates: int = 300  # samples of the whole that are candidates besides its extremities; chosen
    beam_width: int = 1000  # number of partial assignments that the beam search keeps; chosen
    # √area of the whole, mean over anchors; with landmarks, two assignments whose images are nearer are one;
    # chosen on a twisted body
    same_assignment_with_landmarks: float = 0.04
    n_trilaterated: int = 80  # assignments of least cost that trilateration completes; chosen
    n_starts: int = 16  # completed assignments of least cost that become starts; chosen on cuts and holes
    # starts that are kept after all starts have been composed with maps of the whole onto itself; chosen
    n_starts_with_composed: int = 24
    # weight, in an assignment, of the difference between signatures of an anchor and its image; chosen
    signature_weight: float = 0.25
    # √area of the whole; radii of the balls whose areas are compared; chosen: factors of about √2
    ball_radii: tuple[float, ...] = (0.1, 0.15, 0.22, 0.32, 0.45, 0.65, 0.9)
    # share of a bound on the area of a ball by which the area is allowed to violate the bound at no cost;
    # chosen on cuts and holes
    ball_tolerance: float = 0.15
    # violation of a bound on the area of a ball over the mean area of such balls; larger ones are lowered to
    # this; chosen on cuts and holes
    max_ball_cost: float = 0.7
    # cost of a unit for each squared logarithm of its ratio to the files' unit; chosen, not measured
    unit_change_weight: float = 0.05
    n_roots: int = 24  # anchors, the farthest from the boundary, from which regions are grown; chosen
    n_root_candidates: int = 24  # most similar candidates that are tried for each root; chosen
    max_grown_regions: int = 60  # grown regions of most gain that are completed to starts; chosen
    n_starts_from_regions: int = 12  # starts that are made from grown regions; chosen on single views
    # √area of the whole; while regions grow, a distance d has the weight 1 / (near_distance + d); chosen
    near_distance: float = 0.2
    # mean cost of an anchor's distances at which it adds nothing to a region; chosen on single views
    max_distance_cost: float = 0.3
    # weight of an anchor's descriptor distance less the neutral one, in the gain of a region; distances that
    # agree exactly gain 1; chosen
    descriptor_gain: float = 2.0
    # descriptor distance that says nothing of an image; right images have about 0.4, random ones about 0.8
    neutral_descriptor_distance: float = 0.6
    # number of known radii for which the neutral descriptor distance counts; chosen on single views
    neutral_weight: float = 1.0


@dataclass(frozen=True)
class PartFitParameters:
    """The refinement of maps of a part; chosen on shapes with cuts and holes."""

    # last eigenvalue used on the part over the last one used on the whole; chosen on cuts and holes: a
    # boundary needs more functions than the share of the area suggests
    function_ratio: float = 1.75
    extra_functions: int = 3  # functions of the part that are used beyond that eigenvalue; chosen
    # √area of the whole; longer distances from landmarks are lowered to this where they are coordinates:
    # lab/robustness.md, parts
    landmark_reach: float = 0.3
    # √area of the part; shorter distances do not measure the unit of a map; chosen on cuts and holes
    min_near_distance: float = 0.08
    # √area of the part; longer distances do not measure the unit of a map; chosen on cuts and holes
    max_near_distance: float = 0.3
    n_rough_vertices: int = 500  # vertices of the part that the rough refinement maps; chosen
    # numbers of functions of the whole in the steps of the rough refinement; chosen
    rough_sizes: tuple[int, ...] = (20, 40, 70)
    # functions that smooth the whole where normals under rough maps are compared; chosen on cuts and holes
    n_rough_normal_functions: int = 40
    # functions that smooth the whole where normals under fine maps are compared; chosen on cuts and holes
    n_fine_normal_functions: int = 60
    # functions of the whole by which a fine map is extended to the anchors; chosen on cuts and holes
    n_anchor_functions: int = 200
    # times that the part is bent by a map, and the map refined from the bent part; lab/robustness.md, parts
    n_bending_rounds: int = 2
    # exponent of the stress in a map's cost; with 0.15 to 0.4 the same maps win: decisions.md, cost of a part
    stress_exponent: float = 0.25
    # mean cosine of normals, whose root divides the rough cost; lower ones are raised to this; chosen
    min_orientation: float = 0.1
    # rough maps of least cost that are composed with maps of the whole onto itself; chosen on cuts and holes
    n_composed: int = 4
    n_contenders: int = 8  # rough maps of least cost that are refined to the end; chosen on cuts and holes
    # lengths at the end of parts.bending by which the best map is bent at full resolution; with 3 or 10, the
    # errors of four parts are no smaller
    n_final_lengths: int = 5


@dataclass(frozen=True)
class SeedsParameters:
    """The search for regions that two parts of one body have in common; chosen on parts in SHREC'16."""

    n_samples: int = 600  # vertices of each part, at most, that are mapped; chosen
    # landmarks, at most, that the search uses; the refinement uses all of them; chosen
    max_landmarks: int = 50
    body_ratio: float = 1.25  # √area of the body over the root mean square of √area of both parts; chosen
    # ratio of √area of both parts in the files' units, above which both areas are taken as equal; chosen
    max_length_ratio: float = 4.0
    # √area of the body; radii of the balls whose descriptors are compared; chosen: smaller balls are noise,
    # larger ones cross the boundary
    moment_radii: tuple[float, ...] = (0.06, 0.09, 0.13, 0.18, 0.24)
    # √area of the body; a ball that reaches no farther across the boundary counts as whole; chosen
    max_overhang: float = 0.02
    # descriptor distance of two balls that says nothing of an image; chosen on parts in SHREC'16
    neutral_moment_distance: float = 0.25
    neutral_moment_weight: float = 1.5  # number of radii for which neutral_moment_distance counts; chosen
    # difference between the logarithms of two balls' areas that says nothing of an image; chosen
    neutral_area_difference: float = 0.15
    # difference between the logarithms of two balls' areas; larger ones are lowered to this; chosen
    max_area_difference: float = 1.0
    neutral_area_weight: float = 2.0  # number of areas for which neutral_area_difference counts; chosen
    moment_weight: float = 0.6  # weight of the descriptor distance in the cost of a candidate; chosen
    # weight of the difference between areas of balls in the cost of a candidate; chosen on parts in SHREC'16
    area_weight: float = 0.5
    # standard deviations; larger differences between values of a descriptor are lowered to this; chosen
    max_descriptor_distance: float = 2.0
    # descriptor distance that stands in where no radius is known; chosen
    neutral_descriptor_distance: float = 0.5
    # number of radii for which neutral_descriptor_distance counts; chosen
    neutral_descriptor_weight: float = 0.5
    # √area of the body; in local means, a neighbour at distance d has the weight exp(−(d /
    # smoothing_length)²); chosen on parts in SHREC'16
    smoothing_length: float = 0.12
    rank_offset: int = 3  # rank of the most similar sample; chosen above 0, so that −log(rank) is finite
    # mean −log of the ranks of images near a sample (ranks as shares of all samples); lower means are no
    # evidence, random images have 1: decisions.md, two parts
    chance_surprise: float = 1.2
    # √area of the body; a sample needs an image if it lies nearer to a mapped sample than the image of the
    # latter is to the boundary, by more than this; chosen
    min_visible_margin: float = 0.05
    # √area of the body; samples of the target farther from all images are not covered; chosen
    uncovered_distance: float = 0.08
    # weight of the area that should have an image and has none, against the evidence; chosen
    left_out_weight: float = 1.0
    # nearest samples with which a sample forms triangles, whose winding is compared; chosen
    n_neighbours: int = 8
    n_anchors: int = 56  # samples of the source over which regions grow; chosen on parts in SHREC'16
    n_candidates: int = 300  # samples of the target that may be images of anchors; chosen
    n_roots: int = 40  # anchors, the farthest from the boundary, from which regions grow; chosen
    n_root_candidates: int = 30  # candidates of least cost that are tried for each root; chosen
    # √area of the body; in `grow_regions`, a distance d has the weight 1 / (near_distance + d); chosen
    near_distance: float = 0.2
    # mean cost of an anchor's distances above which the anchor gets no image in `grow_regions`; chosen
    max_distance_cost: float = 0.09
    # number of variants of a region that are kept while it grows in `grow_regions`; chosen
    beam_width: int = 4
    # √area of the body; least distance between the images of an anchor in two variants of a region; chosen
    same_variant_distance: float = 0.12
    # weights of a candidate's cost, in the gain of a region; distances that agree exactly gain 1; regions are
    # grown once with each weight; chosen on parts in SHREC'16
    descriptor_gains: tuple[float, ...] = (2.0, 0.5)
    # √area of the body, mean over anchors; two regions whose images are nearer are one; chosen
    same_region_distance: float = 0.1
    min_common_anchors: int = 3  # anchors, at least, with images in both of two regions that are one; chosen
    # share of the samples of a region; the region is another's map only if both have more than this in
    # common; chosen on parts in SHREC'16
    same_map_overlap: float = 0.7
    max_screened: int = 400  # grown regions of most gain, at most, that are extended to more samples; chosen
    # for each step: samples to which regions are extended, rounds of trilateration, regions kept; chosen
    extensions: tuple[tuple[int, int, int], ...] = ((150, 1, 80), (300, 2, 30))
    # mean cost of a sample's distances above which the sample is in no region; chosen
    max_sample_cost: float = 0.06
    # mean cost of a sample's distances above which the sample is in no region if landmarks are given; chosen
    max_sample_cost_with_landmarks: float = 0.12
    # √area of the body; a sample is in no region if its image maps back to a point farther from it; chosen
    max_round_trip: float = 0.12
    # √area of the body; distances d that place samples have the weight 1 / (trilateration_distance + d)²;
    # chosen
    trilateration_distance: float = 0.15
    # samples of a region, at most, from which others are placed while it is extended to some samples; chosen
    n_first_anchors: int = 50
    # samples of a region, at most, from which others are placed once it is extended to all samples; chosen
    n_next_anchors: int = 90
    min_accepted: int = 8  # samples; smaller regions are dropped while they are extended; chosen
    min_samples: int = 25  # samples; smaller regions are dropped in the end; chosen on parts in SHREC'16
    # mean sign of a region's triangles, −1 for inverted ones, else 1; regions with less are dropped; chosen
    min_orientation: float = 0.2


@dataclass(frozen=True)
class TwoPartsParameters:
    """The refinement of regions that two parts have in common; chosen on parts in SHREC'16."""

    # for each round: best regions, largest mean cost of a sample, whether regions are refined roughly; chosen
    rounds: tuple[tuple[int, float, bool], ...] = ((4, 0.05, True), (2, 0.045, False))
    # √area of the body; a region contains vertices up to this far from its samples; chosen
    region_margin: float = 0.05
    # √area of the target; a landmark holds if its image is nearer than this to its target; chosen
    landmark_tolerance: float = 0.1
    # descriptor distance between a sample and its image, from which the sample does not place others; chosen
    max_descriptor_distance: float = 0.6
    # √area of the target; a vertex of the bent region at most this far from the target is in common; chosen
    surface_tolerance: float = 0.04
    # √area of the target; the same distance where the nearest point is on the target's boundary; chosen
    boundary_tolerance: float = 0.02
    # functions, at most, in the rough refinement; chosen: they rank regions as all functions do
    n_rough_functions: int = 100
    # lengths at the end of parts.bending by which the best region is bent at full resolution; chosen
    n_final_lengths: int = 3


@dataclass(frozen=True)
class ComponentsParameters:
    """Shapes of several components."""

    # largest components of each shape that are tried as partners of each other; chosen: nine matches at most
    max_runners_up: int = 3
    # area of a component over the largest's, from which it is tried; hemispheres of brains pass, clothes do
    # not
    min_runner_up_area: float = 0.5
    n_eigenvalues: int = 20  # first eigenvalues whose logarithms are compared; chosen
    # mean difference between logarithms of eigenvalues of two components, less the least such mean; up to
    # this, they are tried as partners; poses differ by 0.03, two halves by 0.13
    same_spectrum_difference: float = 0.1
    # √area of the partner, mean over vertices; a component is matched by its place if it lies this near to
    # its partner when it moves rigidly with what surrounds it; chosen: half the spacing of the samples
    same_place_distance: float = 0.02
    # √area of the partner × (1 + its gap from what carries it); a component that is carried to a place
    # farther from another is no partner; two eyes have 0.9
    max_carried_distance: float = 0.7
    # ratio of √area of two components, up to which they are partners; chosen as for parts
    max_length_ratio: float = 1.4
    # √area of the component; one nearer to what carries it is held by it, and cannot turn by itself; chosen
    max_held_distance: float = 1.0


@dataclass(frozen=True)
class HeldLandmarksParameters:
    """Maps that are bent until landmarks hold."""

    # width of the bump by which a landmark moves the map, over the landmark's shift; 1.5 to 3 do alike:
    # docs/priors.md, exact landmarks
    width_per_shift: float = 2.0
    # √area of the source; least width of the bump of a landmark; docs/priors.md, exact landmarks
    min_width: float = 0.1
    # √area of the source; largest width of the bump of a landmark; docs/priors.md, exact landmarks
    max_width: float = 0.2
    # weight of a landmark at a vertex; where it is lower, the landmark does not move the vertex; chosen
    min_weight: float = 0.02
    # singular value of the matrix of kernels between landmarks; landmarks below it move together; chosen
    min_singular_value: float = 0.1
    function_weight: float = 0.3  # √area; weight of functions beside positions; chosen
    # functions beside positions, which separate sheets that are near each other in space; chosen
    n_functions: int = 20


@dataclass(frozen=True)
class ErrorsParameters:
    """Expected errors, regions of doubt and questions."""

    # exponent of the ratio of two scores in the odds of two maps; chosen: 1 in 10 is right at a tie's bound
    runner_up_exponent: float = 10.0
    # √area; radius over which errors are smoothed; isomatch_lab.studies.vertex_confidence tried 0.05 to 0.14
    smoothing_radius: float = 0.08
    # factor of local errors with which their mean is the mean error of faust_r and creatures;
    # isomatch_lab.studies.vertex_confidence
    error_scale: float = 0.32
    # share of a region's vertices for which a reason of doubt must hold to be named; chosen
    min_reason_share: float = 0.25
    # share of a neighbourhood where values must be known for their mean to be known; chosen
    min_known_share: float = 0.5
    # share of the source's area; smaller regions of doubt are not named; chosen: half a hand
    min_region_area: float = 0.005
    # mean error over √area of a region that looks unlike its images; lab/benchmarks.md, regions of doubt
    unlike_error: float = 0.5
    max_named_landmarks: int = 5  # contradicted landmarks, the worst ones, that a note names; chosen
    # functions that smooth the surfaces whose normals are compared; chosen with outcome.poor_orientation
    n_normal_functions: int = 60
    n_question_vertices: int = 400  # vertices, far from each other, that questions may ask for; chosen
    # √area of the target; a question separates two maps with images at least this far apart; chosen: two
    # hands
    other_place: float = 0.1
    # √area of each shape; a question nearer to an earlier one is worth less, and images farther apart are
    # worth no more; chosen
    question_distance: float = 0.3


@dataclass(frozen=True)
class ExchangeParameters:
    """Maps found by a search from the target, and regions that a map takes from other maps.

    See decisions.md, both sides.
    """

    max_maps_from_target: int = 2  # maps from the target, at most, that are compared with the others; chosen
    # √area of the target; two images farther apart are at different places; chosen: two thirds of a limb
    other_place: float = 0.1
    min_region_area: float = 0.01  # share of the source's area; smaller regions are not exchanged; chosen
    # share of the source's area; larger regions are not exchanged, as they make another map; chosen
    max_region_area: float = 0.4
    max_regions: int = 6  # regions, the largest in which two maps differ, that are tried; chosen
    # descriptor distance of a region under another map over its distance under the present map, up to which
    # the region is tried; right limbs have 1.09, hopeless ones 2.7
    max_unlikeness_ratio: float = 1.25
    # cost of a map after an exchange over its cost before, up to which the exchange is kept; chosen
    max_cost_ratio: float = 0.97
    max_exchanges: int = 4  # exchanges that are made one after the other, at most; chosen
    n_coarse_vertices: int = 400  # vertices that are bent when an exchange is first verified; chosen
    n_compared_vertices: int = 60  # vertices of a region, about, whose images are compared; chosen
    # share of the images of a region, from another map, within half of other_place of the images of a second
    # region, from the present map; above it, both regions are exchanged together; chosen
    min_overlap: float = 0.3


@dataclass(frozen=True)
class SymmetricParameters:
    """Maps composed with near-symmetries, which may fit as well as the selected map.

    See decisions.md, individuals.
    """

    # energy of a composed map over the best map's, up to which the former is refined; in 60 pairs of
    # SHREC'07, composed maps that fit as well have 0.97 to 1.26, and 1.4 in two bodies with a bump
    max_energy_ratio: float = 1.75
    # score of a composed map over the best map's after the first round, up to which the former is refined to
    # the end; composed maps that fit as well have 0.97 to 1.12, people turned front to back 1.12 to 1.34
    max_first_score_ratio: float = 1.2
    # √area of the target, mean over vertices; a composed map farther from the best map turns the whole shape;
    # half turns of ants have 0.24, turned trunks at most 0.2
    min_turned_distance: float = 0.2
    # numbers of functions in the steps by which a map composed with a mirror image is turned over; chosen
    half_turn_sizes: tuple[int, ...] = (10, 15, 20)
    # spectral residual of a half turn over the best map's after these steps, up to which the half turn is
    # refined; ants have 0.84 to 1.06, people at least 1.13, animals at least 1.3
    max_half_turn_residual_ratio: float = 1.1
    max_maps: int = 4  # composed maps of least energy that are refined; chosen
    # cost by `verify` of a composed map over the best map's, up to which both fit equally well; right maps of
    # ants cost at most 1.46 × their half turns, wrong maps of animals at least 1.59 × right ones
    max_cost_ratio: float = 1.5
    # cost by `verify` of a half turn over the best map's, up to which both fit equally well; right maps of
    # ants cost at most 1.89 × their half turns, half turns of people at least 1.93 × right maps
    max_half_turn_cost_ratio: float = 1.9


@dataclass(frozen=True)
class JudgingParameters:
    """A map of any tool beside a reference, see `judge`."""

    # share of the source's area; a map that sends no more elsewhere agrees with the reference; chosen: a hand
    min_region_area: float = 0.01
    # cost of a map that agrees with the reference over the reference's cost; up to this, the map is right,
    # above it doubtful; right maps known at 300 points have 2.6 to 21
    max_right_ratio: float = 25.0
    # cost of a map that sends a region elsewhere over the reference's cost; above this, the map is wrong, up
    # to it doubtful; a limb shifted by half its width has 1.33
    min_wrong_ratio: float = 1.25
    # number of different images over the number of vertices; below this, an image that several vertices share
    # is judged by the best of them; chosen
    coarse_image_share: float = 0.25
    # mean distance of a map from the reference composed with a symmetry, over its distance from the
    # reference; below this, the map exchanges sides; chosen
    exchanged_ratio: float = 0.5
    max_regions: int = 5  # regions, the largest, that are named; chosen


@dataclass(frozen=True)
class SpectralParameters:
    """The refinements of the paper."""

    # numbers of functions with which functional maps begin; the best of these maps is kept: lab/paper.md
    first_sizes: tuple[int, ...] = (15, 20, 30, 40)
    # functions of each of these maps when the best is chosen; chosen: equal to the rank
    choice_size: int = 50
    size_step: int = 5  # functions that are added in each step; Melzi et al. 2019
    # iterations of the plain alignment on the refinement vertices; two on all vertices follow; chosen
    n_distance_steps: int = 15


MAP_DISTANCE = MapDistanceParameters()  # bounds on distances between the images of two maps
TIES = TiesParameters()  # bounds on differences between two maps that tie
SCREENING = ScreeningParameters()  # used where hypotheses of complete shapes become candidates
ANCHORS = AnchorsParameters()  # used by `starts_from_anchors`, for shapes without limbs
STRATEGY = StrategyParameters()  # used by the strategies that make variants of the shapes
ELASTIC_SEARCH = ElasticSearchParameters()  # used to find and coarsely fit first maps that stretch limbs
ELASTIC_FIT = ElasticFitParameters()  # used to bend shapes whose limbs stretch
PART_UNIT = PartUnitParameters()  # used to bring a part and a whole into one unit
PART_SEARCH = PartSearchParameters()  # used to find first maps of a part
PART_FIT = PartFitParameters()  # used to refine maps of a part
SEEDS = SeedsParameters()  # used to find regions that two parts have in common
TWO_PARTS = TwoPartsParameters()  # used to refine these regions
COMPONENTS = ComponentsParameters()  # used to match shapes of several components
HELD_LANDMARKS = HeldLandmarksParameters()  # used to bend maps until landmarks hold
ERRORS = ErrorsParameters()  # used for expected errors, regions of doubt and questions
EXCHANGE = ExchangeParameters()  # used to exchange regions between maps found from both shapes
JUDGING = JudgingParameters()  # used by `judge`
SYMMETRIC = SymmetricParameters()  # used to compare a map with its compositions with near-symmetries
SPECTRAL = SpectralParameters()  # used by the refinements of the paper
