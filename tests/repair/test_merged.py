"""Limbs merged by distance come apart again where they were merged, with all that lies on them; nothing else does."""

from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from isomatch import Asset, Attribute, Config, Mesh, SettingError, check, prepare, repair
from isomatch.decimation import decimate
from isomatch.repair import count_handles, for_matching, prepare_for_matching
from isomatch.settings import PreparationSettings
from isomatch_lab.damage import merge
from shapes import icosphere, inside_out
from zoo.made import boxes, soup, together

MERGED = [
    (0.03, 11, 1.0),
    (0.05, 1, 1.5),
    (0.02, 2, 0.7),
    (0.13, 13, 2.0),
]  # gap, seed, distance in mean edge lengths


@cache
def hairpin(gap=0.03, seed=0):
    """A closed tube bent to a U, with straight arms that are so near to each other; its triangles are irregular."""
    ball = icosphere(5)
    # by einsum, for products of matrices differ by kernels, and so would the triangles
    along, *across = np.einsum("ij,jk->ki", ball.vertices, Rotation.random(random_state=seed).as_matrix())
    arm, bend = 3.0, 0.5
    place = along * (arm + bend * np.pi / 2)
    across = np.stack(across) * (bend - gap / 2) * np.sqrt(1 + along**2)
    angle = np.clip(place / bend, -np.pi / 2, np.pi / 2)
    straight = np.maximum(np.abs(place) - bend * np.pi / 2, 0)
    radius = bend - across[0]
    points = np.column_stack([radius * np.sin(angle), straight - radius * np.cos(angle), across[1]])
    return decimate(repair(Mesh(points, ball.faces)).mesh, 3000).mesh


@cache
def merged_hairpin(gap, seed, distance):
    return merge(hairpin(gap, seed), distance)


def corners_before(damaged):
    """Vertex of the whole of each corner of each face that a merge left, (m, 3)."""
    whole = damaged.whole
    became = np.full(whole.n_vertices, -1)
    twins = damaged.twin >= 0
    became[damaged.original] = np.arange(damaged.mesh.n_vertices)
    became[damaged.twin[twins]] = np.flatnonzero(twins)
    rows = {tuple(face): row for row, face in enumerate(became[whole.faces].tolist())}
    return whole.faces[[rows[tuple(face)] for face in damaged.mesh.faces.tolist()]]


@pytest.mark.parametrize("case", MERGED, ids=str)
def test_each_limb_gets_its_vertices_back(case):
    damaged = merged_hairpin(*case)
    assert count_handles(damaged.mesh) > 0
    mended = repair(damaged.mesh)
    assert count_handles(mended.mesh) == 0
    before = corners_before(damaged)[mended.face_index]
    pairs = np.unique(np.column_stack([mended.mesh.faces.ravel(), before.ravel()]), axis=0)
    again_alike = np.bincount(pairs[:, 0])[pairs[:, 0]] + np.bincount(pairs[:, 1])[pairs[:, 1]] == 2
    assert again_alike.mean() > 0.99


@pytest.mark.parametrize("case", MERGED, ids=str)
def test_copies_follow_the_others_and_stand_apart(case):
    damaged = merged_hairpin(*case)
    mended = repair(damaged.mesh)
    n, edge = damaged.mesh.n_vertices, damaged.mesh.edge_lengths.mean()
    np.testing.assert_array_equal(mended.vertex_index[:n], np.arange(n))
    np.testing.assert_array_equal(mended.new_index, np.arange(n))
    np.testing.assert_array_equal(
        np.sort(np.concatenate(mended.contacts)), np.unique(mended.vertex_index[n:])
    )
    moved = np.linalg.norm(mended.mesh.vertices - damaged.mesh.vertices[mended.vertex_index], axis=1)
    is_copy = np.bincount(mended.vertex_index)[mended.vertex_index] > 1
    assert (moved[~is_copy] == 0).all()
    np.testing.assert_allclose(moved[is_copy], 0.25 * edge, rtol=0.5)
    # the first of them has more faces
    faces = np.bincount(mended.mesh.faces.ravel())
    assert (faces[mended.vertex_index[n:]] >= faces[n:]).all()


@pytest.mark.long
def test_check_names_them_and_a_second_repair_changes_nothing():
    damaged = merged_hairpin(*MERGED[0])
    mended = repair(damaged.mesh)
    report = check(damaged.mesh)
    assert set(report.merged_vertices) == {int(v) for seam in mended.contacts for v in seam}
    assert any("where limbs that touch were merged" in sentence for sentence in report.warnings)
    assert not len(check(mended.mesh).merged_vertices)
    assert repair(mended.mesh).changes == ()
    (change,) = (change for change in mended.changes if "parted" in change)
    assert f"{len(report.merged_vertices)} vertices" in change
    assert repair(damaged.mesh, unmerge=np.inf).contacts == ()


def test_a_note_on_a_mesh_in_spatial_order_names_a_given_vertex(monkeypatch):
    monkeypatch.setattr(for_matching, "LARGE_MESH", 100)
    mesh = merged_hairpin(*MERGED[0]).mesh
    draft = prepare_for_matching(mesh, 0.1)
    (note,) = (note for note in draft.notes if "parted" in note)
    contact = np.concatenate(repair(mesh).contacts)
    assert int(note.partition("one of them vertex ")[2].partition(";")[0]) in contact
    np.testing.assert_array_equal(np.sort(np.concatenate(draft.contacts)), np.sort(contact))


def test_inward_faces_and_a_soup_of_triangles_are_parted_too():
    damaged = merged_hairpin(*MERGED[1]).mesh
    for mended in (repair(inside_out(damaged)), repair(soup(damaged))):
        assert count_handles(mended.mesh) == 0
        assert mended.mesh.n_vertices == repair(damaged).mesh.n_vertices


def test_what_lies_on_the_surface_is_on_the_limb_it_was_on():
    damaged = merged_hairpin(*MERGED[0])
    whole, mesh = damaged.whole, damaged.mesh
    before = corners_before(damaged)
    labels = (whole.vertices[:, 1] > 1).astype(np.int64)
    asset = Asset.of_mesh(
        mesh,
        [
            Attribute("label", "point", "label", labels[damaged.original]),
            Attribute("corner", "corner", "scalar", before.ravel().astype(float)),
            Attribute("face", "face", "scalar", np.arange(mesh.n_faces, dtype=float)),
            Attribute("normal", "point", "normal", mesh.vertex_normals.astype(np.float32)),
        ],
    )
    mended = repair(asset)
    after = mended.asset
    np.testing.assert_array_equal(after.polygons.triangles, mended.mesh.faces)
    np.testing.assert_array_equal(after.points, mended.mesh.vertices)
    np.testing.assert_array_equal(
        after.attribute("label").values, labels[damaged.original][mended.vertex_index]
    )
    np.testing.assert_array_equal(after.attribute("face").values, mended.face_index)
    copies = np.bincount(mended.vertex_index)[mended.vertex_index] > 1
    normals = after.attribute("normal").values
    np.testing.assert_allclose(normals[copies], mended.mesh.vertex_normals[copies], atol=1e-6)
    np.testing.assert_array_equal(after.attribute("corner").values.reshape(-1, 3), before[mended.face_index])


def test_two_bodies_come_apart_that_were_merged_but_not_those_that_share_a_corner():
    one = decimate(icosphere(5), 2000).mesh
    turned = one.vertices @ Rotation.random(random_state=3).as_matrix()
    damaged = merge(together(one, one.moved(turned + np.array([2.005, 0, 0]))), 2.0)
    assert len(np.unique(damaged.mesh.components)) == 1
    assert len(np.unique(repair(damaged.mesh).mesh.components)) == 2
    for places in ([(0, 0, 0), (1, 1, 0)], [(0, 0, 0), (1, 1, 1)]):
        assert repair(boxes(places)).contacts == ()
    assert repair(boxes([(0, 0, 0), (1, 0, 0)], inner=True)).contacts == ()


def test_triangles_that_meet_in_points_only_are_left_alone():
    strip = Mesh(
        [[x, y, 0] for x in range(9) for y in (0, 1)], [[2 * i, 2 * i + 2, 2 * i + 1] for i in range(8)]
    )
    assert repair(strip).contacts == ()


@pytest.mark.long
def test_a_body_is_matched_with_its_limbs_apart_and_its_holes_closed():
    damaged = merged_hairpin(*MERGED[0])
    shape = prepare(damaged.mesh)
    assert count_handles(shape.body) == 0
    assert shape.longest_boundary < 0.1
    assert any("parted limbs" in note and "sheet_distance" in note for note in shape.notes)
    glued = Config(preparation=PreparationSettings(sheet_distance=np.inf))
    np.testing.assert_array_equal(shape.user_vertex[shape.body_vertex], np.arange(damaged.mesh.n_vertices))
    assert count_handles(prepare(damaged.mesh, glued).body) > 0


def test_each_body_of_a_scene_is_parted_as_alone_whatever_the_order_of_its_faces():
    damaged = merged_hairpin(*MERGED[1]).mesh
    far = icosphere(3)
    order = np.random.default_rng(0).permutation(damaged.n_faces)
    shuffled = Mesh(damaged.vertices, damaged.faces[order])
    scene = together(far.moved(far.vertices * 5 + 100), shuffled)
    alone, among = repair(damaged), repair(scene)
    assert count_handles(among.mesh) == 0
    np.testing.assert_array_equal(
        np.sort(np.concatenate(among.contacts)), np.sort(np.concatenate(alone.contacts)) + far.n_vertices
    )


def test_what_is_no_distance_is_refused():
    damaged = merged_hairpin(*MERGED[1]).mesh
    assert repair(damaged, remove_duplicates=False).contacts
    for wrong in (-1.0, np.nan, "x"):
        with pytest.raises(SettingError, match="unmerge"):
            repair(damaged, unmerge=wrong)
