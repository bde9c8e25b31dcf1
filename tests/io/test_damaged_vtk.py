"""VTK files: damaged ones are errors, never surfaces without points or with fewer; sound ones of any version are read."""

import base64
import re
import zlib

import numpy as np
import pytest

from isomatch import FormatError, Mesh, check, read_asset, write_asset
from isomatch.io import Attribute, asset_from, to_pyvista
from later import some_later

pytest.importorskip("pyvista")

from made import POINTS, POLYGONS

from isomatch import Asset

REGION = np.array([0, 1, 0, 1, 2, 2, 1])
HEIGHT = np.array([0.0, 1.0, 2.0, 3.0])


def surface():
    of_points = Attribute("region", "point", "label", REGION)
    return Asset(POINTS, POLYGONS, (of_points, Attribute("height", "face", "scalar", HEIGHT)))


@pytest.fixture(params=[True, False], ids=["binary", "text"])
def vtp(request, tmp_path):
    """A sound file, whose arrays can be told by their names."""
    write_asset(tmp_path / "a.vtp", surface(), binary=request.param)
    return tmp_path / "a.vtp"


@pytest.mark.long
@pytest.mark.parametrize(
    ("old", "new"),
    [
        (rb'NumberOfPoints="7"', b'NumberOfPoints="9"'),
        (rb'NumberOfPolys="4"', b'NumberOfPolys="6"'),
        (rb"(?s)<Polys>.*</Polys>", b""),
        (rb"(?s)<Points>.*</Points>", b""),
        (
            rb'(?s)<DataArray[^>]*Name="connectivity"(?:(?!<DataArray).)*</DataArray>\s*(?=<DataArray[^>]*"offsets")',
            b"",
        ),
        (rb"</Piece>", b""),
    ],
)
def test_what_does_not_fit_the_declared_numbers(vtp, old, new):
    data, n = re.subn(old, new, vtp.read_bytes())
    assert n
    vtp.write_bytes(data)
    with pytest.raises(FormatError, match=r"a\.vtp: "):
        read_asset(vtp)


def test_files_cut_anywhere(vtp):
    data = vtp.read_bytes()
    for end in range(0, data.rindex(b"</PolyData>"), 97):
        vtp.write_bytes(data[:end])
        with pytest.raises(FormatError):
            read_asset(vtp)


@pytest.mark.long
def test_numbers_that_are_not_finite_are_no_damage(tmp_path):
    flow = Attribute("flow", "point", "vector", np.full((7, 3), np.nan))
    points = np.where([[True], *[[False]] * 6], np.inf, POINTS)
    for suffix in (".vtp", ".vtk"):
        for binary in (True, False):
            write_asset(tmp_path / f"a{suffix}", Asset(points, POLYGONS, (flow,)), binary=binary)
            found = read_asset(tmp_path / f"a{suffix}")
            np.testing.assert_array_equal(found.points, points)
            assert np.isnan(found.attribute("flow").values).all()
            assert check(found.mesh).non_finite_vertices.tolist() == [0]


def text(rows):
    return "".join(" ".join(map(str, row)) + "\n" for row in rows)


def numbers(values, kind, binary):
    return (
        np.asarray(values).astype(kind).tobytes() + b"\n"
        if binary
        else (text([np.ravel(values).tolist()])).encode()
    )


def legacy(version, binary, lower=False):
    """A file with a vertex, two lines, the polygons, and values on points and cells, written by hand."""
    sizes, corners = POLYGONS.sizes, POLYGONS.corners
    head = f"# vtk DataFile Version {version}\nby hand\n{'BINARY' if binary else 'ASCII'}\n"
    parts = [head.encode(), b"dataset polydata\n" if lower else b"DATASET POLYDATA\n", b"POINTS 7 double\n"]
    parts.append(numbers(POINTS, ">f8", binary))
    cells = [("VERTICES", [[6]]), ("LINES", [[0, 1], [1, 2, 3]])]
    cells.append(("POLYGONS", np.split(corners, np.cumsum(sizes)[:-1])))
    for keyword, lists in cells:
        joined, starts = np.concatenate(lists), np.cumsum([0, *map(len, lists)])
        if version[0] == "5":
            parts.append(f"{keyword} {len(starts)} {len(joined)}\nOFFSETS vtktypeint64\n".encode())
            parts += [
                numbers(starts, ">i8", binary),
                b"CONNECTIVITY vtktypeint64\n",
                numbers(joined, ">i8", binary),
            ]
        else:
            counted = np.concatenate([[len(cell), *cell] for cell in lists])
            parts += [f"{keyword} {len(lists)} {len(counted)}\n".encode(), numbers(counted, ">i4", binary)]
    parts.append(b"CELL_DATA 7\nSCALARS height double\nLOOKUP_TABLE default\n")
    parts += [
        numbers([-1, -1, -1, *HEIGHT], ">f8", binary),
        b"POINT_DATA 7\nFIELD FieldData 1\nregion 1 7 int\n",
    ]
    return b"".join([*parts, numbers(REGION, ">i4", binary)])


TOLD = [("3.0", True, True), ("5.1", False, True)]
LEGACY = [("3.0", True), ("4.2", True), ("4.2", False), ("5.1", True), ("5.1", False)]


@pytest.mark.parametrize(
    ("version", "binary", "lower"),
    some_later([(*each, lower) for each in LEGACY for lower in (False, True)], lambda each: each in TOLD),
)
def test_legacy_files(tmp_path, version, binary, lower):
    (tmp_path / "a.vtk").write_bytes(legacy(version, binary, lower))
    asset = read_asset(tmp_path / "a.vtk")
    np.testing.assert_array_equal(asset.points, POINTS)
    np.testing.assert_array_equal(asset.polygons.corners, POLYGONS.corners)
    np.testing.assert_array_equal(asset.attribute("height").values, HEIGHT)
    np.testing.assert_array_equal(asset.attribute("region").values, REGION)
    assert asset.notes == ("cells that are no polygons are left out: 1 vertex, 2 line",)


@pytest.mark.long
@pytest.mark.parametrize(("version", "binary"), LEGACY)
def test_legacy_files_cut_anywhere(tmp_path, version, binary):
    data = legacy(version, binary)
    sound = 0
    for end in [*range(0, len(data) - 8, 23), len(data) - 8]:
        (tmp_path / "a.vtk").write_bytes(data[:end])
        try:
            asset = read_asset(tmp_path / "a.vtk")
        except FormatError:
            continue
        sound += 1  # what ends with a whole section cannot be told from a file that has no more
        np.testing.assert_array_equal(asset.points, POINTS)
        assert len(asset.polygons) in (0, 4)
        assert all(len(a) == {"point": 7, "face": 4}[a.domain] for a in asset.attributes)
    assert sound <= 6


@pytest.mark.long
@pytest.mark.parametrize(("version", "binary"), LEGACY)
@pytest.mark.parametrize(
    ("keyword", "wrong"),
    [
        (rb"POINTS 7", b"POINTS 9"),
        (rb"POINTS 7", b"POINTS 5"),
        (rb"POLYGONS (\d+)", b"POLYGONS 9"),
        (rb"POLYGONS (\d+) \d+", rb"POLYGONS \1 12"),
        (rb"POLYGONS (\d+) \d+", rb"POLYGONS \1 99999"),
        (rb"POLYGONS (\d+)", b"POLYGONS -1"),
        (rb"CELL_DATA 7", b"CELL_DATA 900"),
        (rb"region 1 7", b"region 3 7"),
    ],
)
def test_legacy_files_with_other_numbers_than_declared(tmp_path, version, binary, keyword, wrong):
    (tmp_path / "a.vtk").write_bytes(re.sub(keyword, wrong, legacy(version, binary)))
    with pytest.raises(FormatError, match=r"a\.vtk: "):
        read_asset(tmp_path / "a.vtk")


POINT = '<Points><DataArray type="Float32" NumberOfComponents="3" format="{}">{}</DataArray></Points>'
DECLARED = "# vtk DataFile Version 3.0\nx\nASCII\nDATASET POLYDATA\n"
HOSTILE = {
    "tuples of no components.vtk": DECLARED + "FIELD a 1\nb 0 9999999999999 float\n",
    "components of no tuples.vtk": DECLARED + "FIELD a 1\nb 9999999999999 0 float\n",
    "points that are bits.vtk": DECLARED + "POINTS 99999999999 bit\n0 0 0\n",
    "points.vtp": ("99999999999", "0", POINT.format("ascii", "0 0 0")),
    "polygons.vtp": ("1", "9999999999", POINT.format("ascii", "0 0 0") + "<Polys>{}</Polys>"),
    "corners.vtp": ("1", "1", POINT.format("ascii", "0 0 0") + "<Polys>{}</Polys>"),
    "less than no components.vtp": ("1", "0", POINT.format("ascii", "0 0 0").replace('"3"', '"-3"')),
    "blocks.vtp": ("1", "0", POINT.format("binary", "/////////38IAAAAAAAAAA==")),
}
CELLS = "".join(
    f'<DataArray type="Int64" Name="{name}" format="ascii">{text}</DataArray>'
    for name, text in (("connectivity", "0 0 0"), ("offsets", "999999999999"))
)


@pytest.mark.parametrize(
    "name", some_later(HOSTILE, lambda name: name.startswith(("points", "components", "corners")))
)
def test_what_ends_vtk_ends_in_an_error(tmp_path, name):
    """Numbers that VTK takes at their word: it crashes, in a process of its own, or says what is wrong."""
    content = HOSTILE[name]
    if not isinstance(content, str):
        n_points, n_polygons, rest = content
        content = (
            '<VTKFile type="PolyData" compressor="vtkZLibDataCompressor"><PolyData>'
            f'<Piece NumberOfPoints="{n_points}" NumberOfPolys="{n_polygons}">{rest.format(CELLS)}</Piece>'
            "</PolyData></VTKFile>"
        )
    (tmp_path / name).write_text(content)
    with pytest.raises(FormatError, match="damaged"):
        read_asset(tmp_path / name)


def zeros(suffix, n_points):
    """A sound file of points at one place, compressed."""
    block = zlib.compress(bytes(12 * n_points))
    head = np.array([1, 12 * n_points, 0, len(block)], "<u4").tobytes()
    array = (base64.b64encode(head) + base64.b64encode(block)).decode()
    kind, cells = ("PolyData", "") if suffix == ".vtp" else ("UnstructuredGrid", f"<Cells>{ONE_CELL}</Cells>")
    return (
        f'<VTKFile type="{kind}" version="0.1" byte_order="LittleEndian" header_type="UInt32" '
        f'compressor="vtkZLibDataCompressor"><{kind}><Piece NumberOfPoints="{n_points}" NumberOfCells="1" '
        f'NumberOfPolys="0">{POINT.format("binary", array)}{cells}</Piece></{kind}></VTKFile>'
    ).encode()


ONE_CELL = "".join(
    f'<DataArray type="{kind}" Name="{name}" format="ascii">{text}</DataArray>'
    for kind, name, text in (
        ("Int64", "connectivity", "0 0 0"),
        ("Int64", "offsets", "3"),
        ("UInt8", "types", "5"),
    )
)


@pytest.mark.long
@pytest.mark.parametrize("suffix", [".vtp", ".vtu"])
def test_a_bomb_of_zeros_does_not_fill_memory(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    path.write_bytes(zeros(suffix, 1000))
    assert len(read_asset(path).points) == 1000
    path.write_bytes(zeros(suffix, 20_000_000))
    assert path.stat().st_size < 1_000_000
    with pytest.raises(FormatError, match="reader"):
        read_asset(path)


@pytest.mark.long
def test_cells_that_are_no_polygons_are_told(tmp_path):
    """Whether a file has them, or the mesh of a library; vertices alone are a cloud of points."""
    meshio, pyvista = pytest.importorskip("meshio"), pytest.importorskip("pyvista")
    blocks = [("line", [[0, 1], [1, 2]]), ("triangle", [[0, 1, 2]]), ("tetra", [[0, 1, 2, 3]])]
    solid = meshio.Mesh(POINTS[:4], blocks)
    surface = pyvista.PolyData(POINTS[:4], faces=[3, 0, 1, 2], verts=[1, 3], lines=[2, 0, 1])
    cloud = pyvista.PolyData(POINTS[:4], verts=[1, 0, 1, 1, 1, 2, 1, 3])
    solid.write(tmp_path / "a.vtu")
    surface.save(tmp_path / "b.vtp")
    start = "cells that are no polygons are left out: "
    for asset in (asset_from(solid), read_asset(tmp_path / "a.vtu")):
        assert asset.notes == (f"{start}2 line, 1 tetra",)
    for asset in (asset_from(surface), read_asset(tmp_path / "b.vtp")):
        assert asset.notes == (f"{start}1 vertex, 1 line",)
    assert asset_from(cloud).notes == ()


@pytest.mark.parametrize(
    ("suffix", "binary"),
    some_later(
        [(s, b) for s in (".vtp", ".vtk", ".vtu") for b in (True, False)], lambda case: case == (".vtp", True)
    ),
)
def test_texts_are_kept_and_other_arrays_named(tmp_path, suffix, binary):
    words = Attribute("words", "point", "label", ["a b", "Größe", "", "b", "b", "b", "b"])
    parts = Attribute("part", "face", "label", [f"limb {i}" for i in range(4)])
    mesh = to_pyvista(Asset(POINTS, POLYGONS, (words, parts)))
    pairs = mesh.GetPointData().GetAbstractArray("words").NewInstance()
    pairs.SetName("pairs")
    pairs.SetNumberOfComponents(2)
    for i in range(14):
        pairs.InsertNextValue(str(i))
    mesh.GetPointData().AddArray(pairs)
    (mesh.cast_to_unstructured_grid() if suffix == ".vtu" else mesh).save(
        tmp_path / f"a{suffix}", binary=binary
    )
    asset = read_asset(tmp_path / f"a{suffix}")
    assert asset.notes == ("the array 'pairs' is left out: it has neither numbers nor one text in a row",)
    assert write_asset(tmp_path / f"b{suffix}", asset, binary=binary) == ()
    for found in (asset, read_asset(tmp_path / f"b{suffix}")):
        for given in (words, parts):
            assert found.attribute(given.name).values.tolist() == given.values.tolist()


def test_nothing_in_the_working_folder_is_run(tmp_path, monkeypatch):
    for name in ("zipfile", "numpy", "isomatch"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit(9)")
    write_asset(tmp_path / "triangle.vtp", Asset.of_mesh(Mesh(np.eye(3), [[0, 1, 2]])))
    monkeypatch.chdir(tmp_path)
    assert len(read_asset("triangle.vtp").polygons) == 1
