"""Two fragments are matched by way of a whole of their kind."""

import numpy as np
import pytest

from isomatch import Config, Mesh, Outcome, PointCloud, SettingError, match, prepare
from isomatch._core.errors import MeshError
from isomatch.datasets import ground_truth
from isomatch.matching.via import chains_of
from isomatch.settings import PartSettings
from isomatch_lab.procedural import creature
from isomatch_lab.sets import relabelled
from shapes import icosphere


def back_and_front():
    """The hind and the front part of two poses of a quadruped, and the true image of each vertex, −1 without one."""
    first, second = (creature(1500, triangulation=i, pose=i) for i in (1, 2))
    target, new = relabelled(second.mesh, 0)
    place = np.empty(len(new), dtype=int)
    place[new] = np.arange(len(new))
    along = [x.rest[:, 1] for x in (first, second)]
    hind, rows = first.mesh.submesh(along[0] < np.quantile(along[0], 0.62))
    front, columns = target.submesh((along[1] > np.quantile(along[1], 0.38))[place])
    number = np.full(target.n_vertices, -1)
    number[columns] = np.arange(len(columns))
    return hind, front, number[new[ground_truth(first, second).vertices]][rows]


@pytest.fixture(scope="module")
def fragments():
    return back_and_front()


@pytest.fixture(scope="module")
def whole():
    return prepare(creature(1500, triangulation=3, pose=3).mesh)


@pytest.fixture(scope="module")
def found(fragments, whole):
    return match(*fragments[:2], via=whole)


@pytest.mark.long
def test_what_both_fragments_show_is_found_and_matched(fragments, found):
    source, target, truth = fragments
    image, has = found.map.vertices, truth >= 0
    both, either = (image >= 0) & has, (image >= 0) | has
    assert source.vertex_areas[both].sum() > 0.8 * source.vertex_areas[either].sum()
    distance = np.linalg.norm(target.vertices[image[both]] - target.vertices[truth[both]], axis=1)
    assert distance.mean() < 0.04 * np.sqrt(target.area)
    assert found.outcome is Outcome.PARTIAL


@pytest.mark.long
def test_the_result_says_how_it_was_found(found):
    assert found.way == "via"
    assert "1 other shape" in found.reason
    assert found.overlap == (found.quality.matched, found.quality.coverage)
    assert np.array_equal(np.isnan(found.expected_error), ~found.map.matched)
    assert (found.expected_error[found.map.matched] > 0).all()


@pytest.mark.long
def test_of_several_wholes_the_one_that_verifies_best_is_taken(fragments, whole, found):
    several = match(*fragments[:2], via=[icosphere(3), whole])
    assert np.array_equal(several.map.vertices, found.map.vertices)


@pytest.mark.long
def test_two_wholes_follow_each_other(fragments, whole, found):
    other = prepare(creature(1500, triangulation=4, pose=1).mesh)
    chained = match(*fragments[:2], via=(other, whole))
    both = chained.map.matched & found.map.matched
    assert both.mean() > 0.8 * found.map.matched.mean()
    assert np.nanmean(chained.expected_error) > np.nanmean(found.expected_error)


@pytest.mark.long
def test_a_composed_map_that_verifies_badly_is_not_sure(fragments, whole):
    strict = Config(parts=PartSettings(poor_via=0.0))
    assert match(*fragments[:2], via=whole.surface, config=strict).outcome is Outcome.LOW_CONFIDENCE


def test_a_tuple_of_vertices_and_faces_is_a_shape():
    corners, faces = [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]
    mesh = Mesh(corners, faces)
    assert chains_of((corners, faces)) == [((corners, faces),)]
    assert chains_of(mesh) == [(mesh,)]
    assert chains_of((mesh, mesh)) == [(mesh, mesh)]
    assert chains_of([mesh, (mesh, mesh)]) == [(mesh,), (mesh, mesh)]
    with pytest.raises(SettingError, match="no shape"):
        chains_of([])


@pytest.mark.long
def test_priors_say_nothing_of_the_shapes_between(fragments, whole):
    with pytest.raises(SettingError, match="no priors"):
        match(*fragments[:2], via=whole, landmarks=[[0, 0], [1, 1], [2, 2]])


@pytest.mark.long
def test_clouds_are_not_matched_by_way_of_others(whole):
    cloud = PointCloud(whole.surface.vertices)
    with pytest.raises(MeshError, match="give meshes"):
        match(cloud, cloud, via=whole)
