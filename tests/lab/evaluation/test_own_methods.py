"""One's own functions and the maps of other programs, benched: the same errors, whatever way they come in."""

import csv
import json
import re
import sys
from importlib import import_module

import numpy as np
import pytest
from scipy.io import savemat
from scipy.spatial.distance import cdist

from data import real_file
from isomatch import Correspondence, Mesh, PrecisePoints, match, write_mesh
from isomatch._core.errors import FormatError, MissingFileError, SettingError
from isomatch.cli import main
from isomatch.evaluation import geodesic_errors
from isomatch.geodesics import geodesic_distances
from isomatch_lab.evaluation import (
    BenchmarkRun,
    MapsInFolder,
    OwnFunction,
    benchmark,
    read_rows,
    run_benchmark,
)
from isomatch_lab.evaluation.methods import NamedPair
from isomatch_lab.sets import relabelled
from zoo import grid

QUICK = {"jobs": 1, "distortion": False}
SHEET = grid(12, 9)
N = SHEET.n_vertices


@pytest.fixture
def image():
    """A true image of each vertex of a sheet on another one, which has all its vertices in another order."""
    return np.random.default_rng(0).permutation(N)


@pytest.fixture
def folder(tmp_path, image):
    """A set of one pair: a sheet, and the same with its vertices in another order."""
    root = tmp_path / "sheets"
    (root / "truth").mkdir(parents=True)
    back = np.argsort(image)
    write_mesh(root / "a.off", SHEET)
    write_mesh(root / "b.off", Mesh(SHEET.vertices[back], image[SHEET.faces]))
    np.savetxt(root / "truth" / "a__b.txt", image, fmt="%d")
    return root


def right(source, target):
    """The vertex that is as far from all others, whatever its number and the pose."""
    keys = [np.sort(cdist(mesh.vertices, mesh.vertices), axis=1) for mesh in (source, target)]
    return cdist(*keys).argmin(axis=1)


def shifted(source, target):
    return np.roll(right(source, target), 1)


FORMS = {
    "array": right,
    "points": lambda a, b: PrecisePoints.at_vertices(right(a, b)),
    "map": lambda a, b: Correspondence(right(a, b), b.n_vertices),
}


@pytest.mark.parametrize("form", FORMS)
def test_a_function_may_return_a_map_in_any_form(folder, form):
    result = benchmark(folder, OwnFunction(form, FORMS[form]), **QUICK)
    assert result.means == {form: pytest.approx(0, abs=1e-9)}, "the relabelling is undone by no method"


@pytest.mark.long
def test_a_function_may_return_a_result():
    result = benchmark("example", OwnFunction("mine", lambda a, b: match(a, b)), n_points=50, **QUICK)
    assert result.means["mine"] < 3
    assert result.rows[0]["outcome"] == "CONVERGED"


def test_the_result_is_a_table(folder, tmp_path):
    def broken(source, target):
        raise RuntimeError("no <map> today")

    result = benchmark(folder, [right, shifted, broken], tmp_path / "out", **QUICK)
    assert list(result.means) == ["right", "shifted", "broken"]
    assert result.means["broken"] is None
    assert result.means["shifted"] > 5
    assert result.problems == {"broken, a-b": "RuntimeError: no <map> today"}
    text, html = repr(result), result._repr_html_()
    head = "method pairs mean error median worst problems seconds"
    assert text.splitlines()[0].split() == head.split()
    assert text.splitlines()[3].startswith("broken ")
    assert "RuntimeError: no &lt;map&gt; today" in html
    assert "<map>" not in html
    assert html.count("<tr>") == 4
    assert result.folder == tmp_path / "out"
    assert (result.folder / "index.html").is_file()
    assert len(benchmark(folder, right, **QUICK).rows) == 1, "and without a folder"


@pytest.mark.parametrize("jobs", [1, pytest.param(2, marks=pytest.mark.long)])
def test_what_functions_print_stays_apart_from_the_answer(folder, tmp_path, image, capfd, jobs):
    """Also where they end the process, and where a problem has several lines."""
    np.savetxt(folder / "truth" / "b__a.txt", np.argsort(image), fmt="%d")
    file = tmp_path / "talking.py"
    file.write_text(
        "print('loaded')\n\ndef leaves(a, b):\n    print('called')\n    exit(3)\n\n"
        "def fails(a, b):\n    raise ValueError('one line\\n  and another')\n\n"
        "def stops(a, b):\n    raise ValueError\n"
    )
    own = [word for name in ("leaves", "fails", "stops") for word in ("--method", f"{file}:{name}")]
    command = ["bench", "--set", str(folder), *own, "-o", str(tmp_path / "out"), "--jobs", str(jobs)]
    assert main([*command, "--json"]) == 1, "nothing was measured"
    out, err = capfd.readouterr()
    notes = json.loads(out)["notes"]
    assert sum(note.endswith("leaves: SystemExit: the method called exit(3)") for note in notes) == 2
    assert sum(note.endswith("fails: ValueError: one line and another") for note in notes) == 2
    assert {"loaded", "called"} <= set(err.split())
    assert main(command) == 1
    assert "note: 1 more note is in pairs.csv" in capfd.readouterr().out


def test_a_file_that_exits_is_no_method(tmp_path):
    (tmp_path / "leaving.py").write_text("exit(3)\n")
    with pytest.raises(SettingError, match="SystemExit"):
        OwnFunction(f"{tmp_path / 'leaving.py'}:f")


@pytest.mark.parametrize(
    ("method", "message"),
    [
        (lambda a, b: [0, 1], rf"returned a map of 2 vertices onto {N}, but the source has {N}"),
        (lambda a, b: None, r"returned NoneType of shape \(\) and type object"),
        (lambda a, b: np.zeros(N), "of shape .* and type float64"),
        (lambda a, b: np.full(N, N), "are mapped outside the target's vertices"),
        (lambda a, b: PrecisePoints(np.zeros((N, 3), int), np.ones((N, 2))), "not both"),
        (lambda a, b: Correspondence(np.zeros(N, int), N + 1), rf"onto {N + 1}, but"),
    ],
)
def test_what_is_no_map_is_a_problem(folder, method, message):
    (row,) = benchmark(folder, OwnFunction("mine", method), **QUICK).rows
    assert re.search(message, row["problem"])


def test_methods_need_names_of_their_own(folder):
    with pytest.raises(SettingError, match="OwnFunction"):
        benchmark(folder, lambda a, b: None)
    with pytest.raises(SettingError, match="cannot"):
        benchmark(folder, OwnFunction("isomatch", right))
    with pytest.raises(SettingError, match="methods"):
        benchmark(folder, [right, right])
    with pytest.raises(SettingError, match="function"):
        benchmark(folder, [3])


MODULE = '''"""Methods."""
import numpy as np
from scipy.spatial.distance import cdist

def right(source, target):
    keys = [np.sort(cdist(mesh.vertices, mesh.vertices), axis=1) for mesh in (source, target)]
    return cdist(*keys).argmin(axis=1)
'''


def test_functions_of_a_file_are_kept_while_its_text_is_the_same(folder, tmp_path):
    file = tmp_path / "mine.py"
    file.write_text(MODULE)
    run = {"set_name": str(folder), "methods": (f"{file}:right",), **QUICK}
    assert [row["method"] for row in run_benchmark(BenchmarkRun(**run), folder / "out")] == [*run["methods"]]
    assert list(run_benchmark(BenchmarkRun(**run), folder / "out")) == []
    file.write_text(MODULE + "# changed\n")
    assert len(list(run_benchmark(BenchmarkRun(**run), folder / "out"))) == 1
    truth = folder / "truth" / "a__b.txt"
    truth.write_text(truth.read_text() + "# the set was corrected\n")
    assert len(list(run_benchmark(BenchmarkRun(**run), folder / "out"))) == 1
    assert len(read_rows(folder / "out")) == 3


@pytest.mark.parametrize("place", ["file", "module", "imported"])
def test_rows_are_those_of_the_text_that_their_digest_tells(folder, tmp_path, monkeypatch, place):
    """Also in one session, within a second and with as many letters."""
    label = f"changing_{place}"
    file = tmp_path / f"{label}.py"
    file.write_text(MODULE + "\n\ndef rolled(a, b):\n    return np.roll(right(a, b), 0)\n")
    monkeypatch.syspath_prepend(tmp_path)
    if place == "imported":
        import_module(label)
    name = f"{file if place == 'file' else label}:rolled"
    run = BenchmarkRun(str(folder), (name,), **QUICK)
    (first,) = run_benchmark(run, folder / "out")
    file.write_text(file.read_text().replace(", 0)", ", 1)"))
    (second,) = run_benchmark(BenchmarkRun(str(folder), (name,), **QUICK), folder / "out")
    assert first["error"] == pytest.approx(0, abs=1e-9)
    assert second["error"] > 5
    assert first["settings"] != second["settings"]
    with pytest.raises(SettingError, match="changed"):
        OwnFunction(name, digest="of another text")(SHEET, SHEET)


def test_an_imported_module_is_read_again_if_it_changed_before_the_first_run(tmp_path, monkeypatch):
    file = tmp_path / "changed_early.py"
    file.write_text("def f(a, b):\n    return [0] * a.n_vertices\n")
    monkeypatch.syspath_prepend(tmp_path)
    import_module("changed_early")
    file.write_text("def f(a, b):\n    return [1] * a.n_vertices\n")
    assert (OwnFunction("changed_early:f")(SHEET, SHEET).vertices == 1).all()


@pytest.mark.long
def test_isomatch_can_start_from_the_map_of_a_function(tmp_path):
    file = tmp_path / "mine.py"
    file.write_text("import isomatch\n\ndef found(a, b):\n    return isomatch.match(a, b).map.vertices\n")
    result = benchmark("example", f"{file}:found+isomatch", n_points=50, **QUICK)
    assert list(result.means) == [f"{file}:found+isomatch"]
    assert max(result.means.values()) < 3


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("nowhere.py:f", "there is no file nowhere.py"),
        ("no_such_module_:f", r"no_such_module_ cannot be imported \(ModuleNotFoundError"),
        ("json:f", "json has no function 'f'; a function takes two meshes"),
        (":f", "is not MODULE:FUNCTION"),
        ("json:", "is not MODULE:FUNCTION"),
    ],
)
def test_functions_that_are_not_found(name, message):
    with pytest.raises(SettingError, match=message):
        BenchmarkRun("example", (name,))


@pytest.mark.parametrize("first", [0, 1])
@pytest.mark.parametrize("suffix", ["txt", "npy", "mat", "npz"])
def test_maps_of_another_program(folder, tmp_path, image, suffix, first):
    maps = tmp_path / "theirs"
    maps.mkdir()
    path = maps / f"a__b.{suffix}"
    write = {
        "txt": lambda x: np.savetxt(path, x, fmt="%d"),
        "npy": lambda x: np.save(path, x),
        "npz": lambda x: np.savez(path, T=x),
        "mat": lambda x: savemat(path, {"T": x.astype(float), "other": np.eye(3)}),
    }[suffix]
    write(image + first)
    result = benchmark(folder, MapsInFolder(maps), **QUICK)
    assert result.means == {"theirs": 0}
    assert bool(result.notes) == bool(first), "what was decided is told"
    write(np.clip(image, 1, N - 2))
    (problem,) = benchmark(folder, MapsInFolder(maps), **QUICK).problems.values()
    assert "all maps of these pairs can count from 0 or from 1; say which, by --maps-from" in problem
    errors = [benchmark(folder, MapsInFolder(maps, each), **QUICK).means["theirs"] for each in (0, 1)]
    assert errors[0] < 2 < errors[1]


def test_one_map_that_tells_decides_for_those_that_do_not(folder, tmp_path, image):
    np.savetxt(folder / "truth" / "b__a.txt", np.argsort(image), fmt="%d")
    maps = tmp_path / "theirs"
    maps.mkdir()
    inner = np.clip(image, 1, N - 2) + 1
    np.savetxt(maps / "a-b.txt", inner, fmt="%d")
    np.savetxt(maps / "b_a.txt", np.argsort(image) + 1, fmt="%d")
    result = benchmark(folder, MapsInFolder(maps), **QUICK)
    assert result.means["theirs"] < 2
    assert "a-b.txt: counts from 1, as other maps of its folder do" in result.notes


def test_a_map_with_zeros_does_not_decide_for_others(folder, tmp_path, image):
    """It is taken to count from 0, unless another one shows that it counts from 1, whichever comes first."""
    back = np.argsort(image)
    np.savetxt(folder / "truth" / "b__a.txt", back, fmt="%d")
    maps = tmp_path / "theirs"
    maps.mkdir()
    there = np.where(image == N - 1, -1, image)
    there[:3] = there[0]
    np.savetxt(maps / "a-b.txt", there + 1, fmt="%d")
    np.savetxt(maps / "b-a.txt", back + 1, fmt="%d")
    result = benchmark(folder, MapsInFolder(maps), **QUICK)
    assert "a-b.txt: counts from 1, as other maps of its folder do" in result.notes
    assert result.means == benchmark(folder, MapsInFolder(maps, 1), **QUICK).means
    back[:3] = back[3]
    np.savetxt(maps / "b-a.txt", back, fmt="%d")
    assert benchmark(folder, MapsInFolder(maps), **QUICK).notes == ()


def test_maps_that_tell_nothing_are_read_once(tmp_path, image):
    """Not again for every pair: what is written meanwhile changes nothing."""
    pairs = (("a", "b"), ("b", "c"), ("c", "a"))
    for a, b in pairs:
        np.savetxt(tmp_path / f"{a}-{b}.txt", np.clip(image, 1, N - 2), fmt="%d")
    method, pair = MapsInFolder(tmp_path), NamedPair(*pairs[0], None, pairs, lambda *_: N, {})
    with pytest.raises(FormatError, match="count from 0 or from 1"):
        method(SHEET, SHEET, pair)
    np.savetxt(tmp_path / "c-a.txt", image, fmt="%d")
    with pytest.raises(FormatError, match="count from 0 or from 1"):
        method(SHEET, SHEET, pair._replace(source="b", target="c"))
    assert "other maps" in method(SHEET, SHEET, pair._replace(kept={}))[1]


def test_maps_that_are_missing_or_unreadable_are_problems(folder, tmp_path, image):
    maps = tmp_path / "theirs"
    with pytest.raises(MissingFileError, match="no such folder of maps"):
        MapsInFolder(maps)
    maps.mkdir()
    (problem,) = benchmark(folder, MapsInFolder(maps), **QUICK).problems.values()
    assert "no map of a to b; expected a__b.npz" in problem
    (maps / "a__b.mat").write_bytes(b"nothing")
    (problem,) = benchmark(folder, MapsInFolder(maps), **QUICK).problems.values()
    assert "a__b.mat: not a map (" in problem
    savemat(maps / "a__b.mat", {"T12": image, "T21": image})
    (problem,) = benchmark(folder, MapsInFolder(maps), **QUICK).problems.values()
    assert f"T12, T21 could each be the map of the source's {N} vertices" in problem
    (maps / "a-b.txt").write_text("0\n")
    (problem,) = benchmark(folder, MapsInFolder(maps), **QUICK).problems.values()
    assert "a__b.mat and a-b.txt could both be the map; keep one" in problem
    with pytest.raises(SettingError, match="undamaged"):
        benchmark(folder, MapsInFolder(maps), damage="noise")


@pytest.mark.long
def test_the_command_runs_functions_and_maps(folder, tmp_path, image, monkeypatch, capsys):
    (tmp_path / "mine_of_a_test.py").write_text(MODULE)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", sys.path.copy())
    (tmp_path / "theirs").mkdir()
    image[:9] = -1
    np.savetxt(tmp_path / "theirs" / "a__b.txt", image, fmt="%d")
    own = "--method mine_of_a_test:right --maps theirs --maps-from 0"
    assert main(f"bench --set sheets {own} -o out --jobs 1".split()) == 0
    said = capsys.readouterr().out
    assert "IoU" not in said  # every vertex has a counterpart, so that it says what "unmatched" says
    with (tmp_path / "out" / "pairs.csv").open() as file:
        rows = {row["method"]: row for row in csv.DictReader(file)}
    assert set(rows) == {"mine_of_a_test:right", "theirs"}
    areas = SHEET.vertex_areas
    assert float(rows["theirs"]["iou"]) == pytest.approx(1 - areas[:9].sum() / areas.sum(), rel=1e-4)
    assert float(rows["theirs"]["error"]) == pytest.approx(100 * 9 / N, rel=1e-4)
    assert float(rows["theirs"]["error_matched"]) == 0
    page = (tmp_path / "out" / "index.html").read_text(encoding="utf-8")
    assert "<th scope=col>iou</th>" not in page
    assert "<th scope=col>unmatched</th>" in page
    assert main(f"bench --set sheets --methods nothing:f -o {tmp_path}/out".split()) == 1
    assert "nothing cannot be imported" in capsys.readouterr().err


@pytest.mark.long
def test_functions_of_a_file_run_in_other_processes(folder, tmp_path, image):
    np.savetxt(folder / "truth" / "b__a.txt", np.argsort(image), fmt="%d")
    file = tmp_path / "mine.py"
    file.write_text(MODULE)
    result = benchmark(folder, f"{file}:right", jobs=2, distortion=False)
    assert len(result.rows) == 2
    assert result.means == {f"{file}:right": pytest.approx(0, abs=1e-9)}


def test_errors_of_parts_are_in_the_unit_of_the_whole(tmp_path):
    """Vertices without a counterpart are in no mean; the overlap counts those that are matched nevertheless."""
    root = tmp_path / "parts"
    root.mkdir()
    image = np.arange(N)
    image[:20] = -1
    rows = np.column_stack([np.arange(N), image])
    np.savez(
        root / "shapes.npz", a=SHEET.vertices, a_faces=SHEET.faces, b=SHEET.vertices, b_faces=SHEET.faces
    )
    np.savez(root / "truth.npz", **{"a|b": rows, "a|b|scale": 5.0})
    maps = tmp_path / "theirs"
    maps.mkdir()
    found = np.roll(np.arange(N), 1)
    found[10:15], found[60:70] = -1, -1
    np.savetxt(maps / "a__b.txt", found, fmt="%d")
    (row,) = benchmark(root, MapsInFolder(maps), jobs=1).rows
    has, matched, areas = image >= 0, found >= 0, SHEET.vertex_areas
    assert row["iou"] == pytest.approx(areas[has & matched].sum() / areas[has | matched].sum())
    assert row["recall"] == pytest.approx((has & matched).sum() / has.sum())
    assert row["precision"] == pytest.approx((has & matched).sum() / matched.sum())
    both = np.flatnonzero(has & matched)
    apart = geodesic_distances(SHEET, image[both])[np.arange(len(both)), found[both]]
    assert row["error_matched"] == pytest.approx(100 * apart.mean() / 5.0, rel=1e-6)
    counted = np.concatenate([apart / 5.0, np.ones(has.sum() - len(both))])
    assert row["error"] == pytest.approx(100 * counted.mean(), rel=1e-6)
    assert row["distortion_l2_truth"] == pytest.approx(0, abs=1e-12)


def test_distances_to_points_in_triangles():
    flat = Mesh(SHEET.vertices * [1, 1, 0], SHEET.faces)
    rng = np.random.default_rng(0)
    corners = flat.faces[rng.integers(0, flat.n_faces, N)]
    points = PrecisePoints(corners, rng.dirichlet(np.ones(3), N))
    image = rng.integers(0, N, N)
    image[:10] = corners[:10, 0]
    rows = np.column_stack([np.arange(N), corners[:, 0]])
    errors = geodesic_errors(flat, Correspondence(image, N), rows, points=points, unit=1.0)
    true = np.linalg.norm(points.interpolated(flat.vertices) - flat.vertices[image], axis=1)
    np.testing.assert_allclose(errors[:10], true[:10], err_msg="a straight line from a corner")
    assert np.abs(errors - true).max() < 0.35, "of edges of 1"
    assert np.abs(errors - true).mean() < 0.06


def test_a_vertex_as_point_has_the_error_of_the_vertex():
    image, true = np.roll(np.arange(N), 3), np.arange(N)
    rows = np.column_stack([true, true])
    as_vertex, as_point = (
        geodesic_errors(SHEET, Correspondence(image, N), rows, 40, points=points)
        for points in (None, PrecisePoints.at_vertices(true))
    )
    np.testing.assert_allclose(as_vertex, as_point, rtol=1e-3, err_msg="fronts from either end")


@pytest.mark.long
@pytest.mark.parametrize("name", ["topkids", "shrec16_cuts", "smal"])
def test_real_sets_do_not_depend_on_the_numbers_of_the_target(name, tmp_path):
    """The same map, given for a set and for one whose target has other vertex numbers, has the same errors."""
    with np.load(real_file(f"{name}/truth.npz")) as truth, np.load(real_file(f"{name}/shapes.npz")) as shapes:
        key = next(key for key in truth.files if key.count("|") == 1)
        a, b = key.split("|")
        rows = truth[key]
        source, target = (Mesh(shapes[each], shapes[f"{each}_faces"]) for each in (a, b))
    other, new = relabelled(target, 5)
    found = np.random.default_rng(0).integers(0, target.n_vertices, source.n_vertices)
    errors = []
    for label, mesh, moved in (("first", target, np.arange(target.n_vertices)), ("second", other, new)):
        root = tmp_path / label
        (root / "maps").mkdir(parents=True)
        arrays = {a: source.vertices, f"{a}_faces": source.faces, b: mesh.vertices, f"{b}_faces": mesh.faces}
        np.savez(root / "shapes.npz", **arrays)
        np.savez(root / "truth.npz", **{key: np.column_stack([rows[:, 0], moved[rows[:, 1]]])})
        np.save(root / "maps" / f"{a}__{b}.npy", moved[found])
        (row,) = benchmark(root, MapsInFolder(root / "maps", 0), n_points=200, **QUICK).rows
        errors.append(row["error"])
    assert errors[0] == pytest.approx(errors[1], rel=1e-4)


def test_damage_adds_to_what_has_no_counterpart(tmp_path):
    """Also where the truth lies in triangles, which are gone from a damaged target but not from the whole."""
    root = tmp_path / "sheets"
    (root / "truth").mkdir(parents=True)
    for name in "ab":
        write_mesh(root / f"{name}.off", SHEET)
    table = np.column_stack([np.arange(N) * 7 % SHEET.n_faces, np.full((N, 3), 1 / 3)])
    table[:7, 0] = -1
    np.savetxt(root / "truth" / "a__b.txt", table)
    (root / "set.toml").write_text("counts_from = 0\n")

    def all_on_one(source, target):
        return np.zeros(source.n_vertices, dtype=int)

    whole, cut = (benchmark(root, all_on_one, damage=each, **QUICK).rows[0] for each in (None, "cut:0.3"))
    assert whole["precision"] == pytest.approx(1 - 7 / N)
    assert cut["precision"] < whole["precision"] - 0.1
    assert whole["iou"] > cut["iou"] > 0.3
    result = benchmark(root, all_on_one, tmp_path / "out", **QUICK)
    assert "IoU" in str(result)
    page = (tmp_path / "out" / "index.html").read_text(encoding="utf-8")
    assert "<th scope=col>iou</th>" in page
    assert "<th scope=col>error matched</th>" in page
    assert whole["recall"] == cut["recall"] == 1
    assert 20 < cut["error"] < 200


def test_a_benchmark_that_measures_nothing_fails(tmp_path, capsys):
    (tmp_path / "mine.py").write_text("def f(source, target):\n    raise RuntimeError('no')\n")
    words = ["bench", "--set", "example", "--methods", "", "--method", f"{tmp_path / 'mine.py'}:f"]
    assert main([*words, "-o", str(tmp_path / "out"), "--jobs", "1", "--points", "10"]) == 1
    assert "no pair could be matched and measured" in capsys.readouterr().err
