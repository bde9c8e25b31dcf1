"""Large meshes: matched on few vertices, polished on more, and carried to all."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from scipy.spatial import cKDTree

from isomatch import (
    Config,
    Graph,
    LandmarkError,
    Mesh,
    Outcome,
    PointCloud,
    SettingError,
    geodesic_distances,
    match,
    prepare,
)
from isomatch.datasets import ground_truth
from isomatch.matching import Priors
from isomatch.repair import for_matching
from isomatch.shapes import capped_shape, components_of
from isomatch.shapes.body import body_of
from isomatch_lab.damage import cut, weld
from isomatch_lab.procedural import creature
from isomatch_lab.procedural.organs import organ
from shapes import box, disguised, icosphere
from zoo.made import cut_along, moved, together, with_vertices

pytestmark = pytest.mark.usefixtures("prepared_once")
LEVELS = {"matched": 1000, "polished": 1800, "fast_matched": 800, "fast_polished": 1000}
COARSE = Config.from_dict({"levels": LEVELS})
FULL = Config.from_dict({"levels": LEVELS, "resolution": "full"})
FAST = Config.from_dict({"levels": LEVELS, "resolution": "fast"})
TINY = Config.from_dict({"levels": {"matched": 200, "polished": 400}})


@pytest.fixture(scope="module")
def made():
    """Two poses of a creature, large beside these levels."""
    return tuple(creature(2500, triangulation=i, pose=i) for i in (1, 2))


@pytest.fixture(scope="module")
def truth(made):
    return ground_truth(*made).vertices


@pytest.fixture(scope="module")
def shapes(made):
    """Both, prepared at three levels each."""
    return tuple(prepare(animal.mesh, COARSE) for animal in made)


@pytest.fixture(scope="module")
def in_full(made):
    return tuple(prepare(animal.mesh, FULL) for animal in made)


@pytest.fixture(scope="module")
def found(shapes):
    return match(*shapes)


@pytest.fixture(scope="module")
def found_in_full(in_full):
    return match(*in_full)


def mean_error(found, truth, target, count=300):
    """Mean distance on the target between matched images and truths / √area of the target."""
    rows = np.flatnonzero(found.map.matched & (truth >= 0))
    rows = rows[np.linspace(0, len(rows) - 1, count).astype(int)]
    columns = geodesic_distances(target, truth[rows])
    return columns[np.arange(count), found.map.vertices[rows]].mean() / np.sqrt(target.area)


def assert_valid(found, source, target, off=()):
    """All but the vertices ``off`` the body have an image: a point in a face of the target, in its own vertices."""
    image = found.map
    assert len(image.vertices) == source.n_vertices
    assert image.n_target == target.n_vertices
    np.testing.assert_array_equal(np.flatnonzero(~image.matched), off)
    inside = image.faces[image.matched]
    weights = image.barycentric[image.matched]
    assert weights.min() >= 0
    np.testing.assert_allclose(weights.sum(axis=1), 1)
    np.testing.assert_array_equal(inside[:, 0], image.vertices[image.matched])
    assert (weights.argmax(axis=1) == 0).mean() > 0.99, "the vertex is the nearest corner"
    assert found.quality.matched == pytest.approx(image.matched.mean())
    if isinstance(target, Mesh):
        place = np.unique(target.vertices, axis=0, return_inverse=True)[1].ravel()  # welded vertices are one
        faces = {tuple(face) for face in np.sort(place[target.faces], axis=1).tolist()}
        corners = np.sort(place[inside], axis=1)
        proper = corners[:, 0] != corners[:, 2]
        assert {tuple(face) for face in corners[proper].tolist()} <= faces


@pytest.mark.long
def test_three_levels(made, shapes):
    for animal, shape in zip(made, shapes):
        n = animal.mesh.n_vertices
        assert (shape.body.n_vertices, shape.finer.surface.n_vertices) == (1000, 1800)
        assert shape.detail.transfer.fine.n_vertices == n
        for level in (shape, shape.finer):
            body = level.body if level is shape else level.surface
            assert body.area == pytest.approx(1)
            np.testing.assert_allclose(
                np.average(body.vertices, axis=0, weights=body.vertex_areas), 0, atol=1e-9
            )
            assert level.scale**2 == pytest.approx(animal.mesh.area, rel=0.03)
            np.testing.assert_array_equal(np.unique(level.body_vertex), np.arange(body.n_vertices))
            np.testing.assert_array_equal(level.body_vertex[level.user_vertex], np.arange(body.n_vertices))
            positions = animal.mesh.vertices[level.user_vertex] / level.scale
            off = (positions - positions.mean(axis=0)) - (body.vertices - body.vertices.mean(axis=0))
            assert np.linalg.norm(off, axis=1).max() < 1.5 / np.sqrt(body.n_vertices)


def test_a_mesh_somewhat_larger_than_is_matched_is_polished_in_full(made):
    shape = prepare(made[0].mesh, Config.from_dict({"levels": {**LEVELS, "polished": 2400}}))
    assert shape.body.n_vertices == 1000
    assert shape.finer.surface.n_vertices == made[0].mesh.n_vertices
    assert shape.finer.detail is None


def test_fast_takes_levels_of_its_own(made):
    shape = prepare(made[0].mesh, FAST)
    assert (shape.body.n_vertices, shape.finer.surface.n_vertices) == (800, 1000)


def test_polished_functions_are_those_of_the_finer_level(shapes):
    shape = shapes[0].polishable
    assert shape.laplace.vectors.shape == (1800, Config().n_functions)
    np.testing.assert_array_equal(shape.body_vertex[shape.user_vertex], np.arange(1800))
    assert len(np.unique(shape.sample_vertices)) == len(shapes[0].sample_vertices)
    offset = shape.body.vertices[shape.sample_vertices] - shapes[0].body.vertices[shapes[0].sample_vertices]
    assert np.linalg.norm(offset, axis=1).max() < 2 / np.sqrt(1000)
    assert shapes[0].polishable is shape


@pytest.mark.long
def test_samples_stay_on_their_sheet_where_sheets_were_glued():
    """At a weld, two vertices of the body are one of the user's."""
    welded = weld(creature(2500, pose=3).mesh, 0.1)
    shape = prepare(welded.mesh, COARSE)
    assert any("glued together" in note for note in shape.notes)
    everywhere = np.arange(shape.body.n_vertices)
    np.testing.assert_array_equal(shape.refining.coarse.owner[shape.refining.nearest_members], everywhere)
    samples = shape.polishable.sample_vertices
    assert len(np.unique(samples)) == len(samples)
    np.testing.assert_array_equal(shape.refining.coarse.owner[samples], shape.sample_vertices)


@pytest.mark.long
def test_the_map_of_two_poses(made, truth, shapes, found, found_in_full):
    """The levels are a quarter and a half finer than in practice; the full resolution is hardly better."""
    assert_valid(found, made[0].mesh, made[1].mesh)
    target = made[1].mesh
    error, full = mean_error(found, truth, target), mean_error(found_in_full, truth, target)
    assert error < max(1.1 * full, full + 0.002)
    assert found.outcome is found_in_full.outcome is Outcome.CONVERGED
    assert found.quality.coverage > 0.99
    assert found.quality.matched == 1


@pytest.mark.long
def test_what_was_done_is_told(made, found, found_in_full):
    for side, animal in zip(("source", "target"), made):
        beginning = f"{side}: matched on 1000 of {animal.mesh.n_vertices} vertices"
        assert sum(note.startswith(beginning) for note in found.notes) == 1
    assert any("polished on 1800 and 1800 vertices" in note for note in found.notes)
    assert any("resolution = 'full'" in note for note in found.notes)
    assert {"polish", "carry"} <= found.timings.keys()
    assert not found_in_full.notes
    assert not {"polish", "carry"} & found_in_full.timings.keys()


@pytest.mark.long
def test_without_polishing_none_is_told(made, truth, shapes):
    config = Config.from_dict({"levels": LEVELS, "refinement": "none"})
    plain = match(*shapes, config=config)
    assert_valid(plain, made[0].mesh, made[1].mesh)
    assert mean_error(plain, truth, made[1].mesh) < 0.05
    assert "polish" not in plain.timings
    assert "carry" in plain.timings
    assert not any("polished" in note for note in plain.notes)


@pytest.mark.long
@pytest.mark.parametrize("resolution", ["auto", "fast", "full"])
def test_a_shape_finds_its_copy(made, resolution):
    config = Config.from_dict({"levels": LEVELS, "resolution": resolution})
    mesh = made[0].mesh
    copy = disguised(mesh, 3, scale=7.0)
    same = match(mesh, copy.mesh, config=config)
    assert_valid(same, mesh, copy.mesh)
    assert same.outcome is Outcome.CONVERGED
    assert (same.map.vertices == copy.new_vertex).mean() > 0.99
    images = same.map.pull_back(copy.mesh.vertices)
    off = np.linalg.norm(images - copy.mesh.vertices[copy.new_vertex], axis=1)
    assert off.mean() < 0.1 * copy.mesh.edge_lengths.mean()
    assert off.max() < 2 * copy.mesh.edge_lengths.mean()


@pytest.mark.long
def test_new_labels_of_the_target_are_those_of_the_images(made, shapes, found):
    target = made[1].mesh
    copy = disguised(target, 4, scale=0.01)
    other = match(shapes[0], prepare(copy.mesh, COARSE))
    back = np.argsort(copy.new_vertex)[other.map.vertices]
    distance = np.linalg.norm(target.vertices[back] - target.vertices[found.map.vertices], axis=1)
    assert np.median(distance) < 0.5 * target.edge_lengths.mean()
    assert np.quantile(distance, 0.99) < 4 * target.edge_lengths.mean()
    assert other.outcome is found.outcome


@pytest.mark.long
def test_threads_change_nothing(made, found, monkeypatch):
    monkeypatch.setenv("ISOMATCH_NUM_THREADS", "2")
    again = match(*(animal.mesh for animal in made), config=COARSE)
    for name in ("vertices", "faces", "barycentric"):
        assert getattr(again.map, name).tobytes() == getattr(found.map, name).tobytes()
    assert again.quality == found.quality
    for one, other in zip(again.alternatives, found.alternatives):
        assert one.map.vertices.tobytes() == other.map.vertices.tobytes()


@pytest.mark.long
def test_small_shapes_are_matched_in_full(made, found_in_full):
    settings = {"levels": {**LEVELS, "matched": 2100, "polished": 2400}}
    by_default = match(*(animal.mesh for animal in made), config=Config.from_dict(settings))
    for name in ("vertices", "faces", "barycentric"):
        np.testing.assert_array_equal(getattr(by_default.map, name), getattr(found_in_full.map, name))
    assert by_default.notes == found_in_full.notes


@pytest.mark.long
@pytest.mark.parametrize("large", ["source", "target"])
def test_only_one_shape_is_large(made, truth, large, found_in_full):
    small = creature(1500, triangulation=5, pose=1 if large == "target" else 2)
    both = (small, made[1]) if large == "target" else (made[0], small)
    one = match(
        *(animal.mesh for animal in both), config=Config.from_dict({"levels": {**LEVELS, "matched": 1300}})
    )
    assert sum("matched on" in note for note in one.notes) == 1
    assert next(note for note in one.notes if "matched on" in note).startswith(large)
    assert one.outcome is Outcome.CONVERGED
    assert_valid(one, both[0].mesh, both[1].mesh)
    assert mean_error(one, ground_truth(*both).vertices, both[1].mesh) < 0.015


@pytest.mark.long
def test_landmarks_are_obeyed(made, truth, shapes):
    """Among them neighbours, which become one vertex of the coarse body."""
    source, target = (animal.mesh for animal in made)
    spread = shapes[0].user_vertex[shapes[0].column_vertices[:6]]
    chosen = np.unique([*spread, *source.faces[np.flatnonzero((source.faces == spread[0]).any(axis=1))[0]]])
    led = match(*shapes, landmarks=np.column_stack([chosen, truth[chosen]]))
    assert_valid(led, source, target)
    assert led.quality.landmark_error < 0.05
    assert led.outcome is Outcome.CONVERGED
    assert not any("contradict" in note for note in led.notes)
    assert mean_error(led, truth, target) < 0.015


def test_landmarks_that_become_one_vertex_are_too_few(shapes):
    of_largest = [
        np.flatnonzero(shape.body_vertex == np.bincount(shape.body_vertex).argmax())[:3] for shape in shapes
    ]
    with pytest.raises(LandmarkError, match="resolution"):
        match(*shapes, landmarks=np.column_stack(of_largest))


@pytest.mark.long
def test_wrong_landmarks_are_named_as_they_were_given(shapes, truth):
    chosen = np.flatnonzero(~np.isin(np.arange(len(truth)), shapes[0].user_vertex))
    chosen = chosen[np.isin(chosen, shapes[0].finer.user_vertex)][::150]
    wrong = np.column_stack([chosen, np.roll(truth[chosen], 1)])
    against = match(*shapes, landmarks=wrong)
    assert against.outcome is Outcome.PRIORS_CONTRADICTED
    note = next(note for note in against.notes if "contradicts" in note)
    pairs = {f"{i} → {j} " for i, j in wrong}
    assert sum(pair in note for pair in pairs) >= 3
    assert note.count("→") == sum(pair in note for pair in pairs)


@pytest.mark.long
def test_landmarks_of_the_mirror_image_are_obeyed():
    """What is polished and carried is the map that the landmarks ask for."""
    source, target = (creature(2500, symmetric=True, triangulation=i) for i in (1, 2))
    mirrored = ground_truth(source, target, mirrored=True).vertices
    shape = prepare(source.mesh, COARSE)
    chosen = shape.user_vertex[shape.column_vertices[:8]]
    led = match(shape, target.mesh, landmarks=np.column_stack([chosen, mirrored[chosen]]))
    assert mean_error(led, mirrored, target.mesh) < 0.02
    assert led.outcome is Outcome.SYMMETRY_AMBIGUOUS


@pytest.mark.long
@pytest.mark.parametrize("kind", ["initial map", "sparse initial map", "descriptors"])
def test_what_is_known_is_obeyed(made, truth, shapes, kind):
    of_target = np.sin(made[1].rest @ np.random.default_rng(0).normal(size=(3, 12)))
    step = 37 if kind.startswith("sparse") else 1
    known = np.where(np.arange(len(truth)) % step == 0, truth, -1)
    priors = {"initial_map": known}
    if kind == "descriptors":
        priors = {"initial_descriptors": (of_target[truth], of_target)}
    led = match(*shapes, **priors, config=Config.from_dict({"levels": LEVELS, "hypotheses": "given"}))
    assert kind.endswith(led.origin)
    if kind != "descriptors":
        assert led.quality.initial_map_error < 1.5 / np.sqrt(1000), (
            "as it can be known on a thousand vertices"
        )
        assert_valid(led, made[0].mesh, made[1].mesh)
    assert mean_error(led, truth, made[1].mesh) < 0.015


def test_an_initial_map_may_name_any_vertices(truth, shapes):
    """Also where none of them is the one nearest to its vertex of the coarse body."""
    known = np.full(len(truth), -1)
    chosen = np.setdiff1d(np.arange(len(truth)), shapes[0].user_vertex)[::60]
    known[chosen] = truth[chosen]
    priors = Priors.of(*shapes, None, known)
    pairs = np.column_stack([shapes[0].body_vertex[chosen], shapes[1].body_vertex[truth[chosen]]])
    np.testing.assert_array_equal(np.unique(priors.initial_pairs, axis=0), np.unique(pairs, axis=0))


def test_of_an_initial_map_the_nearest_vertices_count(truth, shapes):
    priors = Priors.of(*shapes, None, truth)
    source, image = priors.initial_pairs.T
    np.testing.assert_array_equal(np.sort(source), np.arange(1000))
    np.testing.assert_array_equal(image, shapes[1].body_vertex[truth[shapes[0].user_vertex[source]]])


def test_priors_outside_the_shapes_are_refused(made, shapes):
    """Any vertex number of the user's mesh is valid, although the body has fewer vertices."""
    n = made[0].mesh.n_vertices
    with pytest.raises(LandmarkError, match=f"outside 0…{n - 1}"):
        match(*shapes, landmarks=[[0, 1], [1, 2], [n, 3]])


def test_alternatives_are_maps_of_the_users_vertices(made, found):
    assert found.alternatives
    for alternative in found.alternatives:
        image = alternative.map
        assert len(image.vertices) == made[0].mesh.n_vertices
        assert image.n_target == made[1].mesh.n_vertices
        assert image.matched.all()
        assert image.barycentric.min() >= 0
        assert alternative.map is image, "it is computed once"


def test_pickled_without_the_shapes(found):
    packed = pickle.dumps(found)
    again = pickle.loads(packed)
    assert len(packed) < 3e6
    for one, other in zip((again, *again.alternatives), (found, *found.alternatives)):
        np.testing.assert_array_equal(one.map.vertices, other.map.vertices)
        np.testing.assert_array_equal(one.map.barycentric, other.map.barycentric)
    assert [a.energy for a in again.alternatives] == [a.energy for a in found.alternatives]
    assert again.to_dict() == found.to_dict()


@pytest.mark.long
def test_what_is_off_the_body_has_no_image(made, truth):
    """Debris, vertices in no face, and a component without a partner."""
    source, target = (animal.mesh for animal in made)
    ball, crumb = icosphere(3), icosphere(0)
    pieces = together(moved(ball, 5, 0.1), with_vertices(moved(crumb, -5, 0.001), [[9, 9, 9]]))
    rich = together(pieces, source)
    extra = rich.n_vertices - source.n_vertices
    partial = match(rich, target, config=COARSE)
    assert_valid(partial, rich, target, off=np.arange(extra))
    assert mean_error(partial, np.append(np.full(extra, -1), truth), target) < 0.015
    assert any("642 vertices" in note and "no partner" in note for note in partial.notes)


@pytest.mark.long
def test_components_are_decimated_each(made, truth):
    """A ball in reach of the body, larger than what is matched."""
    ball = icosphere(4)
    pairs = []
    for animal in made:
        near = np.argsort(animal.rest[:, 2])[-30:]  # above the head
        place = animal.mesh.vertices[near].mean(axis=0) + np.array([0, 0, 0.15])
        pairs.append(together(animal.mesh, moved(ball, place, 0.08)))
    n, m = (animal.mesh.n_vertices for animal in made)
    found = match(*pairs, config=COARSE)
    assert_valid(found, *pairs)
    assert (found.map.vertices[:n] < m).all()
    assert (found.map.vertices[n:] >= m).all()
    body = components_of(prepare(pairs[0], COARSE))
    assert [shape.body.n_vertices for shape in body] == [1000, 1000]
    assert any("2562 vertices" in note for note in found.notes)


def of_upper_half(mesh):
    height = mesh.vertices[mesh.faces].mean(axis=1)[:, 1]
    return height > np.median(height)


@pytest.mark.long
def test_seams_of_duplicate_vertices(made, truth, found):
    """A map of the welded bodies, in the vertices of the files."""
    source, target = (cut_along(animal.mesh, of_upper_half(animal.mesh)) for animal in made)
    seamed = match(source, target, config=COARSE)
    assert_valid(seamed, source, target)
    n = made[0].mesh.n_vertices
    seam = cKDTree(source.vertices[:n]).query(source.vertices[n:])[1]
    np.testing.assert_array_equal(seamed.map.vertices[n:], seamed.map.vertices[seam])
    offset = seamed.map.pull_back(target.vertices)[:n] - found.map.pull_back(made[1].mesh.vertices)
    assert np.median(np.linalg.norm(offset, axis=1)) < 0.5 * made[1].mesh.edge_lengths.mean()


@pytest.mark.parametrize("kind", ["mesh", "points", "graph", "mesh with distances"])
def test_what_is_decimated(kind):
    """Meshes alone, and not where distances are given, which no coarse mesh has."""
    mesh = icosphere(3)
    distances = np.linalg.norm(mesh.vertices[:, None] - mesh.vertices, axis=2)
    i, j = mesh.edges.T
    surface = {
        "points": PointCloud(mesh.vertices),
        "graph": Graph(mesh.n_vertices, mesh.edges, distances[i, j]),
    }.get(kind, mesh)
    shape = prepare(surface, TINY, distances=distances if kind == "mesh with distances" else None)
    if kind == "mesh":
        assert shape.body.n_vertices == 200
        return
    assert shape.body.n_vertices == mesh.n_vertices
    assert shape.detail is shape.finer is None
    assert shape.polishable is shape


@pytest.mark.parametrize("opened", [False, True])
def test_with_holes_closed_the_body_is_as_coarse(opened):
    """The first vertices of the closed body are the vertices of the body, and a map names them."""
    sphere = icosphere(4)
    mesh = sphere.submesh(sphere.vertices[:, 2] < 0.9)[0] if opened else sphere
    shape = prepare(mesh, Config.from_dict({"levels": {"matched": 800, "polished": 1200, "spared": 1}}))
    closed, n = capped_shape(shape), shape.body.n_vertices
    assert n == 800
    assert (closed.body.n_vertices > n) == opened
    assert closed.surface is shape.surface
    assert closed.finer is None
    ratio = closed.scale / shape.scale
    assert np.ptp(closed.body.vertices[:n] * ratio - shape.body.vertices, axis=0).max() < 1e-9
    everything = np.arange(closed.body.n_vertices)
    carried, direct = closed.correspondence(closed, everything), shape.correspondence(shape, np.arange(n))
    np.testing.assert_array_equal(carried.vertices, direct.vertices)
    on_last = closed.correspondence(closed, np.full(len(everything), everything[-1]))
    assert on_last.matched.all() != opened, "a cap is no image"
    np.testing.assert_array_equal(np.flatnonzero(closed.origin < 0), np.arange(n, closed.body.n_vertices))
    on_rim = np.unique(shape.mesh_body.boundary_edges)
    assert closed.balls.to_boundary[on_rim].max(initial=0.0) < 0.1, "what looks at a cap does not count"


@pytest.mark.long
@pytest.mark.parametrize("kind", ["points", "graph"])
def test_a_large_mesh_and_its_own_points(made, shapes, kind):
    mesh, shape = made[1].mesh, shapes[1]
    copy = disguised(mesh, 4)
    other = PointCloud(copy.mesh.vertices)
    if kind == "graph":
        i, j = copy.mesh.edges.T
        lengths = np.linalg.norm(copy.mesh.vertices[i] - copy.mesh.vertices[j], axis=1)
        other = Graph(mesh.n_vertices, copy.mesh.edges, lengths)
    forward, backward = match(shape, other), match(other, shape)
    assert_valid(forward, mesh, other)
    assert_valid(backward, other, mesh)
    if kind == "points":  # a graph has no sides, and a creature is nearly its own mirror image
        off = copy.mesh.vertices[forward.map.vertices] - copy.mesh.vertices[copy.new_vertex]
        assert np.linalg.norm(off, axis=1).mean() < mesh.edge_lengths.mean()
        off = backward.map.pull_back(mesh.vertices)[copy.new_vertex] - mesh.vertices
        assert np.linalg.norm(off, axis=1).mean() < mesh.edge_lengths.mean()


def test_settings_of_both_shapes_must_agree(shapes, made):
    with pytest.raises(SettingError, match="resolution"):
        match(*shapes, config=FULL)
    with pytest.raises(SettingError, match="prepared with levels = "):
        match(*shapes, config=Config())


def bar(folded):
    """A tapered bar, 80 long and 6 thick, straight or folded in the middle until its halves nearly touch.

    Returns it and the place of each vertex along it. The gap is a tenth of an edge.
    """
    block, thickness, length, gap = box(6, 9, 80), 6, 80, 0.1
    x, y, z = block.vertices.T
    taper = 1 - 0.35 * z / length
    x, y = taper * (x - thickness / 2), taper * (y - 4.5)
    y *= 1 + 0.12 * x
    if not folded:
        return Mesh(np.column_stack([x, y, z]), block.faces), z
    radius = (thickness + gap) / 2
    turn = np.clip((z - length / 2) / radius, -np.pi / 2, np.pi / 2)
    beyond = np.abs(z - length / 2 - turn * radius)
    points = np.column_stack([np.cos(turn) * (radius + x) - beyond, y, np.sin(turn) * (radius + x)])
    return Mesh(points, block.faces), z


@pytest.mark.long
@pytest.mark.parametrize("folded", ["source", "target"])
def test_neighbouring_sheets_do_not_exchange_images(folded):
    """Neither when maps are carried from a coarse mesh that is folded, nor to it."""
    source, along = bar(folded == "source")
    target, _ = bar(folded == "target")
    copy = disguised(target, 3)
    of_copy = np.empty_like(along)
    of_copy[copy.new_vertex] = along
    over = match(source, copy.mesh, config=COARSE)
    assert_valid(over, source, copy.mesh)
    assert np.abs(over.map.pull_back(of_copy) - along).max() < 6


@pytest.mark.long
@pytest.mark.parametrize("sides", ["mirror image", "turn"])
def test_symmetric_shapes_are_still_ambiguous(sides):
    """What two decimations differ by is no knowledge of sides."""
    if sides == "turn":
        both = [organ("kidney", 2500, symmetry="turn", pose=i) for i in (1, 2)]
        config = COARSE
    else:
        both = [creature(2500, symmetric=True, triangulation=i, pose=i) for i in (1, 4)]
        config = Config.from_dict({"levels": LEVELS, "orientation": "any"})
    either = match(*(animal.mesh for animal in both), config=config)
    assert either.outcome is Outcome.SYMMETRY_AMBIGUOUS
    assert_valid(either, *(animal.mesh for animal in both))


@pytest.mark.long
@pytest.mark.parametrize("part", ["source", "target"])
def test_a_part(made, truth, shapes, part):
    """Matched with its holes closed too; what lands on no vertex of the other shape is unmatched."""
    if part == "source":
        damaged = cut(made[0].mesh, 0.3, seed=4)
        pair, expected = (damaged.mesh, shapes[1]), truth[damaged.original]
        found, target = match(*pair), made[1].mesh
        assert_valid(found, damaged.mesh, target)
    else:
        damaged = cut(made[1].mesh, 0.1, seed=2)
        found, target = match(shapes[0], damaged.mesh), damaged.mesh
        expected = damaged.damaged_vertex[truth]
        assert_valid(found, made[0].mesh, target, off=np.flatnonzero(~found.map.matched))
        kept = expected >= 0
        assert found.map.matched[kept].mean() > 0.9
        assert found.map.matched[~kept].mean() < 0.9
    assert found.outcome in (Outcome.PARTIAL, Outcome.LOW_CONFIDENCE)
    assert mean_error(found, expected, target) < 0.05
    assert sum("matched on 1000 of" in note for note in found.notes) == 2
    assert not any("polished" in note for note in found.notes)
    assert "polish" not in found.timings


@pytest.mark.parametrize("defect", ["none", "seam", "unused", "reversed"])
def test_a_large_body_lies_in_spatial_order_and_knows_the_users_vertices(defect, made, monkeypatch):
    mesh = made[0].mesh
    random = np.random.default_rng(0)
    place = random.permutation(mesh.n_vertices)
    vertices, faces = np.empty_like(mesh.vertices), random.permutation(place[mesh.faces])
    vertices[place] = mesh.vertices
    if defect == "seam":
        vertices, faces = np.concatenate([vertices, vertices[faces[0]]]), faces.copy()
        faces[0] = len(vertices) - 3 + np.arange(3)
    elif defect == "unused":
        vertices = np.concatenate([[[9.0, 9, 9]], vertices])
        faces = faces + 1
    elif defect == "reversed":
        faces = faces.copy()
        faces[:100] = faces[:100, ::-1]
    shuffled = Mesh(vertices, faces)
    plain = body_of(shuffled, COARSE.preparation)
    monkeypatch.setattr(for_matching, "LARGE_MESH", 1000)
    monkeypatch.setattr("isomatch.shapes.body.LARGE_MESH", 1000)
    ordered = body_of(shuffled, COARSE.preparation)
    assert ordered.notes == plain.notes
    assert ordered.scale == pytest.approx(plain.scale, rel=1e-12)
    used = plain.body_vertex >= 0
    assert np.array_equal(ordered.body_vertex >= 0, used)
    for found in (plain, ordered):
        offset = found.scale * found.surface.vertices - vertices[found.user_vertex]
        assert np.ptp(offset, axis=0) == pytest.approx(0, abs=1e-12)
        assert np.array_equal(vertices[found.user_vertex][found.body_vertex[used]], vertices[used])
        assert found.surface.volume > 0
    steps = [
        np.linalg.norm(np.diff(shape.surface.vertices, axis=0), axis=1).mean() for shape in (plain, ordered)
    ]
    assert steps[1] < 0.2 * steps[0]
