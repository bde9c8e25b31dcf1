"""Memory and error of the basis of a large surface, measured in a process of its own."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = """
import json, resource
import numpy as np
from isomatch import distance_basis, distance_engine
from isomatch_lab.procedural import creature
from shapes import planar_delaunay

distance_basis(planar_delaunay(500), 5, 10)  # compiles
mesh = creature(100_000).mesh
basis = distance_basis(mesh)
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
engine = distance_engine(mesh)
missed = whole = 0.0
for rows in np.array_split(np.random.default_rng(9).choice(mesh.n_vertices, 200, replace=False), 10):
    columns = engine.distances_from(rows)
    missed += (basis.weights * (basis.row(rows) - columns) ** 2).sum()
    whole += (basis.weights * columns**2).sum()
error = float(np.sqrt(missed / whole))
print(json.dumps({"gib": peak, "error": error, "estimate": basis.error_estimate()}))
"""


@pytest.mark.long
def test_a_hundred_thousand_vertices():
    """2 GiB at the peak, and the error on 200 random columns."""
    folders = [str(Path(__file__).parents[1]), *filter(None, sys.path)]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(folders)}
    run = subprocess.run(
        [sys.executable, "-c", SCRIPT], capture_output=True, text=True, check=True, env=environment
    )
    measured = json.loads(run.stdout.splitlines()[-1])
    assert measured["gib"] < 2.0, measured
    assert measured["error"] < 0.015, measured
    assert measured["estimate"] == pytest.approx(measured["error"], rel=0.4)
