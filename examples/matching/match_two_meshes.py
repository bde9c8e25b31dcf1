"""
Match two meshes
================

Two poses of an animal, with different triangulations, are matched without any prior. Corresponding points have the
same colour. The animals are made by isomatch, so the exact truth is known, and the error can be measured.
"""

import numpy as np

from isomatch import match
from isomatch.datasets import example_pair, ground_truth
from isomatch.evaluation import geodesic_errors
from isomatch.visualization import draw_map

source, target = example_pair()
result = match(source.mesh, target.mesh)
print(f"{result.outcome.value}: {result.outcome.advice}")

draw_map(source.mesh, target.mesh, result.map, "match_two_meshes.png")

# %%
# The map leads from the source to the target. Functions go the other way: values on the target are pulled back to the
# source.

height = result.map.pull_back(target.mesh.vertices[:, 2])
print(f"image of source vertex 0: target vertex {result.map.vertices[0]}, at height {height[0]:.3f}")

# %%
# Errors are geodesic distances on the target, divided by the square root of its area.

truth = ground_truth(source, target).vertices
pairs = np.column_stack([np.arange(len(truth)), truth])
errors = geodesic_errors(target.mesh, result.map, pairs, n_points=500, seed=0)
print(f"mean geodesic error: {100 * errors.mean():.2f} % of √(target area)")
