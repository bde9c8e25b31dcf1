"""Fast marching against exact geodesics (Mitchell, Mount & Papadimitriou, in pygeodesic)."""

import numpy as np
import pytest

from data import tosca
from isomatch import geodesic_distances
from isomatch_lab.procedural import creature

exact_package = pytest.importorskip("pygeodesic.geodesic", reason="needs pygeodesic")


def mean_relative_errors(mesh, sources):
    exact = exact_package.PyGeodesicAlgorithmExact(mesh.vertices, mesh.faces.astype(np.int32))
    computed = geodesic_distances(mesh, sources)
    errors = []
    for source, row in zip(sources, computed):
        truth, _ = exact.geodesicDistances(np.array([source]), None)
        away = truth > 0
        errors.append(np.abs(row[away] / truth[away] - 1).mean())
    return np.array(errors)


@pytest.mark.long
@pytest.mark.parametrize("pose", [0, 2])
def test_creature(pose):
    mesh = creature(5000, pose=pose).mesh
    sources = np.random.default_rng(pose).integers(mesh.n_vertices, size=5)
    assert mean_relative_errors(mesh, sources).mean() < 0.003


@pytest.mark.long
def test_cat():
    mesh = tosca("cat0")
    sources = np.random.default_rng(0).integers(mesh.n_vertices, size=6)
    assert mean_relative_errors(mesh, sources).mean() < 0.003
