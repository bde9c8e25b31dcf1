"""The mesh: derived quantities against closed forms, and what its constructor refuses."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from isomatch._core.errors import MeshError
from isomatch.surfaces import Mesh, count_fans, in_spatial_order, unsound_faces, vertex_normals
from isomatch.surfaces._coincident import first_equal
from zoo import grid, specimen, torus, zoo

TETRAHEDRON = specimen("tetrahedron").mesh


def test_torus_converges_to_its_area_and_volume():
    area, volume = 4 * np.pi**2 * 3, 2 * np.pi**2 * 3
    coarse, fine = torus(40, 20), torus(80, 40)
    for measured, true in (("area", area), ("volume", volume)):
        error = [abs(getattr(mesh, measured) - true) / true for mesh in (coarse, fine)]
        assert error[1] < 0.01
        assert error[1] < 0.3 * error[0]  # second order


def test_vertex_areas_add_up_and_unused_vertices_have_none():
    mesh = specimen("unused_vertex").mesh
    assert mesh.vertex_areas[-1] == 0
    assert mesh.vertex_areas.sum() == pytest.approx(mesh.area)


def test_normals_of_a_torus_point_away_from_its_core():
    mesh = torus(60, 40)
    ring = mesh.vertices * [1, 1, 0]
    core = 3 * ring / np.linalg.norm(ring, axis=1, keepdims=True)
    assert (np.einsum("ij,ij->i", mesh.vertex_normals, mesh.vertices - core) > 0.99).all()


def test_normals_where_no_face_is_are_zero():
    assert specimen("unused_vertex").mesh.vertex_normals[-1].tolist() == [0, 0, 0]


def test_edges_are_sorted_and_each_there_once():
    assert TETRAHEDRON.edges.tolist() == [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3]]
    mesh = torus()
    assert mesh.n_vertices - len(mesh.edges) + mesh.n_faces == 0


def test_components():
    assert specimen("two_tetrahedra").mesh.components.tolist() == [0] * 4 + [1] * 4
    assert len(np.unique(specimen("unused_vertex").mesh.components)) == 2


@given(arrays(np.int64, st.tuples(st.integers(0, 30), st.just(3)), elements=st.integers(0, 7)))
@settings(max_examples=100, deadline=None)
def test_edges_and_components_are_those_found_one_by_one(faces):
    mesh = Mesh(np.zeros((8, 3)), faces)
    sides: dict[tuple[int, int], list[int]] = {}
    label = list(range(8))
    for side, (start, end) in enumerate(zip(faces.ravel().tolist(), faces[:, [1, 2, 0]].ravel().tolist())):
        sides.setdefault((min(start, end), max(start, end)), []).append(side)
        label = [label[start] if same == label[end] else same for same in label]
    table = mesh.edge_table
    assert table.ends.tolist() == [list(edge) for edge in sorted(sides)]
    assert table.n_faces.tolist() == [len(sides[edge]) for edge in sorted(sides)]
    assert table.sides.tolist() == [side for edge in sorted(sides) for side in sides[edge]]
    opposite = np.full(faces.size, -1)
    for pair in sides.values():
        opposite[pair] = pair[::-1] if len(pair) == 2 else -1
    assert table.opposite.tolist() == opposite.tolist()
    start = faces.ravel()
    clash = [len(pair) == 2 and start[pair[0]] == start[pair[1]] for _, pair in sorted(sides.items())]
    assert table.clash.tolist() == clash
    first_seen = list(dict.fromkeys(label))
    assert mesh.components.tolist() == [first_seen.index(same) for same in label]


@given(arrays(np.int64, st.tuples(st.integers(0, 12), st.just(3)), elements=st.integers(0, 6)))
@settings(max_examples=100, deadline=None)
def test_fans_are_those_found_corner_by_corner(faces):
    table = Mesh(np.zeros((7, 3)), faces).edge_table
    label = list(range(faces.size))

    def join(i: int, j: int) -> None:
        label[:] = [label[i] if same == label[j] else same for same in label]

    def after(corner: int) -> int:
        return corner - corner % 3 + (corner + 1) % 3

    start, first = faces.ravel(), 0
    for count in table.n_faces.tolist():
        corners = table.sides[first : first + count].tolist()
        for corner, other in pairwise(corners):
            ends = other, after(other)
            if start[corner] != start[other]:
                ends = ends[::-1]
            join(corner, ends[0])
            join(after(corner), ends[1])
        first += count
    expected = [len({same for same, v in zip(label, start) if v == w}) for w in range(7)]
    assert count_fans(faces, table, 7).tolist() == expected


def test_vertices_with_many_faces_are_sorted_too():
    n = 100
    hub = np.column_stack([np.zeros(n, int), np.arange(1, n + 1), 1 + np.arange(1, n + 1) % n])
    faces = np.random.default_rng(0).permutation(np.concatenate([hub, hub[::7, ::-1]]))
    mesh = Mesh(np.ones((n + 1, 3)), faces)
    expected, counts = np.unique(
        np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)), axis=0, return_counts=True
    )
    assert np.array_equal(mesh.edges, expected)
    assert np.array_equal(mesh.edge_table.n_faces, counts)
    _, first = np.unique(np.sort(faces), axis=0, return_index=True)
    assert np.array_equal(np.flatnonzero(~unsound_faces(mesh.vertices, faces).duplicate), np.sort(first))


def test_in_spatial_order_the_mesh_is_the_same_and_what_is_near_is_near_in_memory():
    mesh = torus(60, 30)
    random = np.random.default_rng(0)
    place = random.permutation(mesh.n_vertices)
    vertices, faces = np.empty_like(mesh.vertices), random.permutation(place[mesh.faces])
    vertices[place] = mesh.vertices / np.abs(mesh.vertices).max()
    ordered, renumbered, order = in_spatial_order(vertices, faces)
    assert np.array_equal(ordered, vertices[order])
    assert sorted(map(tuple, order[renumbered])) == sorted(map(tuple, faces))
    assert (np.diff(renumbered.min(axis=1)) >= 0).all()
    distances = np.linalg.norm(np.diff(ordered, axis=0), axis=1)
    assert np.median(distances) < 0.1 * np.median(np.linalg.norm(np.diff(vertices, axis=0), axis=1))


NUMBER = st.sampled_from([0.0, -0.0, 1.0, np.nan, np.inf, 5e-324])


@pytest.mark.parametrize("same_hash", [False, True])
@given(arrays(np.float64, st.tuples(st.integers(0, 30), st.just(2)), elements=NUMBER))
@settings(max_examples=100, deadline=None)
def test_the_first_equal_row_is_the_one_found_by_comparing_all(same_hash, points):
    expected = [next((j for j in range(i) if (points[j] == row).all()), i) for i, row in enumerate(points)]
    with pytest.MonkeyPatch.context() as patched:
        if same_hash:
            zeros = np.zeros(len(points), dtype=np.uint64)
            patched.setattr("isomatch.surfaces._coincident._hashes", lambda _: zeros)
        assert first_equal(points).tolist() == expected


@pytest.mark.parametrize("specimen", zoo("sound"), ids=repr)
def test_a_moved_mesh_shares_what_depends_on_the_faces_alone(specimen):
    mesh = specimen.mesh
    moved = mesh.moved(2 * mesh.vertices)
    again = Mesh(2 * mesh.vertices, mesh.faces)
    assert moved.edges is mesh.edges
    assert moved.components is mesh.components
    for name in ("vertices", "faces", "edges", "components", "face_areas", "vertex_areas", "edge_lengths"):
        np.testing.assert_array_equal(getattr(moved, name), getattr(again, name))
    with pytest.raises(MeshError, match="1 positions"):
        mesh.moved(np.zeros((1, 3)))


def test_volume_does_not_depend_on_the_place():
    away = Mesh(TETRAHEDRON.vertices + 1e3, TETRAHEDRON.faces)
    assert away.volume == pytest.approx(TETRAHEDRON.volume)
    assert TETRAHEDRON.volume == pytest.approx(1 / 6)


def test_submesh_keeps_order_and_says_where_it_came_from():
    sheet = grid(3, 3)
    part, index = sheet.submesh(np.arange(9) != 0)
    assert index.tolist() == list(range(1, 9))
    assert part.n_faces == sheet.n_faces - 1
    np.testing.assert_array_equal(part.vertices[part.faces], sheet.vertices[sheet.faces[1:]])
    assert sheet.submesh(np.full(9, True))[0] is sheet


def test_arrays_cannot_be_changed():
    for array in (TETRAHEDRON.vertices, TETRAHEDRON.faces):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


@pytest.mark.parametrize(
    ("vertices", "faces", "message"),
    [
        (np.zeros((4, 2)), [[0, 1, 2]], r"vertices have shape \(4, 2\), expected \(n, 3\)"),
        (np.zeros((4, 3)), [[0, 1, 2, 3]], r"faces have shape \(1, 4\), expected \(m, 3\): split polygons"),
        (np.zeros((4, 3)), [[0, 1, 2.0]], "faces have type float64, expected integers"),
    ],
)
def test_arrays_of_the_wrong_kind(vertices, faces, message):
    with pytest.raises(MeshError, match=message):
        Mesh(vertices, faces)


def test_what_needs_sound_faces_names_the_bad_ones():
    with pytest.raises(MeshError, match=r"faces 12, 13.*repair"):
        _ = specimen("wild").mesh.area


def test_normals_of_faces_out_of_range_are_refused():
    with pytest.raises(MeshError, match="outside"):
        vertex_normals(np.eye(3), np.array([[0, 1, 3]]))


def test_vertices_without_faces_have_no_normal():
    assert not vertex_normals(np.eye(3), np.zeros((0, 3), dtype=np.int64)).any()
