"""Weights between rigged files: one skin, with the joints of the one that gives, whatever the other had."""

import numpy as np
import pytest
from gltf_made import Square, onto

from isomatch import Attribute, carry_attributes, read_asset, write_asset
from isomatch._core.errors import DescriptorError
from isomatch.io.formats._gltf_data import GltfData, node_matrices

NAMES, PLACES = ("Hips", "Chest", "Arm"), ([0.5, 0, 0], [1, 0, 0], [0, 2, 1])


def shares(points, n=3):
    """Weights that rise from joint to joint along x."""
    at = points[:, 0] / 4 * (n - 1)
    return np.maximum(1 - np.abs(at[:, None] - np.arange(n)), 0)


def rigged(names=NAMES, places=PLACES, n=5):
    square = Square(n)
    return square.bones(names, places, shares(square.points, len(names)))


def bare():
    return Square(9)


def same_names():
    return rigged(places=([9, 9, 9], [0, 0, 7], [1, 1, 1]), n=9)


def other_names():
    return rigged(("A", "B", "C", "D"), ([0, 0, 0],) * 4, n=9)


def same_names_elsewhere():
    """Names of joints of the giver in a skin of another order, below a node of its own."""
    square = rigged(("Arm", "Hips", "Chest"), ([0, 0, 0],) * 3, n=9)
    armature = square.gltf.append("nodes", {"name": "Armature", "children": [1], "translation": [0, 0, 5]})
    square.json["scenes"][0]["nodes"] = [0, armature]
    return square


def moved_by_its_node():
    square = Square(9)
    square.json["nodes"][0]["translation"] = [0, 0, 5]
    return square


def two_skins():
    """Two meshes, and two skins of the same names."""
    square = rigged(n=9)
    square.bones(NAMES, ([0, 0, 1],) * 3, shares(square.points))
    second = square.gltf.append("meshes", {"primitives": [dict(square.first)]})
    square.gltf.append("nodes", {"mesh": second, "skin": 0})
    square.json["scenes"][0]["nodes"].append(7)
    return square


RECEIVERS = [bare, same_names, other_names, same_names_elsewhere, moved_by_its_node, two_skins]


def inverses(asset, skin):
    gltf = GltfData(asset.document.json, bytearray(asset.document.blob))
    return gltf.array(skin["inverseBindMatrices"]).reshape(-1, 4, 4).transpose(0, 2, 1)


def above(nodes):
    return {child: i for i, node in enumerate(nodes) for child in node.get("children", [])}


def with_weights_of(giver, receiver, folder):
    """Carry weights between the files of two squares; what was carried, and what is read again."""
    giver, receiver = (
        read_asset(square.write(folder / f"{i}.glb")) for i, square in enumerate((giver, receiver))
    )
    carried = carry_attributes(onto(receiver, giver), receiver, giver, "weights")
    write_asset(folder / "out.glb", carried.asset)
    return carried, read_asset(folder / "out.glb")


@pytest.mark.parametrize("make", RECEIVERS)
def test_one_skin_with_the_joints_of_the_giver(make, tmp_path):
    giver = read_asset(rigged().write(tmp_path / "giver.glb"))
    _, found = with_weights_of(rigged(), make(), tmp_path)
    nodes = found.document.json["nodes"]
    [skin] = found.document.json["skins"]
    assert [nodes[joint]["name"] for joint in skin["joints"]] == list(NAMES)
    assert [nodes[joint]["translation"] for joint in skin["joints"]] == list(PLACES)
    parent = above(nodes)
    assert [parent.get(joint) for joint in skin["joints"]] == [None, *skin["joints"][:2]]
    assert [node["name"] for node in nodes if node.get("name") in (*NAMES, "A", "Armature")] == list(NAMES)
    own = np.eye(4)
    own[2, 3] = 5 * (make in (moved_by_its_node, same_names_elsewhere))
    assert np.allclose(found.placed_points, found.points + own[:3, 3], atol=1e-6)
    given = inverses(giver, giver.document.json["skins"][0])
    assert np.allclose(inverses(found, skin), given @ own, atol=1e-6)
    weights = found.attribute("weights")
    assert list(weights.names.values()) == list(NAMES)
    assert np.allclose(weights.dense_weights, shares(found.points), atol=1e-6)
    assert all(node["skin"] == 0 for node in nodes if "mesh" in node)
    reached = set(found.document.json["scenes"][0]["nodes"])
    while more := {child for i in reached for child in nodes[i].get("children", [])} - reached:
        reached |= more
    assert reached == {i for i, node in enumerate(nodes) if node}


@pytest.mark.parametrize("node", [{"scale": [100] * 3}, {"scale": [-2, 2, 2], "rotation": [0.6, 0, 0, 0.8]}])
def test_the_surface_stays_where_its_node_put_it(node, tmp_path):
    square = Square(9)
    square.json["nodes"][0] |= node
    receiver = read_asset(square.write(tmp_path / "receiver.glb"))
    giver = read_asset(rigged().write(tmp_path / "giver.glb"))
    carried = carry_attributes(onto(receiver, giver), receiver, giver, "weights").asset
    write_asset(tmp_path / "out.glb", carried)
    found = read_asset(tmp_path / "out.glb")
    assert np.allclose(found.mesh.vertices, receiver.mesh.vertices, rtol=1e-5, atol=1e-5)
    assert np.array_equal(found.mesh.faces, receiver.mesh.faces)
    again = carry_attributes(onto(found, giver), found, giver, "weights").asset
    skins = [each.document.json["skins"][0] for each in (carried, again)]
    assert np.allclose(inverses(carried, skins[0]), inverses(again, skins[1]), atol=1e-4)


def test_a_joint_of_no_size_is_named(tmp_path):
    square = rigged()
    square.json["nodes"][2]["scale"] = [0, 0, 0]
    giver = read_asset(square.write(tmp_path / "giver.glb"))
    with pytest.raises(DescriptorError, match="Chest"):
        carry_attributes(onto(giver, giver), giver, giver, "weights")


def test_what_hangs_on_a_former_joint_stays_there(tmp_path):
    giver = read_asset(rigged().write(tmp_path / "giver.glb"))
    square = same_names()
    camera = square.gltf.append("cameras", {"type": "perspective", "perspective": {"yfov": 1, "znear": 1}})
    square.json["nodes"][3]["children"] = [square.gltf.append("nodes", {"name": "in hand", "camera": camera})]
    receiver = read_asset(square.write(tmp_path / "receiver.glb"))
    before = receiver.document.json
    place = {node.get("name"): node_matrices(before)[i] for i, node in enumerate(before["nodes"])}["in hand"]
    found = carry_attributes(onto(receiver, giver), receiver, giver, "weights").asset.document.json
    [i] = [i for i, node in enumerate(found["nodes"]) if node.get("name") == "in hand"]
    assert np.allclose(node_matrices(found)[i], place)


@pytest.mark.parametrize("names", [("Bone", "Bone", "Bone"), ("Bone", "Bone_1", "Bone")])
def test_joints_of_one_name_stay_different(names, tmp_path):
    _, found = with_weights_of(rigged(names), rigged(names, n=9), tmp_path)
    [skin] = found.document.json["skins"]
    assert [found.document.json["nodes"][joint]["name"] for joint in skin["joints"]] == list(names)
    assert np.allclose(found.attribute("weights").dense_weights, shares(found.points), atol=1e-6)


def test_two_skins_of_the_giver_become_one(tmp_path):
    """One half of the giver is bound to each, by joints of the same names."""
    square = rigged()
    other = rigged(places=([0, 0, 9],) * 3)
    left = square.points[square.faces, 0].mean(axis=1) < 2
    attributes = square.first["attributes"]
    halves = [{**square.primitive(square.faces[here]), "attributes": attributes} for here in (left, ~left)]
    square.bones(NAMES, ([0, 0, 9],) * 3, shares(other.points))
    square.json["meshes"] = [{"primitives": [half]} for half in halves]
    square.json["nodes"][0]["skin"] = 0
    square.json["scenes"][0]["nodes"].append(square.gltf.append("nodes", {"mesh": 1, "skin": 1}))
    _, found = with_weights_of(square, same_names(), tmp_path)
    [skin] = found.document.json["skins"]
    assert [found.document.json["nodes"][joint]["name"] for joint in skin["joints"]] == [*NAMES, *NAMES]
    dense = found.attribute("weights").dense_weights
    assert np.allclose(dense[:, :3] + dense[:, 3:], shares(found.points), atol=1e-6)
    assert np.allclose(dense[found.points[:, 0] < 1.9, 3:], 0)
    assert np.allclose(dense[found.points[:, 0] > 2.1, :3], 0)


def test_new_weights_in_a_file_of_two_skins_keep_both(tmp_path):
    asset = read_asset(two_skins().write(tmp_path / "a.glb"))
    weights = asset.attribute("weights")
    assert list(weights.names.values()) == [*NAMES, *(f"{name}_1" for name in NAMES)]
    turned = weights.dense_weights[:, [1, 0, 2, 4, 3, 5]]
    changed = Attribute("weights", "point", "weights", turned, names=weights.names)
    write_asset(tmp_path / "b.glb", asset.with_attributes(changed))
    found = read_asset(tmp_path / "b.glb")
    assert len(found.document.json["skins"]) == 2
    assert np.allclose(found.attribute("weights").dense_weights, turned, atol=1e-6)


def test_animations_of_joints_that_are_gone_are_told(tmp_path):
    square = same_names()
    times, turns = (square.gltf.add_array(np.float32(x)) for x in ([0, 1], [[0, 0, 0, 1], [0, 0, 1, 0]]))
    channels = [
        {"sampler": 0, "target": {"node": node, "path": path}}
        for node, path in ((1, "rotation"), (0, "rotation"))
    ]
    square.json["animations"] = [{"samplers": [{"input": times, "output": turns}], "channels": channels}]
    carried, _ = with_weights_of(rigged(), square, tmp_path)
    assert carried.notes == ("animations of joints and shape keys that the receiver had before are left out",)
    [animation] = carried.asset.document.json["animations"]
    [channel] = animation["channels"]
    assert carried.asset.document.json["nodes"][channel["target"]["node"]]["mesh"] == 0


def test_a_posed_skeleton_is_told(tmp_path):
    square = rigged()
    for node in (square.json["nodes"][1], {**square.json["nodes"][2], "rotation": [0, 0, 0.6, 0.8]}):
        square.json["nodes"][1 if node["name"] == "Hips" else 2] = {**node, "scale": [2, 2, 2]}
        giver = read_asset(square.write(tmp_path / "giver.glb"))
        carried = carry_attributes(onto(giver, giver), giver, giver, "weights")
        assert [note.split(",")[0] for note in carried.notes] == (
            [] if node["name"] == "Hips" else ["the skeleton is posed"]
        )
