"""Laws of repair on the whole zoo and on arbitrary meshes, then each mend by its outcome and its sentence."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from isomatch.repair import check, repair
from isomatch.surfaces import Mesh
from zoo import any_mesh, grid, specimen, torus, zoo
from zoo.made import together

OPTIONS = st.fixed_dictionaries({name: st.booleans() for name in ("weld", "remove_unused", "orient")})


def assert_laws(mesh, **options):
    mended = repair(mesh, **options)
    new = mended.mesh
    # the maps compose back; where limbs were parted, copies follow the others, and both have moved
    n = len(np.unique(mended.vertex_index))
    parted = np.isin(mended.vertex_index, np.concatenate([[], *mended.contacts]))
    np.testing.assert_array_equal(new.vertices[~parted], mesh.vertices[mended.vertex_index[~parted]])
    np.testing.assert_array_equal(mended.new_index[mended.vertex_index[:n]], np.arange(n))
    assert set(mended.vertex_index[n:]) == {int(v) for seam in mended.contacts for v in seam}
    of_old = np.sort(mended.new_index[mesh.faces[mended.face_index]], axis=1)
    of_new = np.sort(mended.new_index[mended.vertex_index][new.faces], axis=1)
    alone = np.bincount(mended.face_index)[mended.face_index] == 1  # others were cut at a T-junction
    np.testing.assert_array_equal(of_old[alone], of_new[alone])
    kept = (mended.new_index >= 0) & ~np.append(parted, True)[mended.new_index]
    np.testing.assert_array_equal(new.vertices[mended.new_index[kept]], mesh.vertices[kept])
    # order is kept
    assert (np.diff(mended.vertex_index[:n]) > 0).all()
    assert (np.diff(mended.face_index) >= 0).all()
    # nothing is changed without saying so, and nothing twice
    assert (new is mesh) == (not mended.changes)
    again = repair(new, **options)
    if mended.contacts and again.changes:  # parted vertices moved, and may have come to lie on an edge
        assert [change.split()[0] for change in again.changes] == ["inserted"]
        new = again.mesh
        again = repair(new, **options)
    assert again.changes == ()
    assert again.mesh is new
    return mended


@pytest.mark.long
@given(any_mesh(), OPTIONS)
@settings(max_examples=200, deadline=None)
def test_laws_on_anything(mesh, options):
    report = check(assert_laws(mesh, **options).mesh)
    for field in ("non_finite_vertices", "out_of_range_faces", "repeated_index_faces", "duplicate_faces"):
        assert not len(getattr(report, field))


@pytest.mark.parametrize("specimen", zoo(), ids=repr)
def test_what_is_left_after_repair(specimen):
    mended = assert_laws(specimen.mesh)
    report = check(mended.mesh)
    assert not len(report.unused_vertices) or not mended.mesh.n_faces  # points are no rest of a surface
    assert not len(report.coincident_vertices)
    assert not len(report.inward_components)
    assert bool(len(report.inconsistent_edges)) == ("one_sided" in specimen.tags)


def same_repair(one, other):
    for field in ("vertex_index", "new_index", "face_index", "changes"):
        np.testing.assert_array_equal(getattr(one, field), getattr(other, field))
    np.testing.assert_array_equal(one.mesh.vertices, other.mesh.vertices)
    np.testing.assert_array_equal(one.mesh.faces, other.mesh.faces)


@given(any_mesh(), OPTIONS)
@settings(max_examples=100, deadline=None)
def test_the_report_changes_only_the_time(mesh, options):
    same_repair(repair(mesh, **options, report=check(mesh)), repair(mesh, **options))


@pytest.mark.parametrize("specimen", zoo("sound") + zoo("extreme"), ids=repr)
def test_a_sound_mesh_is_left_alone(specimen):
    assert repair(specimen.mesh).mesh is specimen.mesh


@given(st.integers(0, 2**32))
@settings(max_examples=25, deadline=None)
def test_any_winding_of_a_closed_surface_becomes_outward(seed):
    rng = np.random.default_rng(seed)
    faces = torus().faces.copy()
    turned = rng.random(len(faces)) < rng.random()
    faces[turned] = faces[turned, ::-1]
    mended = assert_laws(Mesh(torus().vertices, faces)).mesh
    assert check(mended).ok
    assert mended.volume == pytest.approx(torus().volume)


@pytest.mark.parametrize("scale", [1e-120, 1e100])
def test_winding_in_any_unit(scale):
    inward = Mesh(scale * torus().vertices, torus().faces[:, ::-1])
    np.testing.assert_array_equal(np.sort(repair(inward).mesh.faces), np.sort(torus().faces))
    assert repair(inward).changes == (f"rewound {inward.n_faces} faces",)


def test_each_piece_is_wound_by_itself():
    """Faces of three surfaces in any order, some of them rewound."""
    tori = [torus(24, 12), torus(12, 6), torus(9, 5)]
    whole = together(*(one.moved(one.vertices + 20 * i) for i, one in enumerate(tori)))
    rng = np.random.default_rng(0)
    faces = rng.permutation(whole.faces)
    turned = rng.random(len(faces)) < 0.4
    faces[turned] = faces[turned, ::-1]
    mended = assert_laws(Mesh(whole.vertices, faces)).mesh
    assert not len(check(mended).inconsistent_edges)
    for label, one in enumerate(tori):
        assert mended.submesh(mended.components == label)[0].volume == pytest.approx(one.volume)


@given(st.integers(0, 2**32))
@example(76117)  # limbs are parted at an edge where a face is left wound the other way
@example(2920)  # a parted vertex comes to lie on an edge
@settings(max_examples=8, deadline=None)
def test_coincident_vertices_and_holes_do_not_change_which_side_is_outer(seed):
    """Welding joins sheets there, so that more than two faces meet at an edge, or faces vanish.

    Faces that then reach across the surface stay: without them, it would not be nearly closed.
    """
    rng = np.random.default_rng(seed)
    whole = torus(24, 12)
    vertices, faces = whole.vertices.copy(), whole.faces[:, ::-1]
    one, other = rng.permutation(whole.n_vertices)[:12].reshape(2, 6)
    vertices[other] = vertices[one]
    small = np.flatnonzero(~np.isin(faces, other).any(axis=1))
    faces = np.delete(faces, rng.permutation(small)[:6], axis=0)
    mended = assert_laws(Mesh(vertices, faces)).mesh
    assert mended.volume > 0
    assert not len(check(mended).inconsistent_edges)


def test_a_nearly_closed_surface_that_faces_inward_is_reported():
    faces = torus().faces[1:, ::-1]
    assert check(Mesh(torus().vertices, faces)).inward_components.tolist() == [0]
    assert not len(check(Mesh(grid(4, 4).vertices, grid(4, 4).faces[:, ::-1])).inward_components)


def test_an_open_surface_keeps_the_side_of_most_of_its_faces():
    faces = grid(4, 4).faces.copy()
    faces[[3, 8]] = faces[[3, 8]][:, ::-1]
    mended = repair(Mesh(grid(4, 4).vertices, faces))
    assert mended.changes == ("rewound 2 faces",)
    np.testing.assert_array_equal(np.sort(np.flatnonzero((mended.mesh.faces != faces).any(axis=1))), [3, 8])
    faces = faces[:, ::-1]
    assert repair(Mesh(grid(4, 4).vertices, faces)).changes == ("rewound 2 faces",)


@pytest.mark.parametrize("specimen", zoo("one_sided"), ids=repr)
@pytest.mark.parametrize("mirror", [1, -1])
def test_a_one_sided_surface_cannot_be_wound_and_is_left(specimen, mirror):
    assert repair(Mesh(mirror * specimen.mesh.vertices, specimen.mesh.faces)).changes == ()


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("seam", ["welded 3 vertices onto an earlier vertex at the same position"]),
        ("wild", ["removed 2 faces with a vertex index out of range"]),
        ("nan", ["removed 1 face with a non-finite vertex", "removed 1 vertex with non-finite coordinates"]),
        ("repeated_index", ["removed 1 face with a repeated vertex"]),
        ("duplicate", ["removed 1 face with the vertices of an earlier face"]),
        ("unused_vertex", ["removed 1 vertex that no face used"]),
        ("rewound_face", ["rewound 1 face"]),
        ("inward", ["rewound 4 faces"]),
    ],
)
def test_each_mend_says_what_it_did_and_leaves_a_sound_mesh(name, changes):
    mended = repair(specimen(name).mesh)
    assert list(mended.changes) == changes
    assert check(mended.mesh).ok
    assert changes[0] in repr(mended)


def test_options_leave_things_as_they_are():
    assert repair(specimen("seam").mesh, weld=False).changes == ()
    assert repair(specimen("unused_vertex").mesh, remove_unused=False).changes == ()
    assert repair(specimen("inward").mesh, orient=False).changes == ()


def test_welded_vertices_point_to_the_survivor():
    mended = repair(specimen("seam").mesh)
    assert mended.new_index[12:].tolist() == [2, 6, 10]
    assert mended.mesh.n_vertices == 12


def test_faces_of_zero_area_stay_so_that_the_surface_is_not_torn():
    assert repair(specimen("flat_face").mesh).mesh is specimen("flat_face").mesh
