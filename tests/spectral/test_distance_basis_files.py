"""A saved distance basis: versions of its file, and contents that are checked before they are used."""

import numpy as np
import pytest

from isomatch import DistanceBasis, FormatError, MissingFileError
from isomatch.geodesics import Sampling

BASIS = DistanceBasis(
    vectors=np.array([[0.5, 0.1], [0.4, -0.2], [0.3, 0.7]]),
    values=np.array([2.0, -1.0]),
    weights=np.array([1.0, 2.0, 0.5]),
    method="nystrom",
    engine="fast_marching",
    samples=np.array([0, 2]),
    held_out=Sampling(np.array([1]), np.array([[1.0, 0.0, 2.0]])),
)
ARRAYS_OF_0_1 = {name: value for name, value in vars(BASIS).items() if name != "held_out"} | {
    "held_out_vertices": BASIS.held_out.vertices,
    "held_out_columns": BASIS.held_out.columns,
}


def assert_equal(one, other):
    for name in ("vectors", "values", "weights", "samples"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    assert (one.method, one.engine) == (other.method, other.engine)
    assert one.error_estimate() == other.error_estimate()


def test_the_file_has_a_format_version(tmp_path):
    BASIS.save(tmp_path / "basis.npz")
    with np.load(tmp_path / "basis.npz", allow_pickle=False) as stored:
        assert stored["format_version"] == 1
    assert_equal(DistanceBasis.load(tmp_path / "basis.npz"), BASIS)


def test_files_of_version_0_1_are_read(tmp_path):
    np.savez(tmp_path / "basis.npz", **ARRAYS_OF_0_1)
    assert_equal(DistanceBasis.load(tmp_path / "basis.npz"), BASIS)


def test_files_of_a_newer_version_are_refused(tmp_path):
    np.savez(tmp_path / "basis.npz", format_version=2, **ARRAYS_OF_0_1)
    with pytest.raises(FormatError, match="isomatch"):
        DistanceBasis.load(tmp_path / "basis.npz")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"vectors": np.ones(3)},
            r"vectors has shape \(3,\) and type float64, not numbers of shape \(any, any\)",
        ),
        ({"vectors": np.full((3, 2), np.inf)}, "vectors has entries that are not finite"),
        ({"vectors": np.ones((3, 2), dtype=complex)}, "vectors has .* type complex128"),
        ({"values": np.ones(3)}, r"values has shape \(3,\) .* of shape \(2\)"),
        ({"weights": np.array([1.0, 0.0, 1.0])}, "weights has entries that are not positive"),
        ({"samples": np.array([0, 3])}, r"samples has entries outside 0…2 at 1"),
        ({"samples": np.array([0.0, 1.0])}, "samples has .* not integers"),
        ({"held_out_columns": np.ones((2, 3))}, "held_out_columns has shape"),
        ({"method": np.array(1)}, "method has .* not a text"),
    ],
)
def test_contents_are_checked_before_they_are_used(tmp_path, change, message):
    np.savez(tmp_path / "basis.npz", **(ARRAYS_OF_0_1 | change))
    with pytest.raises(FormatError, match=message):
        DistanceBasis.load(tmp_path / "basis.npz")


def test_a_missing_file(tmp_path):
    with pytest.raises(MissingFileError, match="nowhere"):
        DistanceBasis.load(tmp_path / "nowhere.npz")
