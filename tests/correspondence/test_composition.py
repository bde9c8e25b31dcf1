"""Maps one after the other, turned round, and refused for other surfaces."""

import numpy as np
import pytest
from scipy.spatial import Delaunay

from isomatch import Correspondence, Graph, MapError, Mesh, PointCloud
from isomatch_lab.sets import relabelled
from shapes import cylinder, icosphere, planar_delaunay


def placed(source, target):
    """The exact map between two triangulations of one square; what lies outside the target is unmatched."""
    triangles = Delaunay(target.vertices[:, :2])
    face = triangles.find_simplex(source.vertices[:, :2])
    corners = triangles.simplices[face]
    a, b, c = (target.vertices[corners[:, k], :2] for k in range(3))
    s, t = (
        np.linalg.solve(np.stack([b - a, c - a], axis=2), (source.vertices[:, :2] - a)[:, :, None])
        .squeeze(2)
        .T
    )
    weights = np.clip(np.column_stack([1 - s - t, s, t]), 0, 1)
    image = np.where(face < 0, -1, corners[np.arange(len(face)), weights.argmax(axis=1)])
    return Correspondence(image, target.n_vertices, corners, weights / weights.sum(axis=1, keepdims=True),
                          source.content_hash, target.content_hash)  # fmt: skip


@pytest.fixture(scope="module")
def squares():
    return [planar_delaunay(n, seed) for seed, n in enumerate((900, 700, 1200))]


def inner(square):
    """Vertices away from the slivers along the boundary."""
    return np.abs(square.vertices[:, :2] - 0.5).max(axis=1) < 0.4


def off_by(f, source, target):
    return np.linalg.norm(f.pull_back(target.vertices) - source.vertices, axis=1)[inner(source)]


def test_composition_keeps_precise_images(squares):
    a, b, c = squares
    first, second = placed(a, b), placed(b, c)
    on_surface, in_faces = first.then(second, b, c), first.then(second)
    vertices = Correspondence(first.vertices, b.n_vertices).then(
        Correspondence(second.vertices, c.n_vertices)
    )
    assert off_by(on_surface, a, c).max() < 1e-9
    assert off_by(in_faces, a, c).mean() < 0.8 * off_by(vertices, a, c).mean()
    assert (on_surface.source_hash, on_surface.target_hash) == (a.content_hash, c.content_hash)


def test_composition_within_one_triangle_needs_no_surface():
    inside = Correspondence([0], 3, [[0, 1, 2]], [[0.5, 0.25, 0.25]])
    corners = np.array([[0.6, 0.2, 0.2], [0.1, 0.8, 0.1], [0.0, 0.0, 1.0]])
    further = Correspondence([4, 5, 4], 7, [[4, 5, 6], [4, 5, 6], [6, 5, 4]], corners)
    found = inside.then(further)
    np.testing.assert_allclose(
        found.to_sparse().toarray(), (inside.to_sparse() @ further.to_sparse()).toarray()
    )


def test_composition_with_a_relabelling_and_with_the_identity(squares):
    a, b, _ = squares
    copy, new = relabelled(b, 3)
    renamed = Correspondence(new, b.n_vertices)
    f = placed(a, b)
    values = np.random.default_rng(0).normal(size=b.n_vertices)
    found, expected = f.then(renamed, b, copy) @ values, f @ (renamed @ values)
    np.testing.assert_allclose(found[inner(a)], expected[inner(a)], atol=1e-9)
    everything = Correspondence(np.arange(a.n_vertices), a.n_vertices)
    for same in (everything.then(f), everything.then(f, a, b)):
        for name in ("vertices", "faces", "barycentric"):
            np.testing.assert_array_equal(getattr(same, name), getattr(f, name))


def test_composition_does_not_interpolate_across_a_tear():
    """The halves of the middle surface have images far apart: each point stays with its nearest corner."""
    grid = planar_delaunay(400, 1)
    f = placed(planar_delaunay(300, 2), grid)
    left = grid.vertices[:, 0] < 0.5
    parted = Mesh(grid.vertices + np.where(left, 0.0, 5.0)[:, None] * [1, 0, 0], grid.faces)
    torn = Mesh(parted.vertices, grid.faces[left[grid.faces].all(axis=1) | ~left[grid.faces].any(axis=1)])
    everything = Correspondence(np.arange(grid.n_vertices), grid.n_vertices)
    found = f.then(everything, grid, torn)
    assert len(set(map(tuple, left[found.faces[found.matched]])) - {(True,) * 3, (False,) * 3}) == 0


def test_unmatched_corners_and_vertices():
    f = Correspondence(
        [0, 1, -1], 3, [[0, 1, 2], [1, 2, 0], [0, 0, 0]], [[0.6, 0.4, 0], [0.7, 0.2, 0.1], [1, 0, 0]]
    )
    g = Correspondence([5, -1, 5], 6)
    assert f.then(g).vertices.tolist() == [5, -1, -1]
    assert g.then(Correspondence([0] * 6, 2)).vertices.tolist() == [0, -1, 0]


def test_precise_reversal_is_the_inverse(squares):
    a, b, _ = squares
    f = placed(a, b)
    back = f.reversed(a, b, within=0.2)
    assert back.matched.all()
    assert (~f.reversed().matched).mean() > 0.15
    assert off_by(back, b, a).max() < 1e-9
    assert off_by(back.then(f, a, b), b, b).max() < 1e-9
    assert (back.source_hash, back.target_hash) == (b.content_hash, a.content_hash)


def test_reversal_of_a_relabelling():
    sphere = icosphere(3)
    copy, new = relabelled(sphere, 0)
    f = Correspondence(new, sphere.n_vertices)
    for back in (f.reversed(), f.reversed(sphere, copy)):
        np.testing.assert_array_equal(back.vertices[new], np.arange(len(new)))
        np.testing.assert_allclose(back.barycentric[:, 0], 1.0, atol=1e-9)


def test_reversal_stays_on_its_sheet():
    """Both sides of a flattened tube lie on each other; a vertex without an image takes one of its own side."""
    tube = cylinder(80, 30)
    flat = tube.moved(tube.vertices * [1.0, 1e-4, 1.0])
    image = np.where(np.arange(tube.n_vertices) % 3 == 0, -1, np.arange(tube.n_vertices))
    back = Correspondence(image, tube.n_vertices).reversed(tube, flat)
    assert back.matched.all()
    places = (back.barycentric[:, :, None] * tube.vertices[back.faces]).sum(axis=1)
    assert np.linalg.norm(places - tube.vertices, axis=1).max() < 2.5 / 80


def test_reversal_leaves_what_the_source_lacks():
    square = planar_delaunay(900, 5)
    part, index = square.submesh(square.vertices[:, 0] < 0.5)
    f = Correspondence(index, square.n_vertices)
    back = f.reversed(part, square)
    assert back.matched[index].all()
    assert not back.matched[square.vertices[:, 0] > 0.65].any()
    assert f.reversed(part, square, within=np.inf).matched.all()
    assert "unmatched" in repr(back)
    nothing = Correspondence(np.full(part.n_vertices, -1), square.n_vertices).reversed(part, square)
    assert not nothing.matched.any()


def test_reversal_between_points_is_on_vertices():
    points = np.random.default_rng(0).normal(size=(200, 3))
    cloud = PointCloud(points / np.linalg.norm(points, axis=1, keepdims=True))
    f = Correspondence(np.arange(200) // 2 * 2, 200)
    back = f.reversed(cloud, cloud, within=1.0)
    assert back.matched.all()
    np.testing.assert_array_equal(back.vertices[::2], np.arange(0, 200, 2))


def test_a_map_knows_its_surfaces(squares):
    a, b, _ = squares
    f = placed(a, b)
    f.check_fits(a, b)
    f.check_fits(Mesh(a.vertices.tolist(), a.faces.astype(np.int32)))
    moved = a.moved(a.vertices + 1e-12)
    with pytest.raises(MapError, match="vertices"):
        f.check_fits(moved, b)
    with pytest.raises(MapError, match="700"):
        f.check_fits(b, a)
    with pytest.raises(MapError, match="another"):
        f.reversed(a, Mesh(b.vertices, b.faces[::-1]))
    with pytest.raises(MapError, match="needed"):
        f.reversed(a)
    with pytest.raises(MapError, match="middle"):
        f.then(placed(b, a), b)
    with pytest.raises(MapError, match="second"):
        f.then(placed(b.moved(b.vertices * 1.0000001), b))
    copy = a.moved(a.vertices[::-1])
    with pytest.raises(MapError, match="exchanged"):
        Correspondence(np.arange(900), 900, None, None, a.content_hash, copy.content_hash).check_fits(copy, a)
    Correspondence(f.vertices, f.n_target).check_fits(moved, b)


def test_hashes_tell_surfaces_apart():
    points = np.random.default_rng(0).random((6, 3))
    surfaces = [Mesh(points, []), Mesh(points, [[0, 1, 2]]), Mesh(points[::-1], []), PointCloud(points),
                Graph(6, [[0, 1]], [1.0]), Graph(6, [[0, 1]], [2.0])]  # fmt: skip
    hashes = [surface.content_hash for surface in surfaces]
    assert len(set(hashes)) == len(hashes)
    assert Mesh(points.copy(), [[0, 1, 2]]).content_hash == hashes[1]


@pytest.mark.parametrize("name", ["map.npz", "map.txt"])
def test_files_keep_the_hashes(tmp_path, squares, name):
    a, b, _ = squares
    f = placed(a, b)
    f.save(tmp_path / name)
    loaded = Correspondence.load(tmp_path / name)
    assert (loaded.source_hash, loaded.target_hash) == (f.source_hash, f.target_hash)
    Correspondence(f.vertices, f.n_target).save(tmp_path / name)
    assert Correspondence.load(tmp_path / name).source_hash == ""
