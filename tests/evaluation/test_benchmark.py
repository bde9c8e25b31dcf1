"""Runs over a set: every pair is a row, interrupted runs go on, problems are told."""

import csv

import numpy as np
import pytest

from isomatch import Correspondence, FormatError, SettingError
from isomatch.datasets import BenchmarkPair, example_pair, ground_truth
from isomatch.datasets.benchmarks import BenchmarkSet, benchmark_set, relabelled
from isomatch.evaluation import BenchmarkRun, benchmark, read_rows, run_benchmark, summaries, write_tables


@pytest.fixture
def small(monkeypatch):
    """A set of two pairs and three methods: the truth, its mirror truth, and one that fails."""
    source, target = example_pair()
    truth = ground_truth(source, target).vertices
    pairs = np.column_stack([np.arange(len(truth)), truth])
    wrong = np.column_stack([np.arange(len(truth)), np.roll(truth, 1)])
    calls = []

    def load(a, b):
        return BenchmarkPair(f"{a}-{b}", source.mesh, target.mesh, pairs, wrong)

    def answer(image):
        def method(one, other):
            calls.append(one)
            return Correspondence(image, other.n_vertices), {"outcome": "CONVERGED"}

        return method

    def broken(one, other):
        raise RuntimeError("no map today")

    chosen = BenchmarkSet("small", (("a", "b"), ("b", "c")), load)
    monkeypatch.setattr(benchmark, "benchmark_set", lambda name, folder: chosen)
    monkeypatch.setattr(
        benchmark,
        "METHODS",
        {"right": answer(truth), "flipped": answer(wrong[:, 1]), "broken": broken},
    )
    return calls


def test_rows_tables_and_resuming(small, tmp_path):
    run = BenchmarkRun("small", ("right", "flipped", "broken"), n_points=50, jobs=1)
    assert len(list(run_benchmark(run, tmp_path))) == 6
    assert len(small) == 4
    again = list(run_benchmark(run, tmp_path))
    assert [row["method"] for row in again] == ["broken"] * 2, "only what failed is tried again"
    assert len(small) == 4
    table = {row["method"]: row for row in write_tables(tmp_path)}
    assert table["right"]["mean"] == 0
    assert table["flipped"]["mean"] == 0, "one decision for the pair between direct and mirrored truth"
    assert table["broken"]["problems"] == 2
    assert table["broken"]["mean"] is None
    with (tmp_path / "pairs.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [row["problem"] for row in rows if row["method"] == "broken"] == ["RuntimeError: no map today"] * 2
    assert all(float(row["direct"]) > 0 for row in rows if row["method"] == "flipped")
    assert {path.name for path in tmp_path.iterdir()} >= {"curves.png", "curves.svg", "summary.csv"}


def test_failures_are_counted():
    rows = [{"set": "s", "method": "m", "error": error, "seconds": 1.0} for error in (1.0, 9.9, 10.1)]
    assert summaries(rows)[0]["failures"] == 1


def test_nothing_run_yet(tmp_path):
    assert read_rows(tmp_path) == []
    assert write_tables(tmp_path) == []


def test_unknown_names_are_told():
    with pytest.raises(SettingError, match="unknown method magic; known are isomatch"):
        BenchmarkRun("creatures", ("magic",))
    with pytest.raises(FormatError, match="unknown benchmark set 'horses'; known are faust_r"):
        benchmark_set("horses")
    with pytest.raises(FormatError, match="benchmark set scape not found in None"):
        benchmark_set("scape")


def test_relabelling_moves_the_surface_and_nothing_else():
    mesh = example_pair()[0].mesh
    other, new = relabelled(mesh, seed=3)
    assert (np.sort(new) == np.arange(mesh.n_vertices)).all()
    assert (new != np.arange(mesh.n_vertices)).mean() > 0.99
    assert other.area == pytest.approx(mesh.area)
    assert other.volume == pytest.approx(mesh.volume), "a rotation, not a reflection"
    lengths, others = (
        np.linalg.norm(m.vertices[a] - m.vertices[b], axis=1)
        for m, (a, b) in ((mesh, mesh.edges.T), (other, new[mesh.edges].T))
    )
    np.testing.assert_allclose(lengths, others)


def test_drawing_pairs_keeps_their_order():
    every = benchmark_set("creatures")
    some = every.chosen(5, seed=2)
    places = [every.pairs.index(pair) for pair in some.pairs]
    assert len(set(places)) == 5
    assert places == sorted(places)
    assert every.chosen(None) is every
