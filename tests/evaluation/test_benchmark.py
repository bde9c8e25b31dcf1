"""Runs over a set: every pair is a row, interrupted runs go on, problems are told."""

import csv
from dataclasses import replace

import numpy as np
import pytest

from isomatch import Correspondence, FormatError, PreparedShape, SettingError, geodesic_distances
from isomatch.cli.bench import bench
from isomatch.datasets import BenchmarkPair, example_pair, ground_truth
from isomatch.datasets.benchmarks import BenchmarkSet, benchmark_set, relabelled
from isomatch.evaluation import (
    CONTINUATIONS,
    METHODS,
    BenchmarkRun,
    Method,
    benchmark,
    read_published_curves,
    read_rows,
    run_benchmark,
    summaries,
    true_landmarks,
    write_tables,
)


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
            return Correspondence(image, other.n_vertices)

        return Method(method, preparation=None)

    def broken(one, other):
        raise RuntimeError("no <map> today")

    chosen = BenchmarkSet("small", (("a", "b"), ("b", "c")), load)
    monkeypatch.setattr(benchmark, "benchmark_set", lambda name, folder: chosen)
    fakes = {
        "right": answer(truth),
        "flipped": answer(wrong[:, 1]),
        "broken": Method(broken, preparation=None),
    }
    for name, method in fakes.items():
        monkeypatch.setitem(METHODS, name, method)
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
    assert [row["problem"] for row in rows if row["method"] == "broken"] == [
        "RuntimeError: no <map> today"
    ] * 2
    assert all(float(row["direct"]) > 0 for row in rows if row["method"] == "flipped")
    right = [row for row in rows if row["method"] == "right"]
    assert all(float(row["auc"]) == float(row["within_05"]) == 1 for row in right)
    assert all(float(row["distortion_l2"]) == float(row["distortion_l2_truth"]) > 0 for row in right)
    assert all(0.5 < float(row["coverage"]) < 1 < float(row["smoothness"]) for row in right)
    assert {path.name for path in tmp_path.iterdir()} >= {"curves.png", "curves.svg", "summary.csv"}
    page = (tmp_path / "index.html").read_text(encoding="utf-8")
    assert "RuntimeError: no &lt;map&gt; today" in page
    assert "<map>" not in page
    assert "data:image/svg+xml;base64," in page
    assert "http" not in page.replace("http-equiv", ""), "nothing is loaded from elsewhere"


def test_what_continues_a_map_runs_the_method_once(small, monkeypatch, tmp_path):
    def turned(source, target, initial_map):
        return Correspondence(np.roll(initial_map, 7), target.n_vertices)

    monkeypatch.setitem(CONTINUATIONS, "turned", Method(turned, preparation=None))
    monkeypatch.setitem(CONTINUATIONS, "failing", None)
    run = BenchmarkRun("small", ("right+turned", "right+failing"), n_points=50, jobs=1)
    rows = list(run_benchmark(run, tmp_path))
    assert [row["method"] for row in rows] == ["right", *run.methods] * 2, "the start itself is told as well"
    assert len(small) == 2, "once for each pair"
    right, further, failed = rows[:3]
    assert right["error"] == 0 < further["error"]
    assert further["seconds"] > right["seconds"]
    assert "NoneType" in failed["problem"], "the others are kept"
    table = write_tables(tmp_path)
    assert [line["method"] for line in table] == ["right", "right+failing", "right+turned"]
    with (tmp_path / "improvements.csv").open() as file:
        gain = next(csv.DictReader(file))
    assert (gain["method"], gain["pairs"], float(gain["error_before"])) == ("right+turned", "2", 0)
    assert float(gain["error_after"]) == pytest.approx(further["error"], rel=1e-4)
    assert float(gain["error_smaller"]) == 0 == float(gain["distortion_l2_smaller"])
    assert "right+turned" in (tmp_path / "index.html").read_text(encoding="utf-8")
    with pytest.raises(SettingError, match=r"unknown method right\+magic; .* followed by \+isomatch or"):
        BenchmarkRun("small", ("right+gdd", "right+magic"))
    with pytest.raises(SettingError, match=r"unknown method right\+;"):
        BenchmarkRun("small", ("right+",))


def test_mirrored_truth_is_told_but_does_not_excuse_shapes_that_are_not_symmetric(
    small, monkeypatch, tmp_path
):
    chosen = benchmark.benchmark_set("small", None)
    lopsided = replace(chosen, load=lambda a, b: replace(chosen.load(a, b), symmetric=False))
    monkeypatch.setattr(benchmark, "benchmark_set", lambda name, folder: lopsided)
    row = next(run_benchmark(BenchmarkRun("small", ("flipped",), n_points=50, jobs=1), tmp_path))
    assert row["error"] == row["direct"] > row["mirrored"] == 0


def test_published_curves_of_the_sets_are_drawn_beside(small, tmp_path):
    curve = {"small|theirs|x": [0.0, 0.1], "small|theirs|y": [40.0, 90.0]}
    np.savez(tmp_path / "a.npz", **curve, **{"other|theirs|x": [0.0], "other|theirs|y": [1.0]})
    np.savez(tmp_path / "b.npz", **{"small|theirs|x": [0.0], "small|theirs|y": [0.0]})
    curves = read_published_curves(tmp_path)
    assert [(curve.set_name, curve.method) for curve in curves] == [("small", "theirs"), ("other", "theirs")]
    assert curves[0].shares.tolist() == [0.4, 0.9], "the first file that has it"
    list(run_benchmark(BenchmarkRun("small", ("right",), n_points=20, jobs=1), tmp_path / "out"))
    write_tables(tmp_path / "out", curves)
    drawn = (tmp_path / "out" / "curves.svg").read_text(encoding="utf-8")
    assert "theirs (published)" in drawn
    assert drawn.count("theirs (published)") == 1


def test_published_curves_that_cannot_be_read_are_told(tmp_path):
    with pytest.raises(FormatError, match="no published curves; expected"):
        read_published_curves(tmp_path)
    (tmp_path / "a.npz").write_text("nothing")
    with pytest.raises(FormatError, match="cannot be read as curves"):
        read_published_curves(tmp_path)


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


@pytest.fixture
def relabelled_pair():
    mesh = example_pair()[0].mesh
    other, new = relabelled(mesh, seed=3)
    return BenchmarkPair("a-b", mesh, other, np.column_stack([np.arange(len(new)), new]))


def test_true_landmarks(relabelled_pair):
    pair = relabelled_pair
    landmarks = true_landmarks(pair, 5, seed=1)
    truth = dict(pair.truth)
    assert all(truth[a] == b for a, b in landmarks)
    apart = geodesic_distances(pair.source, landmarks[:, 0])[:, landmarks[:, 0]]
    assert apart[~np.eye(5, dtype=bool)].min() > 0.3 * np.sqrt(pair.source.area)
    np.testing.assert_array_equal(landmarks, true_landmarks(pair, 5, seed=1))
    assert (landmarks != true_landmarks(pair, 5, seed=2)).any()


def test_wrong_rows_of_the_truth_are_no_landmarks(relabelled_pair):
    pair = relabelled_pair
    at = np.array([np.flatnonzero(pair.truth[:, 0] == a)[0] for a in true_landmarks(pair)[:, 0]])
    truth = pair.truth.copy()
    truth[at, 1] = np.roll(truth[at, 1], 1)
    drawn = true_landmarks(replace(pair, truth=truth))
    assert not set(drawn[:, 0]) & set(at)


def test_methods_share_landmarks_and_prepared_shapes(small, monkeypatch, tmp_path):
    given = []

    def method(source, target, **hints):
        given.append((source, hints))
        return Correspondence(np.zeros(source.mesh.n_vertices, dtype=int), target.mesh.n_vertices)

    for name, count in (("blind", 0), ("led", 5)):
        monkeypatch.setitem(METHODS, name, Method(method, count))
    monkeypatch.setitem(CONTINUATIONS, "again", Method(method))
    run = BenchmarkRun("small", ("blind", "led", "led+again"), n_pairs=1, n_points=20, jobs=1)
    blind, led, again = run_benchmark(run, tmp_path)
    (shape, nothing), (same, landmarks), (still, start) = given
    assert isinstance(shape, PreparedShape)
    assert shape is same is still
    assert nothing == {}
    pair = benchmark.benchmark_set("small", None).load("a", "b")
    np.testing.assert_array_equal(landmarks["landmarks"], true_landmarks(pair))
    assert (start["initial_map"] == 0).all()
    prepared = 2 * min(shape.seconds, 0.01)
    assert min(blind["seconds"], led["seconds"]) > prepared
    assert again["seconds"] < 1.5 * led["seconds"], "one preparation is counted once"


def test_command_line_names_every_method():
    assert all(name in bench.__doc__ for name in METHODS)


def test_phi_runs_as_a_method(relabelled_pair):
    found, told = METHODS["phi"](
        relabelled_pair.source, relabelled_pair.target, {"landmarks": true_landmarks(relabelled_pair)}
    )
    assert (found.vertices == relabelled_pair.truth[:, 1]).mean() > 0.95
    assert told["outcome"] == "CONVERGED"
