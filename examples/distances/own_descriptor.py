"""
Your own descriptor
===================

Functions that should correspond are a prior: a thickness, an activation, a learned feature. Give an array with a row
for each vertex, for either shape. Here, noisy features tell the two ends of a symmetric shape apart.
"""

import numpy as np

from isomatch import Config, match
from isomatch.cohort.shape_statistics import draw_values
from isomatch_lab.procedural import organ, organ_truth

source = organ("liver", 2500, symmetry="turn", pose=1)
target = organ("liver", 2500, symmetry="turn", pose=2)
plain = match(source.mesh, target.mesh)
print("without:", plain.outcome.name)

# %%
# As a network might give them: 32 smooth functions of the place on the body, with noise. Half a turn does not
# keep them.

directions, phases = np.random.default_rng(0).normal(0, 3, (3, 32)), np.arange(32)


def features(shape, seed):
    """(n, 32) values."""
    noise = np.random.default_rng(seed).normal(0, 0.1, (len(shape.rest), 32))
    return np.cos(shape.rest @ directions + phases) + noise


# %%
# Of two maps that fit equally well, descriptors alone do not choose. ``hypotheses="given"`` lets only their map win.

values = features(source, 0), features(target, 1)
result = match(source.mesh, target.mesh, initial_descriptors=values, config=Config(hypotheses="given"))
print("with:", result.outcome.name, "from:", result.origin)
print(f"score of the best alternative over that of this one: {result.quality.runner_up:.3f}")

# %%
# The outcome is honest: a map that the prior has excluded fits as well, or even better by a hair. The truth is
# known here.

apart = target.mesh.vertices[result.map.vertices] - target.mesh.vertices[organ_truth(source, target).vertices]
print(f"mean error: {np.linalg.norm(apart, axis=1).mean() / target.mesh.area**0.5:.3f} √area")

# %%
# One of the features on the source, and what the map brings there from the target.

clear = values[0].std(axis=0).argmax()
draw_values("source.png", source.mesh, values[0][:, clear] + 1, "feature of the source")
draw_values(
    "carried.png",
    source.mesh,
    result.map.pull_back(values[1])[:, clear] + 1,
    "feature carried from the target",
)
