"""The picture of ``docs/how_to/symmetric_shapes.md``: a body under two maps that are equally good.

Run ``python docs/images/draw_symmetry.py`` to draw it again.
"""

from pathlib import Path

from isomatch import match
from isomatch.view import arranged_panels, camera_of, position_colours, surface_image, to_screen
from isomatch_lab.procedural import organ

HERE = Path(__file__).parent


def turned():
    """A body with half a turn: the map returned, and its alternative."""
    source, target = (organ("liver", 2500, symmetry="turn", pose=pose).mesh for pose in (1, 2))
    result = match(source, target)
    colours = position_colours(target)
    maps = {"one map": result.map, "another, as good": result.alternatives[0].map}
    shown = [(target, colours), *((source, found.pull_back(colours)) for found in maps.values())]
    images = [surface_image(mesh, paint, to_screen, camera_of(target)) for mesh, paint in shown]
    arranged_panels(images, ["target", *maps], per_row=3)[0].savefig(HERE / "symmetry.png")
    print("turned:", result.outcome.name)


if __name__ == "__main__":
    turned()
