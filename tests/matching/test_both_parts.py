"""Two shapes that show overlapping parts of one body."""

import numpy as np
import pytest

from isomatch import Config, Mesh, Outcome, match, prepare
from isomatch.datasets import creature, ground_truth
from isomatch.lab.damage import cut
from isomatch.lab.sets import relabelled
from isomatch.matching import BothParts, Hints, ShapePair, prepare_pair

pytestmark = pytest.mark.usefixtures("prepared_once")


@pytest.fixture(scope="module")
def parts():
    """Parts of two poses of an asymmetric quadruped, and the image of each vertex of the first, −1 where it has none."""
    first, second = (creature(2000, triangulation=i, pose=i) for i in (1, 2))
    target, new = relabelled(second.mesh, 0)
    here, there = cut(first.mesh, 0.4, seed=1), cut(target, 0.4, seed=3)
    image = there.damaged_vertex[new[ground_truth(first, second).vertices][here.original]]
    return here.mesh, there.mesh, image
