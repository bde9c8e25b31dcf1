"""
Continue from the map of another method
=======================================

A map of any method can be given as a start: one target vertex for each source vertex, −1 where unknown. It is
refined, and it wins unless another map fits better.
"""

import numpy as np

from isomatch import match
from isomatch.datasets import example_pair, ground_truth
from isomatch.visualization import draw_map

source, target = example_pair()
truth = ground_truth(source, target).vertices

# %%
# As an example, a map of a few hundred vertices, each of which lands somewhere near its right place.

rng = np.random.default_rng(0)
known = rng.choice(source.mesh.n_vertices, 300, replace=False)
rough = np.full(source.mesh.n_vertices, -1)
places = target.mesh.vertices[truth[known]] + rng.normal(0, 0.05, (300, 3))
distances = np.linalg.norm(target.mesh.vertices[None] - places[:, None], axis=2)
rough[known] = distances.argmin(axis=1)

result = match(source.mesh, target.mesh, initial_map=rough)
print(f"{result.outcome.name}, from: {result.origin}")


def error(image, rows):
    """Mean distance from the right place, straight through space, in √area."""
    apart = target.mesh.vertices[image[rows]] - target.mesh.vertices[truth[rows]]
    return np.linalg.norm(apart, axis=1).mean() / target.mesh.area**0.5


print(f"error of the rough map: {error(rough, known):.3f} √area")
print(f"after matching:         {error(result.map.vertices, np.arange(len(truth))):.3f} √area")
draw_map(source.mesh, target.mesh, result.map, "refined.png")
