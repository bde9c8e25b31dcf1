"""Match two meshes in Blender, and carry vertex groups, shape keys, UV maps and landmarks between them.

`meshes` reads and writes Blender's meshes, `landmarks` its empties and vertex groups of one vertex. `matches` plans
matches, keeps their maps and uses them; `job` runs one in a process of its own, which is `worker`. `settings`,
`operators` and `panel` are what the user sees. isomatch itself is imported when it is
first used, so that the panel can say how to install it.
"""

bl_info = {
    "name": "isomatch",
    "author": "The isomatch authors",
    "version": (0, 1, 0),
    "blender": (4, 2, 0),
    "location": "3D View > Sidebar > isomatch",
    "description": "Match two shapes that bend, and carry data between them",
    "category": "Mesh",
}


def register() -> None:
    """Add the panel and its operators to Blender."""
    from . import matches, operators, panel, settings

    for module in (settings, operators, panel, matches):
        module.register()


def unregister() -> None:
    """Take them away again."""
    from . import matches, operators, panel, settings

    for module in (matches, panel, operators, settings):
        module.unregister()
