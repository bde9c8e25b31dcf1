"""
A symmetric shape, and its other map
====================================

A shape with a symmetry has several maps that are equally good. One of them is returned, the outcome says so, and
the others are among the alternatives.
"""

from isomatch import match
from isomatch.visualization import arranged_panels, camera_of, position_colours, surface_image, to_screen
from isomatch_lab.procedural import organ

source = organ("liver", 2500, symmetry="turn", pose=1).mesh
target = organ("liver", 2500, symmetry="turn", pose=2).mesh
result = match(source, target)
print(f"{result.outcome.name}: {result.outcome.advice}")
print("the source has:", result.symmetries[0])

# %%
# The alternative turns the shape by half a turn about its axis, so the colours at both ends are exchanged.

colours = position_colours(target)
maps = {"returned": result.map, "first alternative": result.alternatives[0].map}
shown = [(target, colours), *((source, found.pull_back(colours)) for found in maps.values())]
images = [surface_image(mesh, paint, to_screen, camera_of(target)) for mesh, paint in shown]
figure, _ = arranged_panels(images, ["target", *maps], per_row=3)
figure.savefig("two_maps.png")

# %%
# Landmarks decide, and so does ``Config(start="pose")`` if the shapes lie in space in the same way. On the
# command line, ``isomatch choose DIR 1`` continues with the first alternative.
