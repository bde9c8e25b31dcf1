"""
Where two shapes look different
===============================

A map may be right although the shapes differ: one animal has a longer snout, one scan a fold that the other lacks.
``result.descriptor_distance`` compares how the surfaces bulge, and how thick they are, around each point and its image.
"""

import numpy as np

from isomatch import Mesh, match
from isomatch.visualization import ValuePanel, draw_map, write_report
from isomatch_lab.procedural import creature

lean, other = (
    creature(3000, pose=1, symmetric=True),
    creature(3000, pose=2, symmetric=True, triangulation=1).mesh,
)

# %%
# The first one gets a hump on its back: points near one vertex are moved along their normals.

vertices, normals = lean.mesh.vertices, lean.mesh.vertex_normals
top = int(np.argmax(lean.rest[:, 2] - 2 * np.abs(lean.rest[:, 1])))
distance = np.linalg.norm(vertices - vertices[top], axis=1) / lean.mesh.area**0.5
humped = Mesh(
    vertices + 0.15 * lean.mesh.area**0.5 * np.exp(-((distance / 0.08) ** 2))[:, None] * normals,
    lean.mesh.faces,
)

result = match(humped, other)
print(f"{result.outcome.name}; mean descriptor distance {result.quality.descriptor_distance:.2f}")
draw_map(
    humped,
    other,
    result.map,
    "descriptor_distance.png",
    values=ValuePanel(result.descriptor_distance, "descriptor distance"),
)

# %%
# It is largest at the hump. The report has it as a layer, beside the expected error: choose the colour "descriptor
# distance".

near = distance < 0.08
for place, chosen in (("at the hump", near), ("elsewhere", ~near)):
    print(f"median descriptor distance {place}: {np.nanmedian(result.descriptor_distance[chosen]):.2f}")
write_report("where_shapes_differ.html", humped, other, result)
