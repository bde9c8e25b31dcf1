"""Vertex maps and functional maps: against plain least squares, on maps that are known, and their laws."""

import numpy as np
import pytest
from scipy.linalg import polar

from isomatch import laplace_basis
from isomatch.correspondence import SampledBasis, SpectralPair, fit_functional_map, spectral_embedding
from isomatch_lab.procedural import creature


@pytest.fixture(scope="module")
def basis():
    return laplace_basis(creature(1500).mesh, 60)


@pytest.fixture(scope="module")
def samples(basis):
    return np.random.default_rng(0).permutation(len(basis.vectors))[:400]


@pytest.fixture(scope="module")
def relabelled(basis, samples):
    """A basis, the same with its vertices shuffled, and where each sampled vertex went."""
    new = np.random.default_rng(1).permutation(len(basis.vectors))
    target = np.empty_like(basis.vectors)
    target[new] = basis.vectors
    return SpectralPair(SampledBasis(basis.vectors, samples), target), new


@pytest.mark.parametrize("k", [1, 7, 60])
def test_one_decomposition_fits_every_number_of_functions(basis, samples, k):
    values = np.random.default_rng(2).normal(size=(len(samples), 3))
    found = SampledBasis(basis.vectors, samples).fit(values, k)
    expected = np.linalg.lstsq(basis.vectors[samples, :k], values, rcond=None)[0]
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_a_relabelling_has_the_identity_as_functional_map(relabelled, samples):
    pair, new = relabelled
    np.testing.assert_allclose(pair.functional_map(new[samples], 60), np.eye(60), atol=1e-8)
    np.testing.assert_array_equal(pair.image(np.eye(60)), new[samples])


def test_functional_map_carries_functions_of_the_target_to_the_source(relabelled, samples):
    """Φ_source F ≈ Φ_target[image], whatever the map."""
    pair, _ = relabelled
    image = np.random.default_rng(3).integers(len(pair.target), size=len(samples))
    found = pair.functional_map(image, 20)
    np.testing.assert_allclose(
        found, fit_functional_map(pair.source.at_samples[:, :20], pair.target[image, :20]), atol=1e-9
    )


def test_embedding_of_the_source_does_not_depend_on_the_map(relabelled):
    pair, _ = relabelled
    rotation = np.linalg.qr(np.random.default_rng(4).normal(size=(12, 12)))[0]
    source, target = pair.embedding(rotation)
    np.testing.assert_array_equal(source, pair.source.functions[:, :12])
    np.testing.assert_allclose(target @ rotation, pair.target[:, :12], atol=1e-9)
    rectangular = spectral_embedding(np.ones((3, 5)), pair.source.functions, pair.target)
    assert (rectangular.source.shape[1], rectangular.target.shape[1]) == (3, 3)


def test_upsampling_recovers_the_map_from_a_few_functions(relabelled):
    pair, _ = relabelled
    found = pair.upsample(np.eye(8), range(10, 61, 5))
    assert found.shape == (60, 60)
    np.testing.assert_allclose(found, np.eye(60), atol=1e-8)


def test_icp_ends_in_an_orthogonal_map(basis, relabelled):
    pair, _ = relabelled
    noise = polar(np.eye(30) + 0.02 * np.random.default_rng(5).normal(size=(30, 30)))[0]
    found = pair.orthogonal_icp(noise, 30, 10, basis.weights)
    np.testing.assert_allclose(found.T @ found, np.eye(30), atol=1e-9)
    np.testing.assert_allclose(found, np.eye(30), atol=1e-6)


def test_signs_of_the_functions_do_not_matter(relabelled, samples):
    pair, new = relabelled
    signs = np.random.default_rng(6).choice([-1.0, 1.0], 60)
    flipped = SpectralPair(SampledBasis(pair.source.functions * signs, samples), pair.target)
    image = new[samples].copy()
    image[::5] = 0
    plain, turned = (basis.image(basis.functional_map(image, 25)) for basis in (pair, flipped))
    np.testing.assert_array_equal(plain, turned)
