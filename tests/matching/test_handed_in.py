"""What is handed to `match` beside the shapes: priors, starts and relations follow the same rules everywhere."""

import numpy as np
import pytest

from isomatch import Config, DescriptorError, Outcome, PointCloud, SettingError, match
from isomatch.matching import Elastic, Isometry, Part
from isomatch.matching.refinements import bumpy_ball
from zoo.made import moved, together

pytestmark = pytest.mark.usefixtures("prepared_once")
RELATIONS = pytest.mark.parametrize("relation", [Isometry, Part, Elastic])
OF_MESHES = pytest.mark.parametrize("relation", [Part, Elastic])


def mean_error(found, target, truth):
    off = np.linalg.norm(target.vertices[found.map.vertices[: len(truth)]] - target.vertices[truth], axis=1)
    return off.mean() / np.sqrt(target.area)


@pytest.mark.long
@RELATIONS
def test_where_only_priors_may_win_no_start_is_asked(bodies, relation):
    source, target, truth = bodies
    asked = []

    def start(pair):
        asked.append(pair)
        return []

    config = Config(hypotheses="given", search_runners_up=False)
    found = match(source, target, initial_map=truth, config=config, starts=[start], relation=relation)
    assert not asked
    assert found.origin == "initial map"
    assert mean_error(found, target, truth) < 0.04


@pytest.mark.long
@RELATIONS
@pytest.mark.parametrize("kind", ["initial map", "landmarks"])
def test_priors_contend_whatever_starts_are_handed_in(bodies, kind, relation):
    source, target, truth = bodies
    rows = np.arange(50, 1400, 200)
    pairs = np.column_stack([rows, truth[rows]])
    given = {"initial_map": truth} if kind == "initial map" else {"landmarks": pairs}
    found = match(source, target, **given, starts=[], relation=relation)
    assert found.origin == kind
    assert mean_error(found, target, truth) < 0.04


@pytest.mark.long
@RELATIONS
def test_without_priors_none_may_win(bodies, relation):
    with pytest.raises(SettingError, match="no landmarks"):
        match(*bodies[:2], config=Config(hypotheses="given"), relation=relation)


@pytest.mark.long
@RELATIONS
def test_the_origin_is_the_start_that_won(bodies, relation):
    source, target, truth = bodies

    def known(pair):
        """Know the truth at few vertices."""
        rows = pair.source_vertices
        return [np.column_stack([rows, pair.target.body_vertex[truth[pair.source.user_vertex[rows]]]])]

    found = match(source, target, starts=[known], relation=relation)
    assert found.origin == "known"
    assert mean_error(found, target, truth) < 0.04


@pytest.mark.long
def test_descriptors_lead_an_elastic_map_and_no_part(bodies):
    source, target, truth = bodies
    of_target = np.zeros((target.n_vertices, 3))
    of_target[truth] = source.vertices
    given = {"initial_descriptors": (source.vertices, of_target)}
    found = match(source, target, **given, relation=Elastic, config=Config(hypotheses="given"))
    assert found.origin == "descriptors"
    assert mean_error(found, target, truth) < 0.06
    with pytest.raises(DescriptorError, match="landmarks"):
        match(source, target, **given, relation=Part)


@OF_MESHES
@pytest.mark.parametrize("orientation", ["any", "reverse"])
def test_relations_that_keep_the_orientation_say_so(bodies, relation, orientation):
    with pytest.raises(SettingError, match=f"orientation = '{orientation}', and this relation finds only"):
        match(*bodies[:2], config=Config(orientation=orientation), relation=relation)


@pytest.mark.long
@OF_MESHES
def test_relations_of_meshes_say_so(bodies, relation):
    source, target, _ = bodies
    with pytest.raises(SettingError, match="inside"):
        match(PointCloud(source.vertices), target, relation=relation)


@pytest.mark.long
@OF_MESHES
def test_a_relation_is_claimed_of_each_two_partners(bodies, relation):
    source, target, truth = bodies
    ball = moved(bumpy_ball(200), [0, 0, 2], 0.1)
    found = match(together(source, ball), together(target, ball), relation=relation)
    assert mean_error(found, target, truth) < 0.06
    assert (found.map.vertices[source.n_vertices :] >= target.n_vertices).all()
    unsure = {Outcome.LOW_CONFIDENCE, Outcome.SYMMETRY_AMBIGUOUS, Outcome.CONVERGED}
    assert found.outcome in ({Outcome.PARTIAL} if relation is Part else unsure), (
        "a body and a ball are no species"
    )
