"""Vertices that nearly coincide, T-junctions, voids, bases and outliers: found, named, and mended with index maps."""

import numpy as np
import pytest

from isomatch import Asset, Attribute, Mesh, PointCloud, check, distance_engine, prepare, repair
from isomatch._core.errors import MeshError, SettingError
from isomatch.io import Polygons
from isomatch.repair import find_outliers
from isomatch_lab.procedural import creature
from shapes import icosphere, inside_out
from zoo.made import moved, sheet, soup, together

STRIP = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [1, 0.5, 0], [2, 0, 0], [2, 0.5, 0], [2, 1, 0]]
"""Two triangles on the left meet four on the right, two of them with a corner on the middle of that edge."""
FACES = [[0, 1, 2], [0, 2, 3], [1, 5, 6], [1, 6, 4], [4, 6, 7], [4, 7, 2]]


def ball(radius, level=2, centre=(0, 0, 0)):
    mesh = icosphere(level)
    return mesh.moved(radius * mesh.vertices + np.array(centre))


def test_paths_cross_an_edge_after_its_t_junction_is_mended():
    strip = Mesh(STRIP, FACES)
    assert check(strip).t_junctions.tolist() == [4]
    mended = repair(strip)
    assert mended.face_index.tolist() == [0, 0, 1, 2, 3, 4, 5]
    assert mended.mesh.area == pytest.approx(strip.area)
    assert check(mended.mesh).ok
    after, before = (distance_engine(mesh).distances_from([0])[0] for mesh in (mended.mesh, strip))
    assert after[6] == pytest.approx(np.hypot(2, 0.5), abs=0.05)
    assert before[4] > after[4] + 0.1


@pytest.mark.parametrize("share", [0.2, 0.7])
def test_a_t_junction_of_quads_keeps_texture_coordinates(share):
    """A point on the side of a quad gets the coordinates between those of its ends."""
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [1, share, 0], [2, 0, 0], [2, 1, 0]])
    corners = [0, 1, 2, 3, 1, 5, 4, 4, 5, 6, 2]
    polygons = Polygons(corners, [4, 3, 4])
    uv = Attribute("uv", "corner", "uv", points[corners][:, :2] / 2)
    mended = repair(Asset(points, polygons, (uv,)))
    asset = mended.asset
    assert asset.polygons.sizes.tolist() == [5, 3, 4]
    np.testing.assert_allclose(asset.attribute("uv").values, asset.points[asset.polygons.corners][:, :2] / 2)
    assert mended.polygon_index.tolist() == [0, 1, 2]


@pytest.mark.parametrize(("digits", "scale"), [(2, 1.0), (3, 1.0), (1, 1000.0)])
def test_triangles_with_few_digits_are_welded_within_the_distance_proposed(digits, scale):
    body = creature(1500).mesh
    split = soup(moved(body, scale=scale))
    noise = 0.6 * 10.0**-digits * np.random.default_rng(0).random(split.vertices.shape)
    split = split.moved(np.round(split.vertices + 0.5 * noise, digits + 1))
    report = check(split)
    assert report.n_components > 100
    assert any(f"weld={report.weld_tolerance:.2g}" in warning for warning in report.warnings)
    mended = repair(split, weld=report.weld_tolerance)
    assert check(mended.mesh).n_components == 1
    assert mended.mesh.n_vertices == pytest.approx(body.n_vertices, rel=0.01)
    np.testing.assert_array_equal(mended.mesh.vertices, split.vertices[mended.vertex_index])


def test_sound_meshes_have_no_such_gaps():
    for mesh in (creature(1500).mesh, icosphere(3), Mesh(STRIP[:4], FACES[:2])):
        report = check(mesh)
        assert not len(report.close_vertices)
        assert not len(report.t_junctions)


@pytest.mark.long
def test_a_match_names_the_command_that_welds():
    body = creature(1500).mesh
    split = soup(body)
    split = split.moved(split.vertices + 1e-4 * np.random.default_rng(0).random(split.vertices.shape))
    whole = together(split, moved(body, [9.0, 0, 0]))
    assert any("isomatch repair --weld" in note for note in prepare(whole).notes)


@pytest.mark.parametrize("weld", [-1.0, np.nan, "yes"])
def test_a_weld_is_a_distance(weld):
    with pytest.raises(SettingError, match="weld"):
        repair(icosphere(1), weld=weld)


def test_a_void_is_no_defect():
    solid = together(ball(1.0), inside_out(ball(0.5)))
    report = check(solid)
    assert report.ok
    assert (report.solid_components.tolist(), report.void_components.tolist()) == ([0], [1])
    assert repair(solid).changes == ()


@pytest.mark.parametrize(
    ("meshes", "expected"),
    [
        pytest.param([ball(1.0), ball(0.5)], [1, 1], id="a solid in a solid stays"),
        pytest.param(
            [ball(1.0), inside_out(ball(0.5, centre=(3, 0, 0)))], [1, 1], id="one beside it is turned"
        ),
        pytest.param(
            [ball(1.0), inside_out(ball(0.8)), inside_out(ball(0.4))], [1, -1, 1], id="in a void is no solid"
        ),
        pytest.param(
            [inside_out(ball(1.0)), inside_out(ball(0.5))], [1, -1], id="a solid inside out with a void"
        ),
    ],
)
def test_containment_decides_which_way_a_shell_looks(meshes, expected):
    mended = repair(together(*meshes)).mesh
    volumes = [abs(mesh.volume) for mesh in meshes]
    assert mended.volume == pytest.approx(np.dot(expected, volumes))


def on_a_plate(height=0.02):
    """A body that stands in a plate: the plate, and what of the body is above."""
    body = creature(3000).mesh
    body = body.moved(body.vertices - [0, 0, body.vertices[:, 2].min() + height])
    above = body.submesh(body.vertices[:, 2] > 0)[0]
    lowest, highest = body.vertices[:, :2].min(axis=0) - 0.2, body.vertices[:, :2].max(axis=0) + 0.2
    plate = moved(sheet(40, 40), [*lowest, 0], [*(highest - lowest), 1])
    return together(plate, above), above


@pytest.mark.long
def test_a_plate_is_named_and_cut_along_its_rim():
    scan, above = on_a_plate()
    report = check(scan)
    assert report.planar > 0.1
    assert "without_base=True" in str(report)
    mended = repair(scan, without_base=True)
    assert any("base" in change for change in mended.changes)
    assert mended.mesh.area == pytest.approx(above.area, rel=0.05)
    np.testing.assert_array_equal(mended.mesh.vertices, scan.vertices[mended.vertex_index])
    assert check(creature(1500).mesh).planar < 0.1


@pytest.mark.parametrize("share", [0.01, 0.03])
def test_outliers_of_a_cloud_are_found_and_left_out(share):
    rng = np.random.default_rng(0)
    points = creature(3000).mesh.vertices
    lowest, highest = points.min(axis=0) - 1, points.max(axis=0) + 1
    stray = lowest + (highest - lowest) * rng.random((int(share * len(points)), 3))
    cloud = np.vstack([points, stray])
    found = find_outliers(cloud)
    far = np.linalg.norm(stray[:, None] - points[None], axis=2).min(axis=1) > 0.2
    assert not found[: len(points)].any()
    assert found[len(points) :][far].all()
    assert check(Mesh(cloud, [])).outliers.tolist() == np.flatnonzero(found).tolist()
    mended = repair(Mesh(cloud, []))
    assert mended.mesh.n_vertices == (~found).sum()
    assert any("far from all others" in change for change in mended.changes)


@pytest.mark.long
def test_a_match_of_a_cloud_leaves_outliers_out():
    points = np.vstack([creature(1500).mesh.vertices, [[50.0, 0, 0]]])
    shape = prepare(PointCloud(points))
    assert shape.body_vertex[-1] == -1
    assert any("far from all others" in note for note in shape.notes)


def test_points_at_one_place_are_refused_at_once():
    """Their neighbours would take a minute to find."""
    with pytest.raises(MeshError, match="at one place"):
        _ = PointCloud(np.zeros((60_000, 3))).components


def test_a_point_that_no_side_has_may_be_far_larger_than_those_that_do():
    tiny = 5e-324
    points = [[tiny, tiny, tiny], [tiny, 0, 0], [0, tiny, 0], [1.0, 0, 0]]
    assert repair(Mesh(points, [[1, 2, 0]]), weld=False, remove_unused=False).mesh.n_vertices == 4
