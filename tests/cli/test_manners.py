"""How commands talk: events, silence, progress, and exit codes that scripts can rely on."""

import json
import os
import re
import subprocess
import sys
import time

import numpy as np
import pytest
from matplotlib.image import imread
from scipy.io import savemat

import isomatch
from command_line import QUICKEST, write_pair
from isomatch.cli import Talk, app, main, program, terminal
from isomatch.datasets import example_pair, ground_truth
from shapes import icosphere

pytestmark = pytest.mark.usefixtures("prepared_once", "small_pictures")


@pytest.fixture(scope="module")
def shapes(tmp_path_factory):
    folder = write_pair(tmp_path_factory.mktemp("shapes"), "ab", QUICKEST)
    np.savetxt(folder / "truth.txt", ground_truth(*example_pair()).vertices, fmt="%d")
    return folder


@pytest.fixture
def matching(shapes, tmp_path, monkeypatch):
    """Run a quick match with more options; exit code."""
    monkeypatch.chdir(shapes)
    out = str(tmp_path / "out")
    return lambda more="": main(f"match a.ply b.ply --config quick.toml --force -o {out} {more}".split())


def events_of(said):
    return [json.loads(line) for line in said.splitlines()]


def test_json_lines_give_stages_and_the_result(matching, tmp_path, capsys):
    assert matching("--json-lines") == 0
    *stages, result = events_of(capsys.readouterr().out)
    assert {each["event"] for each in stages} == {"stage"}
    shares = [each["share"] for each in stages]
    assert shares == sorted(shares)
    assert (shares[0], shares[-1]) == (0.0, 1.0)
    assert result.pop("event") == "result"
    assert result == json.loads((tmp_path / "out" / "result.json").read_text())


@pytest.mark.long
@pytest.mark.parametrize(
    "command",
    [
        "distance sphere.off --from 0 --json-lines",
        "basis sphere.off -o basis.npz --json-lines",
        "bench --set example --points 50 --methods gdd --jobs 1 -o rows --json-lines",
    ],
)
def test_every_long_command_gives_events(command, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    isomatch.write_mesh("sphere.off", icosphere(2))
    assert main(command.split()) == 0
    *stages, result = events_of(capsys.readouterr().out)
    assert [each["share"] for each in (stages[0], stages[-1])] == [0.0, 1.0]
    assert result["event"] == "result"


def test_quiet_prints_nothing_and_no_report_writes_none(matching, tmp_path, capsys):
    assert matching("--quiet --no-report") == 0
    said = capsys.readouterr()
    assert said.out == said.err == ""
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert "report.html" not in names
    assert {"map.npz", "map.png", "map.txt", "result.json"} <= names


@pytest.mark.long
def test_verbose_writes_the_log(matching, capsys):
    assert matching("--verbose") == 0
    assert "INFO  refinement" in capsys.readouterr().err


@pytest.mark.long
@pytest.mark.parametrize(("word", "code"), [("low-confidence,ambiguous", 4), ("contradicted", 0)])
def test_an_outcome_can_fail_after_all_files_are_written(word, code, tmp_path, monkeypatch, capsys):
    """A ball has every symmetry."""
    monkeypatch.chdir(tmp_path)
    isomatch.write_mesh("a.off", icosphere(2))
    assert main(f"match a.off a.off --quiet -o out --fail-on {word}".split()) == code
    said = capsys.readouterr().err
    assert ("the files are in out" in said) == bool(code)
    assert (tmp_path / "out" / "result.json").exists()


def test_an_unknown_outcome_is_refused_before_the_work(matching, tmp_path, capsys):
    assert matching("--fail-on ,") == 1
    assert "--fail-on ',' names nothing" in capsys.readouterr().err
    assert matching("--fail-on sadness") == 1
    assert "'sadness' is not an outcome; known are priors-contradicted" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.long
def test_bounds_stand_beside_the_measures(matching, tmp_path, capsys):
    assert matching("--details") == 0
    assert "≤ 0." in capsys.readouterr().out
    bounds = json.loads((tmp_path / "out" / "result.json").read_text())["bounds"]
    assert bounds["spectral_residual"] == {"most": isomatch.Config().outcome.poor_spectral_residual}
    assert bounds["runner_up"] == {"least": isomatch.Config().outcome.tie}


@pytest.mark.long
def test_both_directions(matching, tmp_path, capsys):
    assert matching("--both --json") == 0
    record = json.loads(capsys.readouterr().out)
    assert record["n_source"] == record["back"]["n_target"]
    back = isomatch.Correspondence.load(tmp_path / "out" / "map_back.npz")
    assert back.shape == (record["n_target"], record["n_source"])


@pytest.mark.long
def test_files_of_an_earlier_result_do_not_stay(matching, tmp_path):
    assert matching("--both") == 0
    for name in ("alternative_3.npz", "picker.html"):
        (tmp_path / "out" / name).write_text("earlier")
    assert "--both" in json.loads((tmp_path / "out" / "result.json").read_text())["match_again"].split()
    assert matching("--no-report") == 0
    files = json.loads((tmp_path / "out" / "result.json").read_text())["files"].values()
    assert {str(path) for path in (tmp_path / "out").iterdir()} == set(files)


@pytest.mark.parametrize("name", ["b.unknown", "b"])
def test_a_mesh_that_cannot_be_written_is_refused_before_the_work(name, matching, tmp_path, capsys):
    assert matching(f"--json-lines --as-mesh {tmp_path}/{name}") == 1
    said = capsys.readouterr()
    assert "b" in said.err
    assert [event["stage"] for event in events_of(said.out)] == ["reading"]
    assert not (tmp_path / "out").exists()


@pytest.mark.long
def test_hypotheses_may_come_from_priors_alone(matching, capsys):
    assert matching("--hypotheses given") == 1
    assert "no landmarks, initial map or descriptors" in capsys.readouterr().err
    assert matching("--hypotheses given --initial-map truth.txt --json") == 0
    assert json.loads(capsys.readouterr().out)["origin"] == "initial map"


def test_other_packages_are_looked_for_only_for_other_commands(monkeypatch, capsys):
    asked = []
    monkeypatch.setattr("isomatch.cli.program.entry_points", lambda group: asked.append(group) or [])
    assert main(["info", "--json"]) == 0
    assert main(["match", "--help"]) == 0
    assert not asked
    for words in ([], ["--help"], ["no-such-command"]):
        main(words)
    assert asked == 3 * ["isomatch.commands"]
    capsys.readouterr()


def test_completion_knows_the_commands():
    script = app.generate_completion(shell="bash")
    assert all(word in script for word in ("match", "evaluate", "--fail-on"))


def test_a_folder_is_checked_in_a_table(tmp_path, capsys):
    isomatch.write_mesh(tmp_path / "good.off", icosphere(3))
    isomatch.write_mesh(tmp_path / "small.off", icosphere(1))
    assert main(["check", str(tmp_path)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines[:3]] == ["file", "good.off", "small.off"]
    assert lines[1].endswith("2  everything")  # the diameter of the sphere
    assert lines[2].endswith("  distance")
    assert any(line.startswith("  not fit for match: ") for line in lines[3:])
    assert max(map(len, lines[:-1])) <= 80
    assert main(["check", str(tmp_path), "--for", "match"]) == 1
    assert "1 of 2 meshes are not fit for match: " in capsys.readouterr().err
    (tmp_path / "bad.off").write_text("nothing")
    assert main(["check", str(tmp_path)]) == 1
    assert re.search(r"(?m)^bad\.off +– +– +–  nothing\n  \S", capsys.readouterr().out)
    assert main(["check", str(tmp_path / "good.off"), str(tmp_path / "bad.off"), "--json"]) == 1
    good, bad = json.loads(capsys.readouterr().out)
    assert good["ok"]
    assert not bad["ok"]
    assert "bad.off" in bad["unreadable"]
    (tmp_path / "empty").mkdir()
    assert main(["check", str(tmp_path / "empty")]) == 1
    assert "no mesh in this folder" in capsys.readouterr().err


def evaluated(capsys, command):
    assert main([*command.split(), "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_evaluate_knows_a_perfect_map_and_counts_what_is_missing(shapes, monkeypatch, tmp_path, capsys):
    monkeypatch.chdir(shapes)
    perfect = evaluated(capsys, "evaluate truth.txt truth.txt a.ply b.ply --points 50")
    assert (perfect["mean"], perfect["max"], perfect["auc"], perfect["points"]) == (0, 0, 1, 50)
    truth = np.loadtxt("truth.txt", dtype=int)
    pairs = np.column_stack([np.arange(40), truth[:40]])
    np.savetxt(tmp_path / "pairs.txt", pairs, fmt="%d")
    truth[:20] = -1
    np.savetxt(tmp_path / "half.txt", truth, fmt="%d")
    half = evaluated(capsys, f"evaluate {tmp_path}/half.txt {tmp_path}/pairs.txt a.ply b.ply")
    assert (half["mean"], half["unmatched"], half["auc"], half["points"]) == (0.5, 0.5, 0.5, 40)
    for name, column in zip(("a.vts", "b.vts"), pairs.T):
        np.savetxt(tmp_path / name, column + 1, fmt="%d")
    marks = f"{tmp_path}/a.vts a.ply b.ply --target-marks {tmp_path}/b.vts"
    assert evaluated(capsys, f"evaluate {tmp_path}/half.txt {marks}") == half | {"truth": f"{tmp_path}/a.vts"}
    assert main(["evaluate", "truth.txt", "truth.txt", "a.ply", "b.ply", "--points", "20"]) == 0
    assert "error, mean" in capsys.readouterr().out


@pytest.mark.long
def test_evaluate_without_a_truth_matches_and_writes_a_page(shapes, monkeypatch, tmp_path, capsys):
    monkeypatch.chdir(shapes)
    right = evaluated(capsys, f"evaluate truth.txt a.ply b.ply -o {tmp_path}/page.html")
    assert (right["verdict"], right["given"]["support"]) == ("right", 1)
    assert "<option>the map that was given</option>" in (tmp_path / "page.html").read_text(encoding="utf-8")


def test_evaluate_with_a_reference_says_whether_a_map_is_right(shapes, monkeypatch, tmp_path, capsys):
    monkeypatch.chdir(shapes)
    shuffled = np.random.default_rng(0).permutation(np.loadtxt("truth.txt", int))
    np.savetxt(tmp_path / "wrong.txt", shuffled, fmt="%d")
    command = ["evaluate", f"{tmp_path}/wrong.txt", "a.ply", "b.ply", "--reference", "truth.txt"]
    wrong = evaluated(capsys, " ".join(command))
    assert (wrong["verdict"], wrong["regions"] != []) == ("wrong", True)
    assert wrong["given"]["cost"] > 2 * wrong["reference"]["cost"]
    assert main([*command, "--fail-on", "wrong"]) == 4
    told = capsys.readouterr()
    assert "descriptor distance" in told.out
    assert "wrong: it differs from the reference" in told.err
    assert main([*command, "--fail-on", "bad"]) == 1
    assert main([*command, "-o", f"{tmp_path}/other.html"]) == 1


def test_evaluate_reads_maps_and_truths_of_other_programs(shapes, monkeypatch, tmp_path, capsys):
    monkeypatch.chdir(shapes)
    truth = np.loadtxt("truth.txt", dtype=int)
    n = isomatch.read_mesh("b.ply").n_vertices
    reference = evaluated(capsys, "evaluate truth.txt truth.txt a.ply b.ply")
    savemat(tmp_path / "map.mat", {"T12": np.append(truth[:-1], n - 1) + 1.0, "C": np.eye(3)})
    np.save(tmp_path / "map.npy", truth)
    corners = np.column_stack([np.arange(len(truth)) % 7, np.full((len(truth), 3), 1 / 3)])
    np.savetxt(tmp_path / "faces.txt", corners)
    one = evaluated(capsys, f"evaluate {tmp_path}/map.mat {tmp_path}/map.npy a.ply b.ply")
    assert one["median"] == reference["median"] == 0
    assert one["notes"] == [
        f"map.mat: counts from 1, as its largest index, {n}, is the number of target vertices"
    ]
    points = evaluated(capsys, f"evaluate {tmp_path}/map.npy {tmp_path}/faces.txt a.ply b.ply --points 20")
    assert 0.1 < points["mean"] < 2
    savemat(tmp_path / "map.mat", {"T12": np.clip(truth, 1, n - 2)})
    command = f"evaluate {tmp_path}/map.mat truth.txt a.ply b.ply --points 50"
    assert main(command.split()) == 1
    assert "map.mat: can count from 0 or from 1" in capsys.readouterr().err
    assert evaluated(capsys, f"{command} --counts-from 0")["median"] == 0
    assert evaluated(capsys, f"{command} --counts-from 1")["median"] > 0


@pytest.mark.parametrize(
    ("truth", "complaint"),
    [
        ("0 999999\n", "names target vertices"),
        ("# nothing\n", "no target vertices"),
        ("x y\n", "is not a pair"),
    ],
)
def test_evaluate_refuses_a_truth_of_other_shapes(truth, complaint, shapes, monkeypatch, tmp_path, capsys):
    monkeypatch.chdir(shapes)
    (tmp_path / "truth.txt").write_text(truth)
    assert main(f"evaluate truth.txt {tmp_path}/truth.txt a.ply b.ply".split()) == 1
    assert complaint in capsys.readouterr().err


def test_evaluate_refuses_a_map_of_other_shapes(shapes, monkeypatch, tmp_path, capsys):
    monkeypatch.chdir(shapes)
    target = isomatch.read_mesh("b.ply")
    found = isomatch.Correspondence(np.loadtxt("truth.txt", dtype=int), target.n_vertices)
    isomatch.Correspondence(found.vertices, found.n_target, source_hash=target.content_hash).save(
        tmp_path / "map.npz"
    )
    assert main(f"evaluate {tmp_path}/map.npz truth.txt a.ply b.ply".split()) == 1
    assert "is a map of another source" in capsys.readouterr().err


def test_evaluate_refuses_the_other_direction(shapes, monkeypatch, capsys):
    monkeypatch.chdir(shapes)
    assert main(["evaluate", "truth.txt", "truth.txt", "b.ply", "a.ply"]) == 1
    assert "give the map of these two shapes in this direction" in capsys.readouterr().err


@pytest.mark.long
@pytest.mark.skipif(os.name != "posix", reason="pseudo-terminals of POSIX")
def test_a_terminal_shows_stage_share_and_time(shapes, tmp_path):
    import pty

    terminal, end = pty.openpty()
    argv = [
        sys.executable,
        *["-m", "isomatch", "match", "a.ply", "b.ply", "--config", "quick.toml", "-o"],
        str(tmp_path / "o"),
    ]
    with subprocess.Popen(argv, cwd=shapes, stdout=subprocess.DEVNULL, stderr=end):
        os.close(end)
        said = b""
        while True:
            try:
                said += os.read(terminal, 4096)
            except OSError:  # the other end was closed
                break
    os.close(terminal)
    assert b"refinement" in said or b"search" in said or b"prepare" in said
    assert b"%" in said
    assert b"0:00:0" in said


def test_quiet_commands_still_answer(tmp_path, monkeypatch, capsys):
    """What is written to no file is what was asked for."""
    monkeypatch.chdir(tmp_path)
    sphere = icosphere(2)
    isomatch.write_mesh("sphere.off", sphere)
    np.savetxt("pairs.txt", [[0, 1], [2, 3]], fmt="%d")
    np.savetxt("map.txt", np.arange(sphere.n_vertices), fmt="%d")
    for command in (
        "distance sphere.off --pairs pairs.txt",
        "distance sphere.off --from 0,5",
        "evaluate map.txt map.txt sphere.off sphere.off",
    ):
        assert main(command.split()) == 0
        said = capsys.readouterr().out
        assert main([*command.split(), "--quiet"]) == 0
        assert capsys.readouterr().out == said != ""
    assert main(["distance", "sphere.off", "--from", "0", "-o", "out.csv", "--quiet"]) == 0
    assert capsys.readouterr().out == ""


@pytest.mark.long
def test_points_without_faces_are_matched_and_drawn(tmp_path, monkeypatch, shapes, capsys):
    monkeypatch.chdir(tmp_path)
    for name in "ab":
        mesh = isomatch.read_mesh(shapes / f"{name}.ply")
        isomatch.write_mesh(f"{name}.ply", isomatch.Mesh(mesh.vertices[::2], []))
    config = str(shapes / "quick.toml")
    assert main(f"match a.ply b.ply --config {config} -o out".split()) == 0
    expected = isomatch.match(
        isomatch.read_point_cloud("a.ply"),
        isomatch.read_point_cloud("b.ply"),
        config=isomatch.Config.from_file(config),
    )
    found = isomatch.Correspondence.load("out/map.npz")
    np.testing.assert_array_equal(found.vertices, expected.map.vertices)
    assert (tmp_path / "out" / "report.html").exists()
    assert (imread(tmp_path / "out" / "map.png")[..., :3] < 0.9).mean() > 0.05
    capsys.readouterr()
    assert main(f"match a.ply b.ply --config {config} -o other --as-mesh c.ply".split()) == 1
    assert "a.ply: has no faces, which --as-mesh needs" in capsys.readouterr().err
    isomatch.write_mesh("few.ply", isomatch.Mesh(np.eye(3), []))
    assert main(["match", "few.ply", "b.ply", "-o", "other"]) == 1
    assert "few.ply: has no faces, and its points have shape (3, 3)" in capsys.readouterr().err


def test_the_clock_tells_rate_and_time_left_of_steps_that_are_counted(monkeypatch):
    now = [0.0]
    monkeypatch.setattr("isomatch.cli.terminal.time.monotonic", lambda: now[0])
    clock = terminal._Clock()
    for seconds, stage in ((50, "looked at 3 of 3: a"), (60, "matched 1 of 5: b"), (70, "matched 2 of 5: c")):
        now[0] = seconds
        clock.tell(stage, 1.0)
    assert str(clock) == "0:01:10, 6 a minute, 0:00:30 left"
    now[0] = 75
    assert str(clock) == "0:01:15, 6 a minute, 0:00:25 left"
    clock.tell("writing", 0.0)
    assert str(clock) == "0:01:15"


def test_without_a_terminal_there_are_dated_lines(monkeypatch, capsys):
    monkeypatch.setattr(terminal, "SECONDS_BETWEEN_LINES", 0.01)
    with Talk().progress() as tell:
        tell("matched 1 of 4: a", 0.25)
        time.sleep(0.1)
    lines = capsys.readouterr().err.splitlines()
    dated = r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d\S+  matched 1 of 4: a  25%  0:00:00.*"
    assert re.fullmatch(dated, lines[-1])
    with Talk(quiet=True).progress() as tell:
        tell("matched 1 of 4: a", 0.25)
        time.sleep(0.05)
    assert capsys.readouterr().err == ""


def test_every_command_has_a_group_an_example_and_short_options(capsys):
    assert main(["--help"]) == 0
    said = capsys.readouterr().out
    titles = ("Match", "Look", "Use", "Many", "Measure", "Develop")
    places = [said.index(f"─ {title} ─") for title in titles]
    assert places == sorted(places)
    for name, example in program.EXAMPLES.items():
        app.parse_args(example.split(), exit_on_error=False, print_error=False)
        assert example.split()[0] == name
    assert main(["match", "--help"]) == 0
    said = capsys.readouterr().out
    assert "Example: isomatch match a.ply b.ply -o result" in said
    assert all(option in said for option in ("--quiet -q", "--verbose -v", "--json -j", "--force -f"))
    assert main(["-V"]) == 0
    assert capsys.readouterr().out == f"{isomatch.__version__}\n"
