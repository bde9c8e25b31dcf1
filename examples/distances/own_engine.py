"""
Your own distances
==================

All that matching needs of a metric is its columns: distances from one point to all others. A matrix, a function or
an engine will do. Here, paths along the edges of the mesh cost more where the surface is low, as if the animal
waded through water.
"""

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from isomatch import distance_basis, geodesic_distances, prepare
from isomatch.cohort.shape_statistics import draw_values
from isomatch.datasets import example_pair
from isomatch.geodesics import ColumnEngine

mesh = example_pair()[0].mesh


class Wading(ColumnEngine):
    """Shortest paths along edges that are three times as long below the water."""

    name = "wading"

    def __init__(self, mesh, water):
        self.n_points = mesh.n_vertices
        i, j = mesh.edges.T
        wet = (mesh.vertices[i, 2] + mesh.vertices[j, 2]) / 2 < water
        self.graph = csr_array((mesh.edge_lengths * np.where(wet, 3, 1), (i, j)), shape=(self.n_points,) * 2)

    def _columns(self, sources):
        return dijkstra(self.graph, directed=False, indices=sources)


low, high = mesh.vertices[:, 2].min(), mesh.vertices[:, 2].max()
engine = Wading(mesh, water=low + 0.4 * (high - low))
print("distances from two vertices:", engine.distances_from([0, 5]).shape)

# %%
# Wherever distances are used, the engine can be given: in a basis, in farthest point sampling, and in a match, by
# ``match(prepare(mesh, distances=engine), ...)``.

basis = distance_basis(engine, k=30)
print(basis, f"with an error of {basis.error_estimate():.1%}")
ready = prepare(mesh, distances=engine)
print(ready.distances.engine)

# %%
# From the nose, dry and wading.

nose = int(mesh.vertices[:, 1].argmax())
draw_values("dry.png", mesh, geodesic_distances(mesh, [nose])[0], "distance, mesh units")
draw_values("wading.png", mesh, engine.distances_from([nose])[0], "distance, wading")
