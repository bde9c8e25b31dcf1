"""Shapes that move: strain, thickness and the measures of regions in closed form, and ``isomatch statistics time``."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from isomatch import Mesh, MeshError, write_mesh
from isomatch.cli import main
from isomatch.cohort.shape_statistics import face_motion, motion_by_region, surface_strain, wall_thickness
from shapes import box, flat_grid, icosphere
from small_collections import lines_of

TURN = Rotation.from_rotvec([0.3, -1.0, 2.0]).as_matrix()
STRIP = flat_grid(4, 6, 0.3)
GRADIENTS = [[1.7, 0], [0, 1]], [[0.6, 0], [0, 0.6]], [[1, 0.8], [0, 1]], [[0.5, 2], [-1, 0.3]], np.eye(2)


def rows_of(mesh, reference, labels=()):
    return motion_by_region(mesh, reference, face_motion(mesh, reference), labels)


@pytest.mark.parametrize("plane", GRADIENTS, ids=["stretched", "scaled", "sheared", "any", "turned"])
def test_strain_of_a_linear_map_is_its_definition(plane):
    gradient = TURN[:, :2] @ plane
    strain = surface_strain(STRIP, STRIP.moved(STRIP.vertices[:, :2] @ gradient.T + 5))
    second, first = np.linalg.eigvalsh((gradient.T @ gradient - np.eye(2)) / 2)
    growth = abs(np.linalg.det(plane)) - 1
    expected = np.broadcast_to([[first], [second], [growth]], strain.shape)
    np.testing.assert_allclose(strain, expected, atol=1e-14)


@pytest.mark.long
def test_a_swelling_ball():
    ball, radius = icosphere(4), 1.3
    labels = np.where(ball.vertices[:, 2] > 0.3, "b10", np.where(ball.vertices[:, 0] > 0, "b9", ""))
    moved = ball.moved(radius * ball.vertices @ TURN.T)
    whole, *regions = rows_of(moved, ball, labels)
    assert [row["region"] for row in regions] == ["b9", "b10"]
    assert whole["area"] == pytest.approx(4 * np.pi * radius**2, rel=5e-3)
    assert whole["volume"] == pytest.approx(4 / 3 * np.pi * radius**3, rel=5e-3)
    nowhere = float(moved.vertex_areas[labels == ""].sum())
    assert sum(row["area"] for row in regions) + nowhere == pytest.approx(whole["area"])
    for row in (whole, *regions):
        assert row["thickness"] == pytest.approx(2 * radius, rel=5e-3)
        strains = [row["first_strain"], row["second_strain"], row["area_strain"] / 2]
        assert strains == pytest.approx([(radius**2 - 1) / 2] * 3)
        assert np.isnan(row["volume"]) == (row is not whole)


def test_area_strain_of_a_region_is_its_growth():
    ball = icosphere(2)
    moved = ball.moved(ball.vertices * [1, 2, 3] + ball.vertices**2)
    labels = np.where(ball.vertices[:, 0] > 0, "right", "left")
    for old, new in zip(rows_of(ball, ball, labels), rows_of(moved, ball, labels)):
        assert new["area_strain"] == pytest.approx(new["area"] / old["area"] - 1)


@pytest.mark.parametrize("sign", [1, -1], ids=["outward", "inward"])
def test_thickness_of_a_shell_and_a_slab(sign):
    ball, inner = icosphere(3), 0.8
    faces = np.concatenate([ball.faces, ball.faces[:, ::-1] + ball.n_vertices])[:, ::sign]
    shell = Mesh(np.concatenate([ball.vertices, inner * ball.vertices]) @ TURN.T + 9, faces)
    np.testing.assert_allclose(wall_thickness(shell), 1 - inner, atol=3e-3)
    slab = box(6, 5, 2)
    widths, normals = np.ptp(slab.vertices, axis=0), np.abs(slab.face_cross)
    turned = Mesh(slab.vertices @ TURN.T, slab.faces[:, ::sign])
    np.testing.assert_allclose(wall_thickness(turned), widths[normals.argmax(axis=1)])


def test_what_is_not_known_is_nan():
    (row,) = rows_of(STRIP, STRIP)
    assert np.isnan([row["volume"], row["thickness"]]).all()
    flat = Mesh([[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    np.testing.assert_allclose(surface_strain(flat, flat.moved(2 * flat.vertices))[2], [np.nan, 3])
    assert rows_of(flat, flat)[0]["area_strain"] == pytest.approx(0)
    with pytest.raises(MeshError, match="same faces"):
        surface_strain(flat, STRIP)


@pytest.mark.long
@pytest.mark.usefixtures("coarse_pictures")
def test_the_command(tmp_path, capsys):
    ball, folder, argv = icosphere(2), tmp_path / "series", ["statistics", "time", str(tmp_path / "series")]
    folder.mkdir()
    for i in range(1, 12):
        write_mesh(folder / f"frame{i}.off", ball.moved(ball.vertices * (1 + 0.1 * np.sin(i))))
    write_mesh(folder / "frame12.off", icosphere(1))
    (tmp_path / "half.csv").write_text("half\n" + "\n".join(np.where(ball.vertices[:, 2] > 0, "up", "down")))
    out = tmp_path / "out"
    argv += ["-o", str(out), "--force"]
    assert main([*argv, "--regions", str(tmp_path / "half.csv"), "--reference", "frame3"]) == 0
    assert "left out: frame12: other faces" in capsys.readouterr().err
    rows = lines_of(out / "time.csv")
    assert [row["name"] for row in rows[::3]] == [f"frame{i}" for i in range(1, 12)]
    s = (1 + 0.1 * np.sin(7)) / (1 + 0.1 * np.sin(3))
    assert float(rows[18]["first_strain"]) == pytest.approx((s**2 - 1) / 2, rel=1e-5)
    assert {"time.png", "strain"} <= {path.name for path in out.iterdir()}
    assert main([*argv, "--reference", "frame0"]) == 1
    assert "no such shape" in capsys.readouterr().err
    for i in range(2, 13):
        (folder / f"frame{i}.off").unlink()
    assert main(argv) == 1
    assert "two shapes or more in one topology, not 1" in capsys.readouterr().err
