"""A creature of 1500 vertices and its distances, which several tests of bases share."""

import numpy as np
import pytest

from isomatch import geodesic_distances
from isomatch_lab.procedural import creature


@pytest.fixture(scope="session")
def mesh():
    return creature(1500).mesh


@pytest.fixture(scope="session")
def all_distances(mesh):
    full = geodesic_distances(mesh, np.arange(mesh.n_vertices))
    return (full + full.T) / 2
