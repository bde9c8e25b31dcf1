"""
A wrong map, and how it is told
===============================

A single view shows half of a body. Such scans are mostly matched wrongly, and reported so. Use a map that ended in
another way than ``CONVERGED`` or ``PARTIAL`` only after you have looked at it.
"""

import numpy as np

from isomatch import match
from isomatch.datasets import ground_truth
from isomatch.view import ValuePanel, draw_map
from isomatch_lab.damage import view
from isomatch_lab.procedural import creature

whole = creature(3000, kind="biped")
posed = creature(3000, kind="biped", pose=2, triangulation=1)
seen = view(posed.mesh, seed=1)

result = match(seen.mesh, whole.mesh)
print(f"{result.outcome.name}: {result.outcome.advice}")
print(*result.notes, sep="\n")

# %%
# The truth is known here, and the panel on the right shows how far the images are from it, straight through space.

truth = ground_truth(posed, whole).vertices[seen.original]
error = np.linalg.norm(whole.mesh.vertices[result.map.vertices] - whole.mesh.vertices[truth], axis=1)
shown = ValuePanel(error / whole.mesh.area**0.5, "error / √area", highest=0.5)
draw_map(seen.mesh, whole.mesh, result.map, "view.png", titles=("one view", "whole"), values=shown)
