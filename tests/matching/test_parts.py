"""Parts matched to wholes, and wholes to parts."""

from dataclasses import replace
from itertools import combinations
from types import SimpleNamespace

import numpy as np
import pytest

from isomatch import Config, Mesh, Outcome, match, prepare, questions, verify
from isomatch._core.stage_timer import StageTimer
from isomatch.datasets import ground_truth
from isomatch.geodesics import distance_along_edges_to_nearest
from isomatch.matching import REFINEMENTS, Part, Problem, prepare_pair, search_under
from isomatch.matching.assessment.quality import covered_share
from isomatch.matching.strategies import CAPPED, PART_FROM_BOTH_SIDES, Attempts, part_of
from isomatch.settings import PartSettings
from isomatch_lab.damage import cut, holes, limb_removed, view
from isomatch_lab.procedural import creature
from isomatch_lab.sets import relabelled


def match_part(part, whole, config):
    """Match a prepared part to a prepared whole, without priors and without closing holes."""
    found = search_under(Part(Problem(part, whole, config)))
    ranking = found.ranking
    best = ranking.best
    return SimpleNamespace(
        fits=[best, *ranking.others],
        score=best.cost_with_bending,
        pair=best.pair,
        bent=found.coordinates,
        share=found.model.fits.local_unit(best.pair, best.image) ** 2,
        runner_up=ranking.runner_up,
    )


pytestmark = pytest.mark.usefixtures("prepared_once")


@pytest.fixture(scope="module")
def bodies():
    """Two poses of an asymmetric quadruped, and the true image of each vertex of the first on the second."""
    first, second = (creature(2500, triangulation=i, pose=i) for i in (1, 2))
    target, new = relabelled(second.mesh, 0)
    return first.mesh, target, new[ground_truth(first, second).vertices]


@pytest.fixture(scope="module")
def prepared(bodies):
    return prepare(bodies[1])


def mean_error(whole, images, truth):
    """Mean distance on a prepared whole / √area."""
    return whole.mean_distance(whole.body_vertex[images], whole.body_vertex[truth])


@pytest.mark.long
@pytest.mark.parametrize(("damage", "share", "covered"), [(cut, 0.3, 0.85), (holes, 0.15, 1.01)])
def test_a_part_is_mapped_to_the_whole(bodies, prepared, damage, share, covered):
    part = damage(bodies[0], share, seed=4)
    found = match(part.mesh, prepared)
    assert found.outcome is Outcome.PARTIAL
    assert found.map.matched.all()
    assert mean_error(prepared, found.map.vertices, bodies[2][part.original]) < 0.05
    assert found.quality.coverage < covered
    assert any("matched as a part" in note for note in found.notes)


@pytest.fixture(scope="module")
def found(bodies, prepared):
    """A part with 70 % of the area, what is left of it, and its match."""
    part = cut(bodies[0], 0.3, seed=4)
    return part, match_part(prepare(part.mesh), prepared, Config())


@pytest.mark.long
def test_a_part_is_bent_onto_the_whole(found, bodies, prepared):
    """Its lengths are kept where they may be, and it lies where it should."""
    part, best = found
    truth = prepared.body_vertex[bodies[2][part.original]]
    mesh = best.pair.part.mesh_body
    stretch = best.bent.mesh.edge_lengths / (best.pair.unit * mesh.edge_lengths)
    assert np.median(np.abs(np.log(stretch))) < 0.05
    rows = best.pair.part.sample_vertices[: len(best.fits[0].image)]
    assert prepared.mean_distance(best.bent.images[rows], truth[rows]) < 0.025


@pytest.mark.long
def test_a_map_that_is_settled_is_more_exact(found, bodies, prepared):
    part, best = found
    unsettled = match_part(prepare(part.mesh), prepared, Config(parts=PartSettings(n_settled=0)))
    truth = prepared.body_vertex[bodies[2][part.original]]
    rows = best.pair.part.sample_vertices[: len(best.fits[0].image)]
    before, after = (
        prepared.mean_distance(ranking.fits[0].image, truth[rows]) for ranking in (unsettled, best)
    )
    assert after < 0.9 * before
    assert best.score < unsettled.score


@pytest.mark.long
def test_the_best_map_bends_the_part_in_full(found, bodies, prepared):
    """From where it lies at a lower resolution, and more exactly."""
    part, best = found
    truth = prepared.body_vertex[bodies[2][part.original]][best.pair.part.user_vertex]
    rough, rows = best.fits[0].bent, np.arange(len(truth))
    assert rough.mesh.n_vertices < best.bent.mesh.n_vertices == len(truth)
    before = prepared.mean_distance(best.fits[0].bending.images(rough, rows), truth)
    after = prepared.mean_distance(best.bent.images, truth)
    assert after < 1.05 * before < 0.03


@pytest.mark.long
def test_what_a_bent_part_covers(found, bodies):
    part, best = found
    whole = best.pair.whole.body
    gap, _ = distance_along_edges_to_nearest(whole, np.unique(bodies[2][part.original]))
    truth = gap <= whole.edge_lengths.mean()
    _, covered = best.bent.onto_part()
    assert (covered & truth).sum() > 0.93 * truth.sum(), "recall"
    assert (covered & truth).sum() > 0.9 * covered.sum(), "precision"


@pytest.mark.long
def test_wrong_maps_bend_badly(found):
    _, best = found
    wrong = [fit for fit in best.fits if best.pair.whole.mean_distance(fit.image, best.fits[0].image) > 0.12]
    assert wrong
    assert min(fit.bent.bending_cost for fit in wrong) > 1.5 * best.bent.bending_cost


@pytest.mark.long
@pytest.mark.parametrize("close", [True, False])
def test_a_part_in_doubt_is_not_sure(bodies, prepared, close):
    """With and without closed holes, the shape is matched as a part."""
    part = cut(bodies[0], 0.3, seed=4)
    settings = PartSettings(poor_doubt=0.0, close_holes=close)
    found = match(part.mesh, prepared, config=Config(parts=settings))
    assert found.outcome is Outcome.LOW_CONFIDENCE
    assert 0 < found.quality.doubt < PartSettings().poor_doubt
    assert any("the map is not sure, for it fits badly" in note for note in found.notes)


FROM_CLOSED = "part, from the holes closed"


def ways(found):
    return {stage.split(":")[0] for stage in found.timings if stage.endswith(": search")}


@pytest.mark.long
def test_holes_are_closed_only_in_doubt_where_much_is_missing(bodies, prepared):
    """The second way does not change the map of one that is sure by the first."""
    part = cut(bodies[0], 0.55, seed=4).mesh
    sure, doubted = (
        match(part, prepared, config=Config(parts=PartSettings(poor_doubt=bound)))
        for bound in (PartSettings().poor_doubt, 0.0)
    )
    assert (sure.outcome, ways(sure)) == (Outcome.PARTIAL, {"part"})
    assert doubted.outcome is Outcome.LOW_CONFIDENCE
    assert ways(doubted) - {PART_FROM_BOTH_SIDES.name} == {"part", "holes closed", FROM_CLOSED}
    if doubted.way == "part":
        np.testing.assert_array_equal(sure.map.vertices, doubted.map.vertices)


@pytest.mark.long
@pytest.mark.parametrize("side", ["source", "target"])
def test_holes_are_closed_and_the_map_is_searched_from_the_other_shape(bodies, prepared, side):
    """A wrong map of the capped shapes is replaced by one that is searched in the other direction."""
    part = cut(bodies[0], 0.3, seed=4)
    pair = prepare_pair(part.mesh, prepared)
    tried = Attempts(pair if side == "source" else pair.turned, StageTimer())
    tried.matches[CAPPED.name] = right = search_under(CAPPED.model(tried))
    assert PART_FROM_BOTH_SIDES.model(tried) is None, "both directions find one map"
    collapsed = replace(right.ranking.best, image=np.zeros_like(right.ranking.best.image))
    tried.matches[CAPPED.name] = replace(right, ranking=replace(right.ranking, best=collapsed))
    image, truth = PART_FROM_BOTH_SIDES.model(tried).known_map[0], bodies[2][part.original]
    assert prepared.mean_distance(image, prepared.body_vertex[truth[pair.source.user_vertex]]) < 0.1


@pytest.mark.long
def test_where_little_is_missing_a_part_is_searched_only_in_doubt(bodies, prepared):
    """Of three bodies that lack a limb each, either way is more exact for some; on average they differ little."""
    errors = []
    for seed in (1, 2, 4):
        part = limb_removed(bodies[0], 0.05, seed=seed)
        sure, searched = (
            match(part.mesh, prepared, config=Config(parts=PartSettings(little_missing=least)))
            for least in (PartSettings().little_missing, 2.0)
        )
        assert sure.outcome is searched.outcome is Outcome.PARTIAL
        assert ways(sure) == {"holes closed", FROM_CLOSED}
        assert ways(searched) == {"part"}
        truth, real = bodies[2][part.original], sure.map.matched & searched.map.matched
        errors += [
            [mean_error(prepared, found.map.vertices[real], truth[real]) for found in (sure, searched)]
        ]
    closed, open_ = np.mean(errors, axis=0)
    assert closed < 1.1 * open_


@pytest.mark.long
def test_a_body_without_a_foot_is_a_part_but_not_one_with_small_holes(bodies):
    """The longest piece of the boundary decides, not its length in all."""
    footless = limb_removed(bodies[0], 0.03, seed=1).mesh
    faces = bodies[0].faces
    pierced = Mesh(bodies[0].vertices, np.delete(faces, np.arange(0, len(faces), 200), axis=0))
    for part, role in ((footless, "source"), (pierced, None)):
        pair = prepare_pair(part, bodies[1])
        assert part_of(pair) == role
    assert prepare(pierced).boundary_length > prepare(footless).boundary_length


@pytest.mark.long
def test_a_whole_is_mapped_to_a_part_and_the_rest_is_unmatched(bodies):
    source, target, truth = bodies
    part = cut(target, 0.3, seed=2)
    goal = part.damaged_vertex[truth]
    found = match(source, part.mesh)
    matched = found.map.matched
    assert found.outcome is Outcome.PARTIAL
    assert (matched & (goal >= 0)).sum() > 0.9 * (goal >= 0).sum(), "recall"
    assert (matched & (goal >= 0)).sum() > 0.85 * matched.sum(), "precision"
    right = prepare(part.mesh)
    both = matched & (goal >= 0)
    assert mean_error(right, found.map.vertices[both], goal[both]) < 0.06
    images = right.body_vertex[found.map.vertices[matched]]
    assert found.quality.coverage == covered_share(right.body, images) > 0.98


@pytest.mark.long
def test_what_is_left_out_of_the_whole_shifts_nothing(bodies, prepared):
    part = holes(bodies[0], 0.15, seed=4)
    crumb = np.array([[0, 0, 0], [0.01, 0, 0], [0, 0.01, 0], [0, 0, 0.01]]) + 5
    vertices = np.vstack([[9.0, 9, 9], crumb, bodies[1].vertices])  # the first is in no face
    faces = np.vstack([np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]) + 1, bodies[1].faces + 5])
    whole = type(part.mesh)(vertices, faces)
    shape = prepare(part.mesh)
    rows = shape.user_vertex[shape.column_vertices[:5]]
    landmarks = np.column_stack([rows, bodies[2][part.original[rows]] + 5])
    closed = Config(parts=replace(PartSettings(), little_missing=0.0))
    found = match(part.mesh, whole, landmarks=landmarks, config=closed)
    assert found.way == FROM_CLOSED
    assert mean_error(prepared, found.map.vertices - 5, bodies[2][part.original]) < 0.03


@pytest.mark.long
def test_a_shape_is_a_part_of_itself():
    """Its map onto itself costs nothing, so that scores have no ratio unless there is a least one."""
    shape = creature(1500).mesh
    found = match(shape, shape, config=Config(part="source"))
    assert found.outcome is Outcome.PARTIAL
    assert found.quality.matched == 1
    assert (
        np.linalg.norm(found.map @ shape.vertices - shape.vertices, axis=1).max() < shape.edge_lengths.mean()
    )


@pytest.mark.long
@pytest.mark.parametrize(
    ("factor", "scale"), [(0.8, "auto"), (0.9, "free"), (1.0, "same"), (1.3, "auto"), (7.0, "auto")]
)
def test_the_unit_is_found(bodies, prepared, factor, scale):
    part = cut(bodies[0], 0.3, seed=4)
    scaled = type(part.mesh)(factor * part.mesh.vertices, part.mesh.faces)
    config = Config(scale=scale)
    found = match_part(prepare(scaled), prepared, config)
    rows = prepare(scaled).sample_vertices[: len(found.fits[0].image)]
    truth = bodies[2][part.original[rows]]
    assert prepared.mean_distance(found.fits[0].image, prepared.body_vertex[truth]) < 0.07
    assert found.share == pytest.approx(part.mesh.area / bodies[0].area, rel=0.1)


@pytest.mark.long
def test_two_bodies_with_holes_are_matched_in_what_both_show(bodies):
    source, target, truth = bodies
    one, other = holes(source, 0.15, seed=1), holes(target, 0.15, seed=2)
    image = other.damaged_vertex[truth[one.original]]
    found = match(one.mesh, other.mesh)
    assert found.outcome is Outcome.PARTIAL
    has, matched = image >= 0, found.map.matched
    assert (matched & has).sum() > 0.97 * has.sum(), "recall"
    assert (matched & has).sum() > 0.9 * matched.sum(), "precision"
    right = prepare(other.mesh)
    both = matched & has
    assert mean_error(right, found.map.vertices[both], image[both]) < 0.05


@pytest.mark.long
def test_a_part_of_another_animal_is_no_sure_match(prepared):
    other = cut(creature(2500, kind="biped").mesh, 0.3, seed=0)
    assert match(other.mesh, prepared).outcome is Outcome.LOW_CONFIDENCE


def roles(source, target, **options):
    problem = prepare_pair(source, target, Config(**options))
    return part_of(replace(problem, refinement=REFINEMENTS[problem.config.refinement]))


@pytest.mark.long
def test_roles_are_found(bodies):
    whole, other, _ = bodies
    part = cut(whole, 0.3, seed=4).mesh
    assert roles(part, other) == "source"
    assert roles(other, part) == "target"
    assert roles(whole, other) is None
    assert roles(part, part) == "both"
    assert roles(part, other, part="none") is None
    assert roles(whole, other, part="target") == "target"
    assert roles(part, other, orientation="any") is None
    assert roles(part, other, refinement="none") is None


@pytest.mark.long
def test_a_view_in_doubt_is_chosen_by_verification_and_has_alternatives(bodies, prepared):
    part = view(bodies[0], 1, seed=3).mesh
    config = Config(parts=PartSettings(poor_doubt=1e-9, close_holes=False))  # so that nothing is sure
    source = prepare(part, config)
    found = match(source, prepared, config=config)
    assert found.outcome is Outcome.LOW_CONFIDENCE
    maps = [found.map, *(other.map for other in found.alternatives)]
    costs = [verify(source, prepared, map_).cost for map_ in maps]
    assert costs[0] == min(costs)
    for one, other in combinations(maps, 2):
        both = one.matched & other.matched
        distance = prepared.mean_distance(
            prepared.body_vertex[one.vertices[both]], prepared.body_vertex[other.vertices[both]]
        )
        assert distance > 0.1
    asked = questions(part, bodies[1], found)
    assert asked
    assert all(len(question.places) > 1 for question in asked)
    turned = match(prepared, source, config=config)  # the whole to its part
    assert [other.map.shape for other in turned.alternatives] == [found.map.shape[::-1]] * len(
        turned.alternatives
    )
