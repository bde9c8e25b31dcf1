"""Shape keys of glTF files are carried to surfaces of other triangles: turned with them, with names and weights."""

import numpy as np
import pytest
from gltf_made import Square, onto

from corresponded import wrapped_as
from isomatch import (
    Asset,
    Attribute,
    Correspondence,
    Mesh,
    carry_attributes,
    read_asset,
    write_asset,
)
from isomatch.cli import main
from isomatch.cli.outputs import write_wrapped
from isomatch.io import Polygons
from shapes import flat_grid, icosphere

TURN = np.array([[0, -1, 0], [0, 0, -1], [1, 0, 0]])  # as a rotation moves columns


def lift(points):
    """A key that depends on the place linearly, so that every triangulation of the square can have it."""
    x, y = points[:, 0], points[:, 1]
    return np.column_stack([0.1 * x, -0.2 * y, x + y])


def slide(points):
    return np.tile([0.5, 0.25, 0], (len(points), 1))


def keyed(n=5, names=("lift", "slide"), weights=(0.25, 0.0)):
    square = Square(n)
    keys = [square.gltf.add_array(np.float32(move(square.points))) for move in (lift, slide)]
    square.first["targets"] = [{"POSITION": key} for key in keys]
    mesh = square.json["meshes"][0]
    if names:
        mesh["extras"] = {"targetNames": list(names)}
    if weights:
        mesh["weights"] = list(weights)
    return square


def mesh_of(asset):
    return asset.document.json["meshes"][0]


@pytest.fixture
def giver(tmp_path):
    return read_asset(keyed().write(tmp_path / "giver.glb"))


def carried_to(receiver, giver, flat, tmp_path, data="keys"):
    """Carry to a receiver whose points are those of a flat one somewhere else, and read the result again."""
    carried = carry_attributes(onto(flat, giver), receiver, giver, data)
    write_asset(tmp_path / "out.glb", carried.asset)
    return read_asset(tmp_path / "out.glb")


def grid(n=9, **kwargs):
    fine = flat_grid(n, n)
    return Asset(fine.vertices * 4 / (n - 1), Polygons.of_triangles(fine.faces), **kwargs)


@pytest.mark.parametrize("size", [1.0, 1000.0, 0.01])
def test_keys_turn_and_grow_with_the_surface(giver, tmp_path, size):
    flat = grid()
    receiver = Asset(size * flat.points @ TURN.T + 7, flat.polygons)
    found = carried_to(receiver, giver, flat, tmp_path)
    assert [a.name for a in found.of_kind("key")] == ["lift", "slide"]
    for move in (lift, slide):
        moved = found.attribute(move.__name__).values
        assert np.allclose(moved, size * move(flat.points) @ TURN.T, atol=1e-5 * size)
    assert mesh_of(found)["extras"]["targetNames"] == ["lift", "slide"]
    assert mesh_of(found)["weights"] == [0.25, 0]


def test_keys_turn_with_a_bent_surface(giver, tmp_path):
    """On a cylinder, what is lifted off the plane goes away from the axis."""
    flat = grid(33)
    angle = flat.points[:, 0] / 4
    outwards = np.column_stack([np.sin(angle), 0 * angle, np.cos(angle)])
    along = np.column_stack([np.cos(angle), 0 * angle, -np.sin(angle)])
    bent = Asset(4 * outwards + flat.points * [0, 1, 0], flat.polygons)
    found = carried_to(bent, giver, flat, tmp_path)
    x, y, z = lift(flat.points).T[:, :, None]
    expected = x * along + y * [0, 1, 0] + z * outwards
    # rotations are averaged over a tenth of the side: at the border from one side alone, so that they lag behind by the
    # angle reach / 4
    reach, rim = 0.4, 2 - np.abs(flat.points[:, 0] - 2)
    lag = np.exp(-rim / reach) * reach / 4 * np.linalg.norm(expected, axis=1)
    error = np.linalg.norm(found.attribute("lift").values - expected, axis=1)
    assert (error < 0.03 + lag).all()


@pytest.mark.parametrize("mirrored", [False, True])
def test_keys_and_normals_go_to_a_mirror_image(mirrored):
    sphere = icosphere(2)
    x, y, z = sphere.vertices.T
    mesh = Mesh(np.column_stack([x + 0.3 * y**2, 0.7 * y, 0.5 * z + 0.2 * x * y]), sphere.faces)
    key = Attribute("slide", "point", "key", np.column_stack([y, np.ones_like(y), x]))
    normal = Attribute("normal", "point", "normal", mesh.vertex_normals)
    turn = TURN @ np.diag([-1.0, 1, 1]) if mirrored else TURN
    faces = mesh.faces[:, ::-1] if mirrored else mesh.faces
    receiver = Asset.of_mesh(Mesh(mesh.vertices @ turn.T, faces))
    order = np.arange(mesh.n_vertices)
    found = carry_attributes(
        Correspondence(order, len(order)), receiver, Asset.of_mesh(mesh, (key, normal))
    ).asset
    np.testing.assert_allclose(found.attribute("slide").values, key.values @ turn.T, atol=1e-9)
    np.testing.assert_allclose(found.attribute("normal").values, normal.values @ turn.T, atol=1e-9)


def test_nodes_that_turn_and_stretch(tmp_path):
    """Both files put their squares at the same place, by other transforms."""
    square = keyed()
    square.json["nodes"][0]["scale"] = [2, 2, 2]
    giver = read_asset(square.write(tmp_path / "giver.glb"))
    square = Square(9)
    square.points @= TURN.T / 4
    square.add("POSITION", square.points)
    matrix = np.eye(4)
    matrix[:3, :3] = 8 * TURN.T
    square.json["nodes"][0]["matrix"] = matrix.T.ravel().tolist()
    receiver = read_asset(square.write(tmp_path / "receiver.glb"))
    found = carried_to(receiver, giver, receiver, tmp_path)
    placed = found.placed
    assert np.allclose(placed.attribute("lift").values, 2 * lift(placed.points / 2), atol=1e-5)


def test_keys_of_the_receiver_stay(giver, tmp_path):
    square = keyed(9, ("slide", "own"), (0.5, 0.75))
    receiver = read_asset(square.write(tmp_path / "receiver.glb"))
    found = carried_to(receiver, giver, receiver, tmp_path)
    mesh = mesh_of(found)
    assert mesh["extras"]["targetNames"] == ["slide", "own", "lift"]
    assert mesh["weights"] == [0.0, 0.75, 0.25]
    assert np.allclose(found.attribute("own").values, slide(found.points))
    assert np.allclose(found.attribute("slide").values, slide(found.points))


def test_a_key_that_moves_nothing_keeps_its_name(tmp_path):
    square = keyed()
    square.first["targets"][0]["POSITION"] = square.gltf.add_array(np.zeros((25, 3), np.float32))
    giver = read_asset(square.write(tmp_path / "giver.glb"))
    assert mesh_of(carried_to(grid(), giver, grid(), tmp_path))["extras"]["targetNames"] == ["lift", "slide"]


def test_without_names_and_with_weights_of_the_node(tmp_path):
    square = keyed(names=(), weights=())
    square.json["nodes"][0]["weights"] = [0, 1]
    giver = read_asset(square.write(tmp_path / "giver.glb"))
    found = carried_to(grid(), giver, grid(), tmp_path)
    assert mesh_of(found)["extras"]["targetNames"] == ["key_0", "key_1"]
    assert mesh_of(found)["weights"] == [0, 1]
    assert np.allclose(found.attribute("key_1").values, slide(found.points))


def test_a_key_and_a_scalar_of_one_name(tmp_path):
    square = keyed()
    square.add("_LIFT", np.arange(25))
    giver = read_asset(square.write(tmp_path / "giver.glb"))
    assert [(a.name, a.kind) for a in giver.attributes] == [
        ("lift", "scalar"), ("lift_1", "key"), ("slide", "key"),
    ]  # fmt: skip
    found = carried_to(grid(), giver, grid(), tmp_path, "all")
    assert np.allclose(found.attribute("lift_1").values, lift(found.points), atol=1e-6)


def test_sparse_keys_and_seams(tmp_path):
    """A key that moves one point, and a new seam that splits the points."""
    square = Square(5)
    sparse = {
        "count": 1,
        "indices": {"bufferView": square.gltf.add_bytes(np.uint8([12]).tobytes()), "componentType": 5121},
        "values": {"bufferView": square.gltf.add_bytes(np.float32([0, 0, 3]).tobytes())},
    }
    key = {"componentType": 5126, "count": 25, "type": "VEC3", "sparse": sparse}
    square.first["targets"] = [{"POSITION": square.gltf.append("accessors", key)}]
    asset = read_asset(square.write(tmp_path / "a.glb"))
    uv = np.random.default_rng(0).random((96, 2))
    write_asset(tmp_path / "b.glb", asset.with_attributes(Attribute("uv", "corner", "uv", uv)))
    found = read_asset(tmp_path / "b.glb")
    assert len(found.points) == 96
    moved = (found.points == asset.points[12]).all(axis=1)
    assert moved.sum() == 6
    assert np.array_equal(found.attribute("key_0").values[moved], np.tile([0, 0, 3], (6, 1)))
    assert not found.attribute("key_0").values[~moved].any()


def test_removed_keys_leave_nothing_behind(giver, tmp_path):
    square = keyed()
    times, weights = (square.gltf.add_array(np.float32(x)) for x in ([0, 1], [0, 0, 1, 1]))
    square.json["animations"] = [
        {
            "samplers": [{"input": times, "output": weights}],
            "channels": [{"sampler": 0, "target": {"node": 0, "path": "weights"}}],
        }
    ]
    asset = read_asset(square.write(tmp_path / "a.glb"))
    write_asset(tmp_path / "same.glb", asset)
    same = read_asset(tmp_path / "same.glb").document.json
    assert all(same[key] == asset.document.json[key] for key in ("animations", "meshes", "nodes"))
    write_asset(tmp_path / "one.glb", asset.without_attributes("lift"))
    one = read_asset(tmp_path / "one.glb")
    assert mesh_of(one)["extras"]["targetNames"] == ["slide"]
    assert "animations" not in one.document.json
    write_asset(tmp_path / "none.glb", asset.without_attributes("lift", "slide"))
    assert not mesh_of(read_asset(tmp_path / "none.glb")).keys() & {"weights", "extras"}


@pytest.mark.parametrize("word", ["keys", "shape keys", "morph-targets", "lift,slide"])
def test_the_command_carries_keys(word, tmp_path, capsys):
    keyed().write(tmp_path / "keys.glb")
    write_asset(tmp_path / "plain.ply", grid())
    giver, receiver = read_asset(tmp_path / "keys.glb"), read_asset(tmp_path / "plain.ply")
    found = onto(receiver, giver)
    hashes = {"source_hash": receiver.mesh.content_hash, "target_hash": giver.mesh.content_hash}
    Correspondence(found.vertices, 25, found.faces, found.barycentric, **hashes).save(tmp_path / "map.npz")
    files = [str(tmp_path / name) for name in ("map.npz", "plain.ply", "keys.glb")]
    assert main(["transfer", *files, "-o", str(tmp_path / "out.glb"), "--data", word]) == 0
    assert capsys.readouterr().out.splitlines()[0] == "carried to the source: lift, slide"
    out = read_asset(tmp_path / "out.glb")
    assert np.allclose(out.attribute("lift").values, lift(out.points), atol=1e-6)
    assert mesh_of(out)["weights"] == [0.25, 0]


@pytest.mark.parametrize("suffix", [".ply", ".vtp", ".vtu", ".vtk", ".gii"])
def test_other_formats_keep_keys_as_vectors(suffix, giver, tmp_path):
    assert write_asset(tmp_path / f"a{suffix}", giver) == ()
    found = read_asset(tmp_path / f"a{suffix}").attribute("lift")
    assert np.allclose(found.values, lift(giver.points), atol=1e-6)


def test_the_shape_of_another_turns_the_keys(tmp_path):
    path = keyed().write(tmp_path / "keys.glb")
    flat = read_asset(path)
    turned = Mesh(flat.mesh.vertices @ TURN.T, flat.mesh.faces)
    write_wrapped(tmp_path / "out.glb", flat, None, wrapped_as(turned), np.zeros(25))
    found = read_asset(tmp_path / "out.glb")
    assert np.allclose(found.attribute("lift").values, lift(flat.points) @ TURN.T, atol=1e-5)
    assert mesh_of(found)["weights"] == [0.25, 0]
