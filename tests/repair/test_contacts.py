"""Self-contacts: handles are counted; fused limbs come apart along their cut paths, and handles that are meant stay."""

import numpy as np
import pytest

from isomatch import Mesh, check
from isomatch.repair import count_handles, cut_self_contacts
from shapes import box, cylinder, disguised, icosphere, two_spheres
from touching import basket, body, cup, double_ring, pelvis, ring, without
from zoo import torus
from zoo.made import block, boxes, moved, together, with_vertices

SMOOTH = {"ring": ring, "bumps": lambda: ring(7), "double ring": double_ring, "pelvis": pelvis, "cup": cup}
FRAME = boxes([cell for cell in block(9, 5, 2) if cell[:2] not in ((2, 2), (6, 2))])  # two square holes
HANDS = {  # where they are fused with their thighs
    "right": np.array([0.18, 0.03, 0.05]),
    "left": np.array([-0.18, 0.03, 0.05]),
}


@pytest.fixture(scope="module")
def fused():
    """A body whose right hand is fused with its thigh."""
    return body("on thigh").mesh


@pytest.fixture(scope="module")
def twice_fused():
    return body("on thigh", "on thigh").mesh


@pytest.fixture(scope="module")
def hand_cut(fused):
    """The fused hand cut off."""
    return cut_self_contacts(fused, 1)


@pytest.fixture(scope="module")
def first_cut(twice_fused):
    """One of two fused hands cut off."""
    return cut_self_contacts(twice_fused, 1)


@pytest.fixture(scope="module", params=SMOOTH)
def smooth(request):
    """A shape whose handles are meant."""
    return SMOOTH[request.param]()


def assert_laws(mesh, cut):
    """What was cut is the same surface, but along the cut paths."""
    n = mesh.n_vertices
    np.testing.assert_array_equal(cut.vertex_index[:n], np.arange(n))
    np.testing.assert_array_equal(cut.mesh.vertices, mesh.vertices[cut.vertex_index])
    np.testing.assert_array_equal(cut.vertex_index[cut.mesh.faces], mesh.faces)
    assert set(cut.vertex_index[n:]) == {int(v) for cut_path in cut.cut_paths for v in cut_path}
    edges = set(map(tuple, mesh.edges))
    for cut_path in cut.cut_paths:
        assert len(np.unique(cut_path)) == len(cut_path)
        assert {
            tuple(side) for side in np.sort(np.column_stack([cut_path, np.roll(cut_path, -1)]), axis=1)
        } <= edges
    assert cut.mesh.components.max() == mesh.components.max()


def place(mesh, cut_path):
    return mesh.vertices[cut_path].mean(axis=0)


@pytest.mark.parametrize(
    ("mesh", "genus"),
    [
        (icosphere(2), 0),
        (box(2, 3, 4), 0),
        (torus(24, 12), 1),
        (FRAME, 2),
        (cylinder(16, 20), 0),
        (without(torus(24, 12), [3, 0, 1], 1.0), 1),
        (without(without(icosphere(3), [0, 0, 1], 0.4), [0, 0, -1], 0.4), 0),
        (two_spheres(1, 0.5), 0),
        (Mesh(icosphere(1).vertices[::-1], 41 - icosphere(1).faces), 0),  # inward
        (together(torus(24, 12), moved(FRAME, [20, 0, 0])), 3),
        (with_vertices(icosphere(1), [[9, 9, 9]]), 0),
    ],
)
def test_handles_are_the_genus(mesh, genus):
    assert count_handles(mesh) == genus


@pytest.mark.parametrize(("mesh", "genus"), [(icosphere(2), 0), (torus(24, 12), 1)])
def test_a_fin_makes_no_handle(mesh, genus):
    a, b = mesh.faces[0, :2]
    tip = 2 * mesh.vertices[a]
    fin = Mesh(np.vstack([mesh.vertices, tip]), np.vstack([mesh.faces, [a, b, mesh.n_vertices]]))
    assert len(check(fin).non_manifold_edges) == 1
    assert count_handles(fin) == genus


@pytest.mark.long
@pytest.mark.parametrize("seed", range(3))
def test_neither_names_nor_places_make_handles(fused, seed):
    assert count_handles(disguised(fused, seed).mesh) == 1
    assert count_handles(disguised(torus(12, 8), seed).mesh) == 1


@pytest.mark.long
def test_a_fused_hand_comes_off_its_thigh(fused, hand_cut):
    assert count_handles(fused) == 1
    assert_laws(fused, hand_cut)
    assert len(hand_cut.cut_paths) == 1
    assert np.linalg.norm(place(fused, hand_cut.cut_paths[0]) - HANDS["right"]) < 0.06
    assert np.linalg.norm(fused.vertices[hand_cut.cut_paths[0]] - HANDS["right"], axis=1).max() < 0.2
    assert count_handles(hand_cut.mesh) == 0
    report = check(hand_cut.mesh)
    assert len(report.boundary_lengths) == 2  # both rims are open
    assert not report.fatal
    assert repr(hand_cut) == f"Cut({hand_cut.mesh!r}, 1 cut paths)"


def test_no_more_are_cut_than_asked_for_or_fused(twice_fused, first_cut):
    assert count_handles(twice_fused) == 2
    assert cut_self_contacts(twice_fused, 0).cut_paths == ()
    assert_laws(twice_fused, first_cut)
    assert len(first_cut.cut_paths) == count_handles(first_cut.mesh) == 1


def test_both_hands_come_off_at_once_as_one_after_the_other(twice_fused, first_cut):
    second = cut_self_contacts(first_cut.mesh, 1)
    at_once = cut_self_contacts(twice_fused, 9)
    assert_laws(twice_fused, at_once)
    assert count_handles(second.mesh) == count_handles(at_once.mesh) == 0
    steps = first_cut.cut_paths[0], first_cut.vertex_index[second.cut_paths[0]]
    for step, cut_path in zip(steps, at_once.cut_paths, strict=True):
        assert np.linalg.norm(place(twice_fused, step) - place(twice_fused, cut_path)) < 0.02
    places = sorted((place(twice_fused, path) for path in at_once.cut_paths), key=lambda place: place[0])
    np.testing.assert_allclose(places, [HANDS["left"], HANDS["right"]], atol=0.06)


@pytest.mark.parametrize(("gap", "pieces"), [(0.02, 2), (0.06, 3), (0.1, 3)])
def test_a_self_contact_next_to_a_hole(fused, hand_cut, gap, pieces):
    """The rim of the hole is about so far from the cut path; the nearest one touches it."""
    cut_path = fused.vertices[hand_cut.cut_paths[0]]
    away = np.linalg.norm(fused.vertices[:, None] - cut_path, axis=2).min(axis=1)
    pierced = without(fused, fused.vertices[np.argmin(abs(away - gap - 0.05))], 0.05)
    assert len(check(pierced).boundary_lengths) == 1
    assert count_handles(pierced) == 1
    cut = cut_self_contacts(pierced, 1)
    assert_laws(pierced, cut)
    assert np.linalg.norm(place(pierced, cut.cut_paths[0]) - HANDS["right"]) < 0.06
    assert count_handles(cut.mesh) == 0
    assert len(check(cut.mesh).boundary_lengths) == pieces


def test_the_surface_alone_tells_where_the_cut_paths_are(fused, hand_cut):
    cut_path = hand_cut.cut_paths[0]
    other = disguised(fused, 1)
    found = cut_self_contacts(other.mesh, 1)
    assert_laws(other.mesh, found)
    vertices = np.argsort(other.new_vertex)[found.cut_paths[0]]
    assert np.linalg.norm(place(fused, vertices) - place(fused, cut_path)) < 0.02


@pytest.mark.parametrize("scale", [1000.0, 0.001])
def test_units_do_not_matter(fused, hand_cut, scale):
    scaled = cut_self_contacts(Mesh(scale * fused.vertices, fused.faces), 1)
    for cut_path, other in zip(scaled.cut_paths, hand_cut.cut_paths, strict=True):
        assert set(cut_path) == set(other)


def test_a_cut_path_must_be_concave_enough(fused):
    assert cut_self_contacts(fused, 1, 0.0).cut_paths == ()
    assert len(cut_self_contacts(fused, 1, 0.4).cut_paths) == 1


@pytest.mark.long
@pytest.mark.parametrize("most", [1, 4])
def test_handles_that_are_meant_stay(smooth, most):
    assert count_handles(smooth) > 0
    cut = cut_self_contacts(smooth, most)
    assert_laws(smooth, cut)
    assert cut.cut_paths == ()
    np.testing.assert_array_equal(cut.mesh.faces, smooth.faces)


def test_sharp_corners_are_no_cut_paths():
    assert cut_self_contacts(FRAME, 2).cut_paths == ()


def test_a_handle_with_two_cut_paths_is_cut_once():
    """Cut at both of its ends, it would come off."""
    mesh = basket()
    assert count_handles(mesh) == 1
    cut = cut_self_contacts(mesh, 2)
    assert_laws(mesh, cut)
    assert len(cut.cut_paths) == 1
    assert count_handles(cut.mesh) == 0


@pytest.mark.long
def test_a_clean_body_has_nothing_to_cut():
    clean = body().mesh
    assert count_handles(clean) == 0
    assert cut_self_contacts(clean, 3).cut_paths == ()
