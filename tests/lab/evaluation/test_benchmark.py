"""Runs over a set: every pair is a row, interrupted runs continue, problems are reported."""

import csv
import json
import re
from dataclasses import asdict, dataclass, replace
from zlib import crc32

import numpy as np
import pytest
from matplotlib.figure import Figure

from isomatch import (
    Config,
    Correspondence,
    FormatError,
    LandmarkError,
    MissingFileError,
    PreparedShape,
    SettingError,
    geodesic_distances,
)
from isomatch.cli import main
from isomatch.datasets import example_pair, ground_truth
from isomatch.evaluation import counted, cycle_errors
from isomatch_lab.commands.bench import bench
from isomatch_lab.damage import DAMAGES, weld
from isomatch_lab.evaluation import (
    CONTINUATIONS,
    METHODS,
    BenchmarkRun,
    Method,
    PublishedCurve,
    improvements,
    read_published_curves,
    read_rows,
    rows_of,
    run_benchmark,
    summaries,
    true_landmarks,
    write_tables,
)
from isomatch_lab.evaluation.curves import curve_panels
from isomatch_lab.evaluation.methods import settings_digest
from isomatch_lab.sets import BenchmarkPair, BenchmarkSet, benchmark_set
from isomatch_lab.sets.benchmarks import MADE, relabelled


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
    monkeypatch.setitem(MADE, "small", lambda: chosen)
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
    assert all(0.5 < float(row["image_area"]) < 1 < float(row["smoothness"]) for row in right)
    assert {path.name for path in tmp_path.iterdir()} >= {"curves.png", "curves.svg", "summary.csv"}
    page = (tmp_path / "index.html").read_text(encoding="utf-8")
    assert "RuntimeError: no &lt;map&gt; today" in page
    assert "<map>" not in page
    assert "data:image/svg+xml;base64," in page
    assert "http" not in page.replace("http-equiv", ""), "nothing is loaded from elsewhere"
    columns = set(re.findall(r"<th scope=col[^>]*>([^<]*)</th>", page))
    explained = {name for names in re.findall(r"<dt>([^<]*)</dt>", page) for name in names.split(", ")}
    assert explained - columns == {"judged at"}, (
        "only what is shown is explained; this is told above the table"
    )
    assert columns - explained == {"method", "pairs", "pair", "set", "problem"}, "the others need no words"


def test_curves_are_drawn_over_errors_times_100_as_in_the_tables():
    row = {"set": "s", "method": "isomatch", "curve": [1.0] * 101, "curve_either": [1.0] * 101}
    published = PublishedCurve("s", "theirs", np.array([0.0, 0.1, 0.25]), np.array([0.0, 0.5, 1.0]))
    (panel,) = curve_panels([row], [published])
    axes = Figure().subplots()
    panel.draw(axes)
    own, theirs = axes.get_lines()
    np.testing.assert_allclose(own.get_xdata(), np.linspace(0, 25, 101))
    np.testing.assert_allclose(theirs.get_xdata(), [0, 10, 25])
    assert axes.get_xlabel() == "geodesic error × 100 / √area"
    assert axes.get_xlim() == (0, 25)


@pytest.mark.long
def test_rows_of_another_version_are_computed_again_and_told_apart(small, tmp_path):
    run = BenchmarkRun("small", ("right",), n_points=20, jobs=1)
    earlier = [row | {"version": "0.0"} for row in run_benchmark(run, tmp_path)]
    (tmp_path / "rows.jsonl").write_text("".join(f"{json.dumps(row)}\n" for row in earlier))
    later = list(run_benchmark(run, tmp_path))
    assert len(later) == 2
    assert read_rows(tmp_path) == earlier + later
    assert rows_of(run, tmp_path) == later
    (line,) = write_tables(tmp_path)
    assert (line["pairs"], line["version"]) == (2, later[0]["version"]), "no mean over rows of two versions"
    assert "not shown: 2." in (tmp_path / "index.html").read_text(encoding="utf-8")


@dataclass(frozen=True)
class Strength:
    """Settings of a method that only a test has."""

    strength: int

    def to_dict(self):
        return asdict(self)


@pytest.mark.long
def test_rows_of_other_settings_are_computed_again(small, monkeypatch, tmp_path):
    given = []

    def method(source, target, config):
        given.append(config.strength)
        return Correspondence(np.zeros(source.n_vertices, dtype=int), target.n_vertices)

    for strength in (1, 2, 2, 1):
        monkeypatch.setitem(METHODS, "set", Method(method, preparation=None, config=Strength(strength)))
        run = BenchmarkRun("small", ("set",), n_pairs=1, n_points=20, jobs=1)
        list(run_benchmark(run, tmp_path))
    assert given == [1, 2]
    assert len(read_rows(tmp_path)) == 2


def test_every_setting_changes_the_digest(monkeypatch):
    def digest(**changes):
        monkeypatch.setitem(METHODS, "m", replace(Method(print, config=Strength(1)), **changes))
        return settings_digest("m")

    assert digest() == digest(config=Strength(1)) == digest(function=len)
    changed = [
        digest(config=Strength(2)),
        digest(config=None),
        digest(n_landmarks=5),
        digest(preparation=None),
        digest(preparation=replace(Config(), weights="uniform")),
        settings_digest("m+gdd"),
        settings_digest("m+isomatch"),
    ]
    assert len({digest(), *changed}) == 1 + len(changed)


@pytest.mark.long
def test_a_torn_last_line_is_dropped_and_run_again(small, caplog, tmp_path):
    run = BenchmarkRun("small", ("right",), n_points=20, jobs=1)
    first, second = run_benchmark(run, tmp_path)
    ledger = tmp_path / "rows.jsonl"
    for cut in (1, 40):
        ledger.write_bytes(ledger.read_bytes()[:-cut])
        assert read_rows(tmp_path) == [first]
        assert "the last line is incomplete" in caplog.text
        (again,) = run_benchmark(run, tmp_path)
        assert again["pair"] == second["pair"]
        assert [json.loads(line)["pair"] for line in ledger.read_text().splitlines()] == ["a-b", "b-c"]
    ledger.write_text("{}\nbroken\n{}\n")
    with pytest.raises(FormatError, match=r"rows\.jsonl:2: not a row"):
        read_rows(tmp_path)


@pytest.fixture
def example_on_disk(tmp_path):
    """The shipped pair as a remeshed set with four landmarks, one of which is not where the dense truth is."""
    source, target = (creature.mesh for creature in example_pair())
    truth = ground_truth(*example_pair()).vertices
    marks = {"beast0": np.arange(len(truth)), "beast1": truth}
    picked = np.array([5, 500, 1500, 2500])
    landmarks = {"beast0": picked, "beast1": truth[[5, 500, 1500, 7]]}
    (tmp_path / "faust_r").mkdir()
    (tmp_path / "landmarks").mkdir()
    for name, mesh in (("beast0", source), ("beast1", target)):
        arrays = {"vertices": mesh.vertices, "faces": mesh.faces, "vts": marks[name]}
        np.savez(tmp_path / "faust_r" / f"{name}.npz", **arrays)
        np.savetxt(tmp_path / "landmarks" / f"{name}.txt", landmarks[name], fmt="%d")
    (tmp_path / "faust_r" / "test_pairs.txt").write_text("beast0 beast1\n")
    return tmp_path, target, truth


@pytest.mark.long
def test_errors_at_landmarks(example_on_disk, monkeypatch, tmp_path):
    folder, target, truth = example_on_disk
    given = []

    def method(one, other, landmarks):
        given.append(landmarks)
        return Correspondence(truth, other.n_vertices)

    monkeypatch.setitem(METHODS, "right", Method(method, 5, preparation=None))
    dense = BenchmarkRun("faust_r", ("right",), str(folder), n_points=50, jobs=1)
    at_landmarks = replace(dense, landmarks=str(folder / "landmarks"))
    rows = [row for run in (dense, at_landmarks, dense) for row in run_benchmark(run, tmp_path / "out")]
    assert [(row["judged_at"], row["unmatched"]) for row in rows] == [("truth", 0), ("landmarks", 0)]
    off = geodesic_distances(target, [truth[7]])[0, truth[2500]] / np.sqrt(target.area)
    assert rows[0]["error"] == 0
    assert rows[1]["error"] == pytest.approx(100 * off / 4)
    np.testing.assert_array_equal(given[0], given[1])
    assert rows[0]["distortion_l2"] == rows[1]["distortion_l2"], "only errors are measured at landmarks"
    (line,) = write_tables(tmp_path / "out")
    assert (line["pairs"], line["judged_at"], line["mean"]) == (1, "landmarks", rows[1]["error"])
    assert "at landmarks: direct" in (tmp_path / "out" / "curves.svg").read_text(encoding="utf-8")
    (folder / "landmarks" / "beast1.txt").unlink()
    (row,) = run_benchmark(replace(at_landmarks, seed=1), tmp_path / "out")
    assert "no landmarks of beast1" in row["problem"]


@pytest.mark.long
def test_cycles_of_a_method_and_of_what_continues_it(monkeypatch, tmp_path):
    there = Correspondence(ground_truth(*example_pair()).vertices, example_pair()[1].mesh.n_vertices)
    maps = {there.shape: there, there.shape[::-1]: there.reversed()}
    starts = []

    def method(source, target):
        return maps[source.n_vertices, target.n_vertices]

    def continued(source, target, initial_map):
        starts.append(initial_map)
        return Correspondence(np.where(initial_map < 0, 0, initial_map), target.n_vertices)

    monkeypatch.setitem(METHODS, "right", Method(method, preparation=None))
    monkeypatch.setitem(CONTINUATIONS, "filled", Method(continued, preparation=None))
    run = BenchmarkRun("example", ("right", "right+filled"), n_points=200, jobs=1)
    assert all("cycle" not in row for row in run_benchmark(run, tmp_path))
    starts.clear()
    right, filled = run_benchmark(replace(run, cycles=True), tmp_path)
    assert [len(start) for start in starts] == list(there.shape)
    source = example_pair()[0].mesh
    back = maps[there.shape[::-1]]
    expected = 100 * counted(cycle_errors(source, there, back, 200)).mean()
    assert right["cycle"] == pytest.approx(expected)
    assert filled["cycle"] >= 0
    assert list(run_benchmark(run, tmp_path)) == [], "rows with more measures serve as well"
    assert write_tables(tmp_path)[0]["cycle"] == pytest.approx(expected)


def test_a_failure_on_the_way_back_is_a_problem_that_says_so(small, monkeypatch, tmp_path):
    n_source = example_pair()[0].mesh.n_vertices

    def one_way(source, target):
        if source.n_vertices != n_source:
            raise ValueError("too long a way")
        return Correspondence(np.zeros(n_source, dtype=int), target.n_vertices)

    monkeypatch.setitem(METHODS, "one_way", Method(one_way, preparation=None))
    run = BenchmarkRun("small", ("one_way",), n_pairs=1, n_points=20, jobs=1, cycles=True)
    (row,) = run_benchmark(run, tmp_path)
    assert row["problem"] == "ValueError: too long a way (target to source, for the cycle error)"


def test_named_pairs_are_run_instead_of_drawn_ones(small, tmp_path):
    run = BenchmarkRun("small", ("right",), n_points=20, jobs=1, pairs=(("b", "c"),))
    assert [row["pair"] for row in run_benchmark(run, tmp_path)] == ["b-c"]


@pytest.mark.long
def test_distortion_of_the_table_is_recorded_where_it_is_asked_for(small, tmp_path):
    run = BenchmarkRun("small", ("right",), n_points=60, jobs=1, n_pairs=1)
    (row,) = run_benchmark(run, tmp_path)
    assert "distortion_table" not in row
    (row,) = run_benchmark(replace(run, table_distortion=True), tmp_path)
    assert row["distortion_table"] == row["distortion_table_truth"] > 0


@pytest.mark.long
def test_the_command_judges_at_landmarks_and_measures_cycles(example_on_disk, capsys, tmp_path):
    folder, _, _ = example_on_disk
    places = ["--data", str(folder), "--landmarks", str(folder / "landmarks"), "-o", str(tmp_path / "out")]
    options = ["--methods", "gdd", "--points", "100", "--jobs", "1", "--cycles"]
    assert main(["bench", "--set", "faust_r", *places, *options]) == 0
    said = capsys.readouterr().out.splitlines()
    assert said[1].split()[-1] == "cycle"
    assert said[2] == "faust_r, at landmarks"
    (row,) = read_rows(tmp_path / "out")
    assert row["judged_at"] == "landmarks"
    assert 0 < row["cycle"] < 5
    assert main(["bench", "--set", "example", *places, *options]) == 1
    assert "the set 'example' has no hand-picked landmarks" in capsys.readouterr().err


@pytest.mark.long
def test_what_continues_a_map_runs_the_method_once(small, monkeypatch, tmp_path):
    def turned(source, target, initial_map):
        return Correspondence(np.roll(initial_map, 7), target.n_vertices)

    monkeypatch.setitem(CONTINUATIONS, "turned", Method(turned, preparation=None))
    monkeypatch.setitem(CONTINUATIONS, "failing", Method(turned, n_landmarks=5, preparation=None))
    run = BenchmarkRun("small", ("right+turned", "right+failing"), n_points=50, jobs=1)
    rows = list(run_benchmark(run, tmp_path))
    assert [row["method"] for row in rows] == ["right", *run.methods] * 2, (
        "the start itself is reported as well"
    )
    assert len(small) == 2, "once for each pair"
    right, further, failed = rows[:3]
    assert right["error"] == 0 < further["error"]
    assert further["seconds"] > right["seconds"]
    assert "unexpected keyword argument 'landmarks'" in failed["problem"], "the others are kept"
    table = write_tables(tmp_path)
    assert [line["method"] for line in table] == ["right", "right+failing", "right+turned"]
    with (tmp_path / "improvements.csv").open() as file:
        gain = next(csv.DictReader(file))
    assert (gain["method"], gain["pairs"], float(gain["error_before"])) == ("right+turned", "2", 0)
    assert float(gain["error_after"]) == pytest.approx(further["error"], rel=1e-4)
    assert float(gain["error_smaller"]) == 0 == float(gain["distortion_l2_smaller"])
    assert "right+turned" in (tmp_path / "index.html").read_text(encoding="utf-8")
    with pytest.raises(SettingError, match="followed"):
        BenchmarkRun("small", ("right+gdd", "right+magic"))
    with pytest.raises(SettingError, match=r"unknown method right\+;"):
        BenchmarkRun("small", ("right+",))


@pytest.mark.parametrize(
    ("before", "after", "smaller", "mean_after"),
    [
        ([4, 4], [1, 5], 0.5, 3.0),
        ([None, 4], [1, 4], 0.5, 4.0),
        ([4, None], [None, None], 0.0, None),
        ([], [], None, None),
    ],
)
def test_a_torn_map_has_a_distortion_larger_than_any(before, after, smaller, mean_after):
    """Rows that were judged without distortion count for none of its numbers."""
    base = {"set": "s", "damage": None, "error": 1.0}
    rows = [
        base | {"pair": str(i), "method": method} | ({"distortion_l2": values[i]} if values else {})
        for method, values in (("a", before), ("a+b", after))
        for i in range(2)
    ]
    (line,) = improvements(rows)
    assert (line["distortion_l2_smaller"], line["distortion_l2_after"]) == (smaller, mean_after)
    assert (line["error_after"], line["error_smaller"], line["pairs"]) == (1.0, 0.0, 2)


def test_mirrored_truth_is_reported_but_does_not_excuse_shapes_that_are_not_symmetric(
    small, monkeypatch, tmp_path
):
    chosen = benchmark_set("small")
    lopsided = replace(chosen, load=lambda a, b: replace(chosen.load(a, b), symmetric=False))
    monkeypatch.setitem(MADE, "small", lambda: lopsided)
    row = next(run_benchmark(BenchmarkRun("small", ("flipped",), n_points=50, jobs=1), tmp_path))
    assert row["error"] == row["direct"] > row["mirrored"] == 0


@pytest.mark.long
def test_published_curves_of_the_sets_are_drawn_for_comparison(small, tmp_path):
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


def test_published_curves_that_cannot_be_read_are_reported(tmp_path):
    with pytest.raises(MissingFileError, match="published"):
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


@pytest.mark.parametrize("bad", [{"n_pairs": 0}, {"n_points": 0}, {"jobs": 0}, {"seed": -1}])
def test_settings_of_a_run_are_checked(bad):
    ((name, value),) = bad.items()
    with pytest.raises(SettingError, match=f"{name} = {value}"):
        BenchmarkRun("example", **bad)


def test_unknown_names_are_reported(tmp_path):
    with pytest.raises(SettingError, match="isomatch"):
        BenchmarkRun("creatures", ("magic",))
    with pytest.raises(SettingError, match="benchmark"):
        benchmark_set("horses")
    with pytest.raises(SettingError, match="folder"):
        benchmark_set("scape")
    with pytest.raises(MissingFileError, match="benchmark"):
        benchmark_set("scape", tmp_path)
    with pytest.raises(SettingError, match="landmarks"):
        benchmark_set("creatures", landmarks=tmp_path)


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
    """They are far apart and drawn by the seed, and rows of the truth that are wrong are not among them."""
    pair = relabelled_pair
    landmarks = true_landmarks(pair, 5, seed=1)
    assert {tuple(row) for row in landmarks.tolist()} <= {tuple(row) for row in pair.truth.tolist()}
    apart = geodesic_distances(pair.source, landmarks[:, 0])[:, landmarks[:, 0]]
    assert apart[~np.eye(5, dtype=bool)].min() > 0.3 * np.sqrt(pair.source.area)
    np.testing.assert_array_equal(landmarks, true_landmarks(pair, 5, seed=1))
    assert (landmarks != true_landmarks(pair, 5, seed=2)).any()
    with pytest.raises(LandmarkError, match="landmarks"):
        true_landmarks(replace(pair, truth=pair.truth[:4]))
    at = np.array([np.flatnonzero(pair.truth[:, 0] == a)[0] for a in true_landmarks(pair)[:, 0]])
    truth = pair.truth.copy()
    truth[at, 1] = np.roll(truth[at, 1], 1)
    drawn = true_landmarks(replace(pair, truth=truth))
    assert not set(drawn[:, 0]) & set(at)


@pytest.mark.long
def test_methods_share_landmarks_and_prepared_shapes(small, monkeypatch, tmp_path):
    given = []

    def method(source, target, **priors):
        given.append((source, priors))
        return Correspondence(np.zeros(source.surface.n_vertices, dtype=int), target.surface.n_vertices)

    for name, count in (("blind", 0), ("led", 5)):
        monkeypatch.setitem(METHODS, name, Method(method, count))
    monkeypatch.setitem(CONTINUATIONS, "again", Method(method))
    run = BenchmarkRun("small", ("blind", "led", "led+again"), n_pairs=1, n_points=20, jobs=1)
    blind, led, again = run_benchmark(run, tmp_path)
    (shape, nothing), (same, landmarks), (still, start) = given
    assert isinstance(shape, PreparedShape)
    assert shape is same is still
    assert nothing == {}
    pair = benchmark_set("small").load("a", "b")
    np.testing.assert_array_equal(landmarks["landmarks"], true_landmarks(pair))
    assert (start["initial_map"] == 0).all()
    prepared = 2 * min(shape.seconds, 0.01)
    assert min(blind["seconds"], led["seconds"]) > prepared
    assert again["seconds"] < 1.5 * led["seconds"], "one preparation is counted once"


def test_command_line_names_every_method():
    assert all(name in bench.__doc__ for name in METHODS)


@pytest.mark.long
def test_phi_runs_as_a_method(relabelled_pair):
    found, diagnostics = METHODS["phi"](
        relabelled_pair.source, relabelled_pair.target, {"landmarks": true_landmarks(relabelled_pair)}
    )
    assert (found.vertices == relabelled_pair.truth[:, 1]).mean() > 0.95
    assert diagnostics["outcome"] == "CONVERGED"


def half_of(mesh, seed):
    """Cut a mesh as a benchmark with a seed does to the target of the example pair."""
    return DAMAGES["cut"].function(mesh, 0.5, seed=crc32(f"standing-running target {seed}".encode()))


@pytest.mark.long
def test_maps_to_a_damaged_target_are_judged_on_the_whole_one(monkeypatch, tmp_path):
    target = example_pair()[1].mesh
    truth = ground_truth(*example_pair()).vertices
    part = half_of(target, seed=3)
    unit = np.sqrt(target.area)
    away = geodesic_distances(target, part.original[:1])[0]

    def nearest(one, other):
        assert other.n_vertices == part.mesh.n_vertices
        became = part.damaged_vertex[truth]
        return Correspondence(became, other.n_vertices)

    def first(one, other):
        return Correspondence(np.zeros(one.n_vertices, dtype=int), other.n_vertices)

    for name, method in (("right", nearest), ("first", first)):
        monkeypatch.setitem(METHODS, name, Method(method, preparation=None))
    run = BenchmarkRun("example", ("right", "first"), n_points=10**6, seed=3, jobs=1, damage="cut:0.5")
    right, wrong = run_benchmark(run, tmp_path)
    assert right["error"] == right["unmatched"] == 0, "only what remains is judged"
    assert right["distortion_l2"] == right["distortion_l2_truth"]
    remaining = truth[part.damaged_vertex[truth] >= 0]
    assert wrong["error"] == pytest.approx(100 * away[remaining].mean() / unit, rel=2e-3), (
        "distances and area of the whole"
    )
    assert (right["damage"], right["n_target"]) == ("cut:0.5", part.mesh.n_vertices)


def test_a_damaged_source_is_judged_where_it_remains(monkeypatch, tmp_path):
    truth = ground_truth(*example_pair()).vertices

    def method(one, other):
        index = np.flatnonzero(np.isin(example_pair()[0].mesh.vertices, one.vertices).all(axis=1))
        return Correspondence(truth[index], other.n_vertices)

    monkeypatch.setitem(METHODS, "right", Method(method, preparation=None))
    (row,) = run_benchmark(BenchmarkRun("example", ("right",), jobs=1, damage="view@source"), tmp_path)
    assert row["error"] == row["unmatched"] == 0
    assert row["damage"] == "view:1@source"


@pytest.mark.long
def test_the_nearer_of_two_merged_vertices_counts(monkeypatch, tmp_path):
    target = example_pair()[1].mesh
    truth = ground_truth(*example_pair()).vertices
    seed = crc32(b"standing-running target 0")
    part = weld(target, 0.2, seed=seed)
    pairs = {int(v): i for i, both in enumerate(zip(part.original, part.with_twins)) for v in both}

    def method(one, other):
        return Correspondence([pairs[v] for v in truth.tolist()], other.n_vertices)

    monkeypatch.setitem(METHODS, "right", Method(method, preparation=None))
    (row,) = run_benchmark(BenchmarkRun("example", ("right",), jobs=1, damage="weld:0.2"), tmp_path)
    assert row["error"] == row["unmatched"] == 0


@pytest.mark.long
def test_damage_tells_rows_apart_in_every_table(small, tmp_path):
    run = BenchmarkRun("small", ("flipped",), n_points=20, n_pairs=1, jobs=1)
    for damage in (None, "noise", "noise:0.3"):
        list(run_benchmark(replace(run, damage=damage), tmp_path))
    assert len(small) == 2, "noise and noise:0.3 are the same rows"
    assert [row["damage"] for row in read_rows(tmp_path)] == [None, "noise:0.3"]
    assert [(line["damage"], line["pairs"]) for line in write_tables(tmp_path)] == [("", 1), ("noise:0.3", 1)]
    with (tmp_path / "pairs.csv").open() as file:
        assert [row["damage"] for row in csv.DictReader(file)] == ["", "noise:0.3"]
    assert "small, noise:0.3: direct" in (tmp_path / "curves.svg").read_text(encoding="utf-8")


@pytest.mark.long
def test_rows_without_a_word_about_damage_are_those_of_whole_shapes(small, tmp_path):
    run = BenchmarkRun("small", ("right",), n_points=20, jobs=1)
    list(run_benchmark(run, tmp_path))
    ledger = tmp_path / "rows.jsonl"
    ledger.write_text(ledger.read_text().replace('"damage": null, ', ""))
    assert "damage" not in ledger.read_text()
    assert list(run_benchmark(run, tmp_path)) == []
    assert write_tables(tmp_path)[0]["damage"] == ""


@pytest.mark.long
def test_workers_find_the_same_rows_as_one_process(tmp_path):
    def measured(jobs):
        run = BenchmarkRun("example", ("functional_maps_5pt",), n_points=50, jobs=jobs)
        (row,) = run_benchmark(run, tmp_path / str(jobs))
        return {name: value for name, value in row.items() if name not in ("seconds", "details")}

    assert measured(1) == measured(2)


@pytest.mark.long
def test_the_command_damages(capsys, monkeypatch, tmp_path):
    def method(one, other):
        return Correspondence(np.zeros(one.n_vertices, dtype=int), other.n_vertices)

    monkeypatch.setitem(METHODS, "first", Method(method, preparation=None))
    asked = ["bench", "--set", "example", "--methods", "first", "--jobs", "1", "--points", "50"]
    asked += ["-o", str(tmp_path)]
    assert main([*asked, "--damage", "cut:0.3", "--damage", "view@both"]) == 0
    shown = capsys.readouterr().out.splitlines()
    assert {"example, cut:0.3", "example, view:1@both"} <= set(shown)
    assert main([*asked, "--damage", "fire"]) == 1
    assert "unknown damage 'fire'; choose from cut, holes" in capsys.readouterr().err
    assert all(name in bench.__doc__ for name in DAMAGES)
