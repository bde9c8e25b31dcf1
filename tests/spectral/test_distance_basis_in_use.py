"""Using a basis: distances of pairs, neighbours, the estimate of its error, precision, files."""

import numpy as np
import pytest

from isomatch import (
    DistanceBasis,
    FormatError,
    MeshError,
    NotConvergedError,
    SettingError,
    distance_basis,
)
from shapes import planar_delaunay


@pytest.fixture(scope="module")
def basis(mesh):
    return distance_basis(mesh)


def true_error(basis, distances):
    difference = basis.row(np.arange(len(distances))) - distances
    weights = basis.weights[:, None] * basis.weights
    return np.sqrt((weights * difference**2).sum() / (weights * distances**2).sum())


@pytest.mark.parametrize("threads", ["1", "3"])
def test_many_pairs_are_those_of_the_rows(basis, threads, monkeypatch):
    monkeypatch.setenv("ISOMATCH_NUM_THREADS", threads)
    i, j = np.random.default_rng(0).integers(len(basis.vectors), size=(2, 100_001))
    rows = basis.row(np.arange(len(basis.vectors)))
    np.testing.assert_allclose(basis.distance(i, j), rows[i, j], atol=1e-12)


@pytest.mark.parametrize("bad", [-2000, 1_000_000])
def test_pairs_outside_the_surface(basis, bad):
    """They are checked before the compiled loop, which does not check."""
    with pytest.raises(MeshError, match="outside"):
        basis.distance(0, bad)


def test_pairs_by_other_than_integers(basis):
    with pytest.raises(MeshError, match="integers"):
        basis.distance(0.5, 1)


def test_nearest_are_a_disc_in_order(basis, all_distances):
    radius = 0.2 * all_distances.max()
    found, distances = basis.nearest(7, radius)
    assert found[0] == 7
    assert distances[0] == 0
    assert (np.diff(distances) >= 0).all()
    assert (distances <= radius).all()
    slack = 0.02 * all_distances.max()
    assert set(np.flatnonzero(all_distances[7] < radius - slack)) <= set(found)
    assert set(found) <= set(np.flatnonzero(all_distances[7] < radius + slack))


@pytest.mark.long
@pytest.mark.parametrize("method", ["predicted", "nystrom", "fmds"])
@pytest.mark.parametrize("weights", ["area", "uniform"])
def test_error_is_estimated_within_a_factor(mesh, all_distances, method, weights):
    for seed in range(4):
        basis = distance_basis(mesh, 40, 80, method, weights, seed)
        assert basis.error_estimate() == pytest.approx(true_error(basis, all_distances), rel=0.4)


def test_error_estimates_follow_the_truncation(basis, all_distances):
    estimates = basis.error_estimates()
    for k in (5, 20, 50):
        part = basis.truncated(k)
        assert part.error_estimate() == pytest.approx(estimates[k - 1])
        assert estimates[k - 1] == pytest.approx(true_error(part, all_distances), rel=0.4)


def test_held_out_columns_are_not_samples(basis):
    assert len(basis.held_out.vertices) == 10
    assert not set(basis.held_out.vertices) & set(basis.samples)


def test_without_held_out_columns_there_is_no_estimate(mesh):
    with pytest.raises(SettingError, match="estimated"):
        distance_basis(mesh, 5, 10, held_out=0).error_estimate()


@pytest.mark.parametrize("tolerance", [0.1, 0.02, 0.01])
def test_tolerance_chooses_rank_and_columns(mesh, all_distances, tolerance):
    basis = distance_basis(mesh, tolerance=tolerance)
    assert basis.error_estimate() <= tolerance
    assert true_error(basis, all_distances) < 1.4 * tolerance
    assert basis.rank == 1 or basis.truncated(basis.rank - 1).error_estimate() > tolerance


def test_tolerance_that_no_basis_reaches():
    with pytest.raises(NotConvergedError, match="tolerance"):
        distance_basis(planar_delaunay(200), tolerance=1e-6)


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ({"method": "magic"}, "method = 'magic' is not one of 'predicted'"),
        ({"weights": "heavy"}, "weights = 'heavy' is not one of 'area'"),
        ({"dtype": np.int32}, "dtype = int32 is not float32 or float64"),
        ({"tolerance": -1.0}, "tolerance = -1.0 is not a positive"),
        ({"engine": "magic"}, "no engine 'magic'"),
    ],
)
def test_bad_settings_are_refused(mesh, setting, message):
    with pytest.raises(SettingError, match=message):
        distance_basis(mesh, 5, 10, **setting)


def test_single_precision_is_near_double(mesh, basis, all_distances):
    single = distance_basis(mesh, dtype=np.float32)
    assert single.vectors.dtype == np.float32
    assert single.vectors.nbytes == basis.vectors.nbytes // 2
    i, j = np.random.default_rng(0).integers(len(basis.vectors), size=(2, 1000))
    far = 2e-6 * all_distances.max()
    np.testing.assert_allclose(single.distance(i, j), basis.distance(i, j), atol=far)
    np.testing.assert_allclose(single.row(3), basis.row(3), atol=far)


def test_saving_and_loading_changes_nothing(basis, tmp_path):
    path = tmp_path / "basis.npz"
    basis.astype(np.float32).save(path)
    basis.save(path)
    assert [file.name for file in tmp_path.iterdir()] == ["basis.npz"]
    back = DistanceBasis.load(path)
    for name in ("vectors", "values", "weights", "samples"):
        np.testing.assert_array_equal(getattr(back, name), getattr(basis, name))
    assert repr(back) == repr(basis)
    assert back.error_estimate() == basis.error_estimate()


@pytest.mark.parametrize("content", [b"", b"nonsense", None])
def test_files_that_hold_no_basis(content, tmp_path):
    path = tmp_path / "basis.npz"
    if content is None:
        np.savez(path, vertices=np.arange(3))
    else:
        path.write_bytes(content)
    with pytest.raises(FormatError, match="distance"):
        DistanceBasis.load(path)


def test_a_matrix_of_distances_has_no_laplacian(all_distances):
    basis = distance_basis(all_distances, 20, 40)
    assert (basis.method, basis.engine) == ("nystrom", "matrix")
    assert basis.error_estimate() < 0.05
    with pytest.raises(SettingError, match="PointCloud"):
        distance_basis(all_distances, 20, 40, "predicted")
