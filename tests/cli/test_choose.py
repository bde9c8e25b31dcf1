"""Alternatives are saved beside the map, and one of them can be made the map."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

import isomatch
from command_line import write_pair
from isomatch.cli import main
from isomatch.cli.results import Earlier
from isomatch.datasets import example_pair, ground_truth
from isomatch.matching import Alternative

pytestmark = pytest.mark.usefixtures("prepared_once", "small_pictures")


@pytest.fixture(scope="module")
def shapes(tmp_path_factory):
    return write_pair(tmp_path_factory.mktemp("shapes"))


def matched_with_alternatives(shapes, folder, *more):
    """Match into a folder, with two alternatives: all vertices to one, and the map itself."""
    match = isomatch.match

    def with_alternatives(source, target, **options):
        found = match(source, target, **options)
        maps = isomatch.Correspondence(np.zeros_like(found.map.vertices), target.n_vertices), found.map
        others = tuple(
            Alternative(lambda one=one: one, 0.1 + k, 0.5, f"try {k}") for k, one in enumerate(maps)
        )
        return isomatch.MatchResult(**{**vars(found), "alternatives": others})

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(isomatch, "match", with_alternatives)
        ends = [str(shapes / "source.ply"), str(shapes / "target.ply")]
        command = ["match", *ends, "-o", str(folder), "--config", str(shapes / "quick.toml"), "--seed", "3"]
        assert main([*command, *more]) == 0


@pytest.fixture(scope="module")
def matched(shapes, tmp_path_factory):
    folder = tmp_path_factory.mktemp("matched")
    matched_with_alternatives(shapes, folder)
    return folder


@pytest.fixture
def result(matched, tmp_path):
    return shutil.copytree(matched, tmp_path / "result")


def test_a_result_finds_its_meshes_after_cd_and_after_a_move(tmp_path, monkeypatch):
    names = ["a.ply", "b.ply"]
    record = {
        "source": "a.ply",
        "target": "b.ply",
        "match_again": "",
        "origin": "",
        "landmarks": [],
        "seed": 0,
    }
    record |= {"alternatives": [], "config": {}, "files": {}, "meshes": ["../a.ply", str(tmp_path / "b.ply")]}
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "result").mkdir()
    (tmp_path / "result" / "result.json").write_text(json.dumps(record))
    for name in names:
        (tmp_path / name).touch()
    monkeypatch.chdir(tmp_path / "elsewhere")
    earlier = Earlier.read(Path("../result"))
    assert [Path.resolve(path) for path in vars(earlier.inputs).values() if isinstance(path, Path)] == [
        tmp_path / name for name in names
    ]
    shutil.move(tmp_path / "result", tmp_path / "elsewhere" / "moved")
    with pytest.raises(isomatch.MissingFileError, match=r"a\.ply: no such file.*give both meshes"):
        Earlier.read(Path("moved"))
    assert (
        Earlier.read(Path("moved"), *(tmp_path / name for name in names)).inputs.source == tmp_path / "a.ply"
    )
    shutil.move(tmp_path / "a.ply", tmp_path / "elsewhere" / "moved" / "a.ply")  # as of a downloaded result
    assert Earlier.read(Path("moved")).inputs.source == Path("moved/a.ply")


@pytest.mark.long
def test_an_alternative_becomes_the_map_and_the_map_an_alternative(matched, result, capsys):
    before = json.loads((result / "result.json").read_text())
    assert before["files"]["alternative_2"] == str(matched / "alternative_2.npz")
    first, chosen = (isomatch.Correspondence.load(result / f"alternative_{k}.npz") for k in (1, 2))
    former = isomatch.Correspondence.load(result / "map.npz")
    capsys.readouterr()
    assert main(["choose", str(result), "2", "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record == json.loads((result / "result.json").read_text())
    assert record["origin"] == "try 1"
    assert "alternative 2, from try 1, was chosen" in record["notes"][0]
    assert [each["origin"].split(",")[0] for each in record["alternatives"]] == ["the map before", "try 0"]
    assert [each["energy"] for each in record["alternatives"]] == [None, 0.1]
    assert record["config"] == {**before["config"], "hypotheses": "given"}
    for kept in ("seed", "source", "target", "match_again"):
        assert record[kept] == before[kept]
    others = [isomatch.Correspondence.load(result / f"alternative_{k}.npz") for k in (1, 2)]
    np.testing.assert_array_equal(others[0].vertices, former.vertices)
    np.testing.assert_array_equal(others[1].vertices, first.vertices)
    target = example_pair()[1].mesh
    found = isomatch.Correspondence.load(result / "map.npz").vertices
    moved = np.linalg.norm(target.vertices[found] - target.vertices[chosen.vertices], axis=1)
    assert np.median(moved) < 0.05 * np.sqrt(target.area)
    report = (result / "report.html").read_text(encoding="utf-8")
    assert "<strong>Alternative 1</strong> The map before this one was chosen. Differs on" in report


@pytest.mark.long
def test_choosing_again_tells_where_maps_came_from(result, capsys):
    record = json.loads((result / "result.json").read_text())
    first = record["origin"]
    del record["files"]["report"]
    shared = result.parent / "shared.ply"
    shared.write_bytes(b"as it was written")
    record["as_mesh"] = {"file": str(shared)}
    (result / "result.json").write_text(json.dumps(record))
    shutil.copy(result / "map.npz", result / "map_back.npz")
    capsys.readouterr()
    for number, removed in (("1", True), ("2", False)):
        assert main(["choose", str(result), number]) == 0
        said = " ".join(capsys.readouterr().out.split())
        assert ("the map back belonged to the map before and was removed" in said) == removed
        assert (f"{shared} is of the map before and was left" in said) == removed
    record = json.loads((result / "result.json").read_text())
    origins = [record["origin"], *(each["origin"] for each in record["alternatives"])]
    assert origins == ["try 1", "the map before, try 0", first]
    assert "as_mesh" not in record
    assert shared.read_bytes() == b"as it was written"


@pytest.mark.long
def test_landmarks_are_held_on_and_the_pose_no_longer_leads(shapes, tmp_path):
    truth = ground_truth(*example_pair()).vertices
    pairs = [(i, int(truth[i])) for i in range(0, len(truth), 600)]
    (tmp_path / "pairs.txt").write_text("\n".join(f"{i}, {j}" for i, j in pairs))
    more = "--no-report", "--pin", "0", "--start", "pose", "--landmarks", str(tmp_path / "pairs.txt")
    matched_with_alternatives(shapes, tmp_path / "out", *more)
    assert main(["choose", str(tmp_path / "out"), "2"]) == 0
    record = json.loads((tmp_path / "out" / "result.json").read_text())
    assert record["landmarks"] == [list(pair) for pair in pairs]
    assert (record["config"]["pin"], record["config"]["start"]) == (0, "auto")
    found = isomatch.Correspondence.load(tmp_path / "out" / "map.npz").vertices
    assert all(found[i] == j for i, j in pairs)
    assert not (tmp_path / "out" / "report.html").exists()


@pytest.mark.long
def test_a_match_without_a_map_leaves_an_earlier_result(shapes, result):
    before = {path.name: path.read_bytes() for path in result.iterdir()}
    (result.parent / "two.txt").write_text("1, 2\n3, 4\n")
    ends = [str(shapes / "source.ply"), str(shapes / "target.ply")]
    more = "--landmarks", str(result.parent / "two.txt"), "--force", "-o", str(result)
    assert main(["match", *ends, *more]) == 1
    assert before.items() <= {path.name: path.read_bytes() for path in result.iterdir()}.items()


@pytest.mark.long
def test_what_cannot_be_chosen_is_refused_and_nothing_changes(result, tmp_path, capsys):
    before = {path.name: path.read_bytes() for path in result.iterdir()}
    capsys.readouterr()
    for folder, number, said in [
        (result, "0", "there is no alternative 0; the result has 2"),
        (result, "3", "there is no alternative 3"),
        (tmp_path / "nowhere", "1", "result.json: no such file"),
    ]:
        assert main(["choose", str(folder), number]) == 1
        assert said in capsys.readouterr().err
    for text in ("[]", "{", json.dumps({"source": 3})):
        (result / "result.json").write_text(text)
        assert main(["choose", str(result), "1"]) == 1
        assert "result.json: lacks source, target" in capsys.readouterr().err
    record = json.loads(before["result.json"])
    swapped = {"source": record["target"], "meshes": [record["meshes"][1]] * 2}
    (result / "result.json").write_text(json.dumps({**record, **swapped}))
    assert main(["choose", str(result), "1"]) == 1
    assert "is not a map of this source" in capsys.readouterr().err
    (result / "result.json").write_bytes(before["result.json"])
    assert {path.name: path.read_bytes() for path in result.iterdir()} == before


def test_a_match_that_finds_no_map_leaves_a_picker(shapes, tmp_path, capsys):
    (tmp_path / "two.txt").write_text("1, 2\n3, 4\n")
    ends = [str(shapes / "source.ply"), str(shapes / "target.ply")]
    argv = ["match", *ends, "-o", str(tmp_path / "out"), "--config", str(shapes / "quick.toml")]
    assert main([*argv, "--start", "pose", "--landmarks", str(tmp_path / "two.txt")]) == 1
    said = capsys.readouterr().err
    assert "2 landmarks do not fix an alignment" in said
    assert f"Both shapes are in {tmp_path / 'out' / 'picker.html'}" in said
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["picker.html"]
    report = (tmp_path / "out" / "picker.html").read_text(encoding="utf-8")
    assert "No map was found" in report
    assert '"landmarks": [[1, 2], [3, 4]]' in report
    assert "--start pose" in report
    assert "--landmarks landmarks.txt --force</pre>" in report
