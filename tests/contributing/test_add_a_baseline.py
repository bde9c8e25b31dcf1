"""CONTRIBUTING.md, "Add a baseline", followed: a method of our own, run by its name."""

from dataclasses import dataclass

import numpy as np
import pytest

from isomatch import LandmarkError, Outcome, match
from isomatch._core.settings import Settings, setting
from isomatch.correspondence import Embedding
from isomatch.settings import Orientation
from isomatch_lab.baselines import Baseline
from isomatch_lab.baselines.task import Task
from isomatch_lab.evaluation import METHODS, BenchmarkRun, run_benchmark
from isomatch_lab.evaluation.methods import methods_of
from isomatch_lab.procedural import creature
from shapes import disguised


@dataclass(frozen=True)
class SignatureConfig(Settings):
    """Settings of the toy: the weight of the signatures."""

    weight: float = setting(1.0, least=0)
    orientation: Orientation = "any"


def nearest_signatures(
    source, target, landmarks=None, initial_map=None, initial_descriptors=None, config=None, seed=0
):
    """Match vertices of nearest point signatures."""
    config = config or SignatureConfig()
    task = Task.of(source, target, landmarks, initial_map, initial_descriptors, seed)
    embedding = Embedding(*(config.weight * values for values in task.pair.signatures))
    return task.result(embedding, config, "signatures")


TOY = {"toy": Baseline(nearest_signatures, SignatureConfig())}


@pytest.fixture(scope="module")
def animal():
    return creature(1500).mesh


@pytest.mark.long
def test_a_relabelled_copy_gives_the_relabelling(animal):
    other = disguised(animal, seed=1)
    found = nearest_signatures(animal, other.mesh)
    assert (found.map.vertices == other.new_vertex).mean() > 0.9
    assert isinstance(found.outcome, Outcome)
    assert np.isnan(found.quality.runner_up)
    assert found.to_dict()["config"] == {"weight": 1.0, "orientation": "any"}
    assert type(found) is type(match(animal, animal))


@pytest.mark.long
def test_priors_are_checked_as_match_checks_them(animal):
    with pytest.raises(LandmarkError, match="2 landmarks do not fix"):
        nearest_signatures(animal, animal, landmarks=[[0, 1], [2, 3]])


@pytest.mark.long
def test_the_benchmark_runs_it_by_name(monkeypatch, tmp_path):
    made = methods_of(TOY)
    assert list(made) == ["toy", "toy_5pt"]
    for name, method in made.items():
        monkeypatch.setitem(METHODS, name, method)
    rows = list(run_benchmark(BenchmarkRun("example", ("toy",), n_points=100, jobs=1), tmp_path))
    assert rows[0]["method"] == "toy"
    assert "problem" not in rows[0]
