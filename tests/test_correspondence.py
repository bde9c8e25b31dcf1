"""A map is an operator from values on the target to values on the source."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.io import savemat

from isomatch import (
    Correspondence,
    DescriptorError,
    FormatError,
    MapError,
    MissingFileError,
    SettingError,
)
from isomatch.correspondence import read_map


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


def test_pull_back_interpolates_at_the_precise_image(precise):
    np.testing.assert_allclose(precise.pull_back([0.0, 10, 20, 30, 40]), [7, 24, 40, np.nan])


@given(maps(), st.data())
def test_pull_back_is_linear_and_the_same_as_the_operator(f, data):
    number = st.floats(-1e3, 1e3)
    x, y = (np.array(data.draw(st.lists(number, min_size=f.n_target, max_size=f.n_target))) for _ in range(2))
    np.testing.assert_allclose(f @ (2 * x - 3 * y), 2 * (f @ x) - 3 * (f @ y), atol=1e-9)
    np.testing.assert_array_equal(f @ x, f.pull_back(x))
    columns = f @ np.column_stack([x, y])
    assert columns.shape == (f.shape[0], 2)
    np.testing.assert_array_equal(columns, np.column_stack([f @ x, f @ y]))


@given(maps())
def test_turned_around_lands_where_it_came_from(f):
    back = f.reversed()
    assert back.shape == f.shape[::-1]
    assert back.matched.sum() == len(np.unique(f.vertices[f.matched]))
    hit = np.flatnonzero(back.matched)
    np.testing.assert_array_equal(f.vertices[back.vertices[hit]], hit)
    for j in hit:
        assert back.vertices[j] == np.flatnonzero(f.vertices == j)[0], "the first of several"


@given(st.data(), st.integers(0, 8), st.integers(1, 8), st.integers(1, 8))
def test_composition_pulls_back_in_two_steps(data, a, b, c):
    f, g = data.draw(maps(a, b)), data.draw(maps(b, c))
    values = np.arange(c, dtype=float)
    np.testing.assert_array_equal(f.then(g) @ values, f @ (g @ values))


def test_composition_of_maps_that_do_not_meet():
    with pytest.raises(MapError, match="vertices"):
        Correspondence([0, 3], 4).then(Correspondence([0, 1, 2], 5))


def assert_equal(one, other):
    assert one.n_target == other.n_target
    for name in ("vertices", "faces", "barycentric"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


@pytest.mark.parametrize("n_target", [None, 5])
def test_round_trip_through_npz(tmp_path, precise, n_target):
    precise.save(tmp_path / "map.npz")
    assert_equal(Correspondence.load(tmp_path / "map.npz", n_target), precise)
    with np.load(tmp_path / "map.npz", allow_pickle=False) as stored:
        assert str(stored["direction"]) == "source -> target"


@pytest.mark.parametrize("image", [[0, 2, 4, -1], [3], [-1, -1], []])
def test_round_trip_through_text(tmp_path, image):
    Correspondence(image, 7).save(tmp_path / "map.txt")
    loaded = Correspondence.load(tmp_path / "map.txt")
    np.testing.assert_array_equal(loaded.vertices, np.array(image, dtype=int))
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


def test_npz_of_another_program_with_a_mesh(tmp_path, precise):
    """Names that isomatch also uses do not make it one of isomatch, whose files have no other variable."""
    path = tmp_path / "map.npz"
    mesh = {"vertices": np.zeros((4, 3)), "faces": [[0, 1, 2], [1, 3, 2]], "n_target": 3}
    np.savez(path, **mesh, map=[3, 1, 2, 2])
    found = read_map(path, 3)
    assert (found.map.vertices.tolist(), found.counts_from) == ([2, 0, 1, 1], 1)
    precise.save(path)
    with pytest.raises(FormatError, match="isomatch"):
        Correspondence.load(path, variable="n_target")


def arrays_of_0_1(precise):
    """What isomatch 0.1 wrote into an .npz file: no format version."""
    return {
        "direction": np.array("source -> target"),
        "vertices": precise.vertices,
        "n_target": precise.n_target,
        "faces": precise.faces,
        "barycentric": precise.barycentric,
    }


def test_files_of_version_0_1_are_read(tmp_path, precise):
    np.savez_compressed(tmp_path / "map.npz", **arrays_of_0_1(precise))
    assert_equal(Correspondence.load(tmp_path / "map.npz"), precise)
    (tmp_path / "map.txt").write_text(
        "# isomatch map, source -> target\n# 2 source vertices, 7 target vertices\n"
        "# line i (from 0): 0-based target vertex of source vertex i, -1 if unmatched\n4\n-1\n"
    )
    assert_equal(Correspondence.load(tmp_path / "map.txt"), Correspondence([4, -1], 7))


def test_files_of_a_newer_version_are_refused(tmp_path, precise):
    precise.save(tmp_path / "map.txt")
    text = (tmp_path / "map.txt").read_text()
    (tmp_path / "map.txt").write_text(text.replace("format version 1", "format version 2"))
    np.savez(tmp_path / "map.npz", format_version=2, anything=0)
    for name in ("map.txt", "map.npz"):
        with pytest.raises(FormatError, match=f"{name}.*upgrade"):
            Correspondence.load(tmp_path / name)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"vertices": None}, "it has no array 'vertices'"),
        (
            {"vertices": np.array([0.0, 2, 4, -1])},
            r"vertices has shape \(4,\) and type float64, not integers",
        ),
        ({"vertices": np.array([[0, 2, 4, -1]])}, r"vertices has shape \(1, 4\)"),
        ({"vertices": np.array([0, 2, 5, -1])}, "source vertices 2 are mapped outside"),
        ({"n_target": np.array([5, 5])}, r"n_target has shape \(2,\) .* of shape \(\)"),
        ({"n_target": 2.5}, "n_target has .* type float64, not integers"),
        ({"n_target": -1}, "n_target = -1 is not a number of target vertices"),
        ({"faces": None}, "it has no array 'faces'"),
        ({"faces": np.full((4, 3), 5)}, r"outside the target's 0…4"),
        ({"faces": np.zeros((3, 3), dtype=int)}, r"faces has shape \(3, 3\) .* of shape \(4, 3\)"),
        ({"faces": np.zeros((4, 3))}, "faces has .* type float64"),
        ({"barycentric": np.full((4, 3), np.nan)}, "barycentric has entries that are not finite"),
        ({"barycentric": np.ones((4, 3))}, "sum to 1"),
        ({"direction": "target -> source"}, "does not map source -> target"),
        ({"format_version": "new"}, "format_version has .* not integers"),
    ],
)
def test_contents_are_checked_before_they_are_used(tmp_path, precise, change, message):
    arrays = {
        name: value for name, value in {**arrays_of_0_1(precise), **change}.items() if value is not None
    }
    np.savez(tmp_path / "map.npz", **arrays)
    with pytest.raises(FormatError, match=rf"map\.npz: .*({message})"):
        Correspondence.load(tmp_path / "map.npz")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("once upon a time", r":1: 'once upon a time' is not a target vertex; write one 0-based"),
        ("# mine\n2\n1.5 # half\n", r":3: '1.5' is not a target vertex"),
        ("1\n\x00\n", r":2: has bytes of zero and is no text"),
        ("", ": no target vertices; write one"),
        ("# nothing\n", ": no target vertices"),
        ("1\n-2\n", ": source vertices 1 are mapped outside"),
        (f"{10**30}\n1\n", ":1: '10*' is not a target vertex"),
        (
            "# isomatch map, source -> target\n# 3 source vertices, 2 target vertices\n0\n1\n",
            ": 2 lines for the 3",
        ),
        (
            "# isomatch map, source -> target\n# 1 source vertices, 2 target vertices\n2\n",
            ": source vertices 0 are",
        ),
    ],
)
def test_texts_that_are_no_map(tmp_path, text, message):
    (tmp_path / "map.txt").write_text(text)
    with pytest.raises(FormatError, match=rf"map\.txt({message})"):
        Correspondence.load(tmp_path / "map.txt")


@pytest.mark.parametrize("content", [b"", b"once upon a time", "one array", "pickled"])
def test_npz_that_holds_no_map(tmp_path, content):
    path = tmp_path / "map.npz"
    if isinstance(content, bytes):
        path.write_bytes(content)
    else:
        with path.open("wb") as file:
            np.save(file, np.arange(3) if content == "one array" else np.array([{}]), allow_pickle=True)
    with pytest.raises(FormatError, match="expected"):
        Correspondence.load(path)


@pytest.mark.parametrize("suffix", [".txt", ".npz"])
def test_missing_file(tmp_path, suffix):
    with pytest.raises(MissingFileError, match="nowhere"):
        Correspondence.load(tmp_path / f"nowhere{suffix}")
    (tmp_path / f"folder{suffix}").mkdir()
    with pytest.raises(FormatError, match="opened"):
        Correspondence.load(tmp_path / f"folder{suffix}")


@pytest.mark.parametrize(
    ("image", "faces", "weights", "message"),
    [
        (
            [0, 3],
            None,
            None,
            "source vertices 1 are mapped outside the target's vertices 0…2; .*−1 means unmatched",
        ),
        ([-2, 0], None, None, "source vertices 0 are mapped outside"),
        (
            [[0, 1]],
            None,
            None,
            r"one integer target vertex for each source vertex, not int64 of shape \(1, 2\)",
        ),
        ([0.9, 1.9], None, None, "integer"),
        ([0, 1], [[0, 1, 2]], [[1, 0, 0]], "source"),
        ([0], [[0, 1, 2]], None, "both or neither"),
        ([0], [[0, 1, 3]], [[1.0, 0.0, 0.0]], r"outside the target's 0…2"),
        ([0], [[0, 1, 2]], [[5.0, 0.0, 0.0]], "sum to 1"),
        ([0], [[0, 1, 2]], [[-0.5, 1.0, 0.5]], "not negative"),
        ([0], [[0, 1, 2]], [[np.nan, 0.5, 0.5]], "must be numbers"),
        ([0], [[0, 1, 1.5]], [[1.0, 0.0, 0.0]], "faces have type float64, expected integers"),
        ([0], [[0, 1, 2]] * 2, [[1.0, 0.0, 0.0]] * 2, "one row of three"),
        ([0], [[0, 1, 2]], [[1.0, 0.0]], "one row of three"),
    ],
)
def test_images_that_make_no_sense(image, faces, weights, message):
    with pytest.raises(MapError, match=message):
        Correspondence(image, 3, faces, weights)


def test_values_of_the_wrong_side():
    with pytest.raises(DescriptorError, match="vertices"):
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


@pytest.mark.parametrize("name", ["map.txt", "map.npz"])
def test_map_of_another_target(tmp_path, name):
    Correspondence([0, 1], 3).save(tmp_path / name)
    with pytest.raises(FormatError, match="not 4"):
        Correspondence.load(tmp_path / name, n_target=4)


def test_what_was_given_for_unmatched_vertices_is_of_no_account():
    f = Correspondence([1, -1], 2, [[1, 0, 0], [9, 9, 9]], [[0.5, 0.5, 0], [np.nan, 0, 0]])
    np.testing.assert_array_equal(f.faces, [[1, 0, 0], [-1, -1, -1]])
    np.testing.assert_array_equal(f.pull_back([2.0, 4.0]), [3.0, np.nan])


def mat(path, **variables):
    savemat(path, variables)
    return path


def npy(path, values):
    np.save(path, values)
    return path


@pytest.mark.parametrize(
    ("values", "options", "image", "first"),
    [
        ([2, 0, 1], {"n_target": 3}, [2, 0, 1], 0),
        ([3, 1, 2], {"n_target": 3}, [2, 0, 1], 1),
        ([3, -1, 2], {"n_target": 3}, [2, -1, 1], 1),
        ([3.0, np.nan, 2.0], {"n_target": 3}, [2, -1, 1], 1),
        ([3, 0, 2], {"n_target": 3, "counts_from": 1}, [2, -1, 1], 1),
        ([1, 2, 2], {"n_target": 4, "counts_from": 1}, [0, 1, 1], 1),
        ([1, 2, 2], {"n_target": 4, "counts_from": 0}, [1, 2, 2], 0),
        ([2, -1, 0], {"n_target": 4}, [2, -1, 0], 0),
        ([-1, -1, -1], {"n_target": 4}, [-1, -1, -1], 0),
    ],
)
@pytest.mark.parametrize("suffix", ["mat", "npy"])
def test_maps_of_other_programs(tmp_path, suffix, values, options, image, first):
    path = tmp_path / f"map.{suffix}"
    mat(path, T=np.array([values]).T) if suffix == "mat" else npy(path, np.array([values]))
    found = read_map(path, **options)
    assert (found.map.vertices.tolist(), found.counts_from, found.is_certain) == (image, first, True)
    assert bool(found.note) == (first == 1 and "counts_from" not in options)
    assert found.map.n_target == options["n_target"]


def test_a_map_that_fits_both_readings(tmp_path, caplog):
    for path in (npy(tmp_path / "a.npy", np.array([1, 2, 2])), tmp_path / "a.txt"):
        if path.suffix == ".txt":
            path.write_text("1\n2\n2\n")
        found = read_map(path, 4)
        assert (found.map.vertices.tolist(), found.is_certain) == ([1, 2, 2], False), (
            "these count from 0 by contract"
        )
        assert found.note.endswith(
            "indices are read as 0-based; neither 0 nor 4 is among them, which would settle it"
        )
    path = mat(tmp_path / "a.mat", T=np.array([1.0, 2, 2]))
    with pytest.raises(FormatError, match="indices"):
        Correspondence.load(path, 4)
    assert not read_map(path, 4, allow_doubt=True).is_certain
    mat(path, T=np.array([0.0, 0, 2]))
    with pytest.raises(FormatError, match="count"):
        Correspondence.load(path, 4)
    Correspondence.load(npy(tmp_path / "b.npy", np.array([4, 1])), 4)
    assert "b.npy: counts from 1, as its largest index, 4, is the number of target vertices" in caplog.text


@pytest.mark.parametrize("suffix", ["mat", "npy", "npz", "txt"])
@pytest.mark.parametrize(
    ("values", "certain", "likely"),
    [
        ([0, 1, 2, 3], True, True),
        ([3, 0, -1, 3], True, True),
        ([3, 0, 1, 3], False, True),
        ([0, 0, 2, 2], False, True),
        ([0, 0, 2, 3], False, False),
        ([3, 1, 2, 3], False, False),
    ],
)
def test_a_zero_may_mean_unmatched(tmp_path, suffix, values, certain, likely):
    """Whatever the suffix: it tells only beside −1, or as one of all indices."""
    path = tmp_path / f"map.{suffix}"
    write = {"mat": lambda: mat(path, T=values), "txt": lambda: np.savetxt(path, values, fmt="%d")}
    write |= {"npy": lambda: npy(path, values), "npz": lambda: np.savez(path, T=values)}
    write[suffix]()
    found = read_map(path, 5, allow_doubt=True)
    assert (found.map.vertices.tolist(), found.counts_from) == (values, 0)
    assert (found.is_certain, found.is_likely, not found.note) == (certain, likely, likely)


def test_the_variable_of_a_map_is_found_by_its_shape(tmp_path):
    arrays = {"T12": np.arange(5.0), "T21": np.arange(7.0), "C": np.eye(5), "name": "cat"}
    path = mat(tmp_path / "map.mat", **arrays)
    assert Correspondence.load(path, 7, 5).vertices.tolist() == [0, 1, 2, 3, 4]
    assert Correspondence.load(path, 7, variable="T21").shape == (7, 7)
    np.savez(tmp_path / "map.npz", **{name: arrays[name] for name in ("T12", "T21", "C")})
    assert Correspondence.load(tmp_path / "map.npz", 7, 5).shape == (5, 7)
    for one in (path, tmp_path / "map.npz"):
        with pytest.raises(FormatError, match="vertices"):
            Correspondence.load(one, 7)
        with pytest.raises(FormatError, match="vertices"):
            Correspondence.load(one, 7, 9)
        with pytest.raises(FormatError, match="variable"):
            Correspondence.load(one, 7, variable="T")


@pytest.mark.parametrize(
    ("values", "options", "message"),
    [
        ([0.5, 1], {}, "fractions are no vertices"),
        (
            [0, 4],
            {"n_target": 4},
            "has both 0 and 4, the number of target vertices; if it counts from 1, and 0 means",
        ),
        ([0, 5], {"n_target": 4}, "mapped outside the target's vertices"),
        ([0, 1], {"n_source": 3}, "no array has one number for each of the source's 3 vertices"),
        ([[0, 1], [1, 0]], {}, r"it holds the array \(2, 2\)"),
        (["a"], {}, "no array has one number"),
    ],
)
def test_arrays_that_are_no_map(tmp_path, values, options, message):
    with pytest.raises(FormatError, match=rf"map\.npy: .*{message}"):
        Correspondence.load(npy(tmp_path / "map.npy", np.array(values)), **options)


def test_files_of_arrays_that_are_damaged(tmp_path):
    path = npy(tmp_path / "map.npy", np.arange(9))
    whole = path.read_bytes()
    for damaged in (b"", whole[:40], whole[:-9], whole.replace(b"(9,)", b"(9999999999,)")[: len(whole)]):
        path.write_bytes(damaged)
        with pytest.raises(FormatError, match=r"map\.npy: not an array"):
            Correspondence.load(path)
    np.save(path, np.array([{}]), allow_pickle=True)
    with pytest.raises(FormatError, match="object"):
        Correspondence.load(path)
    (tmp_path / "map.mat").write_bytes(b"MATLAB 7.3 " * 40)
    with pytest.raises(FormatError, match="expected"):
        Correspondence.load(tmp_path / "map.mat")
    with pytest.raises(SettingError, match="neither"):
        Correspondence.load(npy(path, np.arange(9)), counts_from=2)
    Correspondence([1, 2], 4).save(tmp_path / "map.txt")
    assert Correspondence.load(tmp_path / "map.txt", counts_from=1).vertices.tolist() == [1, 2], (
        "ours count from 0"
    )
