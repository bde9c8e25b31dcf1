"""Canonical forms: a flat patch is reproduced, poses look alike, and the distance basis is more accurate."""

import numpy as np
import pytest
from scipy.spatial import procrustes
from scipy.spatial.distance import pdist, squareform

from isomatch import MemoryBudgetError, SettingError, canonical_form, distance_basis, geodesic_distances
from isomatch.spectral import classical_scaling
from isomatch_lab.procedural import creature
from shapes import cylinder, flat_grid, icosphere, planar_delaunay

METHODS = ("nystrom", "exact", "fmds")


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("weights", ["area", "uniform"])
def test_a_flat_patch_is_its_own_canonical_form(method, weights):
    patch = planar_delaunay(500)
    form = canonical_form(patch, 2, method, weights=weights)
    assert form.stress < 0.01
    assert procrustes(patch.vertices[:, :2], form.points)[2] < 1e-3


def test_centred_with_axes_of_decreasing_extent():
    patch = flat_grid(5, 20)
    form = canonical_form(patch, 2, "exact")
    np.testing.assert_allclose(patch.vertex_areas @ form.points, 0, atol=1e-9)
    gram = (patch.vertex_areas[:, None] * form.points).T @ form.points
    np.testing.assert_allclose(gram, np.diag(form.values), atol=1e-6)
    assert form.values[0] > form.values[1] > 0


@pytest.mark.long
@pytest.mark.parametrize("method", ["nystrom", "fmds"])
def test_low_rank_routes_agree_with_the_dense_one(mesh, method):
    dense, sampled = (canonical_form(mesh, 3, name).points for name in ("exact", method))
    assert procrustes(dense, sampled)[2] < 1e-3


@pytest.mark.long
def test_stress_covers_all_pairs(mesh):
    form = canonical_form(mesh, 3, "exact", weights="uniform")
    distances = geodesic_distances(mesh, np.arange(mesh.n_vertices))
    straight = squareform(pdist(form.points))
    assert form.stress == pytest.approx(np.linalg.norm(straight - distances) / np.linalg.norm(distances))
    assert canonical_form(mesh, 3, p=100, weights="uniform").stress == pytest.approx(form.stress, rel=0.3)


@pytest.mark.long
def test_poses_of_one_body_look_alike():
    """Two poses on one triangulation: canonical forms differ less than the poses."""
    poses = [creature(1500, pose=pose).mesh for pose in (0, 1)]
    forms = [canonical_form(mesh).points for mesh in poses]
    assert procrustes(*forms)[2] < 0.5 * procrustes(*(mesh.vertices for mesh in poses))[2]


@pytest.mark.long
def test_the_distance_basis_is_more_accurate_than_the_canonical_form(mesh):
    """From the same columns, with an error smaller by almost an order of magnitude."""
    assert distance_basis(mesh, 50, 100).error_estimate() < 0.15 * canonical_form(mesh).stress


def test_more_dimensions_than_positive_eigenvalues():
    with pytest.raises(SettingError, match="eigenvalues"):
        canonical_form(flat_grid(3, 3), 9, "exact")


def test_weighted_points_are_found_again():
    rng = np.random.default_rng(0)
    points, measure = rng.normal(size=(12, 3)), rng.uniform(1, 9, 12)
    distances = squareform(pdist(points))
    found, values = classical_scaling(distances**2, measure, 4)
    np.testing.assert_allclose(squareform(pdist(found)), distances, atol=1e-7)
    # the points have three dimensions: coordinates of the fourth are the root of a rounded 0
    np.testing.assert_allclose(measure @ found, 0, atol=1e-4)
    np.testing.assert_allclose((measure[:, None] * found).T @ found, np.diag(values), atol=1e-6)


def test_unknown_method():
    with pytest.raises(SettingError, match="magic"):
        canonical_form(icosphere(1), method="magic")


def test_exact_form_over_the_memory_budget(monkeypatch):
    monkeypatch.setenv("ISOMATCH_MEMORY_BUDGET", "0.0001")
    with pytest.raises(MemoryBudgetError, match="canonical"):
        canonical_form(cylinder(20, 20), 3, "exact")
