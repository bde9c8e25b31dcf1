"""
How far to trust each vertex
============================

A map may be right as a whole and poor in places. ``expected_error`` estimates the error of each image, without
knowing the truth. Here, a body is cut, and the truth is drawn for comparison.
"""

import numpy as np

from isomatch import match
from isomatch.datasets import ground_truth
from isomatch.visualization import ValuePanel, draw_map
from isomatch_lab.damage import cut
from isomatch_lab.procedural import creature

posed, whole = creature(2500, pose=1), creature(2500, pose=2, triangulation=1)
part = cut(posed.mesh, 0.4, seed=1)
result = match(part.mesh, whole.mesh)
expected = ValuePanel(result.expected_error, "expected error / √area")
draw_map(part.mesh, whole.mesh, result.map, "expected.png", values=expected)

# %%
# The true errors, straight through space. They are large near the cut, as expected, but the estimate knows nothing of
# single vertices: it is an average over images like this one.

truth = ground_truth(posed, whole).vertices[part.original]
errors = np.linalg.norm(whole.mesh.vertices[result.map.vertices] - whole.mesh.vertices[truth], axis=1)
errors /= whole.mesh.area**0.5
draw_map(part.mesh, whole.mesh, result.map, "true.png", values=ValuePanel(errors, "true error / √area"))

# %%
# Weigh what you compute by the confidence, and look first where it is low.

order = np.argsort(result.confidence)
tenth = len(order) // 10
print(f"mean error of all vertices:      {errors.mean():.4f} √area")
print(f"mean error of the surest tenth:  {errors[order[-tenth:]].mean():.4f} √area")
print(f"mean error of the least sure:    {errors[order[:tenth]].mean():.4f} √area")
