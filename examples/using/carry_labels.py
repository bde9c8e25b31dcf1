"""
Carry labels
============

One labelled shape labels all others: pull its labels back by the map. This makes training data from a single example.
"""

import numpy as np

from isomatch import match
from isomatch.visualization import arranged_panels, surface_image
from isomatch_lab.procedural import creature

labelled = creature(3000, pose=0)
scan = creature(3000, pose=2, triangulation=1).mesh

# %%
# Parts of the labelled animal, from its rest pose: body, head, forelegs, hind legs, tail.

x, y, z = labelled.rest.T
labels = np.select([z < 0.3 * z.max(), y > 0.45 * y.max(), y < 0.7 * y.min()], [1, 2, 3], 0)
labels[(labels == 1) & (y < 0)] = 4
names = ["body", "forelegs", "head", "tail", "hind legs"]

# %%
# The map leads from the scan to the labelled shape, so that labels can be pulled back. Integers are never
# averaged: each vertex gets the label of the vertex nearest to its image, or the value of ``fill`` if it has
# none.

result = match(scan, labelled.mesh)
on_scan = result.map.pull_back(labels, fill=-1)
for label, name in enumerate(names):
    print(
        f"{name}: {np.mean(labels == label):.1%} of the vertices there, {np.mean(on_scan == label):.1%} here"
    )

# %%
# One column for each label, and a colour for the largest, draws sharp borders.

palette = np.array(
    [[0.80, 0.72, 0.55], [0.0, 0.45, 0.70], [0.84, 0.37, 0.0], [0.80, 0.47, 0.65], [0.0, 0.62, 0.45]]
)
images = [
    surface_image(mesh, np.eye(5)[values], lambda columns: palette[columns.argmax(axis=1)])
    for mesh, values in ((scan, on_scan), (labelled.mesh, labels))
]
figure, _ = arranged_panels(images, ["scan, labels carried", "labelled by hand"], per_row=2)
figure.savefig("labels.png")
