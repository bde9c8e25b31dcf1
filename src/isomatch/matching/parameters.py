"""The numbers of matching that no study moves and no user sets: each with its unit, what it means, and its source.

The source is a measurement, a paper, or "chosen". What a study moves is in `isomatch.settings`; the numbers of
`verify` stand beside it.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SameMapParameters:
    """Distances from which two maps, or their images of a vertex, differ; of one scale where values agree."""

    same_map: float = 0.05  # √area, mean: maps nearer than this are one in the large; that of search.same_map
    # images of a vertex farther apart are in different places; chosen: above the errors of right maps, below a limb
    elsewhere: float = 0.08  # √area
    # maps of a part, of two parts or of two strategies that are farther apart differ; without it, all would be
    # variants of one; chosen together on cuts and holes
    other_map: float = 0.12  # √area, mean
    # a vertex is sent from one limb to another; twice selection.runner_up_distance
    other_limb: float = 0.3  # √area


@dataclass(frozen=True)
class TiesParameters:
    """What counts for nothing between two maps."""

    # orientation decides up to this among maps that agree with landmarks, as a mixture of both sides fits worse than
    # either; chosen
    same_energy: float = 1.5  # energy over the least
    # two limbs may be exchanged if so many are sent far away from where the winner sends them; horse7–horse14 (wrong)
    # 0.08, half of its two forelegs
    elsewhere_share: float = 0.05  # share of vertices
    # a map that exchanges limbs ties up to this; horse7–horse14 (wrong) 1.002; of 111 right maps none below 1.059
    elsewhere_tie: float = 1.05  # score over the winner's
    # a difference of landmark errors up to this counts for nothing; chosen: that of search vertices
    landmark_slack: float = 0.05  # √area
    # a map that is so much better counts whatever priors say; lab/benchmarks.md, confidence
    clearly_better: float = 1.15  # ratio of scores
    # energies below are equal, or one of the symmetric maps between two copies of a mesh would seem better; two
    # triangulations of one surface differ by 0.002 to 0.06; lab/benchmarks.md, symmetry
    energy_noise: float = 0.012  # energy
    # the same of spectral residuals; 0.26 to 0.35; lab/benchmarks.md, symmetry
    spectral_residual_noise: float = 0.25  # spectral residual
    score_noise: float = 0.04  # score: the same of scores; 0.04 to 0.09; lab/benchmarks.md, symmetry
    # costs below are equal; rotations of a flat ring onto itself cost up to 5e-6, maps between poses from 3e-4
    cost_noise: float = 1e-5  # cost of `verify`
    least_region: float = 0.01  # share of vertices: a region below says nothing; chosen: ten of 1000


@dataclass(frozen=True)
class ScreeningParameters:
    """Hypotheses and candidates of complete shapes."""

    # closest points from priors take so many; most maps change little afterwards; chosen
    prior_steps: int = 8  # iterations
    # so many are kept of round shapes, whose residuals tell little before curvature is compared;
    # lab/robustness.md, shapes without limbs
    most_without_limbs: int = 40  # hypotheses
    # a hypothesis is upsampled by these; steps of 5 as in Melzi et al. 2019
    sizes: tuple[int, ...] = (20, 25, 30, 35, 40, 45, 50)  # functions
    sure: float = (
        0.75  # share of the bounds of a poor map: a map below is sure; decisions.md, given up and tried again
    )
    most_mirrored: int = 3  # maps: so many of the orientation that is not allowed are refined; chosen
    # shapes with so many are round, and no automatic map is told from the others; discs and balls 11 to 40, bodies to
    # 6
    many_rotations: int = 11  # symmetries


@dataclass(frozen=True)
class AnchorsParameters:
    """First maps of shapes without limbs, from points far from each other."""

    # points of the source that are assigned: three determine an isometry, three more its errors; chosen
    n_anchors: int = 6  # points
    # their images are sought among so many of the target; chosen: as for symmetries
    n_candidates: int = 200  # search vertices
    # signatures beside distances; lab/robustness.md, shapes without limbs
    signature_weight: float = 0.25  # weight
    beam: int = 200  # partial assignments: so many are kept; chosen
    # assignments that are farther apart differ; chosen: 0.1 with 80 starts is no better
    apart: float = 0.15  # average distances, mean
    n_starts: int = 48  # assignments: the best become first maps; chosen: of the most that extremities give
    # by these signatures move a first map; the first before a candidate is made
    slide_functions: int = 20  # functions
    # signatures move a first map so often; lab/robustness.md, shapes without limbs
    slide_steps: int = 10  # steps


@dataclass(frozen=True)
class StrategyParameters:
    """Variants of the shapes, and the choice between strategies."""

    # flips of the best are tried between capped shapes; of mesh018–mesh014 with holes the error is 30 with 3
    flipped: int = 6  # hypotheses
    creased: int = (
        3  # times: a shape is cut along its creases, and matched; decisions.md, strategies that pay
    )
    # a crease is a self-contact if the images of its sides are farther apart; chosen
    torn: float = 0.1  # √area
    # the map of a part with less doubt needs no other strategy; that of a mirror image had 0.94
    little_doubt: float = 0.5  # share of parts.poor_doubt


@dataclass(frozen=True)
class ElasticSearchParameters:
    """First maps of shapes whose limbs stretch, and their coarse fit."""

    # those without another source: chosen together on pairs of animals

    n_coarse: int = 300  # samples: of each shape in the coarse fit; enough for 30 functions
    signature_weight: float = 0.05  # weight: signatures beside canonical coordinates
    normal_weight: float = 0.05  # weight: normals in the coarse fit
    landmark_weight: float = 30.0  # samples: a landmark counts as so many; chosen
    n_anchors: int = 12  # points: points of the source that are assigned
    n_candidates: int = 150  # points: their images are sought among so many of the target, 0.09 apart
    beam: int = 600  # partial assignments: so many are kept
    apart: float = 0.12  # average distances, mean: assignments that are farther apart differ; as of parts
    most_cost: float = 0.6  # average distances: a distance costs no more, see `IntervalCost`
    soft: float = 0.2  # average distances: short distances count less, see `IntervalCost`
    remoteness_cost: float = 0.5  # weight: share of the area that is less remote
    signature_cost: float = 0.1  # weight: signatures of anchors
    aside_cost: float = 1.0  # weight: distances from mirror images; chosen
    most_aside: float = 1.0  # average distances: such distances count no more; chosen
    # so many do not compare them, where both shapes have mirror images; decisions.md, elastic starts
    n_plain_starts: int = 30  # starts
    # at most, of a map of a shape to itself that gives mirror images
    mirror_spectral_residual: float = 0.26  # spectral residual
    mirror_orientation: float = 0.5  # cosine, mean: at least, of the same
    mirror_starts: int = 24  # starts: first maps of a shape to itself; chosen
    # as elastic.forgiven, for a shape is nearly isometric to its mirror image; chosen
    mirror_forgiven: float = 0.1  # share
    # of these so many go on after each step; decisions.md, elastic choice
    mirror_followed: tuple[int, ...] = (12, 4, 4)  # maps
    # so many coarse fits go on after each step; the last are bent, with maps from elsewhere; decisions.md, elastic choice
    followed: tuple[int, ...] = (90, 40, 8)  # maps
    asymmetry_unit: float = 0.1  # canonical coordinates: asymmetry below is that of the shapes themselves
    asymmetry_exponent: float = 0.25  # exponent: of asymmetry beside the spectral residual
    # a coarse fit goes on from here; selection.orientation_threshold
    least_orientation: float = 0.3  # cosine, mean


@dataclass(frozen=True)
class ElasticFitParameters:
    """The bending of shapes whose limbs stretch, and what is read off."""

    # those without another source: decisions.md, elastic steps

    hopeless: float = 1.5  # score over the least: a map is not bent further from here
    # normals beside canonical coordinates, in the last step; decisions.md, elastic steps
    fine_normal_weight: float = 0.15  # weight
    priored_tie: float = 1.1  # score over the least: a map that agrees with the priors wins up to this
    # the first of elastic.bending, which move large pieces, as the winner was bent by them before
    skipped: int = 2  # lengths
    # the winner is bent in full by these, after those
    full_lengths: tuple[float, ...] = (0.05, 0.04, 0.03)  # √area
    # normals where images are read off the bent source: they only tell sheets apart
    read_unit: float = 0.05  # √area
    lying_weight: float = 15.0  # weight: where the bent shapes lie, beside joint coordinates
    # an ordinary map stays what it is if the shapes it bends stretch less
    nearly_isometric: float = 0.085  # stretch
    fits_isometric: float = 0.105  # stretch: so does one that fits, if it wins


@dataclass(frozen=True)
class PartUnitParameters:
    """A part and a whole in common units."""

    # those without another source: chosen together on cuts and holes

    most_cost: float = 0.6  # √area of the part: a distance costs no more, see `IntervalCost`
    soft: float = 0.18  # √area of the part: short distances count less, see `IntervalCost`
    n_posts: int = 60  # boundary vertices: paths may leave the part through these
    n_anchors: int = 50  # distance columns: a start consists of the images of these
    least_trusted: float = 0.07  # share of known distances: scale = "auto" keeps the unit of the files below
    step: float = 1.1  # ratio: of the units that are tried
    # where the units of the files say nothing; views show 16 % and more
    least_share: float = 0.1  # share of the whole's area
    # of the unit to that of the files; FAUST remeshed: bodies of one person differ by up to 1.2
    largest_change: float = 1.4  # ratio
    # a part is no larger than the whole, except for errors of the measurement
    largest: float = 1.05  # √area of the whole
    grid: float = 0.02  # logarithm of a ratio: units farther apart are told apart
    trusted: float = 0.97  # lower over upper bound: a distance counts as known from here
    long: float = 0.3  # √area of the part: shorter distances do not measure the unit
    fewest_known: int = 40  # distances: so many do
    radius_step: float = 1.25  # ratio: of the radii between which ball signatures are interpolated
    n_energies: int = 20  # energies: of the wave signatures
    reach: float = 4.0  # 1/√eigenvalue: a function feels a boundary at this distance
    curvature_reach: float = 3.0  # 1/√eigenvalue: so does the curvature of a smoothed surface


@dataclass(frozen=True)
class PartSearchParameters:
    """First maps of a part."""

    n_placed: int = 16  # anchors: the beam search assigns so many; chosen together on cuts and holes
    # images are sought among so many; chosen together on cuts and holes
    n_candidates: int = 300  # points of the whole
    beam: int = 1000  # partial assignments: so many are kept; chosen together on cuts and holes
    # assignments with landmarks that are farther apart differ; chosen on a twisted body between right limbs
    led_apart: float = 0.04  # √area, mean
    n_trilaterated: int = 80  # assignments: the best are completed; chosen together on cuts and holes
    n_starts: int = 16  # assignments: the best of these are starts; chosen together on cuts and holes
    # with those composed with maps of the whole onto itself; chosen together on cuts and holes
    n_mirrored: int = 24  # starts
    signature_cost: float = 0.25  # weight: signatures of anchors; chosen together on cuts and holes
    # of the balls whose areas are compared, by factors of about √2; chosen together on cuts and holes
    radii: tuple[float, ...] = (0.1, 0.15, 0.22, 0.32, 0.45, 0.65, 0.9)  # √area
    ball_tolerance: float = 0.15  # share: of areas of balls; chosen together on cuts and holes
    most_ball: float = 0.7  # cost: an area costs no more; chosen together on cuts and holes
    # times the square of the logarithm of the unit over that of the files; chosen on views, not measured
    unit_cost: float = 0.05  # cost
    # regions grow from these; chosen on single views, as those below, not one by one
    n_roots: int = 24  # anchors
    n_likely: int = 24  # candidates: of each of them; chosen on single views
    most_grown: int = 60  # regions: so many are completed; chosen on single views
    n_grown: int = 12  # starts: so many come of regions; chosen on single views
    # distances weigh 1 / (this + distance) in a region; chosen on single views
    near: float = 0.2  # √area of the whole
    dearest: float = 0.3  # cost of distances, mean: an anchor gains nothing at this; chosen on single views
    # of an anchor that looks alike, against one that agrees in its distances; chosen on single views
    descriptor_gain: float = 2.0  # weight
    neutral: float = 0.6  # descriptor distance: says nothing; right ones are about 0.4, any two about 0.8
    prior_radii: float = 1.0  # radii: the neutral distance counts as so many; chosen on single views


@dataclass(frozen=True)
class PartFitParameters:
    """The refinement of maps of a part."""

    # those without another source: chosen together on cuts and holes

    function_ratio: float = 1.75  # ratio: a boundary needs more functions than the share of the area says
    extra_functions: int = 3  # functions: and so many more
    # distances from landmarks are coordinates up to this; lab/robustness.md, parts
    landmark_reach: float = 0.3  # √area
    least_near: float = 0.08  # √area of the part: shortest distances that measure the unit of a map
    most_near: float = 0.3  # √area of the part: longest of them
    n_rough_vertices: int = 500  # vertices: of the part in the short refinement
    rough_sizes: tuple[int, ...] = (20, 40, 70)  # functions of the whole: in it
    n_rough_functions: int = 40  # functions of the whole: tell where normals point in it
    n_fine_functions: int = 60  # functions of the whole: tell where normals point in the end
    n_anchor_functions: int = 200  # functions of the whole: tell the images of the anchors under a fine map
    n_bent: int = 2  # times: a map is settled; lab/robustness.md, parts
    # of the stress in the cost of a map; 0.15 to 0.4 choose alike; decisions.md, cost of a part
    stress_exponent: float = 0.25  # exponent
    least_orientation: float = 0.1  # cosine, mean: a rough map promises no less below
    n_varied: int = 4  # maps: the best rough ones are composed with maps of the whole onto itself
    n_contenders: int = 8  # maps: the best rough ones are refined to the end
    # the last of parts.bending bend the best map in full; 3 and 10 no better on four parts
    n_bent_in_full: int = 5  # lengths


@dataclass(frozen=True)
class SeedsParameters:
    """The search of regions that two parts have in common; lengths are in the unit of both, about √area of their body."""

    # those without another source: chosen together on two parts of SHREC'16

    n_samples: int = 600  # vertices: of each part that are mapped; chosen
    most_landmarks: int = 50  # landmarks: lead the search, of those given; all lead the refinement
    # √area of the body over the root mean square of those of its parts: only the unit of the bounds
    body: float = 1.25  # ratio
    # one part may be so many times as long in the units of the files; beyond, areas are equal
    most_unlike: float = 4.0  # ratio
    # of balls: small ones are noise, large ones cross the boundary
    moment_radii: tuple[float, ...] = (0.06, 0.09, 0.13, 0.18, 0.24)  # lengths
    overhang: float = 0.02  # length: a ball may reach over a boundary by this and count
    usual: float = 0.25  # cost: a candidate that says nothing
    prior_radii: float = 1.5  # radii: it counts as so many
    usual_area: float = 0.15  # logarithm of areas: a candidate whose area says nothing
    most_area: float = 1.0  # logarithm of areas: a difference counts no more
    prior_areas: float = 2.0  # areas: the usual one counts as so many
    moments_weight: float = 0.6  # weight: descriptor distances of candidates
    areas_weight: float = 0.5  # weight: areas of balls of candidates
    most_descriptor_distance: float = 2.0  # standard deviations: values differ as much as any two
    neutral: float = 0.5  # descriptor distance: where nothing is known
    prior: float = 0.5  # radii: it counts as so many
    around: float = 0.12  # length: descriptor distances are averaged over this
    n_alike: int = 3  # samples: of the target always look as alike as any
    by_chance: float = 1.2  # −log of ranks, mean: images may be at random up to this; uniform ranks have 1
    surely: float = 0.05  # length: from where nothing is shown, from which something surely is
    uncovered: float = 0.08  # length: from all images, from which a sample of the target has none
    left_out_cost: float = 1.0  # evidence over area: of area that has no image but must
    n_around: int = 8  # samples: around each, whose triangles are compared
    n_anchors: int = 56  # samples: of the source grow regions
    n_candidates: int = 300  # samples: of the target where they go
    n_roots: int = 40  # anchors: the deepest inside, from which regions grow
    n_likely: int = 30  # candidates: of each of them
    near: float = 0.2  # length: see `grow_regions`
    dearest: float = 0.09  # cost: see `grow_regions`; beyond, none is assigned
    width: int = 4  # partial regions: see `grow_regions`
    variants_apart: float = 0.12  # length, mean: see `grow_regions`
    # of an anchor that looks alike, against one whose distances agree
    likely_gains: tuple[float, ...] = (2.0, 0.5)  # weights
    same_region: float = 0.1  # length, mean: between images of regions that are one
    fewest_common: int = 3  # anchors: in common, of regions that are one
    same_share: float = 0.7  # share of samples: in both, of maps that become one
    n_screened: int = 400  # regions: are extended
    # to so many samples they are extended in so many rounds, and so many remain
    ranks: tuple[tuple[int, int, int], ...] = ((150, 1, 80), (300, 2, 30))  # samples, rounds, regions
    accepted: float = 0.06  # cost: of a sample that belongs to a region
    led_accepted: float = 0.12  # cost: the same where landmarks lead, so that little is wrong
    round_trip: float = 0.12  # length: a sample may be so far from where it returns to
    extension_near: float = 0.15  # length: see `trilaterate`
    first_anchors: int = 50  # samples: from which others are trilaterated first
    next_anchors: int = 90  # samples: from which others are trilaterated once more
    fewest_accepted: int = 8  # samples: of a region on the way
    fewest_samples: int = 25  # samples: of a region in the end
    oriented: float = 0.2  # sign of triangles, mean: a region below is taken for a mirror image


@dataclass(frozen=True)
class TwoPartsParameters:
    """The refinement of regions that two parts have in common."""

    # those without another source: chosen together on two parts of SHREC'16

    # so many of the best are grown again up to this cost of a sample, and refined roughly or in full
    rounds: tuple[tuple[int, float, bool], ...] = ((4, 0.05, True), (2, 0.045, False))  # regions, cost, rough
    around: float = 0.05  # length: a region reaches so far beyond its samples when it is refined
    # a landmark is held if it is no farther from where it is known to go
    held: float = 0.1  # √area of the target
    too_unlike: float = 0.6  # descriptor distance: a sample and its surroundings do not lead others from here
    off: float = 0.04  # √area of the target: bent vertices no farther from it are in common
    rim: float = 0.02  # √area of the target: the same over its boundary
    rough_functions: int = 100  # functions: of a rough refinement, which ranks regions as one in full
    n_bent_in_full: int = 3  # lengths: the last of parts.bending bend the best region in full


@dataclass(frozen=True)
class ComponentsParameters:
    """Shapes of several components."""

    most_runners_up: int = 3  # components: are tried as partners of the largest; chosen: nine matches at most
    # another is one from here; hemispheres differ by less, clothes by more
    runner_up_area: float = 0.5  # area over that of the largest
    spectrum_functions: int = 20  # eigenvalues: whose logarithms are compared; chosen
    # above the least, up to which a pair is tried; poses 0.03, halves 0.13
    same_spectrum: float = 0.1  # difference of logarithms, mean
    # a rigid component fits up to this; half the spacing of the samples
    same_place: float = 0.02  # √area, mean
    # from where a component is carried to; two eyes: 0.9
    most_apart: float = 0.7  # √area and distance from the carriers
    # of one over that of its partner; as for the unit of a part
    most_length_ratio: float = 1.4  # ratio of √area
    held: float = 1.0  # √area: a component no farther from the carriers cannot turn by itself; chosen


@dataclass(frozen=True)
class HeldLandmarksParameters:
    """Maps that are bent until landmarks hold."""

    # steeper turns faces over; docs/priors.md: 1.5 to 3 alike
    slope: float = 2.0  # width of a bump over the distance moved
    least_width: float = 0.1  # √area: of the bump; docs/priors.md
    most_width: float = 0.2  # √area: of the bump; docs/priors.md
    # up to this become 0: what is far from the landmarks stays as it was, bit by bit; chosen
    tail: float = 0.02  # weight
    # of the kernel among landmarks that is inverted; those too close to be told apart move as one; chosen
    least: float = 0.1  # singular value
    function_weight: float = 0.3  # √area: functions beside positions; chosen
    n_functions: int = 20  # functions: tell apart sheets that are near in space; chosen


@dataclass(frozen=True)
class ErrorsParameters:
    """Expected errors, regions of doubt and questions."""

    # one in ten runners-up is then right at the bound of a tie; chosen
    runner_up_exponent: float = 10.0  # exponent of the ratio of scores
    # an expected error is spread over this; 0.05 to 0.14 tried: isomatch_lab.studies.vertex_confidence
    radius: float = 0.08  # √area
    # to the mean error of faust_r and creatures; isomatch_lab.studies.vertex_confidence
    scale: float = 0.32  # factor
    main: float = 0.25  # share of a region: what is doubtful there is a reason from here; chosen
    least_known: float = 0.5  # share of a neighbourhood: its descriptor distance is not known below; chosen
    least_area: float = 0.005  # share of the surface: no region is told below; chosen: half a hand
    # the error where vertices look unlike their images; lab/benchmarks.md, regions of doubt
    unlike: float = 0.5  # mean error over √(area of the region)
    most_named: int = 5  # landmarks: in a note; chosen
    # of the smoothed surfaces whose normals are compared; chosen with outcome.poor_orientation
    normal_functions: int = 60  # functions
    n_asked: int = 400  # vertices: may be asked for; chosen
    # between two places that are told apart by eye; chosen: a hand is half as long
    places_apart: float = 0.1  # √area
    questions_apart: float = 0.3  # √area of the source: questions nearer to each other tell less; chosen


@dataclass(frozen=True)
class ExchangeParameters:
    """Maps found from the target, and regions that a map takes from others; decisions.md, both sides."""

    # so many of the maps that tie when searched from the target contend; chosen
    most_from_target: int = 2  # maps
    # images of a vertex farther apart are at different places; chosen: two thirds of a limb
    other_place: float = 0.1  # √area
    least_area: float = 0.01  # share of the area: a smaller region stays; chosen: ten of 1000 samples
    # a larger region is another map, which is verified as a whole; chosen
    most_area: float = 0.4  # share of the area
    most_regions: int = 6  # regions of one other map: the largest; chosen
    # a region is tried up to this; measured: right limbs 1.09, hopeless ones 2.7
    alike: float = 1.25  # mean descriptor distance over the present one
    gain: float = 0.97  # cost over the present one: an exchange is kept up to this; chosen
    most_exchanges: int = 4  # regions, or groups of them: one after the other; chosen
    n_coarse: int = 400  # vertices: those bent to decide what is bent with all; chosen
    n_compared: int = 60  # vertices: those of a region whose images are compared; chosen
    # regions go together if so many images of one lie where those of the other do; chosen
    lies_on: float = 0.3  # share of the images


@dataclass(frozen=True)
class SymmetricParameters:
    """Maps composed with near-symmetries, which may fit as well as the winner; decisions.md, individuals."""

    # such a map is refined up to this; one at 1.07 fits as well, those from 1.5 cost twice as much by `verify`
    energy: float = 1.75  # energy over the winner's
    # a map that is farther away is turned as a whole; half turns of ants 0.24, trunks alone to 0.2
    turned: float = 0.2  # √area, mean
    most: int = 4  # maps: so many are refined; chosen
    # a map fits as well up to this; the right one over a half turn of ants costs 1.46 times as much at most, a wrong one
    # over the right one of animals 1.59 times at least
    as_well: float = 1.5  # cost of `verify` over the winner's


@dataclass(frozen=True)
class JudgingParameters:
    """A map of any tool beside a reference, see `judge`."""

    # images that are farther apart are in different places; chosen: above the errors of right maps, below a limb
    elsewhere: float = 0.08  # √area
    # a map that sends less elsewhere agrees with the reference, and smaller regions are not named; chosen: a hand
    least_area: float = 0.01  # share of the area
    # a map that agrees is right up to this; measured: right maps known at 300 points 2.6 to 21
    rough: float = 25.0  # cost over that of the reference
    # a map that sends a part elsewhere is wrong from here on; measured: a limb shifted by half its width 1.33
    clearly: float = 1.25  # cost over that of the reference
    # a map with fewer different images is coarse, and judged by the nearest vertex of each image; chosen
    coarse: float = 0.25  # different images over vertices
    most_regions: int = 5  # regions: the largest are named; chosen


@dataclass(frozen=True)
class SpectralParameters:
    """The refinements of the paper."""

    # a functional map grows from the best of these; lab/paper.md
    first: tuple[int, ...] = (15, 20, 30, 40)  # functions
    choice: int = 50  # functions: at which the best of these is chosen; chosen: as many as the rank
    step: int = 5  # functions: are added in each step; Melzi et al. 2019
    # of the plain descriptor alignment; two on all vertices follow; chosen
    distance_steps: int = 15  # iterations


# Other distances from which two maps differ have other values: search.same_map and selection.same_map, 0.05, and
# selection.runner_up_distance, are settings; `ANCHORS.apart` 0.15, `ELASTIC_SEARCH.apart` 0.12 in average distances;
# `SEEDS.same_region` 0.1 and `SEEDS.variants_apart` 0.12 in the unit of two parts; `PART_SEARCH.led_apart` 0.04,
# `COMPONENTS.same_place` 0.02, `ERRORS.places_apart` 0.1, `SYMMETRIC.turned` 0.2.
SAME_MAP = SameMapParameters()
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
