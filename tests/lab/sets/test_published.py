"""Sets as users have them on disk: tiny folders in every form, their truth, and what is said when something is wrong."""

import numpy as np
import pytest
from scipy.io import savemat

from isomatch import FormatError, Mesh, MissingFileError, write_mesh
from isomatch_lab.sets import benchmark_set, faust, remeshed, scape, tosca
from isomatch_lab.sets.shape_files import read_landmarks
from shapes import icosphere

BALL = icosphere(1)
EGG = Mesh(BALL.vertices * [1, 1, 1.3], BALL.faces)
MIRROR = np.linalg.norm(BALL.vertices[:, None] - BALL.vertices * [-1, 1, 1], axis=2).argmin(axis=1)


def save(path, mesh):
    """Write a mesh as the suffix says, also in the forms that the package itself does not write."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.suffix == ".mat":
        x, y, z = mesh.vertices.T[:, :, None]
        savemat(path, {"surface": {"X": x, "Y": y, "Z": z, "TRIV": mesh.faces + 1.0}})
    elif path.suffix == ".vert":
        np.savetxt(path, mesh.vertices, fmt="%.17g")
        np.savetxt(path.with_suffix(".tri"), mesh.faces + 1, fmt="%d")
    elif path.suffix == ".npz":
        np.savez(path, vertices=mesh.vertices, faces=mesh.faces)
    else:
        write_mesh(path, mesh)


def save_vertices(path, vertices):
    np.savetxt(path, np.asarray(vertices) + 1, fmt="%d")


@pytest.fixture
def two_remeshed(tmp_path):
    """Two shapes in a folder of meshes beside one of known vertices, and the known vertices of each."""
    rng = np.random.default_rng(0)
    marks = {name: rng.permutation(BALL.n_vertices)[:9] for name in ("man2", "woman10")}
    for (name, vertices), mesh in zip(marks.items(), (BALL, EGG)):
        save(tmp_path / "remeshed" / "off" / f"{name}.off", mesh)
        (tmp_path / "remeshed" / "corres").mkdir(exist_ok=True)
        save_vertices(tmp_path / "remeshed" / "corres" / f"{name}.vts", vertices)
    return tmp_path / "remeshed", marks


@pytest.mark.parametrize("suffix", [".mat", ".vert", ".off", ".obj", ".ply", ".npz"])
def test_every_kind_of_file_is_read_in_its_order(tmp_path, suffix):
    save(tmp_path / "high" / f"cat0{suffix}", BALL)
    save(tmp_path / "high" / f"cat10{suffix}", EGG)
    save(tmp_path / "high" / f"cat2{suffix}", EGG)
    cats = tosca(tmp_path)
    assert cats.names == ("cat0", "cat2", "cat10")
    assert len(cats.pairs) == 6
    pair = cats.pair("cat0", "cat2")
    np.testing.assert_allclose(pair.target.vertices, EGG.vertices)
    np.testing.assert_array_equal(pair.target.faces, EGG.faces)
    assert (pair.truth == np.arange(BALL.n_vertices)[:, None]).all()
    assert pair.mirrored is None


def test_shapes_of_two_classes_have_no_common_truth(tmp_path):
    save(tmp_path / "cat0.off", BALL)
    save(tmp_path / "dog0.off", EGG)
    assert tosca(tmp_path).pairs == ()
    with pytest.raises(FormatError, match="correspond"):
        tosca(tmp_path).pair("cat0", "dog0")


def test_an_archive_of_poses_is_a_folder_of_shapes(tmp_path):
    np.savez(tmp_path / "scape.npz", mesh000=BALL.vertices, mesh001=EGG.vertices, faces=BALL.faces)
    bodies = scape(tmp_path)
    assert bodies.pairs == (("mesh000", "mesh001"), ("mesh001", "mesh000"))
    np.testing.assert_array_equal(bodies["mesh001"].mesh.vertices, EGG.vertices)


def test_nothing_is_read_before_it_is_asked_for(tmp_path):
    (tmp_path / "tr_reg_000.ply").write_text("broken")
    (tmp_path / "tr_scan_000.ply").write_text("a scan, without truth")
    shapes = faust(tmp_path)
    assert shapes.names == ("tr_reg_000",)
    with pytest.raises(FormatError, match=r"tr_reg_000\.ply"):
        shapes["tr_reg_000"]


def test_known_vertices_correspond_line_by_line(two_remeshed):
    root, marks = two_remeshed
    pair = remeshed(root).pair("man2", "woman10")
    assert pair.truth.tolist() == np.column_stack([marks["man2"], marks["woman10"]]).tolist()
    assert pair.mirrored is None
    save_vertices(root / "corres" / "woman10.sym.vts", MIRROR[marks["woman10"]])
    pair = remeshed(root).pair("man2", "woman10")
    assert pair.mirrored.tolist() == np.column_stack([marks["man2"], MIRROR[marks["woman10"]]]).tolist()
    assert not pair.symmetric, "reported, but a flip stays an error"


def test_pairs_are_those_listed(two_remeshed):
    root, _ = two_remeshed
    assert remeshed(root).pairs == (), "all pairs are within a class"
    (root / "test_pairs.txt").write_text("# pairs\nman2,woman10\n")
    assert remeshed(root).pairs == (("man2", "woman10"),)


def test_a_dense_map_is_truth(tmp_path):
    save(tmp_path / "1.off", BALL)
    save(tmp_path / "2.off", EGG)
    save_vertices(tmp_path / "1_2.map", MIRROR)
    shapes = remeshed(tmp_path)
    assert shapes.pairs == (("1", "2"),)
    assert (shapes.pair("1", "2").truth[:, 1] == MIRROR).all()
    save_vertices(tmp_path / "1_2.map", MIRROR[:5])
    with pytest.raises(FormatError, match="vertices"):
        shapes.pair("1", "2")


def test_landmarks_know_their_mirror_images(tmp_path):
    save(tmp_path / "cat0.vert", BALL)
    save(tmp_path / "cat1.vert", EGG)
    (tmp_path / "landmarks").mkdir()
    (tmp_path / "landmarks" / "cat.txt").write_text("# vertex, mirror\n7, 0\n3, 2\n5, 1\n")
    pair = tosca(tmp_path).with_landmarks(tmp_path / "landmarks").pair("cat0", "cat1")
    assert pair.truth.tolist() == [[7, 7], [3, 3], [5, 5]]
    assert pair.mirrored.tolist() == [[7, 7], [3, 5], [5, 3]]


@pytest.mark.parametrize("name", ["cat.npz", "tosca_cat.npz", "tosca.npz"])
def test_landmarks_of_a_benchmark_set_are_on_the_shapes_that_are_matched(tmp_path, name):
    for pose, mesh in (("cat0", BALL), ("cat1", EGG)):
        save(tmp_path / "tosca" / f"{pose}.off", mesh)
    (tmp_path / "landmarks").mkdir()
    np.savez(tmp_path / "landmarks" / name, landmark_vertices=[7, 3, 5], symmetry_perm=[0, 2, 1])
    dense = benchmark_set("tosca", tmp_path).load("cat0", "cat1")
    pair = benchmark_set("tosca", tmp_path, tmp_path / "landmarks").load("cat0", "cat1")
    np.testing.assert_array_equal(pair.target.vertices, dense.target.vertices)
    image = dict(dense.truth.tolist())
    assert pair.truth.tolist() == [[vertex, image[vertex]] for vertex in (7, 3, 5)]
    assert pair.mirrored.tolist() == [[7, image[7]], [3, image[5]], [5, image[3]]]


def test_an_archive_without_landmarks_is_reported(tmp_path):
    save(tmp_path / "cat0.off", BALL)
    (tmp_path / "landmarks").mkdir()
    np.savez(tmp_path / "landmarks" / "cat.npz", vertices=[1])
    with pytest.raises(FormatError, match="landmarks"):
        tosca(tmp_path).with_landmarks(tmp_path / "landmarks")["cat0"]


def test_a_missing_file_of_triangles_is_reported(tmp_path):
    save(tmp_path / "cat0.vert", BALL)
    (tmp_path / "cat0.tri").unlink()
    with pytest.raises(MissingFileError, match=r"cat0\.tri: no such file"):
        tosca(tmp_path)["cat0"]


def test_a_benchmark_set_hides_equal_indices(tmp_path):
    for name, mesh in (("cat0", BALL), ("cat1", EGG)):
        save(tmp_path / "tosca" / f"{name}.mat", mesh)
    save_vertices(tmp_path / "tosca" / "cat.sym.vts", MIRROR)
    pair = benchmark_set("tosca", tmp_path).load("cat0", "cat1")
    assert (pair.truth[:, 0] != pair.truth[:, 1]).mean() > 0.8
    lengths = (
        np.linalg.norm(x - x.mean(axis=0), axis=1)
        for x in (EGG.vertices, pair.target.vertices[pair.truth[:, 1]])
    )
    np.testing.assert_allclose(*lengths)
    assert (pair.mirrored[:, 1] == pair.truth[MIRROR, 1]).all()


@pytest.mark.parametrize("door", [tosca, scape, faust, remeshed])
def test_an_empty_folder_says_where_to_obtain_the_set(tmp_path, door):
    with pytest.raises(
        MissingFileError, match=f"no shapes of the set '{door.__name__}' in this folder; obtain .*"
    ):
        door(tmp_path)


def test_defects_are_reported(tmp_path, two_remeshed):
    root, _ = two_remeshed
    save_vertices(root / "corres" / "man2.vts", [-1, 3])
    with pytest.raises(FormatError, match="entries"):
        remeshed(root)["man2"]
    save_vertices(root / "corres" / "man2.vts", [3, 42])
    with pytest.raises(FormatError, match="vertices"):
        remeshed(root)["man2"]
    save_vertices(root / "corres" / "man2.vts", [3, 4])
    with pytest.raises(FormatError, match="correspond"):
        remeshed(root).pair("man2", "woman10")
    save_vertices(root / "corres" / "man2.sym.vts", [3])
    with pytest.raises(FormatError, match="vertices"):
        remeshed(root)["man2"]
    (root / "corres" / "man2.vts").write_text("")
    with pytest.raises(FormatError, match="0 rows"):
        remeshed(root)["man2"]
    (root / "corres" / "man2.vts").unlink()
    with pytest.raises(MissingFileError, match="expected"):
        remeshed(root)["man2"]
    with pytest.raises(MissingFileError, match="remeshed"):
        remeshed(root)["child"]
    save(root / "ply" / "man2.ply", BALL)
    with pytest.raises(FormatError, match="man2 is both in"):
        remeshed(root)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("cat0.mat", b"not a matrix", "not a shape"),
        ("cat0.vert", b"1 2 three\n", "cat0.vert:1: .* among numbers"),
        ("cat0.vert", b"1 2\n", "1 rows of 2 numbers, expected rows of 3"),
    ],
)
def test_broken_shapes_are_reported(tmp_path, name, content, message):
    (tmp_path / name).write_bytes(content)
    (tmp_path / "cat0.tri").write_text("1 2 3\n")
    with pytest.raises(FormatError, match=message):
        tosca(tmp_path)["cat0"]


def test_a_broken_archive_and_broken_landmarks_are_reported(tmp_path):
    (tmp_path / "cat.npz").write_bytes(b"PK nothing")
    with pytest.raises(FormatError, match=r"cat.npz: cannot be read"):
        tosca(tmp_path)
    (tmp_path / "cat.npz").unlink()
    save(tmp_path / "cat0.off", BALL)
    with pytest.raises(MissingFileError, match="landmarks"):
        tosca(tmp_path).with_landmarks(tmp_path)["cat0"]
    (tmp_path / "cat.txt").write_text("3 1\n4 9\n")
    with pytest.raises(FormatError, match="mirrored"):
        tosca(tmp_path).with_landmarks(tmp_path)["cat0"]


def test_the_shipped_pair_is_a_set():
    chosen = benchmark_set("example")
    (pair,) = chosen
    assert pair.name == "standing-running"
    assert (pair.truth[:, 0] == np.arange(pair.source.n_vertices)).all()
    assert pair.truth[:, 1].max() < pair.target.n_vertices
    assert pair.mirrored is None


@pytest.mark.parametrize("change", [{"cat0": np.zeros((0, 3))}, {"landmark_vertices": np.zeros(3, "f2")}])
def test_archives_of_few_points_and_of_short_floats(tmp_path, change):
    stored = {"faces": BALL.faces, "cat0": BALL.vertices, "landmark_vertices": np.arange(3)} | change
    np.savez(tmp_path / "cat.npz", **stored)
    assert len(tosca(tmp_path)["cat0"].marks) == len(stored["cat0"])
    assert len(read_landmarks(tmp_path / "cat.npz")[0]) == 3
