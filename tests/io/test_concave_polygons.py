"""Polygons that are not convex: right area, distances and corners, whatever their plane, format and first corner."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import isomatch
from isomatch import Asset, read_asset, read_mesh, write_asset
from isomatch.cli import main
from isomatch.io import Attribute, Polygons
from later import some_later

L_SHAPE = [[0, 0], [3, 0], [3, 1], [1, 1], [1, 3], [0, 3]]
OUTLINES = {  # with their areas
    "L": (L_SHAPE, 5.0),
    "arrow": ([[0, 0], [2, 1], [0, 2], [1, 1]], 1.0),
    "U": ([[0, 0], [5, 0], [5, 3], [4, 3], [4, 1], [1, 1], [1, 3], [0, 3]], 9.0),
    "points on edges": ([[0, 0], [1, 0], [2, 0], [3, 0], [3, 1], [2, 1], [1, 1], [1, 2], [1, 3], [0, 3], [0, 1]], 5.0),
    "equal corners": ([[0, 0], [3, 0], [3, 1], [1, 1], [1, 1], [1, 3], [0, 3]], 5.0),
    "bridge to a hole": ([[0, 0], [4, 0], [4, 4], [0, 4], [0, 0], [1, 1], [1, 2], [2, 2], [2, 1], [1, 1]], 15.0),
}  # fmt: skip


def shoelace(outline):
    x, y = np.transpose(outline)
    return 0.5 * (x @ np.roll(y, -1) - y @ np.roll(x, -1))


def in_space(outline, seed=0):
    """The outline in some plane, and its unit normal."""
    turn = Rotation.random(random_state=seed).as_matrix()
    return np.pad(np.asarray(outline, float), ((0, 0), (0, 1))) @ turn.T, turn[:, 2]


def areas(points, triangles):
    """Vector area of each triangle."""
    a, b, c = (points[triangles[:, i]] for i in range(3))
    return 0.5 * np.cross(b - a, c - a)


def prism(first):
    """An L-shaped prism whose points, and so the corners of its two large polygons, begin at one of the six."""
    outline = np.roll(L_SHAPE, -first, axis=0)
    points = np.vstack([np.pad(outline, ((0, 0), (0, 1)), constant_values=z) for z in (0, 1)]).astype(float)
    sides = [[i, (i + 1) % 6, (i + 1) % 6 + 6, i + 6] for i in range(6)]
    return Asset(points, Polygons([5, 4, 3, 2, 1, 0, *range(6, 12), *np.ravel(sides)], [6, 6] + [4] * 6))


@pytest.mark.parametrize("scale", [1e-150, 1.0, 1e150])
@pytest.mark.parametrize(("outline", "area"), OUTLINES.values(), ids=OUTLINES)
def test_triangles_cover_the_outline_from_every_first_corner(outline, area, scale):
    for first in range(len(outline)):
        for step in (1, -1):
            points, normal = in_space(np.roll(outline, first, axis=0)[::step], seed=first)
            polygons = Polygons(np.arange(len(points)), [len(points)], scale * points)
            parts = areas(points, polygons.triangles) @ normal * step
            assert parts.min() > -1e-12
            assert parts.sum() == pytest.approx(area, abs=1e-9)
            assert set(polygons.triangles.ravel()) == set(range(len(points)))
            assert len(polygons.uncut) == 0


@pytest.mark.long
@given(st.integers(5, 40), st.integers(0, 10**6), st.integers(0, 39))
@settings(max_examples=60, deadline=None)
def test_stars_of_random_radii(n, seed, first):
    rng = np.random.default_rng(seed)
    angle, radius = 2 * np.pi * (np.arange(n) + 0.4 * rng.random(n)) / n, rng.random(n) + 0.05
    outline = np.roll(np.column_stack([radius * np.cos(angle), radius * np.sin(angle)]), first, axis=0)
    points, normal = in_space(outline, seed)
    parts = areas(points, Polygons(np.arange(n), [n], points).triangles) @ normal
    assert parts.min() > -1e-12
    assert parts.sum() == pytest.approx(shoelace(outline), rel=1e-9)


def test_no_inner_edge_can_be_flipped_to_a_better_one():
    outline = np.array(OUTLINES["U"][0], float)
    triangles = Polygons(range(8), [8], np.pad(outline, ((0, 0), (0, 1)))).triangles
    n_inner = 0
    for one in triangles:
        for other in triangles:
            shared = list(set(one) & set(other))
            if len(shared) == 2:
                n_inner += 1
                [a], [d] = set(one) - set(other), set(other) - set(one)
                b, c, across = (
                    outline[shared[0]] - outline[a],
                    outline[shared[1]] - outline[a],
                    outline[d] - outline[a],
                )
                sides = np.cross(np.pad([b, c], ((0, 0), (0, 1))), [*across, 0])[:, 2]
                centre = np.linalg.solve(2 * np.array([b, c]), [b @ b, c @ c])
                if sides.prod() < 0:
                    assert np.linalg.norm(across - centre) >= np.linalg.norm(centre) - 1e-9
    assert n_inner == 2 * 5


@given(st.integers(4, 12), st.integers(0, 10**6))
@settings(max_examples=60, deadline=None)
def test_convex_polygons_remain_fans(n, seed):
    angle = np.sort(np.random.default_rng(seed).random(n)) * 2 * np.pi
    points, _ = in_space(np.column_stack([np.cos(angle), np.sin(angle)]), seed)
    polygons = Polygons([*range(n), 0, 1, 2], [n, 3], points)
    np.testing.assert_array_equal(polygons.corner_of_triangle, Polygons(range(n + 3), [n, 3]).triangles)


@pytest.mark.parametrize(
    "outline",
    [
        [[0, 0], [2, 2], [2, 0], [0, 2]],
        [[0, 0], [2, 1], [2, 0], [0, 2]],
        [[np.cos(4 * np.pi * i / 5), np.sin(4 * np.pi * i / 5)] for i in range(5)],
        [[0, 0], [1, 0], [2, 0], [3, 0]],
        [[1, 1]] * 5,
    ],
    ids=["no area in all", "crossing", "pentagram", "on a line", "on a point"],
)
def test_what_cannot_be_cut_is_a_fan_and_told(tmp_path, capsys, outline):
    n = len(outline)
    points = np.pad(np.asarray(outline, float), ((0, 0), (0, 1)))
    asset = Asset(np.vstack([points, [[9, 9, 9]]]), Polygons([*range(n), 0, 1, n], [n, 3]))
    np.testing.assert_array_equal(asset.polygons.triangles[: n - 2], Polygons(range(n), [n]).triangles)
    assert asset.polygons.uncut.tolist() == [0]
    write_asset(tmp_path / "a.obj", asset)
    [note] = read_asset(tmp_path / "a.obj").notes
    assert note.startswith("the outlines of polygons 0 cross themselves or have no area")
    main(["check", str(tmp_path / "a.obj")])
    assert note in " ".join(capsys.readouterr().out.split())


def test_corners_without_a_place_do_no_harm():
    for corners, place in (([0, 1, 2, 9], 0.5), ([0, 1, 2, 3], np.nan)):
        points = np.array([[0, 0, 0], [2, 0, 0], [0, 2, 0], [place, 0.5, 0]])
        assert Polygons(corners, [4], points).triangles.tolist() == [corners[:3], [0, *corners[2:]]]


SUFFIXES = [".obj", ".off", ".ply", ".vtk", ".vtp", ".vtu", ".stl", ".glb", ".gii"]


@pytest.mark.parametrize(
    ("suffix", "first"),
    some_later(
        [(suffix, first) for suffix in SUFFIXES for first in range(6)],
        lambda each: each[1] == 1 and each[0] not in (".vtk", ".vtp"),
    ),
)
def test_prisms_in_every_format(tmp_path, suffix, first):
    given = prism(first)
    write_asset(tmp_path / f"a{suffix}", given)
    mesh = read_mesh(tmp_path / f"a{suffix}")
    assert mesh.area == pytest.approx(22, abs=1e-5)
    assert mesh.volume == pytest.approx(5, abs=1e-5)
    found = read_asset(tmp_path / f"a{suffix}")
    np.testing.assert_array_equal(mesh.faces, found.polygons.triangles)


@pytest.mark.parametrize("engine", ["exact", "fast_marching"])
@pytest.mark.parametrize("first", range(6))
def test_distance_around_the_inner_edge_of_a_prism(engine, first):
    mesh = prism(first).mesh
    ends = [int(np.flatnonzero((mesh.vertices == end).all(axis=1))[0]) for end in ([3, 0, 0], [0, 3, 0])]
    distance = isomatch.geodesic_distances(mesh, ends[0], engine=engine).ravel()[ends[1]]
    assert distance == pytest.approx(2 * np.sqrt(5), abs=1e-6)


def test_values_of_corners_and_polygons_follow_their_triangles(tmp_path):
    asset = prism(2)
    corners = asset.polygons.corners
    uv = Attribute("uv", "corner", "uv", asset.points[corners][:, :2])
    asset = asset.with_attributes(uv, Attribute("part", "face", "label", np.arange(8)))
    triangles, corner = asset.polygons.triangles, asset.polygons.corner_of_triangle
    np.testing.assert_array_equal(corners[corner], triangles)
    np.testing.assert_array_equal(uv.values[corner], asset.points[triangles][..., :2])
    np.testing.assert_array_equal(
        asset.polygons.of_corner[corner], asset.polygons.of_triangle[:, None].repeat(3, 1)
    )
    write_asset(tmp_path / "a.glb", asset)
    found = read_asset(tmp_path / "a.glb")
    np.testing.assert_allclose(found.attribute("uv").values, found.points[:, :2], atol=1e-6)


def test_a_moved_surface_keeps_its_triangles():
    asset = prism(0)
    bent = asset.mesh.vertices * [1, 1, 1] + np.sin(3 * asset.mesh.vertices[:, [1, 2, 0]])
    np.testing.assert_array_equal(asset.moved(bent).mesh.faces, asset.mesh.faces)
