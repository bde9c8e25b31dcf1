"""
Landmarks that hold exactly
===========================

By default, landmarks lead to a map, and their images are those that fit best everywhere. With ``pin=0`` they are
exactly the points that you gave, and the map around them bends.
"""

import numpy as np

from isomatch import Config, distance_engine, farthest_point_sampling, match
from isomatch.visualization import ValuePanel, draw_map
from isomatch_lab.procedural import organ, organ_truth

source, target = organ("heart", 2500, pose=1), organ("heart", 2500, pose=2)
points = farthest_point_sampling(distance_engine(source.mesh), 5, start=0).vertices
landmarks = np.column_stack([points, organ_truth(source, target).vertices[points]])

free = match(source.mesh, target.mesh, landmarks=landmarks)
held = match(source.mesh, target.mesh, landmarks=landmarks, config=Config(pin=0))
for name, result in (("free", free), ("held", held)):
    print(f"{name}: {np.sum(result.map.vertices[points] == landmarks[:, 1])} of 5 landmarks are hit exactly")

# %%
# How far the images were moved. Far from the landmarks the map is what it was.

moved = target.mesh.vertices[held.map.vertices] - target.mesh.vertices[free.map.vertices]
share = np.linalg.norm(moved, axis=1) / target.mesh.area**0.5
draw_map(source.mesh, target.mesh, held.map, "pinned.png", values=ValuePanel(share, "distance moved / √area"))
