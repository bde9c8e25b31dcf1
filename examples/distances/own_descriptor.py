"""
Your own descriptor
===================

Functions that should correspond are a hint: a thickness, an activation, a learned feature. Give an array with a row
for each vertex, for either shape. Here, two noisy measurements tell the two ends of a symmetric shape apart.
"""

import numpy as np

from isomatch import Config, match
from isomatch.datasets import organ
from isomatch.statistics import draw_values

source = organ("liver", 2500, symmetry="turn", pose=1)
target = organ("liver", 2500, symmetry="turn", pose=2)
plain = match(source.mesh, target.mesh)
print("without:", plain.outcome.name)


def measured(shape, seed):
    """Two noisy values at each vertex, which half a turn does not keep."""
    return shape.rest[:, :2] + np.random.default_rng(seed).normal(0, 0.1, (len(shape.rest), 2))


values = measured(source, 0), measured(target, 1)
result = match(source.mesh, target.mesh, initial_descriptors=values, config=Config(hypotheses="given"))
print("with:", result.outcome.name, "from:", result.origin)
print(result.reason)

# %%
# What was measured on the source, and what the map brings there from the target. It is smoother where the images of
# neighbours lie in one triangle.

lowest = values[0].min()
draw_values("source.png", source.mesh, values[0][:, 0] - lowest, "measured on the source")
draw_values(
    "carried.png", source.mesh, result.map.pull_back(values[1])[:, 0] - lowest, "carried from the target"
)
