"""Match two animals without any hint, carry values over, and measure the error against the exact truth.

Run it with ``python examples/match_two_meshes.py``; it writes ``match_two_meshes.png`` where it is run.
"""

import numpy as np

from isomatch import match
from isomatch.datasets import example_pair, ground_truth
from isomatch.evaluation import geodesic_errors
from isomatch.view import draw_map

source, target = example_pair()
result = match(source.mesh, target.mesh)
print(f"{result.outcome.value}: {result.outcome.advice}")

height = result.map.pull_back(target.mesh.vertices[:, 2])
print(f"image of source vertex 0: target vertex {result.map.vertices[0]}, at height {height[0]:.3f}")

truth = ground_truth(source, target).vertices
pairs = np.column_stack([np.arange(len(truth)), truth])
errors = geodesic_errors(target.mesh, result.map, pairs, n_points=500, seed=0)
print(f"mean geodesic error: {100 * errors.mean():.2f} % of √(target area)")

draw_map(source.mesh, target.mesh, result.map, "match_two_meshes.png")
