"""Separation of glued sheets: what was merged comes apart again, and nothing else does."""

import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from isomatch.geodesics import geodesic_distances
from isomatch.repair import check, for_matching, prepare_for_matching, repair, separate_sheets
from isomatch.repair.sheets import welds_neighbours
from isomatch.surfaces import Mesh
from isomatch_lab.damage import weld
from isomatch_lab.procedural import creature
from shapes import icosphere
from zoo import any_mesh, grid, zoo
from zoo.made import boxes


@pytest.fixture(scope="module", params=[(0, 3, 0.08), (1, 3, 0.07)], ids=str)
def welded(request):
    style, pose, gap = request.param
    return weld(creature(1500, kind="quadruped", style=style, pose=pose, triangulation=1).mesh, gap)


def horseshoe(n=40, around=12, opening=0.08):
    """A closed tube along an arc; its flat ends face each other across a gap."""
    turn, angle = np.linspace(opening, 2 * np.pi - opening, n), 2 * np.pi * np.arange(around) / around
    thick = 0.3 - 0.2 * np.exp(-np.minimum(turn - turn[0], turn[-1] - turn) / 0.2)[:, None]
    radius = 1 + thick * np.cos(angle)
    tube = np.stack(
        [np.cos(turn)[:, None] * radius, np.sin(turn)[:, None] * radius, thick * np.sin(angle)], axis=2
    )
    tube = tube.reshape(-1, 3)
    i, j = np.divmod(np.arange((n - 1) * around), around)
    a, b = i * around + j, i * around + (j + 1) % around
    faces = [np.column_stack([a, a + around, b]), np.column_stack([b, a + around, b + around])]
    ring, centres = np.arange(around), n * around + np.arange(2)
    faces += [
        np.column_stack([np.full(around, centres[0]), ring, np.roll(ring, -1)]),
        np.column_stack([np.full(around, centres[1]), np.roll(ring, -1), ring]) + 0,
    ]
    faces[3][:, 1:] += (n - 1) * around
    ends = [[np.cos(t), np.sin(t), 0.0] for t in turn[[0, -1]]]
    return repair(Mesh(np.vstack([tube, ends]), np.concatenate(faces))).mesh


@pytest.fixture(scope="module")
def closed_horseshoe():
    """The ends of the horseshoe lie on each other, face on face."""
    whole = horseshoe()
    return whole, weld(whole, 0.2)


@pytest.mark.parametrize("specimen", zoo("sound"), ids=repr)
def test_a_manifold_is_left_alone(specimen):
    found = separate_sheets(specimen.mesh)
    assert found.mesh is specimen.mesh
    assert found.seams == ()


@pytest.mark.parametrize("near", [True, False])
def test_a_vertex_at_the_place_of_a_near_one_needs_no_search_for_sheets(near, monkeypatch):
    sphere = icosphere(3)
    a, b, c = sphere.faces[0]
    beyond = np.setdiff1d(sphere.faces[(np.isin(sphere.faces, [a, b]).sum(axis=1) == 2)], [a, b, c])
    moved = beyond[0] if near else ((sphere.vertices - sphere.vertices[c]) ** 2).sum(axis=1).argmax()
    vertices = sphere.vertices.copy()
    vertices[moved] = vertices[c]
    folded = Mesh(vertices, sphere.faces)
    assert welds_neighbours(folded, 0.1) == near
    quick = prepare_for_matching(folded, 0.1)
    monkeypatch.setattr(for_matching, "MAX_WELDED", -1)
    thorough = prepare_for_matching(folded, 0.1)
    np.testing.assert_array_equal(quick.mesh.faces, thorough.mesh.faces)
    np.testing.assert_array_equal(quick.mesh.vertices, thorough.mesh.vertices)
    assert quick.notes == thorough.notes


def test_a_face_with_a_repeated_vertex_joins_no_sheets():
    sphere = icosphere(3)
    opposite = (sphere.vertices @ sphere.vertices[0]).argmin()
    vertices = sphere.vertices.copy()
    vertices[opposite] = vertices[0]
    bridge = [0, 0, opposite]
    expected, found = (
        prepare_for_matching(Mesh(vertices, faces), 0.1) for faces in (sphere.faces, [*sphere.faces, bridge])
    )
    assert len(expected.mesh.vertices) == len(found.mesh.vertices) == sphere.n_vertices
    np.testing.assert_array_equal(found.mesh.vertices, expected.mesh.vertices)


@pytest.mark.long
@given(any_mesh(), st.floats(0, 1))
@settings(max_examples=100, deadline=None)
def test_laws_on_anything(mesh, least):
    mesh = repair(mesh, remove_duplicates=False, orient=False).mesh
    found = separate_sheets(mesh, least)
    np.testing.assert_array_equal(found.vertex_index[: mesh.n_vertices], np.arange(mesh.n_vertices))
    np.testing.assert_array_equal(found.mesh.vertices, mesh.vertices[found.vertex_index])
    glued = np.sort(found.vertex_index[found.mesh.faces], axis=1)
    assert set(map(tuple, glued)) <= set(map(tuple, np.sort(mesh.faces, axis=1)))
    copied = found.vertex_index[mesh.n_vertices :]
    assert set(copied) == {int(v) for seam in found.seams for v in seam}


@pytest.mark.long
def test_welded_limbs_come_apart(welded):
    assert check(welded.mesh).euler_number < 2
    found = separate_sheets(welded.mesh)
    assert check(found.mesh).ok or set(check(found.mesh).warnings) == {
        w for w in check(found.mesh).warnings if "position of an earlier vertex" in w
    }
    assert check(found.mesh).euler_number == 2
    merged = np.flatnonzero(welded.twin >= 0)
    np.testing.assert_array_equal(np.sort(np.concatenate(found.seams)), merged)
    # every vertex stands for one of the whole again
    whole = welded.whole.faces.ravel()
    assert (
        len(np.unique(np.column_stack([found.mesh.faces.ravel(), whole]), axis=0)) == welded.whole.n_vertices
    )


@pytest.mark.long
def test_the_winding_may_be_inward(welded):
    outward = separate_sheets(welded.mesh)
    inward = separate_sheets(Mesh(welded.mesh.vertices, welded.mesh.faces[:, ::-1]))
    assert len(inward.vertex_index) == len(outward.vertex_index)
    assert check(inward.mesh).euler_number == 2


def test_whole_faces_come_apart_and_distances_are_those_along_the_surface(closed_horseshoe):
    whole, ring = closed_horseshoe
    assert len(check(ring.mesh).duplicate_faces) == 12
    found = separate_sheets(ring.mesh)
    assert check(found.mesh).euler_number == 2
    vertices = np.flatnonzero(ring.twin < 0)[::25]
    expected = geodesic_distances(whole, ring.original[vertices])[:, ring.original[vertices]]
    through = geodesic_distances(ring.mesh, vertices)[:, vertices]
    assert (expected - through).max() > 1
    np.testing.assert_allclose(
        geodesic_distances(found.mesh, vertices, weld=False)[:, vertices], expected, atol=0.2
    )


def test_a_layer_that_was_removed_is_put_back(closed_horseshoe):
    _, ring = closed_horseshoe
    single = repair(ring.mesh, unmerge=np.inf).mesh
    assert single.n_faces == ring.mesh.n_faces - 12
    found = separate_sheets(single)
    assert found.mesh.n_faces == ring.mesh.n_faces
    assert check(found.mesh).euler_number == 2


@pytest.mark.long
@given(st.integers(0, 2**32))
@settings(max_examples=20, deadline=None)
def test_normals_need_not_be_clear(seed):
    """Where the glued sheets are crumpled, single fans tell at which edges the wrong faces were taken for one sheet."""
    ring = weld(horseshoe(), 0.2).mesh
    rng = np.random.default_rng(seed)
    crumpled = Mesh(ring.vertices + 0.01 * rng.standard_normal(ring.vertices.shape), ring.faces)
    assert check(separate_sheets(crumpled).mesh).euler_number == 2


def test_near_sheets_stay_together():
    sheet = grid(12, 12)
    pinched = np.where(sheet.faces == 14, 12 * 12 - 15, sheet.faces)
    far = separate_sheets(Mesh(sheet.vertices, pinched), 0.5)
    assert len(far.seams) == 1
    assert separate_sheets(Mesh(sheet.vertices, pinched), np.inf).seams == ()


@pytest.mark.parametrize(
    "solid",
    [
        boxes([(0, 0, 0), (1, 0, 0)], inner=True),  # a wall between two rooms
        boxes([(0, 0, 0), (1, 1, 0)]),  # a common edge
        boxes([(0, 0, 0), (1, 1, 1)]),  # a common corner
    ],
    ids=["wall", "edge", "corner"],
)
def test_what_would_fall_apart_stays_together(solid):
    assert separate_sheets(solid).seams == ()


def test_a_face_listed_twice_is_no_sheet():
    ball = zoo("sound")[0].mesh
    twice = Mesh(ball.vertices, np.vstack([ball.faces, ball.faces[3:5]]))
    assert separate_sheets(twice).seams == ()


@pytest.mark.parametrize(
    ("what", "n"), [("around an edge", 20_000), ("in one place", 100_000), ("in one place", 20_001)]
)
def test_a_crowd_of_faces_stays_together(what, n):
    """Welds have few sheets: here nothing is paired, and memory does not grow with their square."""
    turn = np.linspace(0, 2 * np.pi, n, endpoint=False)
    points = np.vstack(
        [[[0, 0, 0], [0, 0, 1]], np.column_stack([np.cos(turn), np.sin(turn), np.full(n, 0.5)])]
    )
    faces = np.array([[0, 1], [1, 0]])[np.arange(n) % 2]
    mesh = Mesh(
        points,
        np.column_stack([faces, 2 + (np.arange(n) if what == "around an edge" else np.zeros(n, dtype=int))]),
    )
    tracemalloc.start()
    found = separate_sheets(mesh)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert not found.seams
    assert peak < 2000 * n
