"""The shapes that all benchmarks run on; run with ``pytest benchmarks/bench_*.py -s``."""

import os
from pathlib import Path

import numpy as np
import pytest

from isomatch import Mesh
from isomatch_lab.procedural import creature

_BESIDE = Path(__file__).parents[2] / "shared" / "data"
DATA = Path(os.environ.get("ISOMATCH_DATA", _BESIDE))


@pytest.fixture(scope="session", params=["creature 28k", "cat0"])
def large_mesh(request) -> Mesh:
    """Make a procedural animal; load the cat of TOSCA where its file is present."""
    if request.param == "creature 28k":
        return creature(28_000).mesh
    path = DATA / "tosca" / "cat.npz"
    if not path.exists():
        pytest.skip("needs tosca/cat.npz; set ISOMATCH_DATA")
    with np.load(path, allow_pickle=False) as poses:
        return Mesh(poses["cat0"], poses["faces"])
