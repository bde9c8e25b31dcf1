"""The budget counts the work that calls really do."""

from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from isomatch import geodesic_distances
from isomatch.correspondence import nearest_rows
from isomatch.datasets import example_pair
from isomatch_lab.studies.budget import FRONTS, POINTS, ROUTINES, WorkCounter


@pytest.fixture(scope="module")
def counter():
    mesh = example_pair()[0].mesh
    made = WorkCounter()
    made.run(lambda: geodesic_distances(mesh, [0, 5, 9]))
    return mesh, made


def test_each_source_visits_each_vertex_once(counter):
    mesh, made = counter
    assert made.work[""]["visits"] == 3 * mesh.n_vertices
    assert set(made.least[""]) == {FRONTS}


def test_products_are_counted_on_all_threads():
    made, points = WorkCounter(), np.random.default_rng(0).random((70, 4))
    made.run(lambda: nearest_rows(points[:20], points))
    assert made.work[""] == {"visits": 0, "operations": 2 * 70 * 20 * 4}
    assert set(made.least[""]) == {POINTS}


@pytest.mark.parametrize("routine", ROUTINES, ids="-".join)
def test_routines_are_where_the_budget_looks_for_them(routine):
    module, name = routine
    if module.startswith("numpy"):
        pytest.importorskip(module)
    assert f"def {name}(" in Path(import_module(module).__file__).read_text(encoding="utf-8")
