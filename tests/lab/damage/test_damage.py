"""Damage: index maps, seeds, what is removed and what remains; the truth of damaged pairs."""

from dataclasses import replace
from inspect import signature

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from isomatch import InputError, Mesh, MeshError, SettingError, check, geodesic_distances
from isomatch.datasets import example_pair
from isomatch_lab.damage import (
    DAMAGES,
    DamageChoice,
    Damaged,
    cut,
    damaged_pair,
    decimate,
    holes,
    limb_removed,
    merge,
    noise,
    resample,
    view,
    weld,
)
from isomatch_lab.sets import BenchmarkPair, relabelled
from later import some_later
from shapes import flat_grid, icosphere, inside_out, planar_delaunay, two_spheres
from zoo import zoo
from zoo.made import moved, together

BODY = example_pair()[0].mesh
BALL = icosphere(4)
REMOVING = {"cut": cut, "holes": holes, "limb_removed": limb_removed, "view": view}
GAP = 0.2  # √area, to the nearest legs of the standing creature
TOUCHING = {"weld": GAP, "merge": 9.5}  # no limbs of the standing creature touch
LEVELS = [(name, level) for name in DAMAGES if name not in TOUCHING for level in DAMAGES[name].levels]
LEVELS += TOUCHING.items()
DEFAULTS = [(name, TOUCHING.get(name, damage.default)) for name, damage in DAMAGES.items()]


def triangles(mesh):
    """Faces as sets of corners, each corner a position."""
    return {frozenset(map(tuple, corners)) for corners in mesh.vertices[mesh.faces].tolist()}


def euler(mesh):
    return len(np.unique(mesh.faces)) - len(mesh.edges) + mesh.n_faces


@pytest.mark.parametrize(("name", "level"), some_later(LEVELS, lambda case: case[0] != "merge"))
def test_every_damage_is_seeded_and_knows_where_its_vertices_were(name, level):
    one, again, other = (DAMAGES[name].function(BODY, level, seed=seed) for seed in (5, 5, 6))
    np.testing.assert_array_equal(one.mesh.vertices, again.mesh.vertices)
    np.testing.assert_array_equal(one.mesh.faces, again.mesh.faces)
    np.testing.assert_array_equal(one.original, again.original)
    if name not in ("decimate", *TOUCHING):
        assert not np.array_equal(one.mesh.vertices, other.mesh.vertices)
    assert one.whole is BODY
    assert len(one.original) == one.mesh.n_vertices == len(np.unique(one.original))
    if name in ("noise", *TOUCHING):
        return
    np.testing.assert_array_equal(one.mesh.vertices, BODY.vertices[one.original])
    np.testing.assert_array_equal(one.damaged_vertex[one.original], np.arange(one.mesh.n_vertices))
    assert (np.sort(np.unique(one.mesh.faces)) == np.arange(one.mesh.n_vertices)).all()


@pytest.mark.long
@pytest.mark.parametrize(("name", "level"), [each for each in LEVELS if each[0] in REMOVING])
def test_what_remains_is_a_piece_of_the_whole(name, level):
    found = REMOVING[name](BODY, level, seed=3).mesh
    assert triangles(found) <= triangles(BODY)
    assert len(np.unique(found.components)) == 1
    assert found.area < BODY.area


@pytest.mark.long
@pytest.mark.parametrize("name", ["cut", "holes", "limb_removed"])
@pytest.mark.parametrize("share", [0.05, 0.3, 0.6])
def test_the_share_that_is_asked_for_is_removed(name, share):
    for seed in range(3):
        found = REMOVING[name](BALL, share, seed=seed).mesh
        removed = 1 - found.area / BALL.area
        assert share <= removed < share + 0.03


def test_a_cut_is_along_a_plane():
    damaged = cut(BALL, 0.3, seed=2)
    direction = np.random.default_rng(2).standard_normal(3)
    height = BALL.vertices @ direction / np.linalg.norm(direction)
    gone = np.setdiff1d(np.arange(BALL.n_vertices), damaged.original)
    edge = BALL.edge_lengths.max()
    assert height[gone].max() < height[damaged.original].min() + edge
    assert height[damaged.original].min() == pytest.approx(2 * 0.3 - 1, abs=edge), (
        "the area of a zone, by Archimedes"
    )


def test_a_piece_that_falls_off_counts_as_removed():
    damaged = cut(two_spheres(2, 0.5), 0.3, seed=0)
    assert damaged.original.max() < icosphere(2).n_vertices, "the larger sphere remains, without a part"
    assert damaged.mesh.area == pytest.approx(0.7 * damaged.whole.area, rel=0.05)


@pytest.mark.long
def test_holes_are_discs():
    damaged = holes(BALL, 0.1, count=3, seed=5)
    weights = BALL.vertex_areas / BALL.area
    centres = np.random.default_rng(5).choice(BALL.n_vertices, 3, replace=False, p=weights)
    discs = Mesh(BALL.vertices, [face for face in BALL.faces if not np.isin(face, damaged.original).all()])
    assert euler(damaged.mesh) == 2 - len(np.unique(discs.components[discs.faces]))
    nearest = geodesic_distances(BALL, centres).min(axis=0)
    gone = np.setdiff1d(np.arange(BALL.n_vertices), damaged.original)
    assert nearest[gone].max() < nearest[damaged.original].min() + BALL.edge_lengths.max()


def test_a_limb_ends_in_one_extremity_and_leaves_one_boundary():
    damaged = limb_removed(BODY, 0.05, seed=1)
    gone = np.setdiff1d(np.arange(BODY.n_vertices), damaged.original)
    part, _ = BODY.submesh(np.isin(np.arange(BODY.n_vertices), gone))
    assert len(np.unique(part.components[np.unique(part.faces)])) == 1
    assert euler(damaged.mesh) == 1
    distance = geodesic_distances(BODY, [gone[0]])[0]
    assert distance[gone].max() < 0.5 * distance.max()


def test_a_camera_sees_half_a_ball_and_six_see_all_of_it():
    half = view(BALL, seed=1)
    assert half.mesh.area == pytest.approx(0.5 * BALL.area, rel=0.06)
    towards = half.mesh.vertices.mean(axis=0)
    towards /= np.linalg.norm(towards)
    assert (half.mesh.vertices @ towards).min() > -BALL.edge_lengths.max(), "nothing behind the horizon"
    assert view(BALL, 2, seed=1).mesh.area > 0.95 * BALL.area
    assert view(BALL, 6, seed=1).mesh.n_faces == BALL.n_faces


def test_what_is_behind_something_else_is_not_seen():
    sheet = flat_grid(9, 9)
    both = together(sheet, moved(sheet, [2.6, 2.6, -0.2], 0.35))
    sides = set()
    for seed in range(1500):
        height = Rotation.random(rng=np.random.default_rng(seed)).as_matrix()[
            2, 2
        ]  # of the camera over the sheet
        if abs(height) > 0.98:
            sides.add(height > 0)
            seen = view(both, seed=seed)
            assert (seen.original < 81).all(), "the largest component is the sheet"
            assert seen.mesh.area == pytest.approx(64 if height > 0 else 60), (
                "the patch hides 4 of its 64 squares"
            )
    assert len(sides) == 2


def test_noise_is_gaussian_of_the_amplitude_asked_for():
    damaged = noise(BODY, 0.3, seed=0)
    step = (damaged.mesh.vertices - BODY.vertices) / (0.3 * BODY.edge_lengths.mean())
    assert step.std(axis=0) == pytest.approx([1, 1, 1], abs=0.05)
    assert step.mean(axis=0) == pytest.approx([0, 0, 0], abs=0.05)
    assert np.abs(step).max() < 6
    np.testing.assert_array_equal(damaged.mesh.faces, BODY.faces)
    np.testing.assert_array_equal(damaged.original, np.arange(BODY.n_vertices))


def test_welding_joins_what_is_near_in_space_and_far_along_the_surface():
    ball = icosphere(3)
    pair = together(ball, inside_out(moved(ball, [2.05, 0, 0], [-1, 1, 1])))
    unit = np.sqrt(pair.area)
    damaged = weld(pair, 0.06 / unit)
    n_merged = pair.n_vertices - damaged.mesh.n_vertices
    assert n_merged == 1, "the poles"
    assert len(np.unique(damaged.mesh.components)) == 1
    assert euler(damaged.mesh) == 4 - 1
    (at,) = np.flatnonzero(damaged.twin >= 0)
    ends = pair.vertices[[damaged.original[at], damaged.twin[at]]]
    np.testing.assert_allclose(damaged.mesh.vertices[at], ends.mean(axis=0))
    assert damaged.damaged_vertex[damaged.original[at]] == -1 == damaged.damaged_vertex[damaged.twin[at]]
    wider = weld(pair, 0.2 / unit)
    assert pair.n_vertices - wider.mesh.n_vertices > 1
    gaps = np.linalg.norm(pair.vertices[wider.original] - pair.vertices[wider.with_twins], axis=1)
    assert gaps.max() <= 0.2


def test_welded_limbs_are_far_apart_along_the_surface():
    damaged = weld(BODY, GAP)
    merged = damaged.twin >= 0
    first, second = damaged.original[merged], damaged.twin[merged]
    along = np.diag(geodesic_distances(BODY, first)[:, second])
    assert along.min() > 0.5 * np.sqrt(BODY.area)
    assert euler(damaged.mesh) < euler(BODY)
    apart = np.linalg.norm(BODY.vertices[first] - BODY.vertices[second], axis=1)
    assert apart.max() <= GAP * np.sqrt(BODY.area)


@pytest.mark.long
def test_merged_vertices_faced_each_other_and_triangles_between_them_are_gone():
    damaged = merge(BODY, 9.5)
    merged = damaged.twin >= 0
    first, second = damaged.original[merged], damaged.twin[merged]
    normals = BODY.vertex_normals
    assert np.einsum("ij,ij->i", normals[first], normals[second]).max() < 0
    middles = (BODY.vertices[first] + BODY.vertices[second]) / 2
    np.testing.assert_allclose(damaged.mesh.vertices[merged], middles)
    assert not merged[damaged.mesh.faces].all(axis=1).any()
    assert damaged.mesh.n_faces < BODY.n_faces


@pytest.mark.parametrize(("share", "accuracy"), [(0.5, 0.005), (0.1, 0.06)])
def test_decimation_keeps_topology_boundary_and_shape(share, accuracy):
    damaged = decimate(BODY, share)
    assert damaged.mesh.n_vertices == round(share * BODY.n_vertices)
    assert euler(damaged.mesh) == euler(BODY) == 2
    assert not check(damaged.mesh).warnings
    assert damaged.mesh.volume == pytest.approx(BODY.volume, rel=accuracy)
    sheet = planar_delaunay(400)
    flat = decimate(sheet, share).mesh
    assert flat.area == pytest.approx(sheet.area)
    assert euler(flat) == 1
    assert (flat.face_cross[:, 2] * sheet.face_cross[0, 2] > 0).all(), "no face turned over"


def test_decimation_keeps_vertices_where_the_surface_bends():
    grid = flat_grid(21, 21)
    ridge = Mesh(grid.vertices * [1, 1, 0] - [0, 0, 1] * np.abs(grid.vertices[:, :1] - 10), grid.faces)
    kept = decimate(ridge, 0.2).mesh
    assert kept.area == pytest.approx(ridge.area)


@pytest.mark.parametrize("ratio", [4.0, 16.0])
def test_resampling_has_the_density_asked_for(ratio):
    damaged = resample(BODY, ratio, seed=0)
    assert euler(damaged.mesh) == 2
    kept = np.isin(np.arange(BODY.n_vertices), damaged.original)
    ends = [geodesic_distances(BODY, [0])[0].argmax()]
    ends.append(geodesic_distances(BODY, ends)[0].argmax())
    nearest = geodesic_distances(BODY, ends)
    shares = [kept[each < 0.25 * each.max()].mean() for each in nearest]
    expected = ratio ** (1 - 0.25)  # between the middles of both regions
    assert 0.5 * expected < max(shares) / min(shares) < 2 * ratio


def test_levels_out_of_range_are_refused():
    for name, damage in DAMAGES.items():
        for level in (*damage.bounds, -1.0, np.nan, np.inf):
            with pytest.raises(SettingError, match="does not lie between"):
                damage.function(BALL, level)
        _, first, *_ = signature(damage.function).parameters.values()
        assert first.default == damage.default in damage.levels, name
    with pytest.raises(SettingError, match="cameras"):
        view(BALL, 2.5)
    with pytest.raises(SettingError, match="count"):
        holes(BALL, count=0)
    for fuse in (weld, merge):
        with pytest.raises(MeshError, match="limbs"):
            fuse(BALL)
    for damage in DAMAGES.values():
        with pytest.raises(MeshError, match="no faces"):
            damage.function(Mesh(BALL.vertices, []), damage.default)
    with pytest.raises(MeshError, match="nothing would be left"):
        cut(Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]))


def test_choices_are_read_from_text_and_written_back():
    for text in ("cut:0.3", "view:1", "noise:0.125@both", "resample:16@source"):
        assert str(DamageChoice.parse(text)) == text
    assert DamageChoice.parse("holes@source") == DamageChoice("holes", 0.25, "source")
    with pytest.raises(SettingError, match="unknown"):
        DamageChoice.parse("fire:3")
    with pytest.raises(SettingError, match="number"):
        DamageChoice.parse("cut:much")
    with pytest.raises(SettingError, match="damage"):
        DamageChoice.parse("cut@left")
    with pytest.raises(SettingError, match="between"):
        DamageChoice.parse("cut:30")


@pytest.fixture(scope="module")
def whole():
    target, new = relabelled(BODY, seed=1)
    return BenchmarkPair("a-b", BODY, target, np.column_stack([np.arange(len(new)), new]))


@pytest.mark.long
@pytest.mark.parametrize("side", ["source", "target", "both"])
@pytest.mark.parametrize(("name", "level"), DEFAULTS)
def test_truth_of_damaged_pairs(whole, name, level, side):
    pair = DamageChoice(name, level, side)(whole, seed=1)
    given, kept = pair.given, pair.whole
    assert (given.source is whole.source) == (side == "target")
    assert (given.target is whole.target) == (side == "source")
    if name in ("decimate", "resample"):
        assert len(kept.truth) == len(whole.truth), "the surface is still there"
        return
    np.testing.assert_array_equal(pair.source.original[given.truth[:, 0]], kept.truth[:, 0])
    np.testing.assert_array_equal(pair.target.original[given.truth[:, 1]], kept.truth[:, 1])
    known = {tuple(row) for row in whole.truth.tolist()}
    assert {tuple(row) for row in kept.truth.tolist()} <= known
    image = np.full(given.source.n_vertices, -1)
    image[given.truth[:, 0]] = given.truth[:, 1]
    for lift in pair.lifted(image):
        np.testing.assert_array_equal(
            lift[kept.truth[:, 0]], kept.truth[:, 1], "the truth is carried to the truth"
        )
        assert (lift >= 0).sum() == len(kept.truth)


@pytest.mark.parametrize("name", ["decimate", "resample"])
def test_a_vertex_that_was_thinned_out_is_near_its_stand_in(name):
    damaged = DAMAGES[name].function(BODY, DAMAGES[name].levels[0])
    stand_in = damaged.original[damaged.damaged_vertex]
    np.testing.assert_array_equal(stand_in[damaged.original], damaged.original)
    apart = np.linalg.norm(BODY.vertices[stand_in] - BODY.vertices, axis=1)
    assert 0 < apart.max() < 6 * BODY.edge_lengths.mean()
    pair = BenchmarkPair("a-a", BODY, BODY, np.column_stack([np.arange(BODY.n_vertices)] * 2))
    (lift,) = damaged_pair(pair, target=damaged).lifted(damaged.damaged_vertex)
    np.testing.assert_array_equal(lift, stand_in)


def test_a_merged_vertex_may_be_either_of_both(whole):
    pair = DamageChoice("weld", GAP)(whole)
    at = int(np.flatnonzero(pair.target.twin >= 0)[0])
    one, other = pair.lifted(np.full(whole.source.n_vertices, at))
    assert (one == pair.target.original[at]).all()
    assert (other == pair.target.twin[at]).all()


def test_mirrored_truth_stays_in_step(whole):
    symmetric = replace(whole, mirrored=np.column_stack([whole.truth[:, 0], np.roll(whole.truth[:, 1], 1)]))
    pair = DamageChoice("cut", 0.3)(symmetric)
    assert len(pair.given.mirrored) == len(pair.whole.mirrored) == len(pair.given.truth) < len(whole.truth)
    np.testing.assert_array_equal(pair.given.mirrored[:, 0], pair.given.truth[:, 0])
    np.testing.assert_array_equal(pair.target.original[pair.given.mirrored[:, 1]], pair.whole.mirrored[:, 1])


def test_a_pair_without_damage_is_what_it_was(whole):
    pair = damaged_pair(whole)
    assert pair.given.source is whole.source
    np.testing.assert_array_equal(pair.given.truth, whole.truth)
    (lift,) = pair.lifted(whole.truth[:, 1])
    np.testing.assert_array_equal(lift, whole.truth[:, 1])


def test_a_pair_of_which_no_truth_remains_is_reported(whole):
    gone = cut(whole.target, 0.5)
    rows = whole.truth[gone.damaged_vertex[whole.truth[:, 1]] < 0]
    with pytest.raises(InputError, match="nothing"):
        damaged_pair(replace(whole, truth=rows), target=gone)
    assert isinstance(gone, Damaged)


@pytest.mark.parametrize("name", DAMAGES)
@pytest.mark.parametrize("specimen", [each for each in zoo() if each.name != "repeated_index"], ids=repr)
def test_every_kind_of_mesh_is_damaged_or_refused(specimen, name):
    try:
        damaged = DAMAGES[name].function(specimen.mesh, DAMAGES[name].default)
    except (MeshError, SettingError):
        return  # too few vertices, no surface, or no limbs
    assert not specimen.tags & {"fatal", "extreme"}
    assert not check(damaged.mesh).fatal
    assert len(damaged.original) == damaged.mesh.n_vertices
    assert damaged.damaged_vertex.max() < damaged.mesh.n_vertices
