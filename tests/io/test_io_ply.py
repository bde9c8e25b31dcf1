"""PLY: encodings, further properties and elements, and one test per way a file can be broken."""

import struct

import pytest

from isomatch._core.errors import FormatError
from isomatch.io.formats import ply

SQUARE = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
FORMATS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}


def ply_file(encoding, header, rows):
    """A file of the given header lines; each row is (struct code, values)."""
    head = "\n".join(["ply", f"format {encoding} 1.0", *header, "end_header\n"]).encode()
    order = FORMATS[encoding]
    if not order:
        return head + "".join(" ".join(map(str, values)) + "\n" for _, values in rows).encode()
    return head + b"".join(struct.pack(order + code, *values) for code, values in rows)


RICH = [
    "comment element vertex 9",
    "element camera 1",
    "property float focus",
    "property list uchar short lens",
    "element vertex 4",
    "property uchar red",
    "property double x",
    "property float y",
    "property float z",
    "property list uint8 float32 weights",
    "element face {n}",
    "property short group",
    "property list {count} {index} vertex_index",
    "property float quality",
    "element edge 2",
    "property int vertex1",
    "property int vertex2",
]


def rich_file(encoding, polygons, count="uchar", index="int"):
    codes = {"uchar": "B", "int": "i", "uint": "I", "ushort": "H", "short": "h"}
    rows = [("fBhh", (0.5, 2, 7, 8))]
    rows += [("BdffB" + "f" * i, (200, *p, i, *[0.25] * i)) for i, p in enumerate(SQUARE)]
    rows += [(f"h{codes[count]}{len(p)}{codes[index]}f", (3, len(p), *p, 0.5)) for p in polygons]
    rows += [("ii", (0, 1)), ("ii", (1, 2))]
    header = [line.format(n=len(polygons), count=count, index=index) for line in RICH]
    return ply_file(encoding, header, rows)


@pytest.mark.parametrize("encoding", FORMATS)
@pytest.mark.parametrize("polygons", [[[0, 1, 2], [0, 2, 3]], [[0, 1, 2, 3]], [[0, 1, 2, 3], [2, 1, 0]], []])
@pytest.mark.parametrize(("count", "index"), [("uchar", "int"), ("int", "uint"), ("ushort", "short")])
def test_further_properties_and_elements_are_passed_over(encoding, polygons, count, index):
    mesh = ply.read(rich_file(encoding, polygons, count, index), "a.ply")
    fans = [[p[0], p[i], p[i + 1]] for p in polygons for i in range(1, len(p) - 1)]
    assert mesh.vertices.tolist() == SQUARE
    assert mesh.faces.tolist() == fans


@pytest.mark.parametrize("encoding", FORMATS)
def test_elements_without_properties_take_no_room(encoding):
    header = [
        "element nothing 3",
        "element vertex 1",
        "property float x",
        "property float y",
        "property float z",
    ]
    assert ply.read(ply_file(encoding, header, [("fff", (1, 2, 3))]), "a.ply").vertices.tolist() == [
        [1, 2, 3]
    ]


def test_windows_and_old_mac_line_ends():
    text = rich_file("ascii", [[0, 1, 2, 3]])
    for end in (b"\r\n", b"\r"):
        assert ply.read(text.replace(b"\n", end), "a.ply").n_faces == 2


XYZ = ["element vertex 1", "property float x", "property float y", "property float z"]
FACE = ["element face 1", "property list uchar int vertex_indices"]
POINT = ("fff", (0, 0, 0))
NO_PLACE = "a.ply:1: "


@pytest.mark.parametrize(
    ("header", "message"),
    [
        (["element vertex many"], "a.ply:3: .*element NAME COUNT.*found 'element vertex many'"),
        (["element vertex 9999999999999999999"], "a.ply:3: "),  # > 2⁶³
        ([*XYZ, "property list float int v"], "a.ply:7: "),
        (XYZ[:3], NO_PLACE + "expected an element 'vertex' with numbers x, y, z, found no z"),
        ([*XYZ, "element tristrips 0", "property int v"], NO_PLACE + "expected .* element 'tristrips'"),
    ],
)
def test_broken_headers(header, message):
    with pytest.raises(FormatError, match=message):
        ply.read(
            ply_file("ascii", header, [("", ["0 0 0"[: 2 * len(header) - 3]])][: len(header) > 2]), "a.ply"
        )


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "a.ply:1: expected 'ply', found b''"),
        (b"OFF\n", "a.ply:1: expected 'ply', found b'OFF"),
        (b"ply\nformat ascii 1.0\n", "a.ply:1: .*end_header"),
        (
            b"ply\nformat utf 1.0\nend_header\n",
            "a.ply:2: expected 'format' and one of ascii, binary_little_endian",
        ),
        (b"ply\nend_header\n", "a.ply:2: expected 'format'"),
    ],
)
def test_no_header(data, message):
    with pytest.raises(FormatError, match=message):
        ply.read(data, "a.ply")


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ([], "a.ply:9: .*1 lines of element vertex"),
        (["0 0 0 0", "3 0 0 0"], "a.ply:10: .*x y z, found '0 0 0 0'"),
        (["0 0 zero", "3 0 0 0"], "a.ply:10: .*'0 0 zero'"),
        (["0 0 0", "3 0 0"], "a.ply:11: .*found '3 0 0'"),
        (["0 0 0", "2 0 0"], "a.ply:11: .*3 corners, face 0"),
        (["0 0 0", "3 0 0 0.5"], "a.ply:11: .*whole vertex indices, face 0"),
        (["0 0 0", "3 0 0 0", "", "5"], "a.ply:13: .*'5'; correct"),
    ],
)
def test_broken_text(rows, message):
    with pytest.raises(FormatError, match=message):
        ply.read(ply_file("ascii", XYZ + FACE, [("", [row]) for row in rows]), "a.ply")


@pytest.mark.parametrize("encoding", ["binary_little_endian", "binary_big_endian"])
def test_broken_binary(encoding):
    header = XYZ + FACE
    good = ply_file(encoding, header, [POINT, ("B3i", (3, 0, 0, 0))])
    start = len(good) - 25
    assert ply.read(good, "a.ply").n_faces == 1
    cases = {
        good[:-1]: "a.ply: byte .*: expected 1 rows of element face, found the end of the file",
        good[: start + 5]: "a.ply: byte .*: expected 1 rows of element vertex, found the end",
        good + b"tail": f"a.ply: byte {start + 25}: expected the end of the file, found 4 more bytes",
        ply_file(
            encoding, header, [POINT, ("B2i", (2, 0, 0))]
        ): f"byte {start + 12}: expected a face of at least 3",
    }
    for data, message in cases.items():
        with pytest.raises(FormatError, match=message):
            ply.read(data, "a.ply")


def test_every_truncation_of_a_mixed_file_is_reported():
    data = rich_file("binary_little_endian", [[0, 1, 2, 3], [2, 1, 0]])
    for length in range(len(data) - 1):
        with pytest.raises(FormatError):
            ply.read(data[:length], "a.ply")


def test_list_counts_and_indices_of_unusual_types():
    header = [*XYZ, "element face 2", "property list char float vertex_indices"]
    rows = [POINT, ("b3f", (3, 0, 0, 0)), ("b", (-1,))]
    with pytest.raises(FormatError, match="found the end of the file"):
        ply.read(ply_file("binary_little_endian", header, rows), "a.ply")
    rows[2] = ("b3f", (3, 0, 0, 0.5))
    with pytest.raises(FormatError, match="face 1"):
        ply.read(ply_file("binary_little_endian", header, rows), "a.ply")
