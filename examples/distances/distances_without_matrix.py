"""
Distances without their matrix
==============================

Geodesic distances between any two vertices, from 50 numbers a vertex in place of a row of n.
"""

import numpy as np

from isomatch import distance_basis, geodesic_distances
from isomatch.cohort.shape_statistics import draw_values
from isomatch.datasets import example_pair

mesh = example_pair()[0].mesh
basis = distance_basis(mesh, k=50, p=100)
print(basis)
print(f"from vertex 10 to vertex 2000: {float(basis.distance(10, 2000)):.3f} mesh units")

# %%
# How good they are: compared with fast marching from 50 vertices.

sources = np.random.default_rng(0).choice(mesh.n_vertices, 50, replace=False)
measured = geodesic_distances(mesh, sources)
error = np.linalg.norm(basis.row(sources) - measured) / np.linalg.norm(measured)
print(f"relative error on {len(sources)} rows: {100 * error:.2f} %")
print(f"as the basis itself estimates it: {100 * basis.error_estimate():.2f} %")

full, kept = 8 * mesh.n_vertices**2, basis.vectors.nbytes + basis.values.nbytes
print(f"{kept / 1e6:.1f} MB in place of {full / 1e6:.1f} MB")

# %%
# A product with the whole matrix, which is never made: here the mean distance of each vertex from all others.

draw_values("mean_distance.png", mesh, basis @ mesh.vertex_areas / mesh.area, "mean distance, mesh units")
