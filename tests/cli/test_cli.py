"""Every verb by exit code and artefact; every kind of bad input by one line."""

import base64
import contextlib
import io
import json
import subprocess
import sys
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
from threadpoolctl import threadpool_info

import isomatch
from command_line import one_line, write_pair
from isomatch.cli import main
from isomatch.cli.terminal import complain, json_text, start_clock, waited
from isomatch.datasets import example_pair, ground_truth
from shapes import flat_grid, icosphere
from zoo.made import moved, together

pytestmark = pytest.mark.usefixtures("prepared_once", "small_pictures")
RESULT_FILES = ("map.npz", "map.txt", "result.json", "map.png", "report.html")


@pytest.fixture(scope="module")
def shapes(tmp_path_factory):
    """Folder with both shapes as files and settings that make a match quick."""
    return write_pair(tmp_path_factory.mktemp("shapes"))


@pytest.fixture(scope="module")
def matched(shapes, tmp_path_factory):
    """Folder of one finished match, and what was said about it."""
    out = tmp_path_factory.mktemp("result") / "deep" / "out"
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        assert run_match(shapes, out) == 0
    return out, said.getvalue()


def run_match(shapes, out, *more, config=None):
    ends = [str(shapes / "source.ply"), str(shapes / "target.ply")]
    return main(["match", *ends, "-o", str(out), "--config", str(config or shapes / "quick.toml"), *more])


def test_match_writes_all_files_in_agreement(matched):
    folder, _ = matched
    written = sorted(path.name for path in folder.iterdir())
    saved = [
        name for name in json.loads((folder / "result.json").read_text())["files"] if "alternative" in name
    ]
    assert written == sorted([*RESULT_FILES, *(f"{name}.npz" for name in saved)])
    source, target = example_pair()
    found = isomatch.Correspondence.load(folder / "map.npz")
    assert found.shape == (source.mesh.n_vertices, target.mesh.n_vertices)
    as_text = isomatch.Correspondence.load(folder / "map.txt")
    assert as_text.n_target == found.n_target
    np.testing.assert_array_equal(as_text.vertices, found.vertices)
    record = json.loads((folder / "result.json").read_text())
    assert record["direction"] == "source -> target"
    assert record["config"]["n_columns"] == 40
    assert matplotlib.image.imread(folder / "map.png").shape[1] >= 1600
    report = (folder / "report.html").read_text(encoding="utf-8")
    assert isomatch.visualization.HEADLINES[isomatch.Outcome[record["outcome"]]] in report
    assert base64.b64encode((folder / "map.png").read_bytes()).decode() in report


def test_match_tells_in_a_few_lines_what_came_out_and_what_to_open(matched):
    folder, said = matched
    lines = said.splitlines()
    record = json.loads((folder / "result.json").read_text())
    assert lines[0] == isomatch.visualization.HEADLINES[isomatch.Outcome[record["outcome"]]]
    assert f"  open first  {folder / 'report.html'}" in lines
    assert "map.npz, map.png, map.txt, result.json" in lines[-1]
    assert max(len(line) for line in lines if str(folder) not in line) <= 80
    assert 5 <= len(lines) <= 8


@pytest.mark.long
def test_match_tells_all_measures_in_detail(shapes, tmp_path, capsys):
    assert run_match(shapes, tmp_path / "out", "--details") == 0
    said = capsys.readouterr().out
    for word in ("distortion, mean", "of √area", "seconds     prepare", "≤ 0.66"):
        assert word in said


def test_match_refuses_to_overwrite(shapes, matched, capsys):
    folder, _ = matched
    before = (folder / "map.npz").read_bytes()
    assert run_match(shapes, folder) == 1
    said = one_line(capsys)
    assert "map.npz: already exists" in said
    assert "--force" in said
    assert (folder / "map.npz").read_bytes() == before


@pytest.mark.long
@pytest.mark.parametrize("failing", ["draw_map", "write_report"])
def test_a_map_is_not_lost_with_a_drawing_that_fails(shapes, tmp_path, monkeypatch, capsys, failing):
    def fails(*_, **__):
        raise ValueError("too far away")

    monkeypatch.setattr(isomatch.visualization, failing, fails)
    what, name = {"draw_map": ("picture", "map.png"), "write_report": ("report", "report.html")}[failing]
    (tmp_path / name).write_text("of an earlier run")
    assert run_match(shapes, tmp_path, "--force") == 0
    told = f"there is no {what}: too far away"
    assert f"note        {told}" in capsys.readouterr().out
    record = json.loads((tmp_path / "result.json").read_text())
    assert record["undrawn"] == [told]
    assert {Path(path).name for path in record["files"].values()} == {
        path.name for path in tmp_path.iterdir()
    }
    assert (tmp_path / "map.npz").exists()
    assert not (tmp_path / name).exists()


@pytest.mark.long
def test_match_takes_priors_is_forced_and_prints_one_json_object(shapes, matched, tmp_path, capsys):
    folder, _ = matched
    (tmp_path / "map.npz").write_bytes(b"an earlier result")
    landmarks = tmp_path / "landmarks.csv"
    landmarks.write_text("# source, target\n" + "".join(f"{s}, {t}  # a pair\n" for s, t in true_pairs()))
    priors = ["--landmarks", str(landmarks), "--initial-map", str(folder / "map.npz")]
    assert run_match(shapes, tmp_path, *priors, "--force", "--json", "--seed", "3") == 0
    said = capsys.readouterr()
    record = json.loads(said.out)
    assert said.err == ""
    assert record["seed"] == 3
    assert record["outcome"] in isomatch.Outcome.__members__
    assert record["quality"]["landmark_error"] < 0.07  # mostly the error of a basis of rank 20
    assert record == json.loads((tmp_path / "result.json").read_text())
    assert all(path.startswith(str(tmp_path)) for path in record["files"].values())


@pytest.mark.long
def test_options_of_match_come_before_the_file_of_settings(shapes, tmp_path, capsys):
    out = tmp_path / "out"
    assert run_match(shapes, out, "--json", "--refinement", "smooth", "--orientation", "any") == 0
    settings = json.loads(capsys.readouterr().out)["config"]
    assert (settings["refinement"], settings["orientation"], settings["n_columns"]) == ("smooth", "any", 40)
    assert run_match(shapes, out, "--force", "--refinement", "rough") == 2
    assert "rough" in capsys.readouterr().err


@pytest.mark.long
def test_match_holds_landmarks_marked_in_other_tools(shapes, tmp_path, capsys):
    meshes = [isomatch.read_mesh(shapes / f"{side}.ply") for side in ("source", "target")]
    pairs = np.array(true_pairs())
    for side, mesh in enumerate(meshes):
        points = mesh.vertices[pairs[:, side]].tolist()
        rows = "".join(f'<point x="{x}" y="{y}" z="{z}" name="{i}"/>' for i, (x, y, z) in enumerate(points))
        (tmp_path / f"{side}.pp").write_text(f"<PickedPoints>{rows}</PickedPoints>")
    options = ["--landmarks", str(tmp_path / "0.pp"), "--target-landmarks", str(tmp_path / "1.pp")]
    out = tmp_path / "out"
    assert run_match(shapes, out, *options, "--pin", "0", "--hypotheses", "given", "--json") == 0
    record = json.loads(capsys.readouterr().out)
    assert (record["config"]["pin"], record["config"]["hypotheses"]) == (0, "given")
    assert record["quality"]["landmark_error"] == 0
    found = isomatch.Correspondence.load(out / "map.npz")
    np.testing.assert_array_equal(found.vertices[pairs[:, 0]], pairs[:, 1])
    assert run_match(shapes, out, *options[2:], "--force") == 1
    assert "--target-landmarks needs --landmarks" in one_line(capsys)
    assert run_match(shapes, out, "--pin", "0.01", "--force") == 1
    assert "no landmarks were given" in one_line(capsys)


def true_pairs():
    source, target = example_pair()
    truth = ground_truth(source, target).vertices
    return [(vertex, truth[vertex]) for vertex in range(0, source.mesh.n_vertices, 400)]


def test_an_initial_map_is_read_from_plain_text_and_from_npz(matched, tmp_path):
    found = isomatch.Correspondence.load(matched[0] / "map.npz")
    np.savetxt(tmp_path / "plain.txt", found.vertices, fmt="%d")
    for path in (tmp_path / "plain.txt", matched[0] / "map.txt", matched[0] / "map.npz"):
        np.testing.assert_array_equal(
            isomatch.Correspondence.load(path, found.n_target).vertices, found.vertices
        )


def run_with(shapes, out, option, file):
    if option == "--config":
        return run_match(shapes, out, config=file)
    return run_match(shapes, out, option, str(file))


@pytest.mark.parametrize(
    ("option", "content", "complaint"),
    [
        ("--landmarks", "1 2\n3 x\n", "given:2: '3 x' is not a landmark"),
        ("--landmarks", "1 2 3\n", "given:1: '1 2 3' is not a landmark"),
        ("--landmarks", "# nothing\n", "given: no landmarks"),
        ("--landmarks", "1 2\n3 4\n5 999999\n", "target vertices 999999"),
        ("--landmarks", "1 2\n3 4\n", "2 landmarks do not fix"),
        ("--initial-map", "0\n1\n", "is not a map of this source, which has"),
        ("--initial-map", "0\n999999\n", "source vertices 1 are mapped outside"),
        ("--initial-map", "a\n", "given:1: 'a' is not a target vertex"),
        ("--config", "colour = 3\n", "unknown setting colour"),
        ("--config", "rank = \n", "given: not a TOML file"),
        ("--config", "#" * 2**14 + "\n", "given: more than 16384 bytes are not settings"),
        ("--config", "rank = 1000\n", "exceeds n_columns"),
    ],
)
def test_bad_input_files_are_named(shapes, tmp_path, capsys, option, content, complaint):
    given = tmp_path / "given"
    given.write_text(content)
    assert run_with(shapes, tmp_path / "out", option, given) == 1
    assert complaint in one_line(capsys)
    assert not (tmp_path / "out" / "map.npz").exists()


@pytest.mark.parametrize("option", ["--landmarks", "--initial-map", "--config"])
def test_missing_input_files_are_named(shapes, tmp_path, capsys, option):
    assert run_with(shapes, tmp_path / "out", option, tmp_path / "absent") == 1
    assert "absent: no such file; check the name and the folder" in one_line(capsys)


def test_bad_shapes_and_folders_are_named(shapes, tmp_path, capsys):
    ends = [str(shapes / "source.ply"), str(shapes / "target.ply")]
    assert main(["match", ends[0], str(tmp_path / "absent.ply"), "-o", str(tmp_path / "out")]) == 1
    assert "absent.ply: no such file" in one_line(capsys)
    assert main(["match", ends[0], str(shapes / "quick.toml"), "-o", str(tmp_path / "out")]) == 1
    assert "not a mesh format" in one_line(capsys)
    (tmp_path / "file").write_text("")
    assert main(["match", *ends, "-o", str(tmp_path / "file")]) == 1
    assert "file: is a file where a folder is to be" in one_line(capsys)


@pytest.mark.parametrize(
    "argv",
    [
        ["match"],
        ["match", "a.ply"],
        ["match", "a.ply", "b.ply"],
        ["match", "a.ply", "b.ply", "-o", "out", "--unknown"],
        ["match", "a.ply", "b.ply", "-o", "out", "--seed", "many"],
        ["polish"],
        ["check"],
        ["info", "--unknown"],
    ],
    ids=" ".join,
)
def test_wrong_usage_exits_2(argv, capsys):
    assert main(argv) == 2
    own = [] if argv == ["polish"] else argv[:1]
    assert f"See {' '.join(['isomatch', *own])} --help." in one_line(capsys)


def test_check_reports(shapes, capsys):
    assert main(["check", str(shapes / "source.ply")]) == 0
    assert "no defects" in capsys.readouterr().out
    assert main(["check", str(shapes / "source.ply"), "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["ok"] is True
    assert report["n_vertices"] == 2968
    assert main(["check", str(shapes / "source.ply"), "-q"]) == 0
    assert capsys.readouterr().out == ""


def test_check_lives_with_warnings_but_not_with_fatal_defects(tmp_path, capsys):
    corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [5, 5, 5]]
    faces = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]
    isomatch.write_mesh(tmp_path / "unused.off", isomatch.Mesh(corners, faces))
    assert main(["check", str(tmp_path / "unused.off")]) == 0
    capsys.readouterr()
    isomatch.write_mesh(tmp_path / "points.off", isomatch.Mesh(corners, []))
    assert main(["check", str(tmp_path / "points.off"), "--json"]) == 1
    said = capsys.readouterr()
    assert json.loads(said.out)["fatal"]
    assert said.err.count("\n") == 1
    assert "no faces" in said.err


def test_check_says_what_a_mesh_is_fit_for(tmp_path, capsys):
    file = str(tmp_path / "small.off")
    isomatch.write_mesh(file, icosphere(1))
    assert main(["check", file]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert " fit for distance not fit for basis: 42 vertices are too few for 100" in said
    assert " not fit for match: the largest component has 42 vertices, at least 50 are needed" in said
    assert main(["check", file, "--json"]) == 0
    reasons = json.loads(capsys.readouterr().out)["refused_by"]
    assert reasons["distance"] is None
    assert reasons["match"].startswith("the largest component has 42 vertices")
    assert main(["check", file, "--for", "distance"]) == 0
    capsys.readouterr()
    assert main(["check", file, "--for", "match"]) == 1
    assert "small.off: the largest component has 42 vertices" in one_line(capsys)
    assert main(["check", file, "--for", "marriage"]) == 2


@pytest.mark.parametrize("side", ["source", "target"])
def test_match_names_the_file_that_it_refuses(shapes, tmp_path, capsys, side):
    isomatch.write_mesh(tmp_path / "small.off", icosphere(1))
    files = {name: str(shapes / f"{name}.ply") for name in ("source", "target")}
    files[side] = str(tmp_path / "small.off")
    assert main(["match", *files.values(), "-o", str(tmp_path / "out")]) == 1
    assert f"isomatch: {side} {files[side]}: the largest component has 42 vertices" in one_line(capsys)


@pytest.mark.long
def test_match_starts_from_the_pose(tmp_path, capsys):
    isomatch.write_mesh(tmp_path / "strip.off", flat_grid(2, 60))
    file, out = str(tmp_path / "strip.off"), tmp_path / "out"
    assert main(["match", file, file, "--start", "pose", "-o", str(out), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["config"]["start"] == "pose"


@pytest.mark.long
def test_json_says_where_the_time_went(shapes, tmp_path, capsys):
    files = [str(shapes / f"{name}.ply") for name in ("source", "target")]
    settings = ["--config", str(shapes / "quick.toml"), "-o", str(tmp_path / "out"), "--no-report"]
    assert main(["match", *files, *settings, "--json"]) == 0
    timings = json.loads(capsys.readouterr().out)["timings"]
    own = {stage for stage in timings if stage.startswith(("source: ", "target: "))}
    assert {"source: distances", "target: functions"} <= own
    assert min(timings.values()) >= 0
    total = timings.pop("total")
    assert sum(spent for stage, spent in timings.items() if stage not in own) == pytest.approx(
        total, rel=0.03
    )


def test_repair_keeps_the_outermost_surface(tmp_path, capsys):
    sphere = icosphere(3)
    isomatch.write_mesh(tmp_path / "nested.ply", together(sphere, moved(sphere, scale=0.5)))
    argv = ["repair", str(tmp_path / "nested.ply"), "-o", str(tmp_path / "outer.ply"), "--outer"]
    assert main(argv) == 0
    assert "removed 1280 faces of chambers, 20.0% of the area" in capsys.readouterr().out
    assert isomatch.read_mesh(tmp_path / "outer.ply").n_vertices == sphere.n_vertices
    assert main([*argv, "--force", "--opening", "0"]) == 1
    assert "opening = 0.0 is no size" in capsys.readouterr().err


def test_repair_writes_mesh_and_index(tmp_path, capsys):
    points = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]
    isomatch.write_mesh(tmp_path / "torn.off", isomatch.Mesh(points, [[0, 1, 2], [3, 4, 5]]))
    argv = ["repair", str(tmp_path / "torn.off"), "-o", str(tmp_path / "whole.off")]
    assert main(argv) == 0
    assert "welded 2 vertices" in capsys.readouterr().out
    assert isomatch.read_mesh(tmp_path / "whole.off").n_vertices == 4
    with np.load(tmp_path / "whole.index.npz") as index:
        assert index["new_index"].tolist() == [0, 1, 2, 1, 2, 3]
    assert main(argv) == 1
    assert "already exists" in one_line(capsys)
    assert main([*argv, "--force", "-q"]) == 0
    assert capsys.readouterr().out == ""
    assert main([*argv, "--force", "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["files"] == [str(tmp_path / name) for name in ("whole.off", "whole.index.npz")]
    assert "welded 2 vertices" in record["changes"][0]


def test_the_wait_is_that_of_the_whole_command():
    start_clock(with_process=True)
    of_process = waited()
    start_clock(with_process=False)
    assert 0 <= waited() < 0.5 < of_process, "the process has imported this test"


def test_calls_and_settings_are_said_as_they_are_typed(capsys):
    complain("a.ply: repair(mesh, weld=0.1) welds them, repair(mesh) removes them; set resolution = 'full'")
    assert one_line(capsys) == (
        "isomatch: a.ply: isomatch repair --weld 0.1 welds them, isomatch repair removes them; set --resolution full\n"
    )


def test_a_word_that_is_no_number_is_said_so(capsys):
    assert main(["open", "a.ply", "b.ply", "--port", "abc"]) == 2
    assert "--port: 'abc' is not a whole number. See isomatch open --help." in one_line(capsys)
    assert main(["choose", "out", "one"]) == 2
    assert "NUMBER: 'one' is not a whole number." in one_line(capsys)


def test_an_interruption_has_its_own_exit_code(monkeypatch, capsys):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("platform.python_version", interrupted)
    assert main(["info"]) == 130
    assert one_line(capsys) == "isomatch: interrupted\n"


@pytest.mark.parametrize(
    ("said", "told"), [("", "no more is given"), ("Unable to allocate 75 GiB", "75 GiB")]
)
def test_memory_that_does_not_suffice_is_one_line(shapes, monkeypatch, capsys, said, told):
    def too_much(*_, **__):
        raise MemoryError(said)

    monkeypatch.setattr(isomatch, "check", too_much)
    assert main(["check", str(shapes / "source.ply")]) == 1
    complaint = one_line(capsys)
    assert "memory does not suffice" in complaint
    assert told in complaint


def test_info_tells_versions(capsys):
    assert main(["info", "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["isomatch"] == isomatch.__version__
    assert {"python", "numba", "pygeodesic", "threads", "memory_budget_gib"} <= facts.keys()
    assert "processor" in facts["processor"]
    kernels = {pool.get("architecture") for pool in threadpool_info() if pool["user_api"] == "blas"} - {None}
    assert all(kernel in facts["blas"] for kernel in kernels)
    assert kernels or sys.platform != "linux"
    assert main(["info"]) == 0
    assert isomatch.__version__ in capsys.readouterr().out


@pytest.mark.long
def test_demo_is_accurate_and_writes_again(tmp_path, capsys):
    (tmp_path / "map.npz").write_bytes(b"an earlier demo")
    assert main(["demo", "-o", str(tmp_path)]) == 0
    assert "in truth    0." in capsys.readouterr().out
    names = sorted(path.name for path in tmp_path.iterdir() if "alternative" not in path.name)
    assert names == sorted([*RESULT_FILES, "running.ply", "standing.ply"])
    assert json.loads((tmp_path / "result.json").read_text())["mean_error_over_sqrt_target_area"] < 0.015
    assert main(["choose", str(tmp_path), "1"]) == 0


def test_help_shows_defaults_and_version_is_told(capsys):
    assert main(["match", "--help"]) == 0
    assert "default: 0" in " ".join(capsys.readouterr().out.split())
    assert main(["--version"]) == 0
    assert capsys.readouterr().out.strip() == isomatch.__version__


@pytest.mark.long
def test_the_program_itself(tmp_path):
    absent = str(tmp_path / "absent.off")
    run = subprocess.run([sys.executable, "-m", "isomatch", "check", absent], capture_output=True, text=True)
    assert run.returncode == 1
    assert run.stdout == ""
    assert run.stderr == f"isomatch: {absent}: no such file; check the name and the folder\n"


def test_numbers_that_json_does_not_know_become_null():
    assert json.loads(json_text({"a": [float("inf"), 1.5], "b": (float("nan"), "x")})) == {
        "a": [None, 1.5],
        "b": [None, "x"],
    }
