"""A map is an operator from values on the target to values on the source."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from isomatch import Correspondence, FormatError, MapError


@st.composite
def maps(draw, n_source=None, n_target=None):
    n_source = draw(st.integers(0, 12)) if n_source is None else n_source
    n_target = draw(st.integers(1, 12)) if n_target is None else n_target
    image = draw(st.lists(st.integers(-1, n_target - 1), min_size=n_source, max_size=n_source))
    return Correspondence(np.array(image, dtype=int), n_target)


@pytest.fixture
def precise():
    """Four source vertices on a target of five: inside a face, on an edge, at a vertex, unmatched."""
    faces = [[0, 1, 2], [2, 3, 4], [4, 4, 4], [-1, -1, -1]]
    weights = [[0.5, 0.3, 0.2], [0.6, 0.4, 0.0], [1, 0, 0], [1, 0, 0]]
    return Correspondence([0, 2, 4, -1], 5, faces, weights)


def test_pull_back_takes_the_value_of_the_image():
    carried = Correspondence([2, 0, -1], 3).pull_back([10.0, 20.0, 30.0])
    np.testing.assert_array_equal(carried, [30, 10, np.nan])


def test_pull_back_interpolates_at_the_precise_image(precise):
    np.testing.assert_allclose(precise.pull_back([0, 10, 20, 30, 40]), [7, 24, 40, np.nan])


@given(maps(), st.data())
def test_pull_back_is_linear_and_the_same_as_the_operator(f, data):
    number = st.floats(-1e3, 1e3)
    x, y = (np.array(data.draw(st.lists(number, min_size=f.n_target, max_size=f.n_target))) for _ in range(2))
    np.testing.assert_allclose(f @ (2 * x - 3 * y), 2 * (f @ x) - 3 * (f @ y), atol=1e-9)
    np.testing.assert_array_equal(f @ x, f.pull_back(x))
    columns = f @ np.column_stack([x, y])
    assert columns.shape == (f.shape[0], 2)
    np.testing.assert_array_equal(columns, np.column_stack([f @ x, f @ y]))


def test_constants_stay_constant(precise):
    np.testing.assert_allclose((precise @ np.ones(5))[precise.matched], 1)


@given(maps())
def test_turned_around_lands_where_it_came_from(f):
    back = f.reversed()
    assert back.shape == f.shape[::-1]
    assert back.matched.sum() == len(np.unique(f.vertices[f.matched]))
    hit = np.flatnonzero(back.matched)
    np.testing.assert_array_equal(f.vertices[back.vertices[hit]], hit)
    for j in hit:
        assert back.vertices[j] == np.flatnonzero(f.vertices == j)[0], "the first of several"


def test_a_permutation_turned_around_twice_is_itself():
    f = Correspondence(np.random.default_rng(0).permutation(30), 30)
    np.testing.assert_array_equal(f.reversed().reversed().vertices, f.vertices)
    np.testing.assert_array_equal(f.then(f.reversed()).vertices, np.arange(30))


@given(st.data(), st.integers(0, 8), st.integers(1, 8), st.integers(1, 8))
def test_composition_pulls_back_in_two_steps(data, a, b, c):
    f, g = data.draw(maps(a, b)), data.draw(maps(b, c))
    values = np.arange(c, dtype=float)
    np.testing.assert_array_equal(f.then(g) @ values, f @ (g @ values))


def test_composition_of_maps_that_do_not_meet():
    with pytest.raises(MapError, match=r"cannot compose .* the first ends on 4 vertices, the second"):
        Correspondence([0, 3], 4).then(Correspondence([0, 1, 2], 5))


@pytest.mark.parametrize("n_target", [None, 5])
def test_round_trip_through_npz(tmp_path, precise, n_target):
    precise.save(tmp_path / "map.npz")
    loaded = Correspondence.load(tmp_path / "map.npz", n_target)
    assert loaded.n_target == 5
    for name in ("vertices", "faces", "barycentric"):
        np.testing.assert_array_equal(getattr(loaded, name), getattr(precise, name))


def test_npz_tells_its_direction(tmp_path, precise):
    precise.save(tmp_path / "map.npz")
    with np.load(tmp_path / "map.npz", allow_pickle=False) as stored:
        assert str(stored["direction"]) == "source -> target"


@pytest.mark.parametrize("image", [[0, 2, 4, -1], [3], [-1, -1]])
def test_round_trip_through_text(tmp_path, image):
    Correspondence(image, 7).save(tmp_path / "map.txt")
    loaded = Correspondence.load(tmp_path / "map.txt")
    np.testing.assert_array_equal(loaded.vertices, image)
    assert loaded.n_target == 7, "read from the header, not guessed from the largest index"
    text = (tmp_path / "map.txt").read_text(encoding="utf-8")
    assert "source -> target" in text
    assert "0-based" in text


def test_text_of_another_program(tmp_path):
    (tmp_path / "map.txt").write_text("# mine\n2\n0\n-1\n", encoding="utf-8")
    assert Correspondence.load(tmp_path / "map.txt").n_target == 3
    assert Correspondence.load(tmp_path / "map.txt", n_target=9).n_target == 9


def test_npz_with_the_vertices_alone(tmp_path):
    np.savez(tmp_path / "map.npz", vertices=[1, 0])
    loaded = Correspondence.load(tmp_path / "map.npz", n_target=4)
    np.testing.assert_array_equal(loaded.faces, [[1, 1, 1], [0, 0, 0]])


@pytest.mark.parametrize("suffix", [".txt", ".npz"])
def test_file_that_is_no_map(tmp_path, suffix):
    path = tmp_path / f"map{suffix}"
    path.write_text("once upon a time", encoding="utf-8")
    with pytest.raises(FormatError, match=rf"map{suffix}: not a map .*one target index a line"):
        Correspondence.load(path)


def test_missing_file(tmp_path):
    with pytest.raises(FormatError, match=r"nowhere\.txt: not a map"):
        Correspondence.load(tmp_path / "nowhere.txt")


@pytest.mark.parametrize("suffix", [".txt", ".npz"])
def test_empty_file(tmp_path, suffix):
    (tmp_path / f"map{suffix}").write_bytes(b"")
    with pytest.raises(FormatError, match=f"map{suffix}"):
        Correspondence.load(tmp_path / f"map{suffix}")


def test_binary_file_called_text(tmp_path):
    (tmp_path / "map.txt").write_bytes(bytes(range(128, 256)))
    with pytest.raises(FormatError, match=r"map\.txt: not a map"):
        Correspondence.load(tmp_path / "map.txt")


@pytest.mark.parametrize(
    ("image", "message"),
    [
        ([0, 5], "source vertices 1 are mapped outside the target's vertices 0…4; .*−1 means unmatched"),
        ([-2, 0], "source vertices 0 are mapped outside"),
        ([[0, 1]], r"one integer target vertex for each source vertex, not int64 of shape \(1, 2\)"),
    ],
)
def test_images_that_do_not_exist(image, message):
    with pytest.raises(MapError, match=message):
        Correspondence(image, 5)


def test_precise_images_of_another_length():
    with pytest.raises(MapError, match="one row of three for each source vertex"):
        Correspondence([0, 1], 5, [[0, 1, 2]], [[1, 0, 0]])


def test_values_of_the_wrong_side():
    with pytest.raises(MapError, match=r"the target has 4 vertices; pull_back .* use reversed\(\)"):
        Correspondence([0, 1], 4).pull_back([1.0, 2.0])


def test_immutable_and_apart_from_what_it_was_made_of():
    image = np.array([0, 1])
    f = Correspondence(image, 2)
    image[0] = 1
    assert f.vertices[0] == 0
    for array in (f.vertices, f.faces, f.barycentric):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


def test_repr_tells_direction_and_what_is_missing():
    assert repr(Correspondence([0, -1], 3)) == "Correspondence(source 2 → target 3, 1 unmatched)"
    assert repr(Correspondence([0, 1], 3)) == "Correspondence(source 2 → target 3)"


@pytest.mark.parametrize(
    ("faces", "weights", "message"),
    [
        ([[0, 1, 2]], None, "both or neither"),
        ([[0, 1, 3]], [[1.0, 0.0, 0.0]], r"outside the target's 0…2"),
        ([[0, 1, 2]], [[5.0, 0.0, 0.0]], "sum to 1"),
        ([[0, 1, 2]], [[-0.5, 1.0, 0.5]], "must not be negative"),
        ([[0, 1, 2]] * 2, [[1.0, 0.0, 0.0]] * 2, "one row of three"),
    ],
)
def test_precise_images_that_make_no_sense(faces, weights, message):
    with pytest.raises(MapError, match=message):
        Correspondence([0], 3, faces, weights)


def test_fractions_are_no_vertices():
    with pytest.raises(MapError, match="integer"):
        Correspondence([0.9, 1.9], 2)


def test_map_of_another_target(tmp_path):
    Correspondence([0, 1], 3).save(tmp_path / "map.npz")
    with pytest.raises(FormatError, match="a target of 3 vertices, not 4"):
        Correspondence.load(tmp_path / "map.npz", n_target=4)
