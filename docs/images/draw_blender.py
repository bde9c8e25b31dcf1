"""Draw ``blender.png``: two creatures matched by the add-on, their map, and what was carried, rendered by Cycles.

Needs Blender's Python package, ``pip install 'bpy==4.5.*'``, and the extra ``creatures``.
"""

import os
import sys
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector
from PIL import Image

sys.path.insert(0, str(Path(__file__).parents[2] / "extras" / "blender"))

import isomatch_blender
from isomatch_blender import matches, meshes

from isomatch_lab.procedural import creature

FILE = Path(__file__).with_name("blender.png")
WIDTH = 760  # pixels
STEP = 6  # between levels of colour, so that the noise of the renderer is not stored
PAINT = np.array([[0.90, 0.62, 0.25], [0.10, 0.16, 0.28]])  # stripes, in linear light
LANDMARKS = {"nose": (1, 1), "tail": (1, -1), "ear": (2, 1)}  # an axis of the rest pose, and which end


def added(name, mesh, place):
    """Make a smooth object of a mesh."""
    data = bpy.data.meshes.new(name)
    data.from_pydata(mesh.vertices.tolist(), [], mesh.faces.tolist())
    data.shade_smooth()
    obj = bpy.data.objects.new(name, data)
    obj.location = place
    bpy.context.scene.collection.objects.link(obj)
    return obj


def stripes(rest):
    """Paint stripes along the body, and one leg."""
    wave = 0.5 + 0.5 * np.tanh(6 * np.sin(22 * rest[:, 1] + 5 * rest[:, 2]))
    colours = PAINT[0] + wave[:, None] * (PAINT[1] - PAINT[0])
    return np.column_stack([colours, np.ones(len(rest))])


def copied(obj, layer, place):
    """Show another colour attribute of an object in a copy."""
    shown = obj.copy()
    shown.location = place
    bpy.context.scene.collection.objects.link(shown)
    shown.data = obj.data.copy()
    material = bpy.data.materials.new(layer)
    material.use_nodes = True
    nodes = material.node_tree
    colour = nodes.nodes.new("ShaderNodeVertexColor")
    colour.layer_name = layer
    surface = nodes.nodes["Principled BSDF"]
    surface.inputs["Roughness"].default_value = 0.6
    nodes.links.new(colour.outputs["Color"], surface.inputs["Base Color"])
    shown.data.materials.clear()
    shown.data.materials.append(material)
    return shown


def balls(obj, place):
    """Show the landmarks of an object as balls."""
    material = bpy.data.materials.get("mark") or bpy.data.materials.new("mark")
    material.use_nodes = True
    material.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (0.8, 0.02, 0.02, 1)
    for child in obj.children:
        bpy.ops.mesh.primitive_uv_sphere_add(radius=0.035, location=Vector(place) + child.location)
        bpy.context.object.data.materials.append(material)
        bpy.ops.object.shade_smooth()


def render(objects):
    """Render with few samples from the side, on white."""
    scene = bpy.context.scene
    corners = np.array([obj.matrix_world @ Vector(corner) for obj in objects for corner in obj.bound_box])
    low, high = corners.min(axis=0), corners.max(axis=0)
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.data.type = "ORTHO"
    camera.rotation_euler = (np.radians(80), 0, np.radians(90))
    camera.data.ortho_scale = 1.04 * (high - low)[1]
    camera.location = Vector((low + high) / 2) + camera.rotation_euler.to_matrix() @ Vector((0, 0, 20))
    scene.collection.objects.link(camera)
    scene.camera = camera
    for turn, energy, angle in (((0.5, 0.5, 0.3), 2.2, 0.3), ((1.2, 0, 1.9), 0.7, 1.0)):
        sun = bpy.data.objects.new("sun", bpy.data.lights.new("sun", "SUN"))
        sun.data.energy, sun.data.angle, sun.rotation_euler = energy, angle, turn
        scene.collection.objects.link(sun)
    scene.world = bpy.data.worlds.new("world")
    scene.world.color = (0.5, 0.5, 0.5)
    scene.render.engine, scene.cycles.device, scene.cycles.samples = "CYCLES", "CPU", 64
    scene.cycles.use_denoising = False
    scene.cycles.seed = 0
    scene.render.film_transparent = True
    scene.view_settings.view_transform = "Standard"
    scene.render.resolution_x, scene.render.resolution_y = (
        WIDTH,
        round(WIDTH * (high - low)[2] / (high - low)[1] * 1.06),
    )
    scene.render.image_settings.color_mode = "RGBA"
    scene.render.filepath = str(FILE)
    bpy.ops.render.render(write_still=True)
    drawn = Image.open(FILE)
    drawn = Image.alpha_composite(Image.new("RGBA", drawn.size, "white"), drawn).convert("RGB")
    levels = np.minimum((np.asarray(drawn).astype(int) + STEP // 2) // STEP * STEP, 255)
    Image.fromarray(levels.astype(np.uint8)).save(FILE, optimize=True)


def main():
    """Match, show, paint, carry and draw."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    isomatch_blender.register()
    made = creature(9000, pose=3, triangulation=1), creature(11000, pose=8, triangulation=2)
    source, target = (added(name, each.mesh, (0, 0, 0)) for name, each in zip(("receives", "gives"), made))
    settings = bpy.context.scene.isomatch
    settings.source, settings.target = source, target
    bpy.ops.isomatch.match()
    meshes.write_colours(target.data, "paint", stripes(made[1].rest))
    for name, (axis, end) in LANDMARKS.items():
        mark = bpy.data.objects.new(name, None)
        bpy.context.scene.collection.objects.link(mark)
        mark.parent = target
        mark.location = made[1].mesh.vertices[(end * made[1].rest[:, axis]).argmax()]
    settings.data = {meshes.COLOURS, "LANDMARKS"}
    bpy.ops.isomatch.carry()
    shown = []
    for row, layer in enumerate((matches.COLOURS, "paint")):
        for column, obj in enumerate((target, source)):
            place = (0, 1.95 * column, -1.6 * row)
            shown.append(copied(obj, layer, place))
            if layer == "paint":
                balls(obj, place)
    for obj in (source, target):
        obj.hide_render = True
    bpy.context.view_layer.update()
    render(shown)


if __name__ == "__main__":
    main()
    os._exit(0)  # the package of Blender may wait for ever when Python ends
