"""OFF, OBJ, text STL: the variants found in the wild, and one test per way a file can be broken."""

import pytest

from isomatch._core.errors import FormatError
from isomatch.io import FORMATS
from isomatch.io.formats import obj, off

SQUARE = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
HALVES = [[0, 1, 2], [0, 2, 3]]


@pytest.mark.parametrize(
    "text",
    [
        "OFF\n4 2 5\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n",
        "OFF 4 2 5\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3",
        "OFF4 2 5\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n".replace("4 2 5", "4 1 5"),
        "# hand made\r\nOFF # header\r\n\r\n4 1\r\n0 0 0\r\n1 0 0\r\n1 1 0 # c\r\n0 1 0\r\n4 0 1 2 3",
        "COFF\n4 2 0\n0 0 0 255 0 0 255\n1 0 0 0 0 0 0\n1 1 0 0 0 0 0\n0 1 0 0 0 0 0\n3 0 1 2 9\n3 0 2 3\n",
        "STCNOFF\n4 1 0\n0 0 0 .5\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3 0.5 0.5 0.5\n",
        "\ufeffOFF\n4 2 0\n0 0 0\n1.0e0 0 0\n1 1 0\n0\t1  0\n3 0 1 2\n  3 0 2 3\n",
    ],
)
def test_off_variants(text):
    mesh = off.read(text.encode(), "a.off")
    assert mesh.vertices.tolist() == SQUARE
    assert mesh.faces.tolist() == HALVES


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "a.off:1: .*end of the file"),
        ("4 2 0\n", "a.off:1: .*OFF"),
        ("OFF\nfour 2\n", "a.off:2: .*'four 2'"),
        ("OFF\n2 1 0\n0 0 0\n", "a.off:3: .*1 face lines"),
        ("OFF\n1 0 0\n0 0 0\n\n1 1 1\n", "a.off:5: .*'1 1 1'; correct the counts"),
        ("OFF\n2 0 0\n# two\n0 0 0\n1 1\n", "a.off:5: .*x y z"),
        ("OFF\n2 0 0\n0 0 0\n1 1 z\n", "a.off:4: .*numbers, found '1 1 z'"),
        ("OFF\n1 1 0\n0 0 0\n2 0 0\n", "a.off:4: .*3 corners"),
        ("OFF\n1 1 0\n0 0 0\n3 0 0\n", "a.off:4: .*as many"),
        ("OFF\n1 2 0\n0 0 0\n3 0 0 0\n3 0 0.5 0\n", "a.off:5: .*whole"),
    ],
)
def test_off_broken(text, message):
    with pytest.raises(FormatError, match=message):
        off.read(text.encode(), "a.off")


VERTICES = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"


@pytest.mark.parametrize(
    "text",
    [
        VERTICES + "f 1 2 3\nf 1 3 4\n",
        VERTICES + "f 1 2 3 4\n",
        "mtllib a.mtl\no café\n"
        + VERTICES
        + "vt 0 0\nvn 0 0 1\ns off\nusemtl m\nf 1/1 2/1 3/1\nf 1/1/1 3//1 4/1/\nl 1 2\n",
        VERTICES + "f 1 2 3\nf 1 -2 -1\n",
        VERTICES + "f -4 -3 -2\nf -4/-1 -2//-1 -1/-1/-1\n",
        VERTICES.replace("\n", " 0.5 0.5 0.5\n") + "f 1 2 \\\n3\nf 1 3 4",
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nf -3 -2 -1\nv 0 1 0\nf -4 -2 -1\n",
        "  v\t0 0 0\r\nv 1 0 0 1.0\r\nv 1 1 0\r\nv 0 1 0\r\n\tf 1 2 3\r\nf 1 3 4 # last\r\n",
    ],
)
def test_obj_variants(text):
    mesh = obj.read(text.encode(), "a.obj")
    assert mesh.vertices.tolist() == SQUARE
    assert mesh.faces.tolist() == HALVES


def test_lines_are_counted_in_files_of_any_length():
    text = VERTICES + "# comment\n\nf 1 2 3\n" * 30_000
    with pytest.raises(FormatError, match="90005"):
        obj.read((text + "f 1 2\n").encode(), "a.obj")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "a.obj:1: expected vertex lines v x y z, found the end of the file"),
        ("v 0 0 0\nv\nv 1 1 1\n", "a.obj:2: expected at least 3 numbers x y z of a vertex, found ''"),
        ("v 0 0 0\nv 0 0 \\\n a\n", "a.obj:2: expected numbers, found '0 0"),
        ("v 0 \\\n0 0\nv 0 b 0\n", "a.obj:3: expected numbers, found '0 b 0'"),
        (VERTICES + "f 1 2\n", "a.obj:5: expected a face of at least 3 corners, found '1 2'"),
        (VERTICES + "f 1 2 3.5\n", "a.obj:5: expected whole vertex indices, found '1 2 3.5'"),
        (VERTICES + "f 1 2 9007199254740992\n", "a.obj:5: expected whole vertex indices"),  # 2⁵³
    ],
)
def test_obj_broken(text, message):
    with pytest.raises(FormatError, match=message):
        obj.read(text.encode(), "a.obj")


def facet(*corners):
    loop = "\n".join(f"vertex {x} {y} {z}" for x, y, z in corners)
    return f"facet normal 0 0 1\nouter loop\n{loop}\nendloop\nendfacet\n"


TWO_FACETS = facet(*SQUARE[:3]) + facet(SQUARE[0], *SQUARE[2:])


@pytest.mark.parametrize("name", ["", " part # 7", " café"])
def test_stl_text(name):
    text = f"solid{name}\n{TWO_FACETS}endsolid{name}\n"
    for variant in (text, text.upper(), text.replace("vertex", "\t vertex").replace("\n", "\r\n")):
        mesh = FORMATS[".stl"].read(variant.encode(), "a.stl")
        assert mesh.vertices.tolist() == SQUARE
        assert mesh.faces.tolist() == HALVES


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "a.stl: byte 0: expected 'solid' or 84 bytes of header, found the end"),
        (b"\0" * 90, "a.stl: byte 84: expected 84 bytes for the 0 triangles declared at byte 80, found 90"),
        (b"\0" * 80 + b"\2\0\0\0" + b"\0" * 60, "a.stl: byte 144: expected 184 bytes for the 2 .* found 144"),
        (b"solid\n" + TWO_FACETS.encode()[:-30], "a.stl:12: expected an endloop after every 3 vertex lines"),
        (f"solid\n{facet(*SQUARE[:2])}endsolid".encode(), "a.stl:6: expected 3 vertex lines before"),
        (f"solid\n{facet([0, 0, 'x'], *SQUARE[:2])}endsolid".encode(), "a.stl:4: expected numbers"),
        (f"solid\n{TWO_FACETS}vertex 0 0 0\nendsolid".encode(), "a.stl:17: expected an endloop after"),
    ],
)
def test_stl_broken(data, message):
    with pytest.raises(FormatError, match=message):
        FORMATS[".stl"].read(data, "a.stl")
