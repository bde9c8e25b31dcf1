"""What is carried: laws of the identity, of rotations and of linear functions; seams; what has no image."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from isomatch import Asset, Correspondence, Mesh, carry_attributes, write_asset
from isomatch._core.errors import DescriptorError, MapError, MeshError, SettingError
from isomatch.io import Attribute, Polygons
from shapes import cylinder, flat_grid, icosphere, map_to_nearest


def asset_of(mesh, *attributes):
    return Asset(mesh.vertices, Polygons.of_triangles(mesh.faces), attributes)


def identity(n):
    return Correspondence(np.arange(n), n)


@pytest.fixture(scope="module")
def everything():
    """A sphere with an attribute of every kind and domain."""
    mesh = icosphere(2)
    z = mesh.vertices[:, 2]
    uv = np.column_stack([np.arctan2(*mesh.vertices[:, :2].T) / 6 + 0.5, z / 2 + 0.5])[mesh.faces]
    uv[uv[:, :, 0].max(axis=1) - uv[:, :, 0].min(axis=1) > 0.5, :, 0] = 0.25
    weights = np.column_stack([(1 + z) / 2, (1 - z) / 2])
    return asset_of(
        mesh,
        Attribute("half", "point", "label", np.where(z > 0, "north", "south")),
        Attribute("band", "face", "label", (z[mesh.faces[:, 0]] > 0).astype(np.int64)),
        Attribute("color", "point", "colour", np.uint8(255 * (mesh.vertices / 2 + 0.5))),
        Attribute("z", "point", "scalar", z),
        Attribute("pressure", "face", "scalar", z[mesh.faces].mean(axis=1)),
        Attribute("flow", "point", "vector", mesh.vertices),
        Attribute("normal", "point", "normal", mesh.vertex_normals),
        Attribute("uv", "corner", "uv", uv.reshape(-1, 2)),
        Attribute("weights", "point", "weights", weights, np.tile([0, 3], (len(z), 1)), {3: "tail"}),
    )


@pytest.mark.parametrize("to", ["source", "target"])
@pytest.mark.parametrize("labels", ["nearest", "majority"])
def test_the_identity_carries_everything_unchanged(everything, to, labels):
    bare = everything.without_attributes(*(a.name for a in everything.attributes))
    ends = (bare, everything) if to == "source" else (everything, bare)
    carried = carry_attributes(identity(len(bare.points)), *ends, to=to, labels=labels)
    assert (carried.unmatched, carried.across_seams) == (0, 0)
    for before in everything.attributes:
        after = carried.asset.attribute(before.name)
        assert (after.domain, after.kind, after.values.dtype) == (
            before.domain,
            before.kind,
            before.values.dtype,
        )
        if before.values.dtype.kind in "iU" or before.kind == "colour":
            np.testing.assert_array_equal(after.values, before.values)
        elif before.kind != "weights":
            np.testing.assert_allclose(after.values, before.values, atol=1e-12)
    weights = carried.asset.attribute("weights")
    np.testing.assert_allclose(
        weights.dense_weights, everything.attribute("weights").dense_weights, atol=1e-12
    )


def test_linear_functions_are_interpolated_exactly():
    fine, coarse = flat_grid(9, 9), flat_grid(5, 5)
    coarse = Mesh(2 * coarse.vertices, coarse.faces)
    height = Attribute("height", "point", "scalar", coarse.vertices @ [2.0, -1.0, 0.0])
    carried = carry_attributes(
        map_to_nearest(fine.vertices, coarse), asset_of(fine), asset_of(coarse, height)
    )
    np.testing.assert_allclose(
        carried.asset.attribute("height").values, fine.vertices @ [2.0, -1.0, 0.0], atol=1e-12
    )


def test_normals_turn_with_the_surface():
    mesh = icosphere(2)
    turn = Rotation.from_euler("xyz", [40, -70, 100], degrees=True).as_matrix()
    bent = mesh.vertex_normals + 0.2 * np.roll(mesh.vertices, 1, axis=1)
    bent /= np.linalg.norm(bent, axis=1, keepdims=True)
    giver = asset_of(mesh, Attribute("normal", "point", "normal", bent))
    receiver = asset_of(mesh.moved(3 * mesh.vertices @ turn.T))
    carried = carry_attributes(identity(mesh.n_vertices), receiver, giver)
    np.testing.assert_allclose(carried.asset.attribute("normal").values, bent @ turn.T, atol=1e-9)


def test_majority_is_by_area():
    mesh = flat_grid(3, 3)
    label = np.zeros(9, dtype=np.int64)
    label[4] = 7
    giver = asset_of(mesh, Attribute("part", "point", "label", label))
    all_to_middle = Correspondence(np.full(9, 4), 9)
    spread = carry_attributes(identity(9), asset_of(mesh), giver, labels="majority").asset.attribute("part")
    assert spread.values.tolist() == label.tolist()
    assert (carry_attributes(all_to_middle, asset_of(mesh), giver).asset.attribute("part").values == 7).all()


def test_weights_keep_the_largest_and_sum_to_one():
    mesh = icosphere(1)
    rng = np.random.default_rng(0)
    joints = np.array([rng.permutation(9)[:4] for _ in range(mesh.n_vertices)])
    weights = rng.dirichlet(np.ones(4), mesh.n_vertices)
    giver = asset_of(mesh, Attribute("weights", "point", "weights", weights, joints))
    corners = mesh.faces[rng.integers(mesh.n_faces, size=mesh.n_vertices)]
    precise = Correspondence(
        corners[:, 0], mesh.n_vertices, corners, np.tile([0.4, 0.35, 0.25], (mesh.n_vertices, 1))
    )
    carried = carry_attributes(precise, asset_of(mesh), giver).asset.attribute("weights")
    assert carried.values.shape == (mesh.n_vertices, 4)
    np.testing.assert_allclose(carried.values.sum(axis=1), 1.0)
    whole = np.einsum("nc,ncj->nj", precise.barycentric, giver.attribute("weights").dense_weights[corners])
    np.testing.assert_array_equal(
        np.sort(carried.joints, axis=1), np.sort(np.argsort(-whole, axis=1)[:, :4], axis=1)
    )


def unrolled(mesh):
    """Texture coordinates of a cylinder cut along one line: from 0 to 1 around, with the cut at one vertex column."""
    angle = np.arctan2(mesh.vertices[:, 1], mesh.vertices[:, 0]) / (2 * np.pi) % 1.0
    u = angle[mesh.faces]
    wide = np.ptp(u, axis=1) > 0.5
    u[wide] = np.where(u[wide] < 0.5, u[wide] + 1, u[wide])
    return np.stack([u, mesh.vertices[mesh.faces, 2]], axis=2).reshape(-1, 2)


def test_no_face_is_smeared_across_a_seam_of_one_island():
    giver_mesh, mesh = cylinder(40, 15), cylinder(27, 11)
    turn = Rotation.from_euler("z", 4, degrees=True).as_matrix()
    mesh = mesh.moved(
        (mesh.vertices @ turn.T) * [1, 1, giver_mesh.vertices[:, 2].max() / mesh.vertices[:, 2].max()]
    )
    giver = asset_of(giver_mesh, Attribute("uv", "corner", "uv", unrolled(giver_mesh)))
    carried = carry_attributes(map_to_nearest(mesh.vertices, giver_mesh), asset_of(mesh), giver)
    uv = carried.asset.attribute("uv")
    assert uv.domain == "corner"
    assert carried.across_seams > 0
    around = np.ptp(uv.values[:, 0].reshape(-1, 3), axis=1)
    assert around.max() < 1.2 / 27  # a smeared face would span nearly 1
    true = unrolled(mesh)[:, 0]
    away = np.abs((uv.values[:, 0] - true + 0.5) % 1 - 0.5).reshape(-1, 3).max(axis=1)
    assert (away > 0.005).sum() <= carried.across_seams
    assert away.max() < 1 / 27


def test_what_is_unmatched_is_marked(everything):
    n = len(everything.points)
    image = np.arange(n)
    image[:5] = -1
    bare = everything.without_attributes(*(a.name for a in everything.attributes))
    carried = carry_attributes(Correspondence(image, n), bare, everything)
    assert carried.unmatched == 5
    values = {a.name: a.values for a in carried.asset.attributes}
    assert (values["half"][:5] == "").all()
    assert (values["half"][5:] != "").all()
    assert np.isnan(values["z"][:5]).all()
    assert (values["color"][:5] == 128).all()
    assert np.isnan(values["uv"][np.isin(bare.polygons.corners, range(5))]).all()
    np.testing.assert_allclose(values["normal"][:5], bare.mesh.vertex_normals[:5])
    np.testing.assert_allclose(carried.asset.attribute("weights").dense_weights[:5, 0], 1)
    assert np.isfinite(values["weights"]).all()


def test_quads_and_seam_points_stay():
    """A square of one quad whose corner point is doubled; a map of the points or of the welded vertices will do."""
    points = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0], [2, 1, 0], [1, 0, 0], [1, 1, 0]]
    receiver = Asset(points, Polygons([0, 1, 2, 3, 6, 4, 5, 7], [4, 4]))
    part = Attribute("part", "face", "label", ["left", "right"])
    height = Attribute("height", "point", "scalar", receiver.points[:, 0])
    giver = receiver.with_attributes(part, height)
    for n in (8, 6):
        carried = carry_attributes(Correspondence(np.arange(n), n), receiver, giver).asset
        assert carried.polygons is receiver.polygons
        np.testing.assert_array_equal(carried.points, receiver.points)
        assert carried.attribute("part").values.tolist() == ["left", "right"]
        np.testing.assert_allclose(carried.attribute("height").values, receiver.points[:, 0])


def test_kinds_and_names_are_chosen(everything):
    bare = everything.without_attributes(*(a.name for a in everything.attributes))
    for data, names in (
        ("labels", ("half", "band")),
        (["colours", "z"], ("color", "z")),
        ("color", ("color",)),
        (["normals", "weights"], ("normal", "weights")),
    ):
        assert carry_attributes(identity(len(bare.points)), bare, everything, data).names == names
    with pytest.raises(DescriptorError, match="named"):
        carry_attributes(identity(len(bare.points)), bare, everything, "fur")


def test_what_does_not_fit_is_refused(everything):
    n = len(everything.points)
    with pytest.raises(MapError, match="source"):
        carry_attributes(identity(n + 1), everything, everything)
    moved = everything.moved(2 * everything.mesh.vertices)
    own = everything.mesh.content_hash
    with pytest.raises(MapError, match="source"):
        carry_attributes(Correspondence(np.arange(n), n, source_hash=own), moved, everything)
    with pytest.raises(SettingError, match="to = 'both'"):
        carry_attributes(identity(n), everything, everything, to="both")
    empty = Asset(everything.points, Polygons([], []))
    with pytest.raises(MeshError, match="polygons"):
        carry_attributes(identity(n), everything, empty)


def test_white_stays_white_where_weights_exceed_one_by_rounding():
    square = asset_of(flat_grid(2, 2), Attribute("color", "point", "colour", np.ones((4, 3))))
    images = np.tile(np.nextafter([1.0, 0.0, 0.0], 2), (4, 1))
    onto = Correspondence(np.zeros(4, dtype=int), 4, np.tile([0, 1, 2], (4, 1)), images)
    carried = carry_attributes(onto, square, square).asset.attribute("color")
    np.testing.assert_array_equal(carried.values, 1)
    assert Attribute("color", "point", "colour", [[1 + 1e-7, 0.5, 0]]).full == 1


def test_face_normals_turn_with_the_surface_and_grey_is_opaque():
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])
    up = Attribute("normal", "face", "normal", [[0, 0, 1.0]])
    paint = Attribute("color", "point", "colour", np.ones((4, 4)))
    flat = Asset(points, Polygons([0, 1, 2, 3], [4]), (up, paint))
    upright = Asset(points[:, [2, 0, 1]], flat.polygons)
    carried = carry_attributes(Correspondence(np.arange(4), 4), upright, flat).asset
    assert np.allclose(carried.attribute("normal").values, [[1, 0, 0]])
    carried = carry_attributes(Correspondence([0, 1, 2, -1], 4), upright, flat, "colour").asset
    assert carried.attribute("color").values[3].tolist() == [0.5, 0.5, 0.5, 1]


def test_what_was_carried_is_written_where_there_is_one_place(tmp_path):
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0.0]])
    old, new = (Attribute(name, "point", "uv", np.full((3, 2), i)) for i, name in enumerate(["uv", "UVMap"]))
    receiver, giver = (Asset(points, Polygons([0, 1, 2], [3]), (each,)) for each in (old, new))
    carried = carry_attributes(Correspondence(np.arange(3), 3), receiver, giver).asset
    assert [a.name for a in write_asset(tmp_path / "a.obj", carried)] == ["uv"]
