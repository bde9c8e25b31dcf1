"""The recipe "Add a damage" of CONTRIBUTING.md: a shape stretched along an axis, in a benchmark."""

import numpy as np

from isomatch import Correspondence, Mesh
from isomatch.datasets import example_pair, ground_truth
from isomatch_lab.damage import DAMAGES, Damage, Damaged
from isomatch_lab.damage.damaged import require_usable
from isomatch_lab.evaluation import METHODS, BenchmarkRun, Method, run_benchmark

FACTORS = (0.0, 10.0)


def stretched(mesh, factor=1.5, *, seed=0):
    """Stretch a mesh along an axis that is drawn."""
    require_usable(mesh, "factor", factor, FACTORS)
    scale = np.where(np.arange(3) == np.random.default_rng(seed).integers(3), factor, 1.0)
    return Damaged(mesh, Mesh(mesh.vertices * scale, mesh.faces), np.arange(mesh.n_vertices))


def test_one_entry_makes_it_a_damage_of_benchmarks(monkeypatch, tmp_path):
    truth = ground_truth(*example_pair()).vertices
    given = []

    def method(source, target):
        given.append(target)
        return Correspondence(truth, target.n_vertices)

    monkeypatch.setitem(DAMAGES, "stretched", Damage(stretched, "factor", (1.2, 1.5, 3.0), 1.5, FACTORS))
    monkeypatch.setitem(METHODS, "right", Method(method, preparation=None))
    (row,) = run_benchmark(BenchmarkRun("example", ("right",), jobs=1, damage="stretched:3"), tmp_path)
    assert (row["damage"], row["error"]) == ("stretched:3", 0)
    extents = np.ptp(given[0].vertices, axis=0) / np.ptp(example_pair()[1].mesh.vertices, axis=0)
    np.testing.assert_allclose(np.sort(extents), [1, 1, 3])
