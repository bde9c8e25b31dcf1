"""
From a folder of organs to mean and modes
=========================================

Eight kidneys of different build and bend, each with its own triangulation, are matched with one of them, brought
into one topology, and described by their mean and the modes in which they vary.
"""

from pathlib import Path
from tempfile import mkdtemp

from isomatch import match, prepare, write_mesh
from isomatch.cohort import write_modes
from isomatch.cohort.shape_statistics import CorrespondedShapes, ShapeModel
from isomatch_lab.procedural import organ

folder = Path(mkdtemp())
kidneys = {
    f"kidney_{style}_{pose}": organ("kidney", 1500, style=style, pose=pose).mesh
    for style in (0, 1)
    for pose in range(1, 5)
}
for name, mesh in kidneys.items():
    write_mesh(folder / f"{name}.ply", mesh)

# %%
# For files, two commands do all that follows, for any number of shapes:
#
# .. code-block:: console
#
#     $ isomatch collect FOLDER -o out
#     $ isomatch statistics out -o out/statistics
#
# In Python, for a few shapes: match the first with each, and draw each with the vertices of the first.

template, *others = kidneys
prepared = prepare(kidneys[template])
meshes = {template: kidneys[template]}
for name in others:
    result = match(prepared, kidneys[name])
    meshes[name] = result.as_mesh(kidneys[template], kidneys[name])
    print(f"{name}: {result.outcome.value}")

# %%
# The model: generalised Procrustes alignment, then principal components. Move the sliders.

shapes = CorrespondedShapes.of_meshes(meshes)
model = ShapeModel.fit(shapes)
print("share of the variance:", [f"{share:.0%}" for share in model.variance_ratios[:4]])
write_modes("live_modes.html", model, n_modes=3)
