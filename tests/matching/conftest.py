"""Two poses of an animal, which several files match under different conditions."""

import pytest

from isomatch.datasets import ground_truth
from isomatch_lab.procedural import creature


@pytest.fixture(scope="session")
def bodies():
    """Two poses of an animal, and the true image of each vertex."""
    source, target = (creature(1500, pose=i, triangulation=i) for i in (1, 2))
    return source.mesh, target.mesh, ground_truth(source, target).vertices
