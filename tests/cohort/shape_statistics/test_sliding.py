"""Semilandmarks, spread and slid: bending energies by other routes, the direct formula, and what must not move."""

import numpy as np
import pytest
from scipy.interpolate import RBFInterpolator
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist

from isomatch import LandmarkError, MemoryBudgetError, SettingError
from isomatch.cohort.shape_statistics import slid_semilandmarks, sliding
from isomatch.cohort.shape_statistics.sliding import BendingEnergy
from isomatch.landmarks import Curve, spread_on_surface
from isomatch.surfaces import nearest_on_surface
from shapes import icosphere

CURVE, PATCH = Curve("rim", (4, 5, 6, 7, 8)), range(9, 60)


@pytest.fixture(scope="module")
def specimens():
    """Four ellipsoids with four landmarks, an open curve and a patch, drawn at other places on each."""
    ball, random = icosphere(3), np.random.default_rng(0)
    start = random.standard_normal((60, 3))
    angles = np.linspace(0, 2, 5)[:, None]
    start[4:9] = np.cos(angles) * [1, 0, 0] + np.sin(angles) * [0, 1, 0]
    meshes, places = [], []
    for _ in range(4):
        axes = random.uniform(0.8, 1.3, 3)
        mesh = ball.moved(ball.vertices * axes)
        own = start + 0.1 * random.standard_normal((60, 3))
        own /= np.linalg.norm(own, axis=1, keepdims=True)
        places.append(nearest_on_surface(mesh, own * axes).interpolated(mesh.vertices))
        meshes.append(mesh)
    return np.array(places), meshes


def energy_matrix(points):
    """The upper left block of the inverse of the bordered kernel, as Bookstein 1989, with the kernel −r."""
    points = points - points.mean(axis=0)
    points = points / np.linalg.norm(points)
    m = len(points)
    affine = np.column_stack([np.ones(m), points])
    bordered = np.block([[-cdist(points, points), affine], [affine.T, np.zeros((4, 4))]])
    return np.linalg.inv(bordered)[:m, :m]


def test_the_energy_is_that_of_the_bordered_kernel_and_of_scipy():
    random = np.random.default_rng(1)
    points, values = random.standard_normal((2, 30, 3))
    energy = BendingEnergy(points).of_each(values[None])[0]
    np.testing.assert_allclose(energy, np.trace(values.T @ energy_matrix(points) @ values), rtol=1e-7)
    unit = (points - points.mean(axis=0)) / np.linalg.norm(points - points.mean(axis=0))
    spline = RBFInterpolator(unit, values, kernel="linear", degree=1)  # its kernel is −r, too
    weights = spline._coeffs[:30]  # with its scale of coordinates, which the linear kernel does not depend on
    np.testing.assert_allclose(energy, -np.trace(weights.T @ cdist(unit, unit) @ weights), rtol=1e-6)


def test_affine_maps_do_not_bend():
    random = np.random.default_rng(2)
    points = random.standard_normal((40, 3))
    maps, shifts = random.standard_normal((5, 3, 3)), random.standard_normal((5, 1, 3))
    assert BendingEnergy(points).of_each(points @ maps + shifts).max() < 1e-20
    assert BendingEnergy(points).of_each(points[None] ** 2).min() > 1e-3


def test_steps_are_those_of_the_direct_formula(monkeypatch):
    """t = −(UᵀBU)⁻¹UᵀBy with orthonormal directions: two of a surface, one of a curve, none of the fixed points."""
    random = np.random.default_rng(3)
    m, counts = 25, [0] * 4 + [1] * 5 + [2] * 15 + [3]
    points, shape = random.standard_normal((2, m, 3))
    frames = np.linalg.qr(random.standard_normal((m, 3, 3)))[0]
    directions = [frames[i][:, :count] for i, count in enumerate(counts)]
    tangents = np.array([each @ each.T for each in directions])
    columns = [np.kron(np.eye(m)[:, [i]], each) for i, each in enumerate(directions)]  # (3 m, count)
    u, b = np.hstack(columns), np.kron(energy_matrix(points), np.eye(3))
    expected = -u @ np.linalg.solve(u.T @ b @ u, u.T @ b @ shape.ravel())
    bending = BendingEnergy(points)
    monkeypatch.setattr(sliding, "MAX_RESIDUAL", 1e-12)
    monkeypatch.setattr(sliding, "MAX_ITERATIONS", 500)
    found = bending.least(np.stack([shape, 2 * shape]), np.stack([tangents] * 2))
    np.testing.assert_allclose(found[0].ravel(), expected, atol=1e-8)
    np.testing.assert_allclose(found[1], 2 * found[0], atol=1e-8)
    assert bending.of_each(shape + found[:1])[0] < bending.of_each(shape[None])[0]


def test_points_stay_on_surfaces_and_curves_and_fixed_points_where_they_are(specimens):
    places, meshes = specimens
    slid = slid_semilandmarks(places, meshes, [CURVE], PATCH)
    assert (slid.energy_after < 0.5 * slid.energy_before).all()
    fixed = [0, 1, 2, 3, 4, 8]
    assert np.array_equal(slid.positions[:, fixed], places[:, fixed])
    assert (np.abs(slid.positions - places)[:, 9:].mean(axis=(1, 2)) > 0.01).all()
    for mesh, own, start in zip(meshes, slid.positions, places):
        near = nearest_on_surface(mesh, own).interpolated(mesh.vertices)
        np.testing.assert_allclose(own, near, atol=1e-12)
        steps = np.linalg.norm(np.diff(own[4:9], axis=0), axis=1).sum()
        assert steps == pytest.approx(np.linalg.norm(np.diff(start[4:9], axis=0), axis=1).sum(), rel=0.05)


def test_a_closed_curve_slides_but_for_its_first_point(specimens):
    places, meshes = specimens
    slid = slid_semilandmarks(places, meshes, [CURVE._replace(closed=True)])
    assert np.flatnonzero((slid.positions != places).any(axis=(0, 2))).tolist() == [5, 6, 7, 8]


def test_order_place_orientation_and_size_do_not_matter(specimens):
    places, meshes = specimens
    slid = slid_semilandmarks(places, meshes, [CURVE], PATCH)
    turn = np.linalg.qr(np.random.default_rng(4).standard_normal((3, 3)))[0]
    turn *= np.linalg.det(turn)

    def moved(points):
        return 10 * points @ turn + 5

    order = [2, 0, 3, 1]
    others = np.array([moved(places[2]), *places[order[1:]]])
    surfaces = [meshes[2].moved(moved(meshes[2].vertices)), *(meshes[i] for i in order[1:])]
    again = slid_semilandmarks(others, surfaces, [CURVE], PATCH)
    np.testing.assert_allclose(again.positions[0], moved(slid.positions[2]), atol=1e-3)
    np.testing.assert_allclose(again.positions[1:], slid.positions[order[1:]], atol=1e-4)
    np.testing.assert_allclose(again.energy_after, slid.energy_after[order], rtol=1e-3)


def test_a_point_without_a_place_does_not_count(specimens):
    """Where all specimens lack it beside fixed points, and where one does without any."""
    places, meshes = specimens
    without = slid_semilandmarks(places[:, :50], meshes, (), range(9, 50))
    lacking = places.copy()
    lacking[:, 50:] = np.nan
    slid = slid_semilandmarks(lacking, meshes, (), range(9, 60))
    assert np.isnan(slid.positions[:, 50:]).all()
    # steps are known to a hundredth; with no fixed point at all, where points go depends on the last digits
    np.testing.assert_allclose(slid.positions[:, :50], without.positions, atol=0.02)
    lacking[1:, 50:] = places[1:, 50:]
    one = slid_semilandmarks(lacking[:, 9:], meshes, (), range(51))
    assert np.isfinite(one.positions).all(axis=2).sum() == 4 * 51 - 10
    assert (one.energy_after < one.energy_before).all()


def test_points_are_spread_evenly_on_both_sides_of_a_thin_plate_and_keep_them():
    ball, random = icosphere(4), np.random.default_rng(5)
    plate = ball.moved(ball.vertices * [1, 1, 0.01])
    around, spacing = plate.vertices[:5], np.sqrt(plate.area / 405)
    points = spread_on_surface(plate, 400, around)
    near = nearest_on_surface(plate, points).interpolated(plate.vertices)
    np.testing.assert_allclose(points, near, atol=1e-12)
    assert cKDTree(around).query(points)[0].min() > 0.4 * spacing
    for sign in (1, -1):
        side = points[sign * points[:, 2] > 0]
        assert cKDTree(side).query(side, 2)[0][:, 1].min() > 0.5 * spacing
        gaps = cKDTree(side).query(plate.vertices[sign * plate.vertices[:, 2] > 0])[0]
        assert gaps.max() < 1.35 * spacing
    places = np.stack([points[:40]] * 3)
    places[1:, 10:] += 0.2 * random.standard_normal((2, 30, 3)) * [1, 1, 0]
    places = np.stack([nearest_on_surface(plate, own).interpolated(plate.vertices) for own in places])
    slid = slid_semilandmarks(places, [plate] * 3, (), range(10, 40))
    inner = np.hypot(*places[:, :, :2].T).T < 0.9
    assert (np.sign(slid.positions[..., 2]) == np.sign(places[..., 2]))[inner].all()


def test_what_cannot_slide_is_refused(specimens, monkeypatch):
    places, meshes = specimens
    with pytest.raises(LandmarkError, match="4 specimens, 3 surfaces; give each its own"):
        slid_semilandmarks(places, meshes[:3], (), PATCH)
    with pytest.raises(LandmarkError, match="cannot spread 4 points over an area of 0"):
        spread_on_surface(meshes[0].moved(np.zeros_like(meshes[0].vertices)), 4, places[0])
    monkeypatch.setenv("ISOMATCH_MEMORY_BUDGET", "0.00001")
    with pytest.raises(MemoryBudgetError, match="the bending energy of 60 points"):
        slid_semilandmarks(places, meshes, (), PATCH)


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("criterion", ["bending", "distance"])
def test_points_that_were_put_elsewhere_slide_back_without_meshes(dim, criterion):
    """Of straight edges whose points alone differ between specimens, and a flat patch in space."""
    rng = np.random.default_rng(0)
    corners = np.array([[0, 0, 0], [4, 0, 0], [4, 3, 0], [0, 3, 0.0]])
    shares = np.array([0.25, 0.5, 0.75])
    specimens = []
    for _ in range(5):
        along = shares + 0.08 * rng.normal(size=3)
        edge = corners[0] + along[:, None] * (corners[1] - corners[0])
        inner = np.array([[1, 1, 0], [2, 1, 0], [3, 1, 0], [1, 2, 0], [2, 2, 0], [3, 2, 0]])
        inner = inner + [0.1, 0.1, 0] * rng.normal(size=(6, 3))
        specimens.append(np.concatenate([corners, edge, inner]))
    shapes = (np.array(specimens) + np.eye(3)[2])[:, :, :dim]
    curve, until = Curve("e", (0, 4, 5, 6, 1)), {"most_rounds": 30, "enough": 1e-9}
    found = slid_semilandmarks(shapes, None, [curve], range(7, 13), criterion=criterion, **until)
    np.testing.assert_array_equal(found.positions[:, :4], shapes[:, :4])
    spread, before = (np.ptp(each, axis=0).max() for each in (found.positions, shapes))
    assert spread < 1e-2 * before
    np.testing.assert_allclose(found.positions[:, 4:7, 1], 0, atol=1e-9)
    if dim == 3:
        np.testing.assert_allclose(found.positions[:, :, 2], 1, atol=1e-9)


def test_what_cannot_slide():
    with pytest.raises(LandmarkError, match="1 specimens have no mean shape"):
        slid_semilandmarks(np.zeros((1, 5, 3)))
    with pytest.raises(SettingError, match="criterion"):
        slid_semilandmarks(np.zeros((2, 5, 3)), criterion="length")
