"""GIFTI arrays are read by what their intent says, and written with the right one: against nibabel's own tables."""

import base64
import tracemalloc
import zlib

import numpy as np
import pytest

from isomatch import FormatError, read_asset, write_asset
from isomatch.io import Attribute, read_attributes, write_attributes
from shapes import icosphere

nibabel = pytest.importorskip("nibabel")
from nibabel.gifti import GiftiDataArray, GiftiImage  # noqa: E402

MESH = icosphere(1)
COLOURS = (MESH.vertices / 2 + 0.5).astype(np.float32)


def surface(*arrays):
    return GiftiImage(
        darrays=[
            GiftiDataArray(MESH.vertices.astype(np.float32), "NIFTI_INTENT_POINTSET"),
            GiftiDataArray(MESH.faces.astype(np.int32), "NIFTI_INTENT_TRIANGLE"),
            *arrays,
        ]
    )


@pytest.mark.parametrize("width", [3, 4])
@pytest.mark.parametrize("kind", [np.float32, np.uint8])
def test_colours_are_read(tmp_path, width, kind):
    colours = np.pad(COLOURS, ((0, 0), (0, 1)), constant_values=0.5)[:, :width]
    colours = colours if kind == np.float32 else np.uint8(255 * colours)
    intent = f"NIFTI_INTENT_{'RGB' if width == 3 else 'RGBA'}_VECTOR"
    array = GiftiDataArray(colours, intent)
    surface(array).to_filename(tmp_path / "a.surf.gii")
    GiftiImage(darrays=[array]).to_filename(tmp_path / "paint.func.gii")
    (found,) = read_asset(tmp_path / "a.surf.gii").attributes
    (alone,) = read_attributes(tmp_path / "paint.func.gii")
    for colour in (found, alone):
        assert colour.kind == "colour"
        np.testing.assert_array_equal(colour.values, colours)
    assert found.name == alone.name == "color"
    write_asset(tmp_path / "a.ply", read_asset(tmp_path / "a.surf.gii"))
    assert read_asset(tmp_path / "a.ply").attribute("color").kind == "colour"


def test_values_at_some_nodes(tmp_path):
    nodes = np.int32([7, 3, 30])
    arrays = (
        GiftiDataArray(nodes, "NIFTI_INTENT_NODE_INDEX"),
        GiftiDataArray(np.float32([0.5, 1.5, 2.5]), "NIFTI_INTENT_SHAPE", meta={"Name": "depth"}),
        GiftiDataArray(np.int32([4, 4, 5]), "NIFTI_INTENT_LABEL", meta={"Name": "area"}),
    )
    surface(*arrays).to_filename(tmp_path / "a.gii")
    GiftiImage(darrays=list(arrays)).to_filename(tmp_path / "a.func.gii")
    asset = read_asset(tmp_path / "a.gii")
    for depth, area in (asset.attributes, read_attributes(tmp_path / "a.func.gii", asset)):
        assert len(depth) == len(area) == MESH.n_vertices
        np.testing.assert_array_equal(depth.values[nodes], [0.5, 1.5, 2.5])
        np.testing.assert_array_equal(area.values[nodes], [4, 4, 5])
        assert np.isnan(depth.values).sum() == (area.values == -1).sum() == MESH.n_vertices - 3
    assert len(read_attributes(tmp_path / "a.func.gii")[0]) == 31
    write_asset(tmp_path / "b.gii", asset)  # where each point has a value, there is no list of nodes
    again = read_asset(tmp_path / "b.gii").attribute("depth").values
    np.testing.assert_array_equal(again, asset.attribute("depth").values)


def test_several_values_in_one_file(tmp_path):
    given = [
        Attribute("area", "point", "label", [0, 1, 1], names={0: "a", 1: "b"}),
        Attribute("depth", "point", "scalar", np.float32([0.5, 1, 2])),
    ]
    assert write_attributes(tmp_path / "a.func.gii", given) == ()
    found = read_attributes(tmp_path / "a.func.gii")
    assert [(a.name, a.kind, a.values.tolist(), dict(a.names)) for a in found] == [
        (a.name, a.kind, a.values.tolist(), dict(a.names)) for a in given
    ]


@pytest.mark.long
def test_a_bomb_of_zeros_is_not_unpacked(tmp_path):
    """Compressed a thousandfold; comments between the letters do not hide it."""
    packed = base64.b64encode(zlib.compress(bytes(200_000_000))).decode()
    text = (
        '<?xml version="1.0"?><GIFTI Version="1.0" NumberOfDataArrays="1"><DataArray Intent="NIFTI_INTENT_POINTSET" '
        'DataType="NIFTI_TYPE_FLOAT32" ArrayIndexingOrder="RowMajorOrder" Dimensionality="2" Dim0="16666666" Dim1="3" '
        'Encoding="GZipBase64Binary" Endian="LittleEndian" ExternalFileName="" ExternalFileOffset=""><Data>'
        f"{packed[:5]}<!-- a -->{packed[5:]}</Data></DataArray></GIFTI>"
    )
    (tmp_path / "a.gii").write_text(text)
    tracemalloc.start()
    with pytest.raises(FormatError, match="claims"):
        read_asset(tmp_path / "a.gii")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 20 * len(text)


@pytest.mark.parametrize("encoding", ["ASCII", "B64BIN", "B64GZ"])
def test_every_encoding_is_read(tmp_path, encoding):
    corners, faces = np.eye(3, dtype=np.float32), np.array([[0, 1, 2]], dtype=np.int32)
    arrays = [
        GiftiDataArray(values, intent, encoding=f"GIFTI_ENCODING_{encoding}")
        for values, intent in ((corners, "NIFTI_INTENT_POINTSET"), (faces, "NIFTI_INTENT_TRIANGLE"))
    ]
    path = tmp_path / "triangle.surf.gii"
    path.write_bytes(GiftiImage(darrays=arrays).to_xml())
    asset = read_asset(path)
    np.testing.assert_allclose(asset.points, corners)
    np.testing.assert_array_equal(asset.polygons.triangles, faces)
