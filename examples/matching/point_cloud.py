"""
A point cloud
=============

Points without triangles can be matched, too. Such maps rest on distances and spectra alone, which do not tell a
shape from its mirror image, so give landmarks where that matters.
"""

import matplotlib.pyplot as plt
import numpy as np

from isomatch import PointCloud, distance_engine, farthest_point_sampling, match
from isomatch.datasets import ground_truth
from isomatch.visualization import position_colours, to_screen
from isomatch_lab.procedural import creature

scanned, model = creature(3000, pose=1), creature(3000, pose=2, triangulation=1)
points = PointCloud(scanned.mesh.vertices)

marked = farthest_point_sampling(distance_engine(scanned.mesh), 5, start=0).vertices
truth = ground_truth(scanned, model).vertices
result = match(points, model.mesh, landmarks=np.column_stack([marked, truth[marked]]))
print(f"{result.outcome.name}: {result.outcome.advice}")

# %%
# Each point has the colour of its image on the mesh.

colours = position_colours(model.mesh)
figure = plt.figure(figsize=(9, 4.5))
for k, (xyz, paint) in enumerate(
    [(points.vertices, result.map.pull_back(colours)), (model.mesh.vertices, colours)], 1
):
    axes = figure.add_subplot(1, 2, k, projection="3d")
    axes.scatter(*xyz.T, c=to_screen(paint), s=3)
    axes.set_box_aspect(np.ptp(xyz, axis=0), zoom=1.3)
    axes.set_axis_off()
    axes.view_init(15, -20)
figure.tight_layout()

error = np.linalg.norm(model.mesh.vertices[result.map.vertices] - model.mesh.vertices[truth], axis=1)
print(f"mean error, straight through space: {np.mean(error) / model.mesh.area**0.5:.3f} √area")
