"""Folders of one's own: every layout gives the truth that was written, relabelled; what does not fit is named."""

import numpy as np
import pytest
from scipy.io import savemat

from data import real_file
from isomatch import Mesh, write_mesh
from isomatch._core.errors import FormatError, MissingFileError, SettingError
from isomatch.evaluation import read_truth
from isomatch_lab.sets import FolderSettings, StoredSet, benchmark_set, own_set
from zoo import grid

A = B = grid(5, 4)
N = A.n_vertices


@pytest.fixture
def image():
    """A true image of each vertex of A: B in another order, which has both 0 and the last vertex."""
    return np.random.default_rng(0).permutation(N)


@pytest.fixture
def folder(tmp_path):
    """A set of two shapes without truth."""
    root = tmp_path / "mine"
    (root / "shapes").mkdir(parents=True)
    (root / "truth").mkdir()
    write_mesh(root / "shapes" / "a.off", A)
    write_mesh(root / "shapes" / "b.ply", Mesh(B.vertices + 1, B.faces))
    return root


def images_of(pair):
    """Truth of a loaded pair in the order of the files."""
    back = np.argsort(pair.moved)
    return dict(zip(pair.truth[:, 0].tolist(), back[pair.truth[:, 1]].tolist()))


def only_pair(folder):
    opened = benchmark_set(str(folder))
    assert opened.name == "mine"
    (names,) = opened.pairs
    return opened.load(*names)


@pytest.mark.parametrize("first", [0, 1])
@pytest.mark.parametrize("kind", ["txt", "npy", "mat", "npz", "rows"])
def test_a_file_for_each_pair(folder, image, kind, first):
    path = folder / "truth" / f"a__b.{kind if kind != 'rows' else 'txt'}"
    counted = image + first
    if kind == "txt":
        np.savetxt(path, counted, fmt="%d")
    elif kind == "rows":
        np.savetxt(path, np.column_stack([np.arange(N) + first, counted]), fmt="%d")
    elif kind == "npy":
        np.save(path, counted)
    elif kind == "npz":
        np.savez(path, anything=counted)
    else:
        savemat(path, {"T12": counted.astype(float)})
    pair = only_pair(folder)
    assert images_of(pair) == dict(enumerate(image.tolist()))
    assert pair.alone.tolist() == [], "it tells of all vertices"
    assert bool(pair.notes) == bool(first), "that it counts from 1 was found, and is told"
    assert (pair.target.vertices.max(axis=0) != B.vertices.max(axis=0) + 1).any(), "it is rotated"


def test_what_has_no_counterpart(folder, image):
    image[[2, 7]] = -1
    np.savetxt(folder / "truth" / "a__b.txt", image, fmt="%d")
    pair = only_pair(folder)
    assert pair.alone.tolist() == [2, 7]
    assert set(images_of(pair)) == set(range(N)) - {2, 7}
    rows = np.column_stack([np.arange(6), image[:6]])
    np.savetxt(folder / "truth" / "a__b.txt", rows[rows[:, 1] >= 0], fmt="%d")
    (folder / "set.toml").write_text("counts_from = 0\n")
    assert only_pair(folder).alone is None, "of the others nothing is known"


def test_points_in_triangles(folder):
    rng = np.random.default_rng(1)
    faces, weights = rng.integers(0, B.n_faces, N), rng.dirichlet(np.ones(3), N)
    faces[0] = B.n_faces - 1
    table = np.column_stack([faces + 1, weights])
    table[3] = -1
    np.savetxt(folder / "truth" / "a__b.txt", table)
    pair = only_pair(folder)
    assert pair.alone.tolist() == [3]
    at = pair.points.interpolated(pair.target.vertices)
    before = np.einsum("ij,ijk->ik", weights, (B.vertices + 1)[B.faces[faces]])[pair.truth[:, 0]]
    apart = [np.linalg.norm(x[:, None] - x, axis=2) for x in (at, before)]
    np.testing.assert_allclose(*apart, atol=1e-6, err_msg="the same points, rotated")
    largest = np.take_along_axis(pair.points.corners, pair.points.barycentric.argmax(axis=1)[:, None], axis=1)
    assert pair.truth[:, 1].tolist() == largest.ravel().tolist()


def test_mirrored_truth_and_groups(folder, image):
    np.savetxt(folder / "truth" / "a__b.txt", image, fmt="%d")
    np.savetxt(folder / "truth" / "a__b.sym.txt", image[::-1], fmt="%d")
    (folder / "pairs.txt").write_text("# mine\ncats a.off b.ply\n")
    (folder / "set.toml").write_text("symmetric = true\n")
    pair = only_pair(folder)
    assert (pair.group, pair.symmetric) == ("cats", True)
    assert np.argsort(pair.moved)[pair.mirrored[:, 1]].tolist() == image[::-1].tolist()


def test_one_triangulation_has_to_be_declared(folder):
    (folder / "truth").rmdir()
    with pytest.raises(MissingFileError, match="beside"):
        own_set(folder)
    (folder / "set.toml").write_text('truth = "vertices"\n')
    assert own_set(folder).pairs == (("a", "b"), ("b", "a")), "all ordered pairs"
    pair = benchmark_set(str(folder)).load("a", "b")
    assert images_of(pair) == {i: i for i in range(N)}
    write_mesh(folder / "shapes" / "c.off", Mesh(B.vertices, B.faces[:, [1, 2, 0]][::-1]))
    assert len(benchmark_set(str(folder)).load("a", "c").truth) == N, (
        "triangles in another order are the same"
    )
    write_mesh(folder / "shapes" / "d.off", Mesh(B.vertices, np.roll(B.faces, 1)))
    with pytest.raises(FormatError, match="have other triangles"):
        benchmark_set(str(folder)).load("a", "d")


def test_vts_files_as_published(folder, image):
    marks = np.arange(0, N, 2)
    (folder / "truth").rmdir()
    np.savetxt(folder / "shapes" / "a.vts", marks + 1, fmt="%d")
    np.savetxt(folder / "shapes" / "b.vts", image[marks] + 1, fmt="%d")
    np.savetxt(folder / "shapes" / "b.sym.vts", image[marks][::-1] + 1, fmt="%d")
    opened = benchmark_set(str(folder))
    assert opened.pairs == (("a", "b"), ("b", "a"))
    pair = opened.load("a", "b")
    assert images_of(pair) == dict(zip(marks.tolist(), image[marks].tolist()))
    assert np.argsort(pair.moved)[pair.mirrored[:, 1]].tolist() == image[marks][::-1].tolist()
    np.savetxt(folder / "shapes" / "b.vts", [1, N + 1], fmt="%d")
    with pytest.raises(FormatError, match="counted"):
        opened.load("a", "b")


def test_parts_of_one_whole_as_published(folder, image):
    """As SHREC'16: the truth of a part is named by the part alone, counts from 1, and leads into triangles."""
    weights = np.tile([0.2, 0.5, 0.3], (N, 1))
    faces = np.arange(N) % B.n_faces
    for name, table in (("a.baryc_gt", faces), ("a.baryc_gt_sym", faces[::-1])):
        np.savetxt(folder / "shapes" / name, np.column_stack([table + 1, weights]), fmt="%d %f %f %f")
    (folder / "truth").rmdir()
    with pytest.raises(SettingError, match="source"):
        own_set(folder)
    (folder / "set.toml").write_text('target = "b"\n')
    pair = only_pair(folder)
    assert images_of(pair) == dict(enumerate(B.faces[faces, 1].tolist()))
    assert np.argsort(pair.moved)[pair.mirrored[:, 1]].tolist() == B.faces[faces[::-1], 1].tolist()


def test_folders_as_they_are_published(folder, image):
    """As SMAL, PARTIALSMAL and TOPKIDS: other names of the folders, and of files of truth."""
    (folder / "truth").rmdir()
    (folder / "shapes").rename(folder / "off")
    (folder / "corres").mkdir()
    for name, marks in (("a", np.arange(N)), ("b", image)):
        np.savetxt(folder / "corres" / f"{name}.vts", marks + 1, fmt="%d")
    assert images_of(benchmark_set(str(folder)).load("a", "b")) == dict(enumerate(image.tolist()))
    for path in (folder / "corres").iterdir():
        path.unlink()
    (folder / "corres").rename(folder / "maps")
    np.savetxt(folder / "maps" / "a_b.map", [*image, *np.ones(N)], fmt="%d")
    assert images_of(only_pair(folder)) == dict(enumerate(image.tolist()))
    (folder / "maps" / "a_b.map").unlink()
    (folder / "maps").rename(folder / "truth")
    (folder / "set.toml").write_text('truth = "onto"\ntarget = "b"\n')
    np.savetxt(folder / "truth" / "a_ref.txt", image + 1, fmt="%d")
    assert images_of(only_pair(folder)) == dict(enumerate(image.tolist()))


def test_maps_beside_a_truth_are_no_truth(folder, image):
    """A folder of a set may hold the maps of a method."""
    np.savetxt(folder / "truth" / "a__b.txt", image, fmt="%d")
    (folder / "maps").mkdir()
    for name in ("a-b.txt", "b-a.txt"):
        np.savetxt(folder / "maps" / name, image[::-1], fmt="%d")
    assert images_of(only_pair(folder)) == dict(enumerate(image.tolist()))


def test_landmarks(folder):
    (folder / "truth").rmdir()
    (folder / "landmarks").mkdir()
    (folder / "landmarks" / "a.csv").write_text("name,vertex\nnose,3\ntail,9\n")
    (folder / "landmarks" / "b.csv").write_text("name,vertex\ntail,1\nnose,4\n")
    assert images_of(benchmark_set(str(folder)).load("a", "b")) == {3: 4, 9: 1}
    for name in "ab":
        (folder / "landmarks" / f"{name}.csv").unlink()
    table = np.array([[3, 0.2, 0.5, 0.3], [1, 0.1, 0.1, 0.8]])
    savemat(folder / "landmarks" / "a.mat", {"points": [1.0, 7], "verts": [[4], [10]], "baryc": table})
    savemat(folder / "landmarks" / "b.mat", {"points": [7.0, 2], "verts": [[5], [6]], "baryc": table})
    pair = benchmark_set(str(folder)).load("a", "b")
    assert images_of(pair) == {9: B.faces[2, 1]}
    np.testing.assert_allclose(pair.points.barycentric, [[0.2, 0.5, 0.3]])


def archive(root, image, **more):
    rows = np.column_stack([np.arange(N), image])
    shapes = {"a": A.vertices, "a_faces": A.faces, "b": B.vertices + 1, "b_faces": B.faces}
    root.mkdir(exist_ok=True)
    np.savez(root / "shapes.npz", **shapes)
    np.savez(root / "truth.npz", **{"a|b": rows, **more})
    return root


def test_two_archives(tmp_path, image):
    mirror = image[::-1].copy()
    image[4] = -1
    root = archive(tmp_path / "mine", image, **{"a|b|mirror": mirror, "a|b|scale": 2.5})
    assert isinstance(own_set(root), StoredSet)
    pair = only_pair(root)
    assert images_of(pair) == {i: int(b) for i, b in enumerate(image) if b >= 0}
    assert (pair.alone.tolist(), pair.unit) == ([4], 2.5)
    assert len(pair.mirrored) == N - 1
    (root / "pairs.txt").write_text("cats a b\n")
    assert only_pair(root).group == "cats"
    assert benchmark_set("mine", tmp_path).pairs == (("a", "b"),), "a name in the folder of the sets"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"a|b": np.array([[0, N]])}, rf"names target vertices {N}…{N}, outside 0…{N - 1}"),
        ({"a|b": np.array([[-1, 0]])}, "names source vertices -1…-1"),
        ({"a|b": np.array([0, 1])}, r"'a\|b' is no array \(m, 2\)"),
        ({"a|b": np.array([[0, -1]])}, "no vertex with a counterpart"),
        ({"a|b|mirror": np.array([0])}, "no array of one vertex for each row"),
        ({"a|b|scale": 0.0}, "is no positive number"),
    ],
)
def test_archives_that_do_not_fit(tmp_path, image, change, message):
    root = archive(tmp_path / "mine", image, **change)
    with pytest.raises(FormatError, match=message):
        own_set(root).pair("a", "b")


def test_shapes_that_are_missing(tmp_path, folder, image):
    root = archive(tmp_path / "stored", image)
    (root / "pairs.txt").write_text("a c\n")
    with pytest.raises(MissingFileError, match="pairs"):
        own_set(root)
    (folder / "pairs.txt").write_text("a b\n")
    with pytest.raises(MissingFileError, match="expected"):
        own_set(folder).pair("a", "b")
    with pytest.raises(MissingFileError, match="no shapes in this folder"):
        own_set(folder / "truth")
    (folder / "pairs.txt").unlink()
    with pytest.raises(MissingFileError, match="shapes"):
        own_set(folder)


@pytest.mark.parametrize(
    ("file", "text", "message"),
    [
        ("pairs.txt", "a\n", "'a' is no pair; write source and target"),
        ("pairs.txt", "a b\na b\n", "pairs.txt:2: a and b are listed twice"),
        ("pairs.txt", "# nothing\n", "lists no pairs"),
        ("set.toml", "truth = 3", "truth = 3 is no value"),
        ("set.toml", 'truth = "magic"', "'magic' is not known; say which in set.toml: truth = \"vertices\""),
        ("set.toml", "colour = 1", "unknown setting 'colour'; known are truth"),
        ("set.toml", "counts_from = 2", "counts_from = 2 is no value"),
        ("set.toml", "counts_from", "not a TOML file"),
        ("set.toml", 'shapes = ["nowhere"]', "there is no folder .*nowhere of shapes"),
    ],
)
def test_lists_and_settings_that_cannot_be_used(folder, file, text, message):
    (folder / file).write_text(text)
    with pytest.raises(FormatError, match=message):
        own_set(folder)


def test_settings_may_list_a_folder_for_each_of_many_shapes(tmp_path):
    folders = [f"subjects/number_{i}/left/surfaces" for i in range(2000)]
    (tmp_path / "set.toml").write_text(f"shapes = {folders}\n")
    assert FolderSettings.read(tmp_path).shapes == tuple(folders)


def test_several_kinds_of_truth_or_files_are_refused(folder, image):
    np.savetxt(folder / "truth" / "a__b.txt", image, fmt="%d")
    np.save(folder / "truth" / "a__b.npy", image)
    with pytest.raises(FormatError, match="both"):
        own_set(folder)
    (folder / "truth" / "a__b.npy").unlink()
    (folder / "landmarks").mkdir()
    with pytest.raises(MissingFileError, match="landmarks"):
        own_set(folder)
    (folder / "set.toml").write_text('truth = "pairs"')
    assert own_set(folder).pairs == (("a", "b"),)
    write_mesh(folder / "shapes" / "a.ply", A)
    with pytest.raises(FormatError, match="both"):
        own_set(folder)


def test_a_map_and_rows_in_one_file_are_refused(folder, image):
    rows = np.column_stack([np.arange(N), image])
    savemat(folder / "truth" / "a__b.mat", {"T": image.astype(float), "rows": rows})
    with pytest.raises(FormatError, match="several"):
        own_set(folder).pair("a", "b")
    savemat(folder / "truth" / "a__b.mat", {"area": 2.0, "rows": rows})
    assert images_of(only_pair(folder)) == dict(enumerate(image.tolist()))


def test_a_truth_that_fits_both_readings_takes_after_the_others(folder, image):
    inner = np.clip(image, 1, N - 2)
    np.savetxt(folder / "truth" / "a__b.txt", inner, fmt="%d")
    with pytest.raises(FormatError, match="count"):
        own_set(folder).pair("a", "b")
    np.savetxt(folder / "truth" / "b__a.txt", image + 1, fmt="%d")
    for _ in range(2):
        assert dict(own_set(folder).pair("a", "b").truth) == dict(enumerate(inner - 1))
        (folder / "set.toml").write_text("counts_from = 1\n")
        (folder / "truth" / "b__a.txt").unlink(missing_ok=True)
    (folder / "set.toml").write_text("counts_from = 0\n")
    assert dict(own_set(folder).pair("a", "b").truth) == dict(enumerate(inner))


@pytest.mark.parametrize("columns", [1, 2, 4])
def test_a_zero_in_a_truth_that_counts_from_1_means_no_counterpart(folder, image, columns):
    counted = np.where(image == 3, 0, image + 1)
    counted[counted == N] = 1  # so that it does not show what it counts from
    table = {
        1: counted,
        2: np.column_stack([np.arange(N) + 1, counted]),
        4: np.column_stack([counted, np.tile([1, 0, 0], (N, 1))]),
    }[columns]
    np.savetxt(folder / "truth" / "a__b.txt", table, fmt="%d")
    rows = np.column_stack([np.arange(N), image]) + 1
    rows = rows if columns < 4 else np.column_stack([np.full(N, B.n_faces), np.tile([1, 0, 0], (N, 1))])
    np.savetxt(folder / "truth" / "b__a.txt", rows, fmt="%d")
    pair = own_set(folder).pair("a", "b")
    assert pair.alone.tolist() == np.flatnonzero(image == 3).tolist()
    there = np.flatnonzero(image != 3)
    images = counted[there] - 1
    assert (
        pair.truth.tolist()
        == np.column_stack([there, images if columns < 4 else B.faces[images, 0]]).tolist()
    )
    told = "counts from 1, as its largest" if columns == 2 else "counts from 1, as other files of truth"
    assert told in pair.notes[0]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("0\n1\n", f"maps 2 vertices, but the source has {N}"),
        ("\n".join(["0"] * (N - 1) + ["999"]), "outside"),
        ("\n".join(["x"] * N), "is not a target vertex"),
        ("0 1\n2 x\n", ":2: '2 x' is not a pair"),
        ("0 1\n2 999\n", "names target vertices 1…999, outside"),
        ("\n".join(["0 0.5 0.5 0.5"] * N), "weights of vertices 0, 1, .* are negative or do not sum to 1"),
        ("\n".join(["999 1 0 0"] * N), "names triangles of the target"),
        ("\n".join(["-1"] * N), "no vertex has a counterpart"),
    ],
)
def test_truths_that_do_not_fit(folder, text, message):
    (folder / "truth" / "a__b.txt").write_text(text)
    (folder / "set.toml").write_text("counts_from = 0\n")
    with pytest.raises(FormatError, match=message):
        own_set(folder).pair("a", "b")


def test_points_without_triangles_are_refused(folder, image):
    np.savetxt(folder / "truth" / "a__b.txt", image, fmt="%d")
    write_mesh(folder / "shapes" / "a.off", Mesh(A.vertices, []))
    with pytest.raises(FormatError, match=r"a\.off: has no triangles"):
        own_set(folder).pair("a", "b")


def test_a_mask_after_a_map_is_left_out(tmp_path, image):
    """As in PARTIALSMAL."""
    np.savetxt(tmp_path / "a_b.map", [*image, *np.ones(N)], fmt="%d")
    assert read_truth(tmp_path / "a_b.map", A, B).rows[:, 1].tolist() == image.tolist()


@pytest.mark.long
@pytest.mark.parametrize(
    "name", ["topkids", "shrec16_cuts", "shrec16_holes", "shrec16_parts", "smal", "psmal"]
)
def test_real_sets_are_read(name):
    opened = benchmark_set(str(real_file(name)))
    pair = opened.load(*opened.pairs[-1])
    assert len(pair.truth) > 100
    assert (pair.unit is not None) == (name in ("shrec16_parts", "psmal"))
