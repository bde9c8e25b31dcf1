"""The space of coordinates goes with them: from file to file, into other formats, and with ``--as-mesh``."""

import numpy as np
import pytest

from corresponded import wrapped_as
from isomatch import Asset, read_asset, read_mesh, write_asset
from isomatch.cli import main
from isomatch.cli.outputs import write_wrapped
from shapes import icosphere

nibabel = pytest.importorskip("nibabel")

OFFSETS = np.array([[5.0, -20.0, 30.0], [-3.0, 10.0, 2.0]])
AXES = {"xras": [-1.0, 0, 0], "yras": [0, 0, -1.0], "zras": [0, 1.0, 0]}
TILTED = {"xras": [-1.0, 0, 0], "yras": [0, 0.6, -0.8], "zras": [0, 0.8, 0.6]}
SHAPES = [icosphere(1).moved(icosphere(1).vertices * scale) for scale in ([9, 7, 5], [8, 8, 6])]
"""Two shapes in the coordinates of FreeSurfer, whose origin is the centre of the volume."""


def volume(offset, axes=AXES, real=0):
    return {
        "head": np.array([2, real, 20], dtype=np.int32),
        "valid": "1  # volume info valid",
        "filename": "orig.mgz",
        "volume": np.array([256, 256, 256]),
        "voxelsize": np.ones(3),
        **{key: np.array(axis) for key, axis in axes.items()},
        "cras": np.array(offset),
    }


def gifti(mesh, spaces, matrix=None, meta=None):
    gii = nibabel.gifti
    system = gii.GiftiCoordSystem(*(f"NIFTI_XFORM_{space}" for space in spaces), matrix)
    points = gii.GiftiDataArray(mesh.vertices.astype(np.float32), 1008, coordsys=system, meta=meta)
    faces = gii.GiftiDataArray(mesh.faces.astype(np.int32), 1009, meta={"TopologicalType": "Closed"})
    return gii.GiftiImage(darrays=[points, faces])


def shift(offset):
    matrix = np.eye(4)
    matrix[:3, 3] = offset
    return matrix


@pytest.fixture(params=["lh.pial", "matrix.surf.gii", "scanner.surf.gii", "real.pial", "volume.surf.gii"])
def pair(request, tmp_path):
    """Files of both shapes that say in one of five ways where they are in the scanner."""
    paths = []
    for which, mesh, offset in zip("ab", SHAPES, OFFSETS):
        path = tmp_path / f"{which}.{request.param}"
        moved = mesh.moved(mesh.vertices + offset)
        if request.param == "lh.pial":
            nibabel.freesurfer.write_geometry(
                path, mesh.vertices, mesh.faces, volume_info=volume(offset), create_stamp="by hand"
            )
        elif request.param == "real.pial":
            with pytest.warns(UserWarning, match="Unknown extension"):
                nibabel.freesurfer.write_geometry(
                    path, moved.vertices, mesh.faces, volume_info=volume(offset, real=1)
                )
        elif request.param == "matrix.surf.gii":
            gifti(mesh, ("UNKNOWN", "SCANNER_ANAT"), shift(offset)).to_filename(path)
        elif request.param == "volume.surf.gii":
            axes = {f"VolGeom{key[0].upper()}": axis for key, axis in (AXES | {"cras": offset}).items()}
            meta = {f"{key}_{way}": f"{x:.6f}" for key, axis in axes.items() for way, x in zip("RAS", axis)}
            meta |= dict.fromkeys(("VolGeomWidth", "VolGeomHeight", "VolGeomDepth"), "256")
            meta |= dict.fromkeys(("VolGeomXsize", "VolGeomYsize", "VolGeomZsize"), "1.000000")
            gifti(mesh, ("UNKNOWN", "UNKNOWN"), meta=meta).to_filename(path)
        else:
            gifti(moved, ("SCANNER_ANAT", "SCANNER_ANAT"), np.eye(4)).to_filename(path)
        paths.append(path)
    return paths


def in_scanner(path):
    """Where the points of a file are in the scanner, read by nibabel alone."""
    if path.suffix == ".gii":
        image = nibabel.load(path)
        system, meta = image.darrays[0].coordsys, image.darrays[0].meta
        if system.xformspace == 0:
            return image.agg_data("pointset") + [float(meta[f"VolGeomC_{way}"]) for way in "RAS"]
        assert system.xformspace == 1
        return image.agg_data("pointset") @ system.xform[:3, :3].T + system.xform[:3, 3]
    points, _, volume_info = nibabel.freesurfer.read_geometry(path, read_metadata=True)
    directions = np.stack([volume_info[key] for key in ("xras", "yras", "zras")], axis=1)
    in_volume = directions @ np.linalg.inv(np.stack(list(AXES.values()), axis=1))
    return points @ in_volume.T + volume_info["cras"]


@pytest.mark.parametrize("name", ["out.pial", "out.surf.gii"])
def test_the_target_is_where_it_was_in_the_topology_of_the_source(pair, tmp_path, name):
    source, target = pair
    meshes = [read_mesh(path) for path in pair]
    wrapped = wrapped_as(meshes[0].moved(meshes[1].vertices))
    out = tmp_path / name
    record = write_wrapped(
        out, read_asset(source), read_asset(target).frame, wrapped, np.zeros(meshes[0].n_vertices)
    )
    assert record["left_out"] == []
    np.testing.assert_allclose(read_mesh(out).vertices, meshes[1].vertices, atol=1e-5)
    if not (pair[1].name == "b.real.pial" and out.suffix == ".pial"):  # which nibabel does not read
        np.testing.assert_allclose(in_scanner(out), SHAPES[1].vertices + OFFSETS[1], atol=1e-4)


@pytest.mark.parametrize("name", ["out.pial", "out.surf.gii"])
def test_a_conversion_stays_where_it_was(pair, tmp_path, name):
    asset = read_asset(pair[0])
    assert write_asset(tmp_path / name, asset) == ()
    again = read_asset(tmp_path / name)
    np.testing.assert_allclose(again.frame.matrix, asset.frame.matrix, atol=1e-5)
    assert write_asset(tmp_path / f"again_{pair[0].name}", again) == ()
    back = read_asset(tmp_path / f"again_{pair[0].name}")
    np.testing.assert_allclose(back.points, asset.points, atol=1e-5)
    np.testing.assert_allclose(back.frame.matrix, asset.frame.matrix, atol=1e-5)


def test_a_format_without_frames_tells_the_loss(pair, tmp_path, capsys):
    asset = read_asset(pair[0])
    for name in ("a.ply", "a.obj", "a.glb", "a.stl"):
        (lost,) = write_asset(tmp_path / name, asset)
        assert lost.name.startswith("the frame of the coordinates (")
        np.testing.assert_array_equal(lost.values, asset.frame.matrix)
    assert main(["repair", str(pair[0]), "-o", str(tmp_path / "b.ply")]) == 0
    where = "c_ras 5 -20 30, the offset to" if asset.frame.space == "unknown" else "in"
    lost = f"the frame of the coordinates ({where} scanner_anat), which a .ply file cannot store"
    assert f"not in {tmp_path / 'b.ply'}: {lost}" in capsys.readouterr().out
    assert main(["repair", str(pair[0]), "-o", str(tmp_path / "b.surf.gii")]) == 0
    assert "cannot store" not in capsys.readouterr().out
    np.testing.assert_allclose(
        in_scanner(tmp_path / "b.surf.gii"), SHAPES[0].vertices + OFFSETS[0], atol=1e-4
    )


def test_a_tilted_volume(tmp_path):
    """From a volume whose voxel axes are not those of the scanner, the way to it is a rotation too."""
    mesh = SHAPES[0]
    nibabel.freesurfer.write_geometry(
        tmp_path / "a.white", mesh.vertices, mesh.faces, volume_info=volume(OFFSETS[0], TILTED)
    )
    asset = read_asset(tmp_path / "a.white")
    # through voxels: from the surface to the volume's own, and from these to the scanner
    axes, tilted = (np.stack(list(directions.values()), axis=1) for directions in (AXES, TILTED))
    voxels = mesh.vertices @ np.linalg.inv(axes).T + 128
    expected = (voxels - 128) @ tilted.T + OFFSETS[0]
    np.testing.assert_allclose(in_scanner(tmp_path / "a.white"), expected, atol=1e-6)
    assert write_asset(tmp_path / "a.surf.gii", asset) == ()
    np.testing.assert_allclose(in_scanner(tmp_path / "a.surf.gii"), expected, atol=1e-4)
    image = nibabel.load(tmp_path / "a.surf.gii")
    image.darrays[0].meta.clear()  # what FreeSurfer says beside the matrix
    image.to_filename(tmp_path / "bare.surf.gii")
    assert write_asset(tmp_path / "b.white", read_asset(tmp_path / "bare.surf.gii")) == ()
    np.testing.assert_allclose(in_scanner(tmp_path / "b.white"), expected, atol=1e-4)


def test_what_a_volume_cannot_tell(tmp_path):
    """Coordinates of a template, and a matrix that scales, have no place in a FreeSurfer surface."""
    gifti(SHAPES[0], ("TALAIRACH", "TALAIRACH"), np.eye(4)).to_filename(tmp_path / "a.surf.gii")
    (lost,) = write_asset(tmp_path / "a.pial", read_asset(tmp_path / "a.surf.gii"))
    assert lost.name == "the frame of the coordinates (in talairach)"
    gifti(SHAPES[0], ("UNKNOWN", "MNI_152"), np.diag([0.9, 0.9, 0.9, 1])).to_filename(tmp_path / "b.surf.gii")
    (lost,) = write_asset(tmp_path / "b.pial", read_asset(tmp_path / "b.surf.gii"))
    assert lost.name == "the frame of the coordinates (matrix to mni_152)"
    assert write_asset(tmp_path / "c.surf.gii", read_asset(tmp_path / "b.surf.gii")) == ()
    assert read_asset(tmp_path / "c.surf.gii").frame.to == "mni_152"


def test_a_unit_in_comments_is_that_of_the_coordinates(tmp_path):
    for name, words in (("a", "comment unit: mm\ncomment SPACE=LPS\n"), ("b", "comment units = metres\n")):
        write_asset(tmp_path / f"{name}.ply", Asset.of_mesh(SHAPES[0]), binary=False)
        text = (tmp_path / f"{name}.ply").read_text()
        (tmp_path / f"{name}.ply").write_text(
            text.replace("element", f"comment by {name}\n{words}element", 1)
        )
    wrapped = wrapped_as(SHAPES[0])
    errors = np.zeros(SHAPES[0].n_vertices)
    asset, frame = read_asset(tmp_path / "a.ply"), read_asset(tmp_path / "b.ply").frame
    write_wrapped(tmp_path / "c.ply", asset, frame, wrapped, errors)
    header = (tmp_path / "c.ply").read_text().partition("element")[0].splitlines()
    assert header[2:] == ["comment by a", "comment units = metres"]
    record = write_wrapped(tmp_path / "c.white", asset, frame, wrapped, errors)
    assert record["left_out"] == ["the frame of the coordinates (units = metres)"]
    write_asset(tmp_path / "d.ply", read_asset(tmp_path / "a.ply"))
    assert (tmp_path / "d.ply").read_text() == (tmp_path / "a.ply").read_text()
