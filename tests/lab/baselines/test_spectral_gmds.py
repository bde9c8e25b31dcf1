"""Spectral GMDS: distances in the Laplace–Beltrami domain against all of them; what the solution keeps."""

from dataclasses import replace

import numpy as np
import pytest
from poses import landmarks_of

from isomatch import geodesic_distances, prepare
from isomatch.datasets import ground_truth
from isomatch_lab.baselines import SpectralGmdsConfig, spectral_gmds
from isomatch_lab.baselines.functional_maps import FunctionalEnergy
from isomatch_lab.baselines.spectral_gmds import coefficient_map, spectral_distances
from isomatch_lab.baselines.task import Task
from isomatch_lab.procedural import creature
from shapes import disguised, icosphere

CONFIG = SpectralGmdsConfig(sizes=(15, 30))


@pytest.fixture(scope="module")
def poses():
    """Two poses of an animal, differently triangulated, and the truth."""
    made = creature(1500, pose=1, triangulation=1), creature(2000, pose=5, triangulation=2)
    return *(prepare(one.mesh) for one in made), ground_truth(*made).vertices


@pytest.fixture(scope="module")
def copies(poses):
    """One of them, its relabelled copy, and the relabelling."""
    other = disguised(poses[0].surface, seed=3, scale=2.0)
    return poses[0], prepare(other.mesh), other.new_vertex


def task_of(source, target, **priors):
    given = {"landmarks": None, "initial_map": None, "initial_descriptors": None} | priors
    return Task.of(source, target, **given, seed=0)


def test_distances_are_those_of_the_whole_matrix():
    """ΦᵀA D A Φ of all distances, which few columns approximate; the leading entry is the average distance, 1."""
    shape = prepare(icosphere(3))
    phi = shape.laplace.vectors[:, :20] * shape.laplace.weights[:, None]
    everything = geodesic_distances(shape.body, np.arange(shape.body.n_vertices)) / shape.intrinsic_scale
    found = spectral_distances(shape, 20)
    np.testing.assert_allclose(found, phi.T @ everything @ phi, atol=5e-3)
    assert found[0, 0] == pytest.approx(1, abs=5e-3)


def test_average_distance_of_a_sphere():
    """On a unit sphere it is π / 2 everywhere, so constants are kept apart; degree 1 has −π / 8 in all three."""
    shape = prepare(icosphere(4))
    found = spectral_distances(shape, 4) * shape.intrinsic_scale * shape.scale
    np.testing.assert_allclose(np.diag(found), [np.pi / 2, *[-np.pi / 8] * 3], rtol=0.01)
    np.testing.assert_allclose(found - np.diag(np.diag(found)), 0, atol=0.01)


@pytest.mark.long
@pytest.mark.parametrize("prior", ["landmarks", "initial_map", "signatures"])
def test_map_of_a_relabelled_copy_commutes(copies, prior):
    source, target, truth = copies
    priors = {"landmarks": {"landmarks": landmarks_of(source, truth)}, "initial_map": {"initial_map": truth}}
    alpha, origin = coefficient_map(task_of(source, target, **priors.get(prior, {})), CONFIG)
    assert origin == prior.replace("_", " ")
    here, there = (spectral_distances(shape, 30) for shape in (source, target))
    assert np.linalg.norm(alpha @ there - here @ alpha) < 0.02 * np.linalg.norm(here)
    expected = source.laplace.coefficients(target.laplace.vectors[truth, :30], 30)
    assert np.linalg.norm(alpha - expected) < 0.1 * np.linalg.norm(expected)


@pytest.mark.long
def test_areas_are_kept(poses):
    """α m_t = m_s, αᵀ m_s = m_t and αᵀα = I, with m the coefficients of 1."""
    source, target, truth = poses
    alpha, _ = coefficient_map(task_of(source, target, landmarks=landmarks_of(source, truth)), CONFIG)
    m_s, m_t = (s.laplace.coefficients(np.ones((s.body.n_vertices, 1)), 30)[:, 0] for s in (source, target))
    np.testing.assert_allclose(alpha @ m_t, m_s, atol=1e-4)
    np.testing.assert_allclose(alpha.T @ m_s, m_t, atol=1e-4)
    np.testing.assert_allclose(alpha.T @ alpha, np.eye(30), atol=1e-9)


def test_signs_of_eigenfunctions_do_not_matter(poses):
    source, target, truth = poses
    priors = {"landmarks": landmarks_of(source, truth)}
    flips = np.random.default_rng(0).choice([-1.0, 1.0], len(target.laplace.values))
    flipped = replace(target, laplace=replace(target.laplace, vectors=target.laplace.vectors * flips))
    plain, other = (coefficient_map(task_of(source, t, **priors), CONFIG)[0] for t in (target, flipped))
    np.testing.assert_allclose(other, plain * flips[:30], atol=1e-6)


@pytest.mark.long
def test_distances_landmarks_and_growth_decide(poses):
    """Without distances α commutes less with them; without growth, or with wrong landmarks, the map is worse."""
    source, target, truth = poses
    landmarks = landmarks_of(source, truth)
    wrong = np.column_stack([landmarks[:, 0], np.roll(landmarks[:, 1], 1)])
    columns = geodesic_distances(target.surface, truth[::15]) / np.sqrt(target.surface.area)
    here, there = (spectral_distances(shape, 30) for shape in (source, target))

    def commutator(**weights):
        config = replace(CONFIG, **weights)
        alpha, _ = coefficient_map(task_of(source, target, landmarks=landmarks), config)
        return np.linalg.norm(alpha @ there - here @ alpha)

    def error(**given):
        image = spectral_gmds(source, target, **given).map.vertices[::15]
        return columns[np.arange(len(image)), image].mean()

    assert commutator(distance_weight=0.0) > 1.5 * commutator()
    good = error(landmarks=landmarks)
    assert good < 0.015
    assert error(landmarks=landmarks, config=SpectralGmdsConfig(final_sizes=())) > 1.3 * good
    assert error(landmarks=wrong) > 0.1


def test_prescribed_entries_of_an_energy():
    """The rest is least squares with these entries moved to the right."""
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=(3, 9)), rng.normal(size=(4, 9))
    energy = FunctionalEnergy(3, 4)
    energy.preserve(a, b, 1.0)
    known = np.full((3, 4), np.nan)
    known[0, 1], known[2] = 0.7, 0.0
    found = energy.minimiser(known)
    np.testing.assert_array_equal(found[2], 0)
    assert found[0, 1] == 0.7
    rest = [0, 2, 3]
    np.testing.assert_allclose(
        found[0, rest], np.linalg.lstsq(b[rest].T, a[0] - 0.7 * b[1], rcond=None)[0], atol=1e-6
    )
    np.testing.assert_allclose(found[1], np.linalg.lstsq(b.T, a[1], rcond=None)[0], atol=1e-6)
