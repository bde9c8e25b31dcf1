"""
Give landmarks
==============

Landmarks are pairs (source vertex, target vertex) that you know. Three are enough, five far from each other are
better. Automatic maps compete with them: a wrong landmark is contradicted, not obeyed.
"""

import numpy as np

from isomatch import distance_engine, farthest_point_sampling, match
from isomatch.visualization import draw_map
from isomatch_lab.procedural import organ, organ_truth

source = organ("kidney", 2500, symmetry="turn", pose=1)
target = organ("kidney", 2500, symmetry="turn", pose=2)

# %%
# Half a turn carries this body onto itself, so two maps are equally good.

plain = match(source.mesh, target.mesh)
print("without landmarks:", plain.outcome.name)

# %%
# Here the landmarks are taken from the known truth. Your own come from a file (:func:`isomatch.read_landmarks`), from
# positions (:func:`isomatch.nearest_landmarks`), or from clicks in the report of a match.

points = farthest_point_sampling(distance_engine(source.mesh), 5, start=0).vertices
landmarks = np.column_stack([points, organ_truth(source, target).vertices[points]])
result = match(source.mesh, target.mesh, landmarks=landmarks)
print("with landmarks:", result.outcome.name)
print(f"distance of their images from where they should be: {result.quality.landmark_error:.3f} √area")

draw_map(source.mesh, target.mesh, result.map, "landmarks.png")

# %%
# Two landmarks that are exchanged are noticed.

wrong = landmarks.copy()
wrong[[0, 1], 1] = wrong[[1, 0], 1]
doubtful = match(source.mesh, target.mesh, landmarks=wrong)
print("with two exchanged:", doubtful.outcome.name)
print(*doubtful.notes, sep="\n")
