"""Numbers of matching that no user sets: each with its meaning, its unit and its source.

Beside a number stands its unit, or a sentence that begins with the number, as 300 "samples of each
shape are fitted coarsely". A share is a fraction from 0 to 1. A cosine of normals compares normals of
the target with those of the source laid on it by a map: it is near −1 for a mirror image.

A source is a measurement, a paper, or "chosen". Numbers that studies vary are settings, see
`isomatch.settings`, such as ``search.same_map`` or ``parts.poor_doubt``; the numbers of `verify`
stand in its module.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class MapDistanceParameters:
    """Distances between the images of two maps, from which the maps are the same or differ."""

    # maps whose images are closer on average are the same map up to details; equal to search.same_map
    same_map: float = 0.05  # √area, mean over vertices
    # images of one vertex that are farther apart lie at different places; chosen: more than the
    # error of a right map, less than the width of a limb
    other_place: float = 0.08  # √area
    # maps of parts or of different strategies whose images are farther apart on average are different
    # maps, not variants of one; chosen together on shapes with cuts and holes
    other_map: float = 0.12  # √area, mean over vertices
    # images of one vertex that are farther apart lie on different limbs; twice
    # selection.runner_up_distance
    other_limb: float = 0.3  # √area


@dataclass(frozen=True)
class TiesParameters:
    """Differences between two maps that are too small to decide between them."""

    # among maps that agree with landmarks, one of the wanted orientation is preferred only if its energy
    # is within this factor of the least; chosen: a map that mixes both sides fits worse than either
    same_energy_ratio: float = 1.5  # energy over the least energy
    # a map that is close to the winner on average still differs from it, as it may exchange two limbs, if
    # it sends at least this share of the vertices farther than MAP_DISTANCE.other_limb from where the
    # winner sends them; in the wrong map of horse7–horse14, half of two forelegs, 0.08
    exchanged_share: float = 0.05  # share of vertices
    # a map that exchanges limbs in this way counts as a runner-up if its score is at most this multiple
    # of the winner's; horse7–horse14 (wrong) has 1.002, and none of 111 right maps less than 1.059
    exchanged_ratio: float = 1.05  # score over the winner's
    # landmark errors that differ by less count as equal; chosen: the spacing of the search vertices
    landmark_slack: float = 0.05  # √area
    # a map whose score times this factor is below the winner's counts as a runner-up, whatever the priors
    # say; lab/benchmarks.md, confidence
    clearly_better_ratio: float = 1.15  # score of the winner over the score of the map
    # smaller energies count as equal to this: otherwise one of the symmetric maps between two copies of a
    # mesh would seem better; two triangulations of one surface differ by 0.002 to 0.06,
    # lab/benchmarks.md, symmetry
    energy_noise: float = 0.012  # energy
    # smaller spectral residuals count as equal to this; two triangulations of one surface have 0.26 to
    # 0.35, lab/benchmarks.md, symmetry
    spectral_residual_noise: float = 0.25  # spectral residual
    # smaller scores count as equal to this; two triangulations of one surface have 0.04 to 0.09,
    # lab/benchmarks.md, symmetry
    score_noise: float = 0.04  # score
    # smaller costs count as equal to this; rotations of a flat ring onto itself cost up to 5e-6, maps
    # between poses at least 3e-4
    cost_noise: float = 1e-5  # cost of `verify`
    # descriptors are not compared if maps differ on a smaller share; chosen: ten of 1000 vertices
    min_region_share: float = 0.01  # share of vertices


@dataclass(frozen=True)
class ScreeningParameters:
    """Hypotheses and candidates of complete shapes."""

    # they improve a hypothesis from priors; chosen: most maps change little later
    n_prior_steps: int = 8  # iterations of closest points
    # a round shape keeps this many hypotheses, more than search.n_hypotheses, because residuals say
    # little before curvature is compared; lab/robustness.md, shapes without limbs
    max_hypotheses_without_limbs: int = 40  # hypotheses
    # the functional map of each hypothesis grows through these sizes; steps of 5 as in Melzi et al. 2019
    upsampling_sizes: tuple[int, ...] = (20, 25, 30, 35, 40, 45, 50)  # functions
    # a map is sure if its residuals and its descriptor distance are below this fraction of the bounds
    # outcome.poor_… of a poor map; decisions.md, given up and tried again
    sure_fraction: float = 0.75  # measure over its bound
    max_mirrored: int = 3  # maps of the orientation that is not allowed are refined for comparison; chosen
    # a shape with at least this many rotations is round: no automatic map can be told from the
    # others; discs and balls have 11 to 40, bodies at most 6
    min_rotations_of_round: int = 11  # symmetries
    # two shapes are alike after one motion if the next motion leaves this times its distance or more; bones of
    # one kind have 1.25 to 2.4, teddies 1.0 to 1.2
    min_pose_ratio: float = 1.2  # ratio of distances
    # the same for the nearest reflection; bodies with two like sides have 0.95 to 1.05, mirror images 0.7
    min_mirrored_pose_ratio: float = 0.9  # ratio of distances
    # a shape whose principal axes differ less may be turned by any angle; kneecaps have 1.06 and more
    min_axis_ratio: float = 1.05  # ratio of lengths
    # distances of two shapes below this are equal; chosen: 400 points of a copy with other vertices have 0.02
    min_pose_distance: float = 0.01  # √area, mean, normals included


@dataclass(frozen=True)
class AnchorsParameters:
    """First maps of shapes without limbs, from anchors: points far from each other."""

    # anchors on the source; chosen: three determine an isometry, three more show its errors
    n_anchors: int = 6  # points
    # points of the target among which the images of the anchors are sought; chosen: as for symmetries
    n_candidates: int = 200  # search vertices
    # the distance between the signatures of an anchor and its image has this weight beside errors of
    # distances, in units of the average distance; lab/robustness.md, shapes without limbs
    signature_weight: float = 0.25  # weight
    beam_width: int = 200  # the beam search keeps this many partial assignments; chosen
    # assignments whose images are closer on average are the same; chosen: 0.1 with 80 starts is no better
    same_assignment_distance: float = 0.15  # average distances, mean over anchors
    n_starts: int = 48  # the best assignments become first maps; chosen: as many as extremities give at most
    # a first map is relaxed in this many functions, see `relax_spectrally`; equal to the first of
    # ScreeningParameters.upsampling_sizes
    n_relaxation_functions: int = 20  # functions
    n_relaxation_steps: int = 10  # a first map is relaxed this often; lab/robustness.md, shapes without limbs


@dataclass(frozen=True)
class StrategyParameters:
    """Variants of the shapes, and the choice between strategies."""

    # between shapes with capped holes, the flips of the best hypotheses are tried; mesh018–mesh014
    # with holes has an error of 30 with 3 of them
    n_flipped: int = 6  # hypotheses
    # the shape with more handles is cut along creases and matched again, at most this often;
    # decisions.md, strategies that pay
    max_crease_cuts: int = 3  # times
    # a crease is cut as a self-contact if the images of its two sides are farther apart; chosen
    self_contact_distance: float = 0.1  # √area
    # a map of a part ends the search if its doubt is at most this fraction of the bound of a sure map; a
    # mirrored map had 0.94
    final_doubt_fraction: float = 0.5  # doubt over parts.poor_doubt


@dataclass(frozen=True)
class ElasticSearchParameters:
    """First maps of shapes whose limbs stretch, and their coarse fit."""

    # those without another source: chosen together on pairs of animals

    n_coarse_samples: int = 300  # samples of each shape are fitted coarsely; they suffice for 30 functions
    signature_weight: float = 0.05  # signatures have this weight beside canonical coordinates in the fit
    normal_weight: float = 0.05  # normals have this weight beside canonical coordinates in the coarse fit
    landmark_weight: float = 30.0  # a landmark counts as much as this many samples; chosen
    n_anchors: int = 12  # points of the source are assigned to candidates, points of the target
    n_candidates: int = 150  # samples of the target, 0.09 √area apart, are candidates beside extremities
    beam_width: int = 600  # partial assignments are kept by the beam search
    # assignments whose images are closer on average are the same; as for parts
    same_assignment_distance: float = 0.12  # average distances, mean over anchors
    # a larger error of a distance costs no more than this one: `most` of `IntervalCost`
    max_distance_cost: float = 0.6  # average distances
    # the error of a distance is divided by the distance plus this, so that short distances do not count
    # most: `soft` of `IntervalCost`
    short_distance: float = 0.2  # average distances
    # the remoteness of a point is the share of the area that is less remote; the difference between an
    # anchor and its image has this weight in the assignment
    remoteness_weight: float = 0.5  # weight
    # the difference between the signatures of an anchor and its image, over the mean of all differences,
    # has this weight in the assignment
    anchor_signature_weight: float = 0.1  # weight
    # an anchor and its image should be equally far from their mirror images; the difference of these
    # distances has this weight in the assignment; chosen
    mirror_distance_weight: float = 1.0  # weight
    # a longer distance from the mirror image counts as this; chosen
    max_mirror_distance: float = 1.0  # average distances
    # where both shapes have mirror images, this number of further starts ignores them; decisions.md,
    # elastic starts
    n_plain_starts: int = 30  # starts
    # a map of a shape to its mirror image gives mirror images only if its residual is at most this
    max_mirror_spectral_residual: float = 0.26  # spectral residual
    # such a map is left out if its normals, compared with the mirror image, have a lower cosine
    min_mirror_orientation: float = 0.5  # cosine, mean
    n_mirror_starts: int = 24  # assignments give first maps of a shape to its mirror image; chosen
    # between a shape and its mirror image, distances that differ by this share cost little; chosen: less
    # than elastic.distance_tolerance, because both are nearly isometric
    forgiven_of_mirror: float = 0.1  # share of the distance
    # maps to the mirror image that are kept after each coarse step; decisions.md, elastic choice
    n_mirror_maps_kept: tuple[int, ...] = (12, 4, 4)  # maps
    # coarse fits that are kept after each step; the last are bent; decisions.md, elastic choice
    n_maps_kept: tuple[int, ...] = (90, 40, 8)  # maps
    # the score of a map grows with its asymmetry plus this, because shapes are asymmetric as well
    asymmetry_unit: float = 0.1  # distance in canonical coordinates
    asymmetry_exponent: float = 0.25  # asymmetry, plus its unit, counts with this power in the score
    # a coarse fit with a lower cosine of normals is dropped; equal to selection.orientation_threshold
    min_orientation: float = 0.3  # cosine, mean


@dataclass(frozen=True)
class ElasticFitParameters:
    """The bending of shapes whose limbs stretch, and the images taken from the bent shapes."""

    # those without another source: decisions.md, elastic steps

    # after half of the lengths of elastic.bending, a map is given up if its score exceeds this multiple
    hopeless_ratio: float = 1.5  # score over the least score
    # normals have this weight beside canonical coordinates in the last smooth fit
    fine_normal_weight: float = 0.15  # weight
    # with an initial map, the map that agrees best with it wins if its cost is at most this multiple of
    # the least
    prior_tie_ratio: float = 1.1  # cost over the least cost
    # the final bending skips the first of elastic.bending, by which the winner was already bent
    n_skipped_lengths: int = 2  # lengths
    # then the winner is bent at full resolution, and resists stretching at these lengths
    full_lengths: tuple[float, ...] = (0.05, 0.04, 0.03)  # √area
    # weight of normals beside positions when the bent source gives images: they separate close sheets
    normal_weight: float = 0.05  # √area
    # positions of the bent shapes, in √area, have this weight beside the joint coordinates of functions and
    # signatures; from 10 to 20 nothing changes, without positions the error is 3.16, not 2.9
    position_weight: float = 15.0  # 1/√area
    # The cost by `verify` is multiplied by this power of the score, because both measure the bending with
    # independent errors. From 0.1 to 1.5, all values select the same maps in 23 pairs; 0 selects a wrong map
    # in one of them, dog_02–cow_03.
    score_exponent: float = 0.5  # exponent
    # no elastic map is sought if an isometric map that fits stretches the edges of both shapes less when
    # it bends one onto the other
    max_isometric_stretch: float = 0.085  # mean |log| of length over length at rest
    # an isometric map that wins against elastic ones is kept as it is below this stretch if it fits,
    # otherwise below max_isometric_stretch
    max_isometric_stretch_of_winner: float = 0.105  # mean |log| of length over length at rest


@dataclass(frozen=True)
class PartUnitParameters:
    """A part and a whole in common units."""

    # those without another source: chosen together on shapes with cuts and holes

    # a larger error of a distance costs no more than this one: `most` of `IntervalCost`
    max_distance_cost: float = 0.6  # √area of the part
    # the error of a distance is divided by the distance plus this, so that short distances do not count
    # most: `soft` of `IntervalCost`
    short_distance: float = 0.18  # √area of the part
    n_boundary_vertices: int = 60  # samples of the boundary are points at which paths may leave the part
    n_anchors: int = 50  # points of the part are anchors, beside its landmarks; their images make up a start
    # if fewer distances between anchors are known, scale = "auto" keeps the unit of the files
    min_known_share: float = 0.07  # share of the pairs of anchors
    unit_step_ratio: float = 1.1  # consecutive units that are tried have this ratio
    # the smallest part if the units of the files say nothing; single views show 16 % and more
    min_area_share: float = 0.1  # share of the whole's area
    # units that are tried differ from the unit of the files at most by this factor; remeshed bodies of
    # one person in FAUST differ by up to 1.2
    max_unit_ratio: float = 1.4  # ratio
    # a larger unit is lowered to this: parts are no larger than the whole, up to errors of measurement
    max_unit: float = 1.05  # √area of the part over √area of the whole
    unit_spacing: float = 0.02  # units are rounded to a grid of this spacing in the logarithm
    # a distance counts as known if its lower bound is at least this fraction of its upper bound
    known_ratio: float = 0.97  # lower over upper bound
    min_distance: float = 0.3  # √area of the part: shorter distances do not measure the unit
    min_known_distances: int = 40  # known distances are needed to measure the unit; with fewer, it stays
    radius_step_ratio: float = 1.25  # ball signatures are interpolated between radii of this ratio
    n_energies: int = 20  # energies, evenly spaced logarithms of eigenvalues, sample the wave signatures
    # near a boundary, a wave signature counts less, down to 0 at the boundary; this far away, it has 63 %
    # of its weight
    boundary_reach: float = 4.0  # 1/√eigenvalue of its energy
    # the same for the curvature of a surface smoothed to some functions
    curvature_boundary_reach: float = 3.0  # 1/√(last eigenvalue of the functions)


@dataclass(frozen=True)
class PartSearchParameters:
    """First maps of a part."""

    # those without another source: chosen together on shapes with cuts and holes

    n_assigned_anchors: int = 16  # anchors are assigned to points of the whole by the beam search
    n_candidates: int = 300  # samples of the whole are candidates, beside its extremities
    beam_width: int = 1000  # partial assignments are kept by the beam search
    # with landmarks, assignments whose images are closer on average are the same; chosen between the
    # right limbs of a twisted body
    same_assignment_with_landmarks: float = 0.04  # √area, mean over anchors
    n_trilaterated: int = 80  # assignments of least cost are completed by trilateration
    n_starts: int = 16  # completed assignments of least cost become starts
    # starts, together with those composed with maps of the whole onto itself
    n_starts_with_composed: int = 24  # starts
    signature_weight: float = 0.25  # differences of signatures have this weight in the assignment
    # areas of balls of these radii around anchors and images are compared; factors of about √2
    ball_radii: tuple[float, ...] = (0.1, 0.15, 0.22, 0.32, 0.45, 0.65, 0.9)  # √area of the whole
    # the area of a ball may leave the bounds for the ball of an anchor by this share at no cost
    ball_tolerance: float = 0.15  # share of the bound
    # a larger error of the area of a ball, over the mean area of such balls, costs no more than this
    max_ball_cost: float = 0.7  # ratio of areas
    # a unit that differs from the unit of the files costs this × the squared logarithm of the
    # ratio; chosen on single views, not measured
    unit_change_weight: float = 0.05  # cost
    n_roots: int = 24  # regions are grown from this many anchors; chosen with all below on single views
    n_root_candidates: int = 24  # candidates, the most alike, are tried for each root; chosen on single views
    max_grown_regions: int = 60  # regions of most gain are completed; chosen on single views
    n_starts_from_regions: int = 12  # starts are made from regions; chosen on single views
    # in a region, a distance weighs 1 / (this + distance); chosen on single views
    near_distance: float = 0.2  # √area of the whole
    # an anchor whose distances cost this on average adds nothing to a region; chosen on single views
    max_distance_cost: float = 0.3  # cost, mean
    # weight of the descriptor distance of an anchor, less the neutral one, where a perfect agreement of
    # distances counts 1; chosen on single views
    descriptor_gain: float = 2.0  # weight
    # a descriptor distance that speaks neither for an image nor against it; right images have about 0.4,
    # random ones about 0.8
    neutral_descriptor_distance: float = 0.6  # descriptor distance
    neutral_weight: float = 1.0  # the neutral value counts as this many known radii; chosen on single views


@dataclass(frozen=True)
class PartFitParameters:
    """The refinement of maps of a part."""

    # those without another source: chosen together on shapes with cuts and holes

    # functions of the part are used up to this multiple of the last eigenvalue used on the whole, because
    # a boundary needs more functions than the share of the area suggests
    function_ratio: float = 1.75  # ratio of eigenvalues
    extra_functions: int = 3  # functions of the part are used beyond that multiple
    # distances from landmarks are coordinates, cut off to this; lab/robustness.md, parts
    landmark_reach: float = 0.3  # √area
    # the unit of a map is measured by distances that are longer than this, and shorter than the next
    min_near_distance: float = 0.08  # √area of the part
    max_near_distance: float = 0.3  # √area of the part: longer distances do not measure the unit of a map
    n_rough_vertices: int = 500  # vertices of the part are mapped by the rough refinement
    rough_sizes: tuple[int, ...] = (20, 40, 70)  # functions of the whole, for each rough step
    # the cosine of normals of a rough map is measured on the whole smoothed to this many functions
    n_rough_normal_functions: int = 40  # functions of the whole
    n_fine_normal_functions: int = 60  # functions of the whole: the same for a fine map
    # the images of the anchors under a fine map are computed through this many functions
    n_anchor_functions: int = 200  # functions of the whole
    # the part is bent by each of the best maps, and the map refined from the bent part, this often;
    # lab/robustness.md, parts
    n_bending_rounds: int = 2  # times
    # stress counts with this power in the cost; 0.15 to 0.4 choose alike, decisions.md, cost of a part
    stress_exponent: float = 0.25  # exponent
    # the rough cost is divided by the root of the cosine of normals; lower cosines count as this
    min_orientation: float = 0.1  # cosine, mean
    n_composed: int = 4  # rough maps of least cost are composed with maps of the whole onto itself
    n_contenders: int = 8  # rough maps of least cost are refined to the end
    # the best map is bent at full resolution by the last of parts.bending; with 3 and with 10, four
    # parts have no smaller errors
    n_final_lengths: int = 5  # lengths


@dataclass(frozen=True)
class SeedsParameters:
    """The search for regions that two parts have in common.

    Lengths are in the unit of both parts, about √area of the body that they are parts of.
    """

    # those without another source: chosen together on pairs of parts of SHREC'16

    n_samples: int = 600  # vertices of each part, at most, are samples, which are mapped; chosen
    max_landmarks: int = 50  # landmarks are used in the search; the refinement uses all
    # the unit of both parts, about √area of the body, is the root mean square of their √area times this
    body_ratio: float = 1.25  # ratio
    # if √area differs by a larger factor in the units of the files, areas are taken as equal
    max_length_ratio: float = 4.0  # ratio of √area
    # radii of the balls that are compared: smaller ones are noise, larger ones cross the boundary
    moment_radii: tuple[float, ...] = (0.06, 0.09, 0.13, 0.18, 0.24)  # lengths
    max_overhang: float = 0.02  # length by which a ball may cross a boundary and still count
    # a descriptor distance of candidates that speaks neither for an image nor against it
    neutral_moment_distance: float = 0.25  # distance
    neutral_moment_weight: float = 1.5  # the neutral distance counts as much as this many radii
    # a difference of the areas of balls that speaks neither for an image nor against it
    neutral_area_difference: float = 0.15  # logarithm of areas
    max_area_difference: float = 1.0  # logarithm of areas: a larger difference counts as this
    neutral_area_weight: float = 2.0  # the neutral difference counts as much as this many areas
    moment_weight: float = 0.6  # descriptor distances have this weight in the cost of a candidate
    area_weight: float = 0.5  # differences between areas of balls have this weight in the cost of a candidate
    max_descriptor_distance: float = 2.0  # standard deviations: a larger difference of values counts as this
    neutral_descriptor_distance: float = 0.5  # is the descriptor distance where nothing is known
    neutral_descriptor_weight: float = 0.5  # the neutral distance counts as much as this many radii
    smoothing_length: float = 0.12  # length: a neighbour weighs exp(−(distance / this)²) in local means
    # ranks of samples of the target begin here and not at 0, so that the surprise of the best is finite
    rank_offset: int = 3  # samples
    # the surprise of an image is −log of its rank, as a share of the samples; a mean surprise below this
    # counts as none, because for random images it is 1
    chance_surprise: float = 1.2  # −log of ranks, mean
    # a sample must have an image if what the other part shows reaches beyond it by more than this
    min_visible_margin: float = 0.05  # length
    # a sample of the target is not covered if it is farther from all images
    uncovered_distance: float = 0.08  # length
    # the area that should have an image and has none is subtracted from the evidence with this weight
    left_out_weight: float = 1.0  # weight
    n_neighbours: int = 8  # nearest samples of each sample form the triangles whose winding is compared
    n_anchors: int = 56  # samples of the source are the points over which regions grow
    n_candidates: int = 300  # samples of the target may be images of an anchor
    n_roots: int = 40  # anchors, the deepest inside, are roots from which regions grow
    n_root_candidates: int = 30  # candidates, those of least cost, are tried for each root
    near_distance: float = 0.2  # length: a distance d weighs 1 / (this + d), `near` of `grow_regions`
    max_distance_cost: float = 0.09  # cost, mean: an anchor that costs more gets no image, see `grow_regions`
    beam_width: int = 4  # variants of each region are kept while it grows, see `grow_regions`
    same_variant_distance: float = 0.12  # length: images of an anchor in two variants are farther apart
    # regions are grown with each of these weights of the cost of a candidate by descriptors and areas,
    # where a perfect agreement of its distances counts 1
    descriptor_gains: tuple[float, ...] = (2.0, 0.5)  # weights
    same_region_distance: float = 0.1  # length: regions whose images are closer on average are the same
    min_common_anchors: int = 3  # anchors: regions that have fewer in common are different
    # maps are the same, if they are close, only if both have more than this share of the samples of one
    same_map_overlap: float = 0.7  # share of samples
    max_screened: int = 400  # regions of most gain, at most, are extended to more samples
    # in each step regions are extended to a number of samples, in a number of rounds, and then a number
    # of regions is kept
    extensions: tuple[tuple[int, int, int], ...] = ((150, 1, 80), (300, 2, 30))  # samples, rounds, regions
    max_sample_cost: float = 0.06  # cost, mean: a sample that costs more does not belong to a region
    # the same with landmarks, which leave little that can be wrong
    max_sample_cost_with_landmarks: float = 0.12  # cost, mean
    # a sample whose image maps back to a point farther from it does not belong to a region
    max_round_trip: float = 0.12  # length
    trilateration_distance: float = 0.15  # length: a distance d weighs 1 / (this + d)², see `trilaterate`
    n_first_anchors: int = 50  # samples of a region, at most, place the others in regions of some samples
    n_next_anchors: int = 90  # samples of a region, at most, place the others in regions of all samples
    min_accepted: int = 8  # samples: a smaller region is dropped while it is extended
    min_samples: int = 25  # samples: a smaller region is dropped in the end
    min_orientation: float = 0.2  # mean sign: a region whose triangles have less is dropped as a mirror image


@dataclass(frozen=True)
class TwoPartsParameters:
    """The refinement of regions that two parts have in common."""

    # those without another source: chosen together on pairs of parts of SHREC'16

    # in each round, a number of the best regions are grown again, with samples up to a cost, and are
    # refined, roughly if the third is true
    rounds: tuple[tuple[int, float, bool], ...] = ((4, 0.05, True), (2, 0.045, False))  # regions, …
    region_margin: float = 0.05  # length by which a region reaches beyond its samples
    # a landmark holds if its image is less than this far from its target
    landmark_tolerance: float = 0.1  # √area of the target
    max_descriptor_distance: float = 0.6  # a sample that looks less like its image does not place others
    # a vertex of a bent region is in common if its distance from the target is at most this
    surface_tolerance: float = 0.04  # √area of the target
    # the same where the nearest point lies on the boundary of the target
    boundary_tolerance: float = 0.02  # √area of the target
    n_rough_functions: int = 100  # functions are enough: rough regions are ranked as full ones are
    n_final_lengths: int = 3  # lengths, the last of parts.bending, bend the best region in full


@dataclass(frozen=True)
class ComponentsParameters:
    """Shapes of several components."""

    # the largest components of each shape, at most this number, are tried as partners of the largest;
    # chosen: nine matches at most
    max_runners_up: int = 3  # components
    # a component that is at least so large is tried as a partner of the largest; brain hemispheres
    # pass, clothes do not
    min_runner_up_area: float = 0.5  # area over the area of the largest component
    n_eigenvalues: int = 20  # the logarithms of the first eigenvalues are compared; chosen
    # partners are tried if their difference, of the logarithms of eigenvalues, is at most this more than
    # the least; poses differ by 0.03, two halves by 0.13
    same_spectrum_difference: float = 0.1  # difference of logarithms, mean
    # a component that is carried along rigidly is matched so if it then lies this close to its partner;
    # half the spacing of the samples
    same_place_distance: float = 0.02  # √area, mean
    # components are no partners if one is carried farther from the other; two eyes differ by 0.9
    max_carried_distance: float = 0.7  # √area of the partner × (1 + its gap from the carrier)
    # components whose sizes differ by a larger factor are no partners; as the unit of a part
    max_length_ratio: float = 1.4  # ratio of √area
    # a component that is closer to what carries it is held by it, and cannot turn by itself; chosen
    max_held_distance: float = 1.0  # √area of the component


@dataclass(frozen=True)
class HeldLandmarksParameters:
    """Maps that are bent until landmarks hold."""

    # a landmark moves a bump around it, this many times as wide as the shift: a steeper one turns faces
    # over; docs/priors.md, exact landmarks: 1.5 to 3 alike
    width_per_shift: float = 2.0  # width over the distance moved
    min_width: float = 0.1  # √area: a bump is at least this wide; docs/priors.md
    max_width: float = 0.2  # √area: a bump is at most this wide; docs/priors.md
    # smaller weights become 0, so that vertices far from landmarks do not move at all; chosen
    min_weight: float = 0.02  # weight
    # landmarks too close to be separated move together: smaller singular values of the kernel between
    # landmarks are dropped; chosen
    min_singular_value: float = 0.1  # singular value
    function_weight: float = 0.3  # √area: functions have this weight beside positions; chosen
    n_functions: int = 20  # functions separate sheets that are close in space; chosen


@dataclass(frozen=True)
class ErrorsParameters:
    """Expected errors, regions of doubt and questions."""

    # the chance of a map falls with this power of its score; chosen: one runner-up in ten is right
    # at the bound of a tie
    runner_up_exponent: float = 10.0  # exponent of the ratio of scores
    # expected errors are smoothed over this radius; 0.05 to 0.14 were tried by
    # isomatch_lab.studies.vertex_confidence
    smoothing_radius: float = 0.08  # √area
    # factor by which local errors are multiplied, so that their mean is the mean error of faust_r and
    # creatures; isomatch_lab.studies.vertex_confidence
    error_scale: float = 0.32  # factor
    min_reason_share: float = 0.25  # a reason is given for a region if it holds on this share of it; chosen
    min_known_share: float = 0.5  # the mean of a neighbourhood is known if this share of it is known; chosen
    min_region_area: float = 0.005  # share of the surface: smaller regions are not named; chosen: half a hand
    # vertices that look unlike their images have this error; lab/benchmarks.md, regions of doubt
    unlike_error: float = 0.5  # mean error over √(area of the region)
    max_named_landmarks: int = 5  # contradicted landmarks, the worst, are named in a note; chosen
    # the cosine of normals is measured on surfaces smoothed to this many functions; chosen with
    # outcome.poor_orientation
    n_normal_functions: int = 60  # functions
    n_question_vertices: int = 400  # vertices, far apart, are those that questions may ask for; chosen
    # a question separates two maps if their images are at least this far apart; chosen: twice a hand
    other_place: float = 0.1  # √area of the target
    question_distance: float = 0.3  # √area of the source: two questions that are closer say less; chosen


@dataclass(frozen=True)
class ExchangeParameters:
    """Maps found from the target, and regions that a map takes from others.

    See decisions.md, both sides.
    """

    # of the maps that tie in a search from the target, this number contends; chosen
    max_maps_from_target: int = 2  # maps
    # images of one vertex that are farther apart lie at different places; chosen: two thirds of a limb
    other_place: float = 0.1  # √area
    min_region_area: float = 0.01  # share of the area: a smaller region is not exchanged; chosen
    # a larger region makes another map, which is verified as a whole; chosen
    max_region_area: float = 0.4  # share of the area
    max_regions: int = 6  # regions, the largest that differ from another map, are tried; chosen
    # a region is tried if its descriptor distance under the other map is at most this multiple of its
    # distance under the present one; right limbs have 1.09, hopeless ones 2.7
    max_unlikeness_ratio: float = 1.25  # ratio of mean descriptor distances
    # an exchange is kept if the cost after it is at most this multiple of the cost before; chosen
    max_cost_ratio: float = 0.97  # cost over cost
    max_exchanges: int = 4  # exchanges are made, one after the other; chosen
    n_coarse_vertices: int = 400  # vertices are bent when a region is first verified; chosen
    n_compared_vertices: int = 60  # vertices of a region have their images compared; chosen
    # two regions are exchanged together if more than this share of the images of one lies within half of
    # other_place of images of the other; chosen
    min_overlap: float = 0.3  # share of the images


@dataclass(frozen=True)
class SymmetricParameters:
    """Maps composed with near-symmetries, which may fit as well as the winner.

    See decisions.md, individuals.
    """

    # a composed map is refined if its energy is at most this multiple of the winner's; in 60 pairs of
    # SHREC'07, those that fit as well have 0.97 to 1.26, and 1.4 in two bodies with a bump
    max_energy_ratio: float = 1.75  # energy over the winner's
    # it is refined to the end if its score after the first round is at most this multiple of the winner's;
    # those that fit as well have 0.97 to 1.12, of people front to back 1.12 to 1.34
    max_first_score_ratio: float = 1.2  # score over the winner's, both after the first round
    # a composed map turns the whole shape if it is farther from the winner; half turns of ants 0.24,
    # trunks alone to 0.2
    min_turned_distance: float = 0.2  # √area, mean over vertices
    max_maps: int = 4  # composed maps, those of least energy, are refined; chosen
    # a composed map fits as well as the winner up to this ratio; right maps cost at most 1.46 times as
    # much as half turns of ants, wrong maps of animals at least 1.59 times as much as right ones
    max_cost_ratio: float = 1.5  # cost of `verify` over the winner's


@dataclass(frozen=True)
class JudgingParameters:
    """A map of any tool beside a reference, see `judge`."""

    # a map agrees with the reference if it sends at most this share elsewhere; regions that are smaller
    # are not named; chosen: a hand
    min_region_area: float = 0.01  # share of the area
    # a map that agrees with the reference is right up to this ratio, and doubtful above it; right maps
    # known at 300 points have 2.6 to 21
    max_right_ratio: float = 25.0  # cost over the cost of the reference
    # a map that sends a region elsewhere is wrong above this ratio, and doubtful up to it; a limb shifted
    # by half its width has 1.33
    min_wrong_ratio: float = 1.25  # cost over the cost of the reference
    # a map with fewer different images is coarse, and only the vertex nearest to each image is
    # judged; chosen
    coarse_image_share: float = 0.25  # different images over vertices
    # a map exchanges sides if it is so much nearer to the reference composed with a symmetry; chosen
    exchanged_ratio: float = 0.5  # mean distance over the mean distance from the reference
    max_regions: int = 5  # regions, the largest, are named; chosen


@dataclass(frozen=True)
class SpectralParameters:
    """The refinements of the paper."""

    # a functional map grows from each of these sizes, and the best one is taken; lab/paper.md
    first_sizes: tuple[int, ...] = (15, 20, 30, 40)  # functions
    choice_size: int = 50  # functions: when all have this size, the best is chosen; chosen: equal to the rank
    size_step: int = 5  # functions are added in each step; Melzi et al. 2019
    # the plain alignment of descriptors takes this many iterations on the refinement vertices, then
    # two on all vertices; chosen
    n_distance_steps: int = 15  # iterations


MAP_DISTANCE = MapDistanceParameters()
TIES = TiesParameters()
SCREENING = ScreeningParameters()
ANCHORS = AnchorsParameters()
STRATEGY = StrategyParameters()
ELASTIC_SEARCH = ElasticSearchParameters()
ELASTIC_FIT = ElasticFitParameters()
PART_UNIT = PartUnitParameters()
PART_SEARCH = PartSearchParameters()
PART_FIT = PartFitParameters()
SEEDS = SeedsParameters()
TWO_PARTS = TwoPartsParameters()
COMPONENTS = ComponentsParameters()
HELD_LANDMARKS = HeldLandmarksParameters()
ERRORS = ErrorsParameters()
EXCHANGE = ExchangeParameters()
JUDGING = JudgingParameters()
SYMMETRIC = SymmetricParameters()
SPECTRAL = SpectralParameters()
