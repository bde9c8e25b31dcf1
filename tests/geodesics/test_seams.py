"""Points that a file repeats at one position are one point of the surface, in every distance and basis."""

import json

import numpy as np
import pytest

import isomatch
from isomatch import Mesh, PrecisePoints
from isomatch.cli import main
from isomatch.descriptors import ball_signature, mean_curvature
from isomatch.evaluation import coverage
from isomatch.geodesics import (
    distance_engine,
    farthest_point_sampling,
    geodesic_balls,
    geodesic_distances,
    geodesic_path,
    pair_distances,
)
from isomatch.geodesics.given import WeldedEngine
from isomatch.repair import without_seams
from shapes import flat_grid, icosphere, inside_out
from zoo.made import block, boxes, moved, soup, together

NOTE = "onto an earlier vertex at the same position"


def globe(around=24, along=16):
    """A sphere as texture coordinates cut it: the points of one meridian twice, a pole once a column."""
    j, i = np.divmod(np.arange((along + 1) * (around + 1)), around + 1)
    turn, fall = 2 * np.pi * (i % around) / around, np.pi * j / along
    ring = np.sin(fall) * ((j > 0) & (j < along))
    points = np.column_stack([ring * np.cos(turn), ring * np.sin(turn), np.cos(fall)]).astype(np.float32)
    a = np.flatnonzero((i < around) & (j < along))
    b, c, d = a + around + 1, a + around + 2, a + 1
    upper, lower = np.stack([a, b, c], 1)[j[a] < along - 1], np.stack([a, c, d], 1)[j[a] > 0]
    return Mesh(points, np.concatenate([upper, lower]))


SPLIT = {
    "globe": globe(),
    "soup of a cube": soup(boxes(block(3, 3, 3))),
    "sphere with a doubled meridian": Mesh(
        np.concatenate([icosphere(2).vertices] * 2),
        icosphere(2).faces + 162 * (icosphere(2).vertices[icosphere(2).faces].mean(axis=1)[:, :1] > 0),
    ),
}


@pytest.fixture(params=SPLIT)
def split(request):
    return SPLIT[request.param]


def weld(mesh):
    """The same surface with every point once, and the point of each vertex."""
    first, point = np.unique(mesh.vertices, axis=0, return_inverse=True)
    return Mesh(first, point.ravel()[mesh.faces]), point.ravel()


def test_distances_are_those_of_the_closed_surface(split, name):
    whole, point = weld(split)
    sources = [0, 7, split.n_vertices - 1]
    expected = geodesic_distances(whole, point[sources], name)[:, point]
    found = geodesic_distances(split, sources, name)
    np.testing.assert_allclose(found, expected, rtol=1e-3 if name == "fast_marching" else 1e-9, atol=1e-12)
    assert np.array_equal(found == 0, point[sources][:, None] == point)
    assert np.isinf(geodesic_distances(split, sources, name, weld=False)).any() or name != "fast_marching"


@pytest.mark.parametrize("suffix", [".glb", ".ply", ".obj", ".off", ".vtp", ".stl"])
def test_every_format(suffix, tmp_path):
    """Across the seam it is one step, and around the globe it would be 23 of them."""
    isomatch.write_mesh(tmp_path / f"globe{suffix}", globe())
    mesh = isomatch.read_mesh(tmp_path / f"globe{suffix}")
    left, right = (np.array([np.sin(t), np.cos(t) * s, 0.0]) for t, s in ((1.3, -1), (1.3, 1)))
    i, j = (int(np.linalg.norm(mesh.vertices - place, axis=1).argmin()) for place in (left, right))
    expected = np.arccos(
        mesh.vertices[i] @ mesh.vertices[j] / np.linalg.norm(mesh.vertices[[i, j]], axis=1).prod()
    )
    assert geodesic_distances(mesh, [i])[0, j] == pytest.approx(expected, rel=0.05)


def test_a_surface_without_coincident_points_is_taken_as_it_is(name):
    mesh = icosphere(3)
    engine = distance_engine(mesh, name)
    assert not isinstance(engine, WeldedEngine)
    assert type(engine) is type(distance_engine(mesh, name, weld=False))
    assert np.array_equal(
        geodesic_distances(mesh, [3], name), geodesic_distances(mesh, [3], name, weld=False)
    )
    assert without_seams(mesh) == (mesh, None)


def test_what_was_welded_is_noted(split):
    n = split.n_vertices - weld(split)[0].n_vertices
    note = f"welded {n} vertices {NOTE}"
    assert distance_engine(split).notes[0] == note
    assert isomatch.laplace_basis(split, 5).notes[0] == note
    assert isomatch.canonical_form(split, p=20).notes[0] == note
    assert isomatch.distance_basis(split, 5, 20).notes[0] == note


def test_sampling_balls_and_pairs_know_the_copies(split):
    engine, point = distance_engine(split), weld(split)[1]
    columns = engine.distances_from(np.arange(split.n_vertices))
    sampling = farthest_point_sampling(engine, 12, 3)
    assert len(np.unique(point[sampling.vertices])) == 12
    assert np.array_equal(sampling.columns, columns[sampling.vertices])
    _, seams = without_seams(split)
    nearest, expected = np.full(split.n_vertices, np.inf), np.full(seams.mesh.n_vertices, np.inf)
    for source in (3, 40):
        engine.lower(nearest, source)
        distance_engine(seams.mesh).lower(expected, int(seams.new_index[source]))
    assert np.array_equal(nearest, expected[seams.new_index])
    pairs = np.random.default_rng(0).integers(split.n_vertices, size=(40, 2))
    np.testing.assert_allclose(pair_distances(engine, pairs), columns[tuple(pairs.T)], rtol=1e-12)
    balls = geodesic_balls(engine, [5, 30], 0.8)
    for k, centre in enumerate((5, 30)):
        inside = slice(*balls.start[k : k + 2])
        assert np.array_equal(balls.points[inside], np.flatnonzero(columns[centre] <= 0.8))
        np.testing.assert_allclose(balls.distances[inside], columns[centre, balls.points[inside]], rtol=1e-12)


@pytest.mark.parametrize("method", ["predicted", "nystrom", "fmds", "smds", "exact"])
@pytest.mark.parametrize("weights", ["area", "uniform"])
def test_a_distance_basis_is_that_of_the_closed_surface(method, weights):
    split = globe()
    _, seams = without_seams(split)
    found = isomatch.distance_basis(split, 20, 40, method, weights)
    expected = isomatch.distance_basis(seams.mesh, 20, 40, method, weights)
    everywhere = np.arange(split.n_vertices)
    wanted = expected.row(seams.new_index)[:, seams.new_index]
    np.testing.assert_allclose(found.row(everywhere), wanted, atol=1e-12)
    assert found.error_estimate() == pytest.approx(expected.error_estimate(), rel=1e-9)
    gram = found.vectors.T @ (found.weights[:, None] * found.vectors)
    np.testing.assert_allclose(gram, np.eye(20), atol=1e-9)
    assert found.weights.sum() == pytest.approx(expected.weights.sum())
    assert np.array_equal(split.vertices[found.samples], seams.mesh.vertices[expected.samples])


def test_eigenfunctions_are_those_of_the_closed_surface(split):
    whole, _ = weld(split)
    found, expected = isomatch.laplace_basis(split, 12), isomatch.laplace_basis(whole, 12)
    np.testing.assert_allclose(found.values, expected.values, atol=1e-4)
    gram = found.vectors.T @ (found.weights[:, None] * found.vectors)
    np.testing.assert_allclose(gram, np.eye(12), atol=1e-9)


def test_curvature_is_that_of_the_closed_surface(split):
    whole, point = weld(split)
    expected = mean_curvature(whole, isomatch.laplace_basis(whole, 9), 9)[point]
    np.testing.assert_allclose(
        mean_curvature(split, isomatch.laplace_basis(split, 9), 9), expected, rtol=0.02
    )


def test_ball_signatures_and_canonical_forms_are_the_same_on_both_sides(split):
    point = weld(split)[1]
    first = np.unique(point, return_index=True)[1][point]
    signature = ball_signature(split, [0.3])
    assert np.array_equal(signature.values, signature.values[first])
    assert np.isinf(signature.to_boundary).all()
    form = isomatch.canonical_form(split, p=30).points
    assert np.array_equal(form, form[first])


def test_a_file_of_a_basis_keeps_the_note(tmp_path):
    basis = isomatch.distance_basis(globe(), 5, 20)
    basis.save(tmp_path / "basis.npz")
    assert isomatch.DistanceBasis.load(tmp_path / "basis.npz").notes == basis.notes != ()


def test_sheets_that_touch_at_a_point_are_joined_there(name):
    """Two squares with a corner at one position: every way between them goes through it, in the exact engine too."""
    page = flat_grid(5, 5)
    two = together(page, moved(page, scale=-1))
    through = geodesic_distances(two, [12], name)[0]
    corner = geodesic_distances(page, [0, 12], name)
    if name != "heat":  # which is smooth at the corner
        np.testing.assert_allclose(through[25:], corner[1, 0] + corner[0], rtol=0.02)
    assert np.isfinite(through).all()
    assert np.isinf(geodesic_distances(two, [12], name, weld=False)[0, 25:]).all()


def test_sheets_that_coincide_are_one(name):
    page = flat_grid(6, 6)
    found = geodesic_distances(together(page, inside_out(page)), [0, 40], name)
    expected = geodesic_distances(page, [0, 4], name)
    np.testing.assert_allclose(found, np.tile(expected, 2), rtol=1e-9)


def test_points_on_a_seam_have_no_sides(name):
    """The middle of the common edge of two triangles, told by the corners of one or of the other."""
    points = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]
    seam = Mesh(points, [[0, 1, 2], [4, 3, 5]])
    first, second = (
        PrecisePoints(np.array([corners]), np.array([[0.5, 0.5, 0.0]])) for corners in ([1, 2, 0], [3, 4, 5])
    )
    assert geodesic_distances(seam, first, name, targets=second)[0, 0] == 0
    np.testing.assert_allclose(geodesic_distances(seam, first, name), geodesic_distances(seam, second, name))
    assert NOTE in distance_engine(seam, name, points=first).notes[0]


def test_points_in_faces_that_welding_collapses(name):
    """At a pole of the globe a face of its quadrilaterals has two corners at one position: it is an edge."""
    mesh = globe()
    mesh = Mesh(mesh.vertices, [*mesh.faces, [0, 26, 1]])
    point = PrecisePoints(np.array([[0, 26, 1]]), np.array([[0.3, 0.3, 0.4]]))
    same = PrecisePoints(np.array([[0, 26, 26]]), np.array([[0.7, 0.3, 0.0]]))
    found = geodesic_distances(mesh, point, name)
    np.testing.assert_allclose(found, geodesic_distances(mesh, same, name), atol=1e-12)
    assert geodesic_path(mesh, point, 26).length == pytest.approx(
        0.7 * np.linalg.norm(mesh.vertices[0] - mesh.vertices[26])
    )


def test_faces_that_share_an_edge_with_others_keep_engines_at_work(name):
    """Two cubes side by side, each with its own corners: the wall between them has edges of three faces."""
    cube = boxes(block(2, 2, 2))
    two = together(cube, moved(cube, [2, 0, 0]))
    i = int(np.linalg.norm(two.vertices - [0, 1, 2], axis=1).argmin())
    j = int(np.linalg.norm(two.vertices - [4, 1, 2], axis=1).argmin())
    assert geodesic_distances(two, [i], name)[0, j] == pytest.approx(4.0, rel=0.2 if name == "heat" else 1e-6)


def test_defects_are_still_named():
    mesh = globe()
    vertices = np.concatenate([mesh.vertices, [[np.nan, 0, 0]]])
    with pytest.raises(isomatch.MeshError, match="not finite"):
        geodesic_distances(Mesh(vertices, mesh.faces), [0])
    with pytest.raises(isomatch.MeshError, match=r"refer to vertices outside"):
        geodesic_distances(Mesh(mesh.vertices, [*mesh.faces, [0, 1, 9999]]), [0])


def test_commands(tmp_path, capsys):
    isomatch.write_mesh(tmp_path / "globe.glb", globe())
    file, basis = str(tmp_path / "globe.glb"), str(tmp_path / "basis.npz")
    mesh = isomatch.read_mesh(file)
    i, j = 8 * 25 + 1, 8 * 25 + 23
    expected = geodesic_path(mesh, i, j).length
    assert main(["distance", file, "--from", str(i), "--to", str(j), "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["distances"][0][0] == pytest.approx(expected, rel=0.01)
    assert NOTE in record["notes"][0]
    assert main(["distance", file, "--from", str(i), "--to", str(j), "--no-weld", "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["distances"][0][0] > 4 * expected
    assert record["notes"] == []
    assert main(["distance", file, "--from", str(i), "--to", str(j)]) == 0
    assert NOTE in capsys.readouterr().err
    assert main(["basis", file, "-o", basis, "--json"]) == 0
    assert NOTE in json.loads(capsys.readouterr().out)["notes"]
    assert main(["distance", file, "--from", str(i), "--to", str(j), "--basis", basis, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["distances"][0][0] == pytest.approx(expected, abs=0.05)
    assert main(["check", file, "--for", "basis"]) == 0
    assert main(["basis", file, "-o", basis, "--force", "--no-weld"]) == 1
    assert "2 vertices have no area" in capsys.readouterr().err, "those at the poles that no face uses"


def test_a_map_is_inverted_across_a_seam():
    """Of the images of one copy of a point, vertices on the other side of the seam are as near."""
    split = globe()
    _, seams = without_seams(split)
    images = np.arange(split.n_vertices)
    images[seams.vertex_index[seams.new_index] != images] = -1  # only the first of the copies is an image
    one_sided = isomatch.Correspondence(images, split.n_vertices)
    used = np.unique(split.faces)
    back = one_sided.reversed(split, split, within=1e-9)
    assert back.matched[used].all()
    assert np.array_equal(split.vertices[back.vertices[used]], split.vertices[used])
    assert coverage(split, one_sided, 0.0) == pytest.approx(1.0)
