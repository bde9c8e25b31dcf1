"""Geodesic distances between any two vertices, from 50 numbers a vertex in place of a row of n.

Run it with ``python examples/distances_without_matrix.py``.
"""

import numpy as np

from isomatch import distance_basis, geodesic_distances
from isomatch.datasets import example_pair

mesh = example_pair()[0].mesh
basis = distance_basis(mesh, k=50, p=100)
print(basis)
print(f"from vertex 10 to vertex 2000: {float(basis.distance(10, 2000)):.3f} mesh units")

sources = np.random.default_rng(0).choice(mesh.n_vertices, 50, replace=False)
measured = geodesic_distances(mesh, sources)
error = np.linalg.norm(basis.row(sources) - measured) / np.linalg.norm(measured)
print(f"relative error on {len(sources)} rows: {100 * error:.2f} %")

full, kept = 8 * mesh.n_vertices**2, basis.vectors.nbytes + basis.values.nbytes
print(f"{kept / 1e6:.1f} MB in place of {full / 1e6:.1f} MB")
