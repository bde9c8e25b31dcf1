"""
How far to trust each vertex
============================

A map may be right as a whole and poor in places. ``expected_error`` estimates the error of each image, without
knowing the truth. Here, the truth is known, and drawn for comparison.
"""

import numpy as np

from isomatch import match
from isomatch.datasets import organ, organ_truth
from isomatch.evaluation import geodesic_errors
from isomatch.view import ValuePanel, draw_map

source, target = organ("heart", 2500, style=1, pose=3), organ("heart", 2500, style=1, pose=4)
result = match(source.mesh, target.mesh)
draw_map(
    source.mesh,
    target.mesh,
    result.map,
    "expected.png",
    values=ValuePanel(result.expected_error, "expected error / √area"),
)

# %%
# The true errors: geodesic distances between the image of each vertex and where it belongs.

truth = organ_truth(source, target).vertices
pairs = np.column_stack([np.arange(len(truth)), truth])
errors = geodesic_errors(target.mesh, result.map, pairs)
draw_map(source.mesh, target.mesh, result.map, "true.png", values=ValuePanel(errors, "true error / √area"))

# %%
# Weigh what you compute by the confidence, and look first where it is low.

doubtful = np.argsort(result.confidence)[: len(errors) // 10]
print(f"mean error: {errors.mean():.4f} √area; of the least sure tenth: {errors[doubtful].mean():.4f} √area")
