"""Values in files of their own, carried by ``isomatch transfer --values`` and written alone."""

import json

import numpy as np
import pytest

from isomatch import Asset, Correspondence, Mesh, read_asset, write_asset
from isomatch.cli import main
from isomatch.io import (
    Attribute,
    Polygons,
    holds_values,
    read_attributes,
    write_attribute,
    write_attributes,
)
from shapes import icosphere

pytest.importorskip("nibabel")

MESH = icosphere(2)
RNG = np.random.default_rng(1)
ORDER = RNG.permutation(MESH.n_vertices)
REGION = (MESH.vertices > 0) @ [1, 2, 4]
NAMES = {i: f"octant {i}" for i in range(9)}  # one of them is nowhere
COLORS = {i: (i / 15, 1 - i / 15, 0.25 + i / 51, 1.0) for i in range(9)}
THICKNESS = MESH.vertices[:, 2].astype(np.float32)


@pytest.fixture
def folder(tmp_path):
    """A shape, the same with its vertices in another order, and the map between them."""
    write_asset(tmp_path / "a.ply", Asset.of_mesh(MESH))
    place = np.argsort(ORDER)
    write_asset(tmp_path / "b.ply", Asset.of_mesh(Mesh(MESH.vertices[ORDER], place[MESH.faces])))
    Correspondence(place, MESH.n_vertices).save(tmp_path / "map.npz")
    return tmp_path


def transfer(folder, out, *more):
    names = ("map.npz", "a.ply", "b.ply")
    return main(["transfer", *(str(folder / name) for name in names), "-o", str(folder / out), *more])


@pytest.mark.parametrize("out", ["out.annot", "out.label.gii"])
@pytest.mark.parametrize("given", ["lh.aparc.annot", "given.label.gii"])
def test_names_and_colours_of_labels_are_kept(folder, given, out):
    region = Attribute("region", "point", "label", REGION[ORDER], names=NAMES, colors=COLORS)
    write_attribute(folder / given, region)
    assert transfer(folder, out, "--values", str(folder / given)) == 0
    (found,) = read_attributes(folder / out)
    np.testing.assert_array_equal(found.values, REGION)
    assert dict(found.names) == NAMES
    for code, color in COLORS.items():
        np.testing.assert_allclose(found.colors[code], color, atol=0.5 / 255)


@pytest.mark.parametrize(
    "out", ["out.func.gii", "out.shape.gii", "lh.thickness", "out.npy", "out.csv", "out.tsv", "out.txt"]
)
@pytest.mark.parametrize("given", ["in.func.gii", "in.shape.gii", "lh.sulc", "in.npy", "in.csv", "in.txt"])
def test_numbers(folder, given, out):
    write_attribute(folder / given, Attribute("thickness", "point", "scalar", THICKNESS[ORDER]))
    assert transfer(folder, out, "--values", str(folder / given)) == 0
    (found,) = read_attributes(folder / out)
    assert found.kind == "scalar"
    np.testing.assert_allclose(found.values, THICKNESS, rtol=1e-6)


@pytest.mark.parametrize("given", ["in.func.gii", "lh.curv", "in.npy", "in.csv"])
@pytest.mark.parametrize(
    "out", ["out.annot", "out.label.gii", "out.func.gii", "out.csv", "out.npy", "out.ply"]
)
def test_regions_as_floats(folder, given, out, capsys):
    numbers = REGION * 10.0 + 5
    write_attribute(folder / given, Attribute("region", "point", "scalar", numbers[ORDER]))
    assert transfer(folder, out, "--values", str(folder / given)) == 0
    assert "taken for labels, which are not averaged" in capsys.readouterr().out
    (found,) = read_attributes(folder / out) if holds_values(out) else read_asset(folder / out).attributes
    if out.endswith(".annot"):  # which numbers its labels from 0, and names them by the numbers
        assert [float(found.names[code]) for code in found.values.tolist()] == numbers.tolist()
    else:
        np.testing.assert_array_equal(found.values, numbers)


def test_onto_a_surface_beside_what_it_holds(folder, capsys):
    own = Attribute("own", "point", "scalar", np.linspace(0, 1, MESH.n_vertices))
    write_asset(folder / "b.ply", read_asset(folder / "b.ply").with_attributes(own))
    write_attribute(folder / "in.csv", Attribute("depth", "point", "scalar", THICKNESS[ORDER]))
    write_attribute(folder / "part.npy", Attribute("part", "point", "label", REGION[ORDER]))
    both = ["--values", str(folder / "in.csv"), "--values", str(folder / "part.npy")]
    assert transfer(folder, "out.ply", *both, "--json") == 0
    record = json.loads(capsys.readouterr().out)
    assert record["carried"] == ["depth", "part"]
    assert record["taken_as_labels"] == ["part"]
    found = read_asset(folder / "out.ply")
    np.testing.assert_allclose(found.attribute("depth").values, THICKNESS, rtol=1e-6)
    np.testing.assert_array_equal(found.attribute("part").values, REGION)
    assert transfer(folder, "all.ply", *both, "--data", "all") == 0
    assert {a.name for a in read_asset(folder / "all.ply").attributes} == {"own", "depth", "part"}
    assert transfer(folder, "own.csv", *both, "--data", "own") == 0
    assert [a.name for a in read_attributes(folder / "own.csv")] == ["own"]


def test_to_the_target(folder):
    write_attribute(folder / "in.csv", Attribute("depth", "point", "scalar", THICKNESS))
    assert transfer(folder, "out.csv", "--values", str(folder / "in.csv"), "--to", "target") == 0
    np.testing.assert_allclose(read_attributes(folder / "out.csv")[0].values, THICKNESS[ORDER], rtol=1e-6)


def test_values_of_faces(folder):
    of_face = Attribute("part", "face", "label", REGION[MESH.faces[:, 0]])
    write_attribute(folder / "in.npy", of_face)
    assert transfer(folder, "out.csv", "--values", str(folder / "in.npy")) == 0
    (found,) = read_attributes(folder / "out.csv", read_asset(folder / "a.ply"))
    assert found.domain == "face"
    np.testing.assert_array_equal(found.values, of_face.values)


def test_what_does_not_fit_is_told(folder, capsys):
    write_attribute(folder / "short.csv", Attribute("depth", "point", "scalar", THICKNESS[:100]))
    assert transfer(folder, "out.ply", "--values", str(folder / "short.csv")) == 1
    assert "short.csv: 100 rows for a surface of 162 points and 320 polygons" in capsys.readouterr().err
    write_attribute(folder / "in.csv", Attribute("depth", "point", "scalar", THICKNESS[ORDER]))
    assert transfer(folder, "out.annot", "--values", str(folder / "in.csv")) == 1
    assert "a .annot file has no place for depth" in capsys.readouterr().err
    assert not (folder / "out.annot").exists()
    assert transfer(folder, "out.csv") == 1
    assert "out.csv: nothing was carried" in capsys.readouterr().err
    np.save(folder / "objects.npy", np.array([{}], dtype=object), allow_pickle=True)
    assert transfer(folder, "out.ply", "--values", str(folder / "objects.npy")) == 1
    assert "objects.npy: expected a .npy file of numbers or texts" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("region\n3\n1\n2\n", {"region": [3, 1, 2]}),
        ("3\n1\n2\n", {"t": [3, 1, 2]}),
        ("region;depth\n3;0.5\n1;\n2;nan\n", {"region": [3, 1, 2], "depth": [0.5, np.nan, np.nan]}),
        ("\ufeffvertex,region\n2,7\n0,8\n1,9\n", {"region": [8, 9, 7]}),
        (",area\n0,left\n2,right\n", {"area": ["left", "", "right"]}),
        ("# made by hand\nside\n#1\n#2\n#1\n", {"side": ["#1", "#2", "#1"]}),
        ("left\nright\nleft\n", {"t": ["left", "right", "left"]}),
        ("1_2\n1_0\n2_0\n", {"t": ["1_2", "1_0", "2_0"]}),
        ("left front\nback\nback\n", {"t": ["left front", "back", "back"]}),
        ("# by hand\nregion,depth\n1,2\n1,2\n1,4\n", {"region": [1, 1, 1], "depth": [2, 2, 4]}),
        ("0.5\t1\n0.25\t2\n0.5\t1\n", {"t_0": [0.5, 0.25, 0.5], "t_1": [1, 2, 1]}),
        ("depth\n1.5\n#N/A\n2.5\n", {"depth": [1.5, np.nan, 2.5]}),
        ("depth;bend\n1,5;0,25\n2,5;\n3,5;0,5\n", {"depth": [1.5, 2.5, 3.5], "bend": [0.25, np.nan, 0.5]}),
        ("1,5\t0,25\n2,5\t0,75\n3,5\t0,5\n", {"t_0": [1.5, 2.5, 3.5], "t_1": [0.25, 0.75, 0.5]}),
        ("depth\n1,5\n2,5\n3,5\n", {"depth": [1.5, 2.5, 3.5]}),
        ("side;depth\na,b;1.5\nc;1e3\nd;2\n", {"side": ["a,b", "c", "d"], "depth": [1.5, 1000, 2]}),
        ("sep=;\nside;depth\na;1\nb;2\nc;3\n", {"side": ["a", "b", "c"], "depth": [1, 2, 3]}),
    ],
)
def test_tables_of_many_kinds(tmp_path, text, expected):
    (tmp_path / "t.csv").write_text(text, encoding="utf-8")
    surface = Asset.of_mesh(Mesh(np.eye(3), [[0, 1, 2]]))
    found = {a.name: a.values.tolist() for a in read_attributes(tmp_path / "t.csv", surface)}
    assert found.keys() == expected.keys()
    for name, values in expected.items():
        np.testing.assert_array_equal(found[name], values)


def test_a_table_of_some_vertices_of_quads(tmp_path):
    """There are fewer polygons than points, and the rows are of points."""
    points = [[x, y, 0.0] for y in range(3) for x in range(3)]
    quads = Polygons([0, 1, 4, 3, 1, 2, 5, 4, 3, 4, 7, 6, 4, 5, 8, 7], [4, 4, 4, 4])
    (tmp_path / "t.csv").write_text("vertex,depth\n2,0.5\n0,1.5\n")
    (found,) = read_attributes(tmp_path / "t.csv", Asset(points, quads))
    np.testing.assert_array_equal(found.values, [1.5, np.nan, 0.5, *[np.nan] * 6])


@pytest.mark.parametrize(("name", "mark"), [("a.csv", ","), ("a.tsv", "\t"), ("a.txt", "\t")])
def test_marks_between_columns(tmp_path, name, mark):
    flow = Attribute("flow", "point", "vector", np.eye(3))
    write_attribute(tmp_path / name, flow)
    assert (tmp_path / name).read_text().splitlines()[0].split(mark) == ["flow_0", "flow_1", "flow_2"]


def test_names_that_are_not_utf_8_stay_different(tmp_path):
    nibabel = pytest.importorskip("nibabel")
    table = np.array([[10, 20, 30, 0, 0], [40, 50, 60, 0, 0]])
    names = ["für".encode("latin-1"), "fär".encode("latin-1")]
    nibabel.freesurfer.write_annot(tmp_path / "a.annot", np.array([0, 1, 1]), table, names)
    (found,) = read_attributes(tmp_path / "a.annot")
    assert len(set(found.names.values())) == 2
    for name in ("b.annot", "b.label.gii"):
        write_attribute(tmp_path / name, found)
        assert list(read_attributes(tmp_path / name)[0].names.values()) == ["für", "fär"]


def names_written(path, words):
    """The names of labels after they are written, of points, or of the faces of an OBJ file."""
    if holds_values(path):
        write_attribute(path, Attribute("group", "point", "label", words))
        (found,) = read_attributes(path)
    else:
        surface = Asset(np.eye(3), Polygons([0, 1, 2] * len(words), [3] * len(words)))
        write_asset(path, surface.with_attributes(Attribute("group", "face", "label", words)))
        found = read_asset(path).attribute("group")
    return {name for name in found.coded.names.values() if name}


@pytest.mark.parametrize("encoding", ["latin-1", "utf-16"])
@pytest.mark.parametrize("out", ["b.annot", "b.label.gii", "b.csv", "b.obj"])
def test_names_of_a_table_in_any_encoding(tmp_path, encoding, out):
    (tmp_path / "a.csv").write_bytes("group\nStraße\nGasse\n".encode(encoding))
    (given,) = read_attributes(tmp_path / "a.csv")
    assert names_written(tmp_path / out, given.values) == {"Straße", "Gasse"}


@pytest.mark.parametrize("out", ["b.annot", "b.label.gii", "b.csv", "b.obj"])
def test_half_a_letter_is_written_as_an_escape(tmp_path, out):
    """As in JSON, by which a glTF file may have it."""
    assert names_written(tmp_path / out, np.array(["\ud83d", "a"])) == {"\\ud83d", "a"}


def test_an_annotation_keeps_its_colour_table(folder):
    """Also a black label, which is that of points without any."""
    nibabel = pytest.importorskip("nibabel")
    table = np.array([[0, 0, 0, 0, 0], [25, 100, 40, 0, 0], [125, 100, 160, 0, 0]])
    labels = np.where(REGION[ORDER] < 3, -1, 1 + REGION[ORDER] % 2)
    words = [b"Unknown", b"G_front", b"S_central"]
    nibabel.freesurfer.write_annot(folder / "lh.a2009s.annot", labels, table, words)
    assert transfer(folder, "out.annot", "--values", str(folder / "lh.a2009s.annot")) == 0
    found = nibabel.freesurfer.read_annot(folder / "out.annot")
    np.testing.assert_array_equal(found[0], np.where(REGION < 3, -1, 1 + REGION % 2))
    np.testing.assert_array_equal(found[1][:, :4], table[:, :4])
    assert found[2] == words


def test_what_is_left_of_several(tmp_path):
    given = [
        Attribute("area", "point", "label", [0, 1, 1], names={0: "a", 1: "b"}),
        Attribute("depth", "point", "scalar", [0.5, 1.0, 2.0]),
    ]
    assert [a.name for a in write_attributes(tmp_path / "a.csv", given)] == ["names of area"]
    assert [a.name for a in write_attributes(tmp_path / "a.annot", given)] == ["depth"]
    assert [a.name for a in write_attributes(tmp_path / "a.npy", given[1:] + given[:1])] == ["area"]
