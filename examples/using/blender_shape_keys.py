"""
Shape keys in Blender
=====================

A matched shape becomes a shape key, and vertex groups are carried to it by topology.

.. code-block:: console

    $ isomatch match SOURCE.ply TARGET.ply -o result --as-mesh shared.ply
    $ blender --background --python examples/using/blender_shape_keys.py -- SOURCE.ply shared.ply picture.png

With ``pip install bpy``, ``python examples/using/blender_shape_keys.py SOURCE.ply shared.ply picture.png`` will do.
"""

import sys

import bpy
from mathutils import Vector


def read(path):
    """Import a PLY file as an object."""
    bpy.ops.wm.ply_import(filepath=path)
    return bpy.context.object


def shape_key(base, shape):
    """Join as Shapes: the vertices of one object become a shape key of the other."""
    bpy.ops.object.select_all(action="DESELECT")
    shape.select_set(True)
    base.select_set(True)
    bpy.context.view_layer.objects.active = base
    bpy.ops.object.join_shapes()
    return base.data.shape_keys.key_blocks[-1]


def two_groups(shape):
    """Paint weights that pass from one group to the other along the z axis."""
    heights = [vertex.co.z for vertex in shape.data.vertices]
    groups = [shape.vertex_groups.new(name=name) for name in ("low", "high")]
    for vertex, height in enumerate(heights):
        share = (height - min(heights)) / (max(heights) - min(heights))
        for group, weight in zip(groups, (1 - share, share)):
            group.add([vertex], weight, "REPLACE")


def transfer_groups(giver, receiver):
    """Give vertex i the weights of vertex i: Data Transfer, Topology."""
    for group in giver.vertex_groups:
        receiver.vertex_groups.new(name=group.name)
    modifier = receiver.modifiers.new("weights", "DATA_TRANSFER")
    modifier.object = giver
    modifier.use_vert_data = True
    modifier.data_types_verts = {"VGROUP_WEIGHTS"}
    modifier.vert_mapping = "TOPOLOGY"
    bpy.context.view_layer.objects.active = receiver
    bpy.ops.object.modifier_apply(modifier=modifier.name)


def weights(shape):
    """Weight of every vertex in every group."""
    return [{group.group: group.weight for group in vertex.groups} for vertex in shape.data.vertices]


def coloured(shape, name):
    """Show the weights of a group in the object's colours."""
    layer = shape.data.color_attributes.new(name="shown", type="FLOAT_COLOR", domain="POINT")
    index = shape.vertex_groups[name].index
    for vertex, values in enumerate(weights(shape)):
        share = values.get(index, 0.0)
        layer.data[vertex].color = (share, 0.2, 1 - share, 1)
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    nodes = material.node_tree
    colour = nodes.nodes.new("ShaderNodeVertexColor")
    colour.layer_name = "shown"
    nodes.links.new(colour.outputs["Color"], nodes.nodes["Principled BSDF"].inputs["Base Color"])
    shape.data.materials.clear()
    shape.data.materials.append(material)


def still(shapes, path):
    """Render the objects side by side."""
    scene = bpy.context.scene
    width = height = 0.0
    for shape in shapes:
        corners = [Vector(corner) for corner in shape.bound_box]
        low, high = (Vector(each(corner[k] for corner in corners) for k in range(3)) for each in (min, max))
        shape.location = (width - low.x, -(low.y + high.y) / 2, -(low.z + high.z) / 2)
        width += (high.x - low.x) * 1.1
        height = max(height, high.z - low.z)
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.data.type, camera.data.ortho_scale = "ORTHO", 1.1 * max(width, 2 * height)
    camera.data.clip_end = 10 * (width + height)
    camera.location, camera.rotation_euler = (width / 2, -3 * (width + height), 0), (1.5708, 0, 0)
    sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
    sun.data.energy, sun.rotation_euler = 4, (0.9, 0.2, 0.3)
    for each in (camera, sun):
        scene.collection.objects.link(each)
    scene.camera = camera
    scene.world = bpy.data.worlds.new("world")
    scene.world.color = (0.4, 0.4, 0.4)
    scene.render.engine, scene.cycles.device, scene.cycles.samples = "CYCLES", "CPU", 8
    scene.render.resolution_x, scene.render.resolution_y = 1000, 500
    scene.render.filepath = path
    bpy.ops.render.render(write_still=True)


def main(source, shared, picture):
    """Make the shape key, carry the groups, render both shapes and the shape half-way between."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    base, shape = read(source), read(shared)
    two_groups(base)
    transfer_groups(base, shape)
    assert weights(base) == weights(shape)
    key = shape_key(base, shape)
    middle = base.copy()
    middle.data = base.data.copy()
    bpy.context.scene.collection.objects.link(middle)
    middle.data.shape_keys.key_blocks[key.name].value = 0.5
    for each in (base, middle, shape):
        coloured(each, "high")
    still((base, middle, shape), picture)
    print(f"{len(base.data.vertices)} vertices; shape keys:", *base.data.shape_keys.key_blocks.keys())


if __name__ == "__main__":
    main(*sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:])
