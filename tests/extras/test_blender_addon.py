"""The add-on in Blender's own Python package: what is matched, what is carried both ways, and what is refused in words.

Windows, the panel and the modal operator need a Blender with a window and are not tried here.
"""

import os
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from isomatch import Correspondence
from isomatch.datasets import ground_truth

bpy = pytest.importorskip(
    "bpy", reason="needs Blender's Python package: pip install 'bpy==4.5.*' with Python 3.11"
)
sys.path.insert(0, str(Path(__file__).parents[2] / "extras" / "blender"))

import bmesh  # noqa: E402
import isomatch_blender  # noqa: E402
from isomatch_blender import landmarks, matches, meshes  # noqa: E402
from isomatch_blender.job import Job  # noqa: E402
from mathutils import Matrix  # noqa: E402

CLOSE = 0.02  # √area: mean error of what is carried by a map that is right; that of the map is half of it


def added(name, vertices, faces):
    """A new object with a mesh."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(np.asarray(vertices).tolist(), [], np.asarray(faces).tolist())
    obj = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(obj)
    return obj


def empty(name, parent, position):
    """A child empty at a position in the coordinates of its parent."""
    made = bpy.data.objects.new(name, None)
    bpy.context.scene.collection.objects.link(made)
    made.parent, made.location = parent, position
    return made


@pytest.fixture
def scene():
    """An empty scene with the add-on."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    isomatch_blender.register()
    yield bpy.context.scene
    isomatch_blender.unregister()


@pytest.fixture(scope="module")
def result(example):
    """The match of the shipped pair as Blender holds it."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    isomatch_blender.register()
    source, target = (added(name, made.mesh.vertices, made.mesh.faces) for name, made in zip("ab", example))
    settings = bpy.context.scene.isomatch
    settings.source, settings.target = source, target
    assert bpy.ops.isomatch.match() == {"FINISHED"}
    found = matches.kept(source, target).result
    isomatch_blender.unregister()
    return found


@pytest.fixture
def matched(scene, example, result):
    """The shipped pair in the scene, matched."""
    source, target = (added(name, made.mesh.vertices, made.mesh.faces) for name, made in zip("ab", example))
    scene.isomatch.source, scene.isomatch.target = source, target
    matches.keep(source, target, result, False)
    return source, target


def replaced(result, found):
    """The same result with another map."""
    return replace(result, map=found)


def bind(result, source, target):
    """Keep a result for objects whose meshes have the same vertices elsewhere, or other polygons."""
    hashes = [matches.surface_of(meshes.asset_of(obj)).content_hash for obj in (source, target)]
    old = result.map
    new = Correspondence(old.vertices, old.n_target, old.faces, old.barycentric, *hashes)
    matches.keep(source, target, replaced(result, new), False)


def key_of(obj, name):
    return obj.data.shape_keys.key_blocks[name]


def positions(key):
    return meshes.read(key.data, "co", 3)


def carry(to="SOURCE", *data, **options):
    settings = bpy.context.scene.isomatch
    settings.receiver, settings.data = to, set(data)
    for name, value in options.items():
        setattr(settings, name, value)
    assert bpy.ops.isomatch.carry() == {"FINISHED"}


def give_weights(obj, rest):
    """Two groups of a rig, whose weights add up to 1 and change along the body."""
    share = np.interp(rest[:, 1], [rest[:, 1].min(), rest[:, 1].max()], [0, 1])
    for name, weights in (("front", share), ("rear", 1 - share)):
        meshes.write_group(obj, name, weights)
    return share


def weights(obj, name):
    return meshes.weights_of(obj.data, [obj.vertex_groups[name].index])[:, 0]


def test_a_match_is_shown_in_colours_that_correspond(matched, result, example_truth):
    source, target = matched
    assert result.outcome.name == "CONVERGED"
    assert bpy.ops.isomatch.show() == {"FINISHED"}
    shown = {}
    for obj in matched:
        layer = obj.data.color_attributes.active_color
        assert (layer.name, layer.domain) == (matches.COLOURS, "POINT")
        shown[obj] = meshes.read(layer.data, "color", 4)
    away = np.abs(shown[source] - shown[target][example_truth]).mean()
    assert away < 0.1 * np.abs(shown[source] - np.roll(shown[source], 1000, axis=0)).mean()
    bpy.context.scene.isomatch.show = "ERROR"
    bpy.ops.isomatch.show()
    assert source.data.color_attributes.active_color.name == matches.ERRORS


@pytest.mark.parametrize("to", ["SOURCE", "TARGET"])
def test_vertex_groups_go_either_way_and_still_add_up(matched, example, to):
    receiver, giver = matched if to == "SOURCE" else matched[::-1]
    rest = [made.rest for made in (example if to == "SOURCE" else example[::-1])]
    give_weights(giver, rest[1])
    meshes.write_group(receiver, "front", np.ones(len(rest[0])))  # is replaced
    receiver.vertex_groups.new(name="own")
    carry(to, "GROUPS")
    along = rest[1][:, 1]
    expected = np.interp(rest[0][:, 1], [along.min(), along.max()], [0, 1])
    assert set(receiver.vertex_groups.keys()) == {"front", "rear", "own"}
    assert np.abs(weights(receiver, "front") - expected).mean() < CLOSE
    np.testing.assert_allclose(weights(receiver, "front") + weights(receiver, "rear"), 1, atol=1e-6)


def test_shape_keys_turn_and_grow_with_a_receiver_in_other_units(matched, result, example):
    source, target = matched
    source.data.transform(Matrix.Rotation(1.0, 4, "X") @ Matrix.Scale(100, 4))
    source.matrix_world = Matrix.Translation((5, 6, 7)) @ Matrix.Scale(0.01, 4)
    bind(result, source, target)
    places, normals = example[1].mesh.vertices, example[1].mesh.vertex_normals
    target.shape_key_add(name="Basis")
    for name, size in (("thick", 0.01), ("thicker", 0.02)):
        key = target.shape_key_add(name=name)
        key.data.foreach_set("co", (places + size * normals).astype(np.float32).ravel())
    target.data.shape_keys.key_blocks["thicker"].relative_key = key_of(target, "thick")
    key_of(target, "thicker").slider_max = 2.0
    carry("SOURCE", "KEYS")
    basis, thick, thicker = (positions(key_of(source, name)) for name in ("Basis", "thick", "thicker"))
    np.testing.assert_array_equal(basis, meshes.asset_of(source).points)
    own = matches.surface_of(meshes.asset_of(source))
    along = np.einsum("ni,ni->n", thick - basis, own.vertex_normals)
    assert np.median(along) == pytest.approx(1.0, rel=0.05)  # 0.01, 100 times as large
    np.testing.assert_allclose(thicker - basis, 2 * (thick - basis), atol=1e-3)
    assert key_of(source, "thicker").relative_key == key_of(source, "thick")
    assert key_of(source, "thicker").slider_max == 2.0


def test_uv_maps_keep_their_seam_on_polygons_of_any_size(matched, result, example):
    source, target = matched
    for obj in matched:
        edit = bmesh.new()
        edit.from_mesh(obj.data)
        bmesh.ops.join_triangles(
            edit, faces=edit.faces[:], angle_face_threshold=0.3, angle_shape_threshold=3.0
        )
        edit.to_mesh(obj.data)
    assert {len(polygon.vertices) for polygon in source.data.polygons} == {3, 4}
    bind(result, source, target)
    middles = np.array([example[1].rest[list(p.vertices)].mean(axis=0) for p in target.data.polygons])
    corners = meshes.asset_of(target).polygons
    beyond = np.where(middles[corners.of_corner, 0] > 0, 10.0, 0.0)  # the seam is the plane of symmetry
    layer = target.data.uv_layers.new(name="skin", do_init=False)
    given = example[1].rest[corners.corners][:, 1:] + beyond[:, None]
    layer.uv.foreach_set("vector", given.astype(np.float32).ravel())
    target.data.uv_layers.new(name="second")
    carry("SOURCE", "UVS")
    assert source.data.uv_layers.keys() == ["skin", "second"]
    found = meshes.read(source.data.uv_layers["skin"].uv, "vector", 2)
    own = meshes.asset_of(source).polygons
    side = np.round(found[:, 0] / 10)
    assert np.ptp(np.split(side, own.starts[1:])[0]) == 0
    assert all(np.ptp(each) == 0 for each in np.split(side, own.starts[1:]))
    assert np.abs(found - 10 * side[:, None] - example[0].rest[own.corners][:, 1:]).mean() < CLOSE


def test_colours_and_materials_are_carried(matched, example, example_truth):
    source, target = matched
    meshes.write_colours(
        target.data, "paint", example[1].rest - example[1].rest.min(axis=0), "POINT", "BYTE_COLOR"
    )
    for obj, names in ((target, ["fur", "hoof"]), (source, ["old"])):
        for name in names:
            obj.data.materials.append(bpy.data.materials.new(name))
    low = np.array([example[1].rest[list(p.vertices), 2].mean() < -0.2 for p in target.data.polygons])
    target.data.polygons.foreach_set("material_index", low.astype(np.int32))
    bpy.ops.isomatch.show()  # the colours of the map itself are not carried
    carry("SOURCE", "COLOURS", "MATERIALS")
    layer = source.data.color_attributes["paint"]
    assert (layer.domain, layer.data_type) == ("POINT", "BYTE_COLOR")
    given = meshes.read(target.data.color_attributes["paint"].data, "color", 4)
    away = np.abs(meshes.read(layer.data, "color", 4) - given[example_truth])
    assert away.mean() < CLOSE
    assert [slot.name for slot in source.material_slots] == ["fur", "hoof"]
    index = meshes.read(source.data.polygons, "material_index", 1, np.int32)
    expected = [example[0].rest[list(p.vertices), 2].mean() < -0.2 for p in source.data.polygons]
    assert (index == expected).mean() > 0.97


@pytest.mark.parametrize("to", ["SOURCE", "TARGET"])
def test_landmarks_are_placed_in_the_coordinates_of_the_receiver(matched, result, example, to):
    receiver, giver = matched if to == "SOURCE" else matched[::-1]
    ours, theirs = example if to == "SOURCE" else example[::-1]
    giver.matrix_world = Matrix.Translation((1, 2, 3)) @ Matrix.Rotation(0.5, 4, "Y") @ Matrix.Scale(7, 4)
    receiver.matrix_world = Matrix.Translation((-4, 0, 0)) @ Matrix.Scale(3, 4)
    truth = ground_truth(theirs, ours)
    chosen = [int(theirs.rest[:, axis].argmax()) for axis in (1, 2)]
    empty("nose", giver, theirs.mesh.vertices[chosen[0]])
    meshes.write_group(giver, "ear", np.eye(len(theirs.rest))[chosen[1]])
    empty("ear.001", None, (0, 0, 0))  # is no child
    carry(to, "LANDMARKS")
    expected = truth.points(ours.mesh)[chosen]
    (placed,) = receiver.children
    assert landmarks.plain(placed.name) == "nose"
    assert 0 < placed["expected_error"] < 0.1
    unit = np.sqrt(ours.mesh.area)
    assert np.linalg.norm(np.array(placed.location) - expected[0]) < 0.05 * unit
    bpy.context.view_layer.update()
    np.testing.assert_allclose(
        placed.matrix_world.translation, receiver.matrix_world @ placed.location, rtol=1e-5
    )
    (vertex,) = np.flatnonzero(weights(receiver, "ear"))
    assert np.linalg.norm(ours.mesh.vertices[vertex] - expected[1]) < 0.05 * unit
    placed.location = (0, 0, 0)
    carry(to, "LANDMARKS")  # those that are there stay
    assert len(receiver.children) == 1
    assert not np.any(placed.location)
    carry(to, "LANDMARKS", replace_landmarks=True)
    assert len(receiver.children) == 1
    assert np.linalg.norm(np.array(placed.location) - expected[0]) < 0.05 * unit


@pytest.mark.long
def test_landmarks_lead_the_match_and_hold(matched, example, example_truth):
    source, target = matched
    chosen = [int(example[0].rest[:, axis].argmax()) for axis in range(3)] + [
        int(example[0].rest[:, 2].argmin())
    ]
    for i, vertex in enumerate(chosen):
        empty(f"mark {i}", source, example[0].mesh.vertices[vertex])
        empty(f"mark {i}", target, example[1].mesh.vertices[example_truth[vertex]])
    bpy.context.scene.isomatch.use_landmarks = bpy.context.scene.isomatch.hold_landmarks = True
    assert bpy.ops.isomatch.match() == {"FINISHED"}
    found = matches.kept(source, target).result
    np.testing.assert_array_equal(found.map.vertices[chosen], example_truth[chosen])


def test_a_shape_key_is_the_surface_of_the_target(matched, example, example_truth):
    source, target = matched
    assert bpy.ops.isomatch.morph() == {"FINISHED"}
    bent = positions(key_of(source, target.name))
    away = np.linalg.norm(bent - example[1].mesh.vertices[example_truth], axis=1)
    assert away.mean() < CLOSE * np.sqrt(example[1].mesh.area)


def test_a_map_is_saved_and_loaded(matched, tmp_path):
    source, _ = matched
    file = str(tmp_path / "map.npz")
    assert bpy.ops.isomatch.save(filepath=file) == {"FINISHED"}
    matches._forget()
    with pytest.raises(RuntimeError, match="no map from a to b yet"):
        bpy.ops.isomatch.show()
    assert bpy.ops.isomatch.load(filepath=file) == {"FINISHED"}
    assert matches.COLOURS in source.data.color_attributes
    bpy.ops.isomatch.swap()
    with pytest.raises(RuntimeError, match="source"):
        bpy.ops.isomatch.load(filepath=file)


def test_edit_mode_is_left_and_entered_again(matched, example):
    source, target = matched
    give_weights(target, example[1].rest)
    bpy.context.view_layer.objects.active = source
    bpy.ops.object.mode_set(mode="EDIT")
    carry("SOURCE", "GROUPS")
    assert source.mode == "EDIT"
    bpy.ops.object.mode_set(mode="OBJECT")
    assert "front" in source.vertex_groups


def test_other_users_of_a_mesh_stay_as_they_are_if_asked(matched, example):
    source, target = matched
    give_weights(target, example[1].rest)
    other = bpy.data.objects.new("other", source.data)
    carry("SOURCE", "GROUPS", own_copy=True)
    assert source.data != other.data
    assert "front" in source.vertex_groups
    assert "front" not in other.vertex_groups
    bpy.ops.isomatch.show()  # the map is that of the copy too


def test_modifiers_are_left_out_or_taken_in(matched, result, example):
    source, target = matched
    target.modifiers.new("Smooth surface", "SUBSURF")
    assert matches.notes_of(target, False) == ["b is matched without its modifiers (Smooth surface)"]
    give_weights(target, example[1].rest)
    carry("SOURCE", "GROUPS")  # of the mesh before modifiers
    shown = meshes.asset_of(target, True)
    assert len(shown.points) > 3 * len(target.data.vertices)
    # a map of the shape as shown: the first vertices are those that were there
    surfaces = matches.surface_of(meshes.asset_of(source)), matches.surface_of(shown)
    hashes = {"source_hash": surfaces[0].content_hash, "target_hash": surfaces[1].content_hash}
    found = replaced(result, Correspondence(result.map.vertices, len(shown.points), **hashes))
    matches.keep(source, target, found, True)
    carry("SOURCE", "GROUPS", "UVS")
    with pytest.raises(RuntimeError, match="modifiers"):
        carry("TARGET", "GROUPS")
    target.shape_key_add(name="Basis")
    with pytest.raises(RuntimeError, match="shape"):
        carry("SOURCE", "KEYS")


def test_uneven_scale_is_told(matched):
    source, _ = matched
    source.scale = (1, 1, 2)
    bpy.context.view_layer.update()
    assert matches.notes_of(source, False) == ["a is scaled unevenly, which is not seen: apply the scale"]


def test_what_cannot_be_done_is_said_in_words(matched, scene):
    source, target = matched
    scene.isomatch.use_landmarks = True
    with pytest.raises(RuntimeError, match="share 0 landmarks"):
        bpy.ops.isomatch.match()
    for name in ("tip", "tip.001"):
        empty(name, source, (0, 0, 0))
    with pytest.raises(RuntimeError, match="landmarks"):
        bpy.ops.isomatch.match()
    scene.isomatch.use_landmarks = False
    empty("far", target, (100, 0, 0))
    with pytest.raises(RuntimeError, match="not on its surface: far"):
        carry("SOURCE", "LANDMARKS")
    with pytest.raises(RuntimeError, match="nothing"):
        carry("SOURCE", "UVS")
    for obj, n in ((source, 8), (target, 1)):
        for i in range(n):
            obj.data.uv_layers.new(name=f"{obj.name}{i}")
    with pytest.raises(RuntimeError, match="a would have 9 UV maps"):
        carry("SOURCE", "UVS")
    source.data.vertices[0].co.x += 0.01
    with pytest.raises(RuntimeError, match="changed"):
        bpy.ops.isomatch.show()
    scene.isomatch.target = added("points", [[0, 0, 0], [1, 0, 0]], [])
    with pytest.raises(RuntimeError, match="points has no faces"):
        bpy.ops.isomatch.match()
    scene.isomatch.target = added("flat", [[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]])
    with pytest.raises(RuntimeError, match="area"):
        bpy.ops.isomatch.match()
    scene.isomatch.target = source
    assert not bpy.ops.isomatch.match.poll()


def test_a_match_tells_its_progress_and_is_ended_at_once(matched, scene):
    order, _ = matches.planned(*matched, scene.isomatch)
    job = Job(*order)
    assert job.progress == ("starting", 0.0)
    while job.is_running and job.progress[1] == 0:
        time.sleep(0.01)
    assert job.is_running
    stage, share = job.progress
    assert 0 < share < 1
    assert stage
    folder = job._folder
    since = time.monotonic()
    job.cancel()
    assert time.monotonic() - since < 1
    assert not job.is_running
    assert not folder.exists()


def test_a_process_that_dies_is_told(matched, scene):
    order, _ = matches.planned(*matched, scene.isomatch)
    job = Job(*order)
    job._process.kill()
    job.wait()
    with pytest.raises(meshes.Refused, match="exit code -9"):
        job.result()


def test_maps_are_forgotten_with_the_file(matched):
    source, target = matched
    assert matches.kept(source, target)
    bpy.ops.wm.read_homefile(use_empty=True)
    assert not matches._kept


INSTALL = """
import sys, bpy
bpy.ops.wm.read_factory_settings(use_empty=True)
kind, file = sys.argv[-2:]
if kind == "extension":
    bpy.ops.extensions.package_install_files(filepath=file, repo="user_default", enable_on_install=True)
else:
    bpy.ops.preferences.addon_install(filepath=file)
    bpy.ops.preferences.addon_enable(module="isomatch_blender")
assert bpy.types.Scene.bl_rna.properties.get("isomatch") or bpy.context.scene.isomatch
print(sorted(name for name in bpy.context.preferences.addons.keys() if "isomatch" in name))
"""


@pytest.mark.long
@pytest.mark.parametrize(
    ("kind", "name"), [("extension", "bl_ext.user_default.isomatch_blender"), ("add-on", "isomatch_blender")]
)
def test_the_zip_is_installed_by_blender(tmp_path, kind, name):
    root = Path(__file__).parents[2]
    subprocess.run([sys.executable, root / "extras" / "zipped.py", tmp_path], check=True)
    done = subprocess.run(
        [sys.executable, "-c", INSTALL, kind, str(tmp_path / "isomatch_blender.zip")],
        env={**os.environ, "BLENDER_USER_RESOURCES": str(tmp_path / "user")},
        capture_output=True,
        text=True,
    )
    assert f"['{name}']" in done.stdout, done.stdout + done.stderr
