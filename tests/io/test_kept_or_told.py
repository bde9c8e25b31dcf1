"""What a surface carries is in the file, or returned as lost: every format, everything that may be carried."""

from dataclasses import replace

import numpy as np
import pytest

from isomatch import Asset, Mesh, MeshError, read_asset, write_asset
from isomatch.io import FORMATS, Attribute, Frame, asset_from, to_pyvista
from later import some_later
from shapes import icosphere

BODY = icosphere(2)
N, M = BODY.n_vertices, BODY.n_faces
RANDOM = np.random.default_rng(3)
DIRECTIONS = BODY.vertices / np.linalg.norm(BODY.vertices, axis=1, keepdims=True)
CARRIED = {
    "space": Frame(words=("SPACE=LPS",)),
    "unit": Frame(words=("units = mm",)),
    "colours of points": Attribute("color", "point", "colour", RANDOM.integers(0, 256, (N, 3), np.uint8)),
    "colours of faces": Attribute("color", "face", "colour", RANDOM.integers(0, 256, (M, 3), np.uint8)),
    "labels": Attribute("region", "point", "label", np.arange(N) % 3, names={0: "a", 1: "b", 2: "c"}),
    "labels of faces": Attribute("part", "face", "label", np.arange(M) % 4),
    "texture coordinates": Attribute("uv", "point", "uv", RANDOM.random((N, 2)).astype(np.float32)),
    "normals": Attribute("normal", "point", "normal", DIRECTIONS.astype(np.float32)),
    "scalars": Attribute("thickness", "point", "scalar", RANDOM.random(N).astype(np.float32)),
}
# surfaces of FreeSurfer differ by their names alone
SUFFIXES = [suffix for suffix in FORMATS if FORMATS[suffix].axes is None or suffix == ".pial"]
MOSTLY_NOW = some_later(
    SUFFIXES, lambda suffix: suffix not in (".vtp", ".vtu")
)  # each read by a process of its own


def is_like(given, found, asset):
    """Whether an attribute of a file has the values that were given, where the surface is the same."""
    if (given.kind, given.domain == "face") != (found.kind, found.domain == "face"):
        return False
    values = found.fractions[:, :3] if found.kind == "colour" else found.coded.values
    expected = given.fractions if given.kind == "colour" else given.coded.values
    if found.domain == "corner":
        expected = expected[asset.polygons.corners]
    return values.shape == expected.shape and np.allclose(values, expected, atol=1e-6)


@pytest.mark.parametrize("what", CARRIED)
@pytest.mark.parametrize("suffix", MOSTLY_NOW)
def test_everything_is_kept_or_told(tmp_path, suffix, what):
    given, asset = CARRIED[what], Asset.of_mesh(BODY)
    is_frame = isinstance(given, Frame)
    asset = replace(asset, frame=given) if is_frame else asset.with_attributes(given)
    left = [attribute.name for attribute in write_asset(tmp_path / f"a{suffix}", asset)]
    again = read_asset(tmp_path / f"a{suffix}")
    if is_frame:
        kept = again.frame is not None and given.words[0] in again.frame.words
        reported = [name for name in left if given.words[0] in name]
    else:
        kept = any(is_like(given, found, again) for found in again.attributes)
        reported = [name for name in left if name == given.name]
    assert kept != bool(reported)
    if what == "labels" and kept:
        (found,) = (attribute for attribute in again.attributes if attribute.kind == "label")
        words = [found.names.get(code) for code in found.coded.values.tolist()]
        assert (words == [given.names[code] for code in given.values.tolist()]) != ("names of region" in left)


def test_the_law_can_be_broken(tmp_path):
    """A loss that a format does not tell would be found: STL files have no scalars, and say so."""
    asset = Asset.of_mesh(BODY).with_attributes(CARRIED["scalars"])
    assert [lost.name for lost in write_asset(tmp_path / "a.stl", asset)] == ["thickness"]
    assert not read_asset(tmp_path / "a.stl").attributes


LINES = [
    ("3D Slicer output. SPACE=RAS",),
    ("space = lps", "all lengths in m", "unit: cm"),
    ("Coordinate system: RAS", "units are millimetres"),
]


@pytest.mark.long
@pytest.mark.parametrize("words", LINES, ids=str)
@pytest.mark.parametrize("first", SUFFIXES)
def test_the_space_goes_through_any_two_formats(tmp_path, first, words):
    asset = replace(Asset.of_mesh(BODY), frame=Frame.of_lines(*words))
    axes = asset.frame.axes
    for last in (".ply", ".obj", ".vtp", ".pial"):
        write_asset(tmp_path / f"a{first}", asset)
        write_asset(tmp_path / f"b{last}", read_asset(tmp_path / f"a{first}"))
        found = read_asset(tmp_path / f"b{last}")
        # FreeSurfer surfaces are in RAS, and positions are turned with the name of the space
        turn = np.array([-1.0, -1.0, 1.0]) if found.frame.axes != axes else 1
        assert (".pial" in (first, last)) == (found.frame.axes != axes) or axes == "RAS"
        np.testing.assert_allclose(found.placed_points.sum(0), (BODY.vertices * turn).sum(0), atol=1e-3)
        np.testing.assert_allclose(found.placed_points.min(0), (BODY.vertices * turn).min(0), atol=1e-6)


def slicer_files(folder):
    """Files as 3D Slicer writes them, the space in the place that each format has for it."""
    faces = "".join(f"3 {a} {b} {c}\n" for a, b, c in BODY.faces)
    points = "".join(f"{x} {y} {z}\n" for x, y, z in BODY.vertices.tolist())
    comment = "3D Slicer output. SPACE=RAS"
    (folder / "a.vtk").write_text(
        f"# vtk DataFile Version 3.0\n{comment}\nASCII\nDATASET POLYDATA\nPOINTS {N} double\n{points}"
        f"POLYGONS {M} {4 * M}\n{faces}"
    )
    rows = "".join(f"f {a} {b} {c}\n" for a, b, c in BODY.faces + 1)
    (folder / "a.obj").write_text(f"# {comment}\n" + "".join(f"v {p}\n" for p in points.splitlines()) + rows)
    triangles = np.zeros(M, [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    triangles["corners"] = BODY.vertices[BODY.faces]
    (folder / "a.stl").write_bytes(
        comment.encode().ljust(80, b"\0") + M.to_bytes(4, "little") + triangles.tobytes()
    )
    (folder / "a.off").write_text(f"OFF\n#{comment}\n{N} {M} 0\n{points}{faces}")
    mesh = to_pyvista(Asset.of_mesh(BODY))
    mesh.field_data["SPACE"] = ["RAS"]
    mesh.save(folder / "a.vtp")


@pytest.mark.long
def test_files_of_slicer_and_what_is_written_from_them(tmp_path):
    pytest.importorskip("pyvista")
    slicer_files(tmp_path)
    for given in sorted(tmp_path.glob("a.*")):
        asset = read_asset(given)
        assert asset.frame.axes == "RAS", given
        for suffix in SUFFIXES:
            write_asset(tmp_path / f"b{suffix}", asset)
            assert read_asset(tmp_path / f"b{suffix}").frame.axes == "RAS", (given, suffix)
    import pyvista  # as another program reads them

    write_asset(tmp_path / "b.vtp", read_asset(tmp_path / "a.stl"))
    assert list(pyvista.read(tmp_path / "b.vtp").field_data["SPACE"]) == ["RAS"]
    assert (tmp_path / "b.vtk").read_bytes().splitlines()[1] == b"SPACE=RAS"
    assert asset_from(pyvista.read(tmp_path / "b.vtp")).points.shape == (N, 3)


def test_a_line_too_long_for_a_title_is_told_but_for_the_space(tmp_path):
    words = (f"units = mm, {'x' * 90}", "SPACE=LPS")
    asset = replace(Asset.of_mesh(BODY), frame=Frame(words=words))
    (lost,) = write_asset(tmp_path / "a.stl", asset)
    assert "units = mm" in lost.name
    assert read_asset(tmp_path / "a.stl").frame.words == ("SPACE=LPS",)


UTM = np.array([512345.6, 5412345.7, 321.5])
SCANNER = np.array([-3.2e7, 1.7e5, 9.9e6])


@pytest.mark.parametrize("offset", [UTM, SCANNER], ids=["UTM", "scanner"])
@pytest.mark.parametrize("suffix", MOSTLY_NOW)
@pytest.mark.parametrize("template", [None, ".ply", ".glb"])
def test_far_from_the_origin_positions_stay_or_it_is_said_by_how_much(tmp_path, suffix, offset, template):
    """A thousandth of the mean edge is what a file may move them by without being asked."""
    asset, places = Asset.of_mesh(BODY), BODY.vertices + offset
    if template:
        write_asset(tmp_path / f"template{template}", asset)
        asset = read_asset(tmp_path / f"template{template}")
        if template == ".ply":
            asset = replace(asset, document=replace(asset.document, positions="f4"))
    asset, path = asset.moved(places), tmp_path / f"a{suffix}"
    edge = np.linalg.norm(BODY.vertices[BODY.faces] - BODY.vertices[np.roll(BODY.faces, 1, 1)], axis=2).mean()
    rounding = np.linalg.norm(places - places.astype(np.float32), axis=1).max()
    assert rounding > 0.1 * edge
    if suffix in (".gii", ".pial"):
        with pytest.raises(MeshError, match=rf"would move by up to {rounding:.2g}, .* \.ply"):
            write_asset(path, asset)
        assert not path.exists()
        (left,) = write_asset(path, asset, rounded=True)
        assert left.name == f"the last digits of the positions (moved by up to {rounding:.2g})"
        assert left.values.max() == pytest.approx(rounding)
        return
    assert write_asset(path, asset) == ()
    found = read_asset(path).placed_points
    if suffix == ".stl":
        places, found = (np.unique(positions, axis=0) for positions in (places, found))
    assert np.linalg.norm(found - places, axis=1).max() < 1e-3 * edge


def test_near_the_origin_nothing_changes(tmp_path):
    """Floats hold these as well as they did: a template of floats stays one of floats, a node stays where it was."""
    single = BODY.moved(BODY.vertices.astype(np.float32))
    write_asset(tmp_path / "a.ply", Asset.of_mesh(single))
    asset = read_asset(tmp_path / "a.ply")
    asset = replace(asset, document=replace(asset.document, positions="f4"))
    assert write_asset(tmp_path / "b.ply", asset.moved(1.1 * single.vertices)) == ()
    assert b"property float x" in (tmp_path / "b.ply").read_bytes()
    write_asset(tmp_path / "b.gltf", asset)
    assert "translation" not in (tmp_path / "b.gltf").read_text()
    write_asset(tmp_path / "b.stl", asset)
    assert (tmp_path / "b.stl").read_bytes().startswith(b"binary STL")


@pytest.mark.parametrize("binary", [True, False])
def test_ply_without_doubles_where_rounding_is_asked_for(binary, tmp_path):
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1 / 3, 0]])
    values = Attribute("depth", "point", "scalar", np.array([0.1, 0.2, 0.3]))
    asset = Asset.of_mesh(Mesh(points, [[0, 1, 2]]), [values])
    write_asset(tmp_path / "a.ply", asset, binary=binary, rounded=True)
    assert b"double" not in (tmp_path / "a.ply").read_bytes()
    np.testing.assert_allclose(read_asset(tmp_path / "a.ply").points, points, atol=1e-7)
    write_asset(tmp_path / "a.ply", asset, binary=binary)
    np.testing.assert_array_equal(read_asset(tmp_path / "a.ply").points, points)
