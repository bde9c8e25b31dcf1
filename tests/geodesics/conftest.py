"""What the tests of distances share: every engine for meshes, and a mesh that is no manifold."""

import numpy as np
import pytest

from isomatch import Mesh, MissingDependencyError
from isomatch.geodesics import distance_engine, engine_names
from shapes import flat_grid, icosphere
from zoo.made import together


@pytest.fixture(params=engine_names(Mesh))
def name(request):
    """Every registered engine for meshes; an engine whose package is not installed is skipped."""
    try:
        distance_engine(icosphere(0), request.param)
    except MissingDependencyError as error:
        pytest.skip(str(error))
    return request.param


@pytest.fixture(scope="session")
def book():
    """Three square pages of 5 × 5 vertices that meet at the spine, x = 0 of each; and the page in the plane."""
    page = flat_grid(5, 5)
    turns = [np.array([[c, s, 0], [0, 0, 1], [s, -c, 0]]) for c, s in ((1, 0), (0, 1), (-1, 0))]
    return together(*(page.moved(page.vertices @ turn) for turn in turns)), page
