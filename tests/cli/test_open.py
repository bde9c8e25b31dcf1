"""`isomatch open`: what is refused before a page is served, and the files that the page keeps."""

import json
import sys
import zipfile
from dataclasses import replace
from importlib import import_module
from io import BytesIO
from queue import Empty, Queue
from threading import Event

import numpy as np
import pytest

import isomatch
from command_line import QUICKEST
from isomatch import server
from isomatch.cli import main
from isomatch.matching import match
from served_pages import PAIRS, QUICK, bent

pytest.importorskip("starlette", reason="needs the extra open")
pytest.importorskip("uvicorn", reason="needs the extra open")
pytestmark = pytest.mark.usefixtures("small_pictures")


@pytest.fixture
def shapes(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in "ab":
        isomatch.write_mesh(f"{name}.ply", bent())
    return tmp_path


@pytest.fixture
def served(monkeypatch):
    """The command serves nothing; what it would have served, and with what."""
    kept = []

    class Recorded(server.Session):
        def __init__(self, surfaces, page, keeper, **options):
            kept.append((keeper, options))
            super().__init__(surfaces, page, keeper, **options)

    monkeypatch.setattr(import_module("isomatch.cli.open_command"), "Session", Recorded)
    monkeypatch.setattr(server.PageServer, "run", lambda server: server._socket.close())
    monkeypatch.setattr("webbrowser.open", lambda address: None)
    return kept


@pytest.mark.parametrize("name", ["starlette", "uvicorn"])
def test_a_missing_package_is_named_at_once(name, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, name, None)
    assert main(["open", "nowhere.ply", "either.ply"]) == 1
    assert (
        f"isomatch open needs the package {name}; in the checkout of isomatch, pip install '.[open]'"
        in capsys.readouterr().err
    )


def test_the_browser_gets_an_address_that_works_once_and_may_take_long(shapes, served, monkeypatch, capsys):
    closed, asked = Event(), Queue()
    monkeypatch.setattr("webbrowser.open", lambda address: closed.wait(20) and asked.put(address))
    assert main(["open", "a.ply", "b.ply"]) == 0
    assert asked.empty()
    closed.set()
    once = asked.get(timeout=20)
    address = capsys.readouterr().out.splitlines()[0]
    assert address.startswith("http://127.0.0.1:")
    assert "/?token=" in address
    assert once.partition("?")[0] == address.partition("?")[0]
    assert once.partition("?")[2].startswith("once=")
    assert main(["open", "a.ply", "b.ply", "--no-browser"]) == 0
    with pytest.raises(Empty):
        asked.get(timeout=0.2)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("a.ply", "a.ply: isomatch open needs two shapes, or the folder of a result"),
        (". -o out --config x.toml", "-o, --config: the result in . has its own"),
        (". --initial-map x.txt", "--initial-map: the result in . has its own"),
        ("a.ply b.ply --initial-map short.txt", "is not a map of this source, which has"),
        (". --seed 0 --force", "--seed, --force: the result in . has its own, and Save replaces it"),
        (".", "result.json: no such file"),
        ("a.ply b.ply --target-landmarks x.txt", "--target-landmarks needs --landmarks"),
        ("a.ply b.ply -o full", "full/map.npz: already exists"),
        ("a.ply b.ply --port 70000", "--port 70000 cannot be used"),
    ],
)
def test_what_is_refused(words, said, shapes, served, capsys):
    (shapes / "full").mkdir()
    (shapes / "full" / "map.npz").write_bytes(b"a result")
    (shapes / "short.txt").write_text("0\n1\n")
    assert main(["open", *words.split()]) == 1
    assert said in capsys.readouterr().err
    assert not (shapes / "out").exists()


def test_a_map_to_look_at_is_read_and_told(shapes, served):
    n = bent().n_vertices
    np.savetxt("turned.txt", np.roll(np.arange(n), 1), fmt="%d")
    assert main(["open", "a.ply", "b.ply", "--initial-map", "turned.txt"]) == 0
    inputs = served[0][0].inputs
    np.testing.assert_array_equal(inputs.initial_map.vertices, np.roll(np.arange(n), 1))
    assert inputs.facts == {"initial map": "turned.txt"}
    assert "--initial-map turned.txt" in inputs.again


@pytest.mark.long
def test_a_result_is_written_and_packed_as_match_writes_it(shapes, served):
    (shapes / "pairs.txt").write_text("".join(f"{i}, {j}\n" for i, j in PAIRS))
    (shapes / "quick.toml").write_text("n_columns = 90\n")
    words = "a.ply b.ply -o out --landmarks pairs.txt --config quick.toml --seed 3"
    assert main(["open", *words.split()]) == 0
    keeper, options = served[0]
    assert (options["landmarks"], options["config"].n_columns, options["seed"]) == (PAIRS, 90, 3)
    assert not (shapes / "out").exists()  # nothing was saved
    result = match(bent(), bent(), landmarks=PAIRS, config=QUICK)
    archive = zipfile.ZipFile(BytesIO(keeper.packed(result, PAIRS)))
    with keeper.results.claimed(force=False):
        assert keeper.write(result, PAIRS).startswith(
            "Saved map.npz, map.txt, result.json, map.png, report.html"
        )
    written, packed = (
        json.loads((shapes / "out" / "result.json").read_text()),
        json.loads(archive.read("result.json")),
    )
    assert set(archive.namelist()) == {path.name for path in (shapes / "out").iterdir()}
    assert written["meshes"] == ["../a.ply", "../b.ply"]
    assert written | {"files": 0, "meshes": ["a.ply", "b.ply"]} == packed | {"files": 0}
    assert written["match_again"] == (
        "isomatch match a.ply b.ply --output out --config quick.toml --seed 3 --landmarks landmarks.txt --force"
    )
    assert main(["open", "out"]) == 0
    again = served[-1][1]
    np.testing.assert_array_equal(again["result"].map.vertices, result.map.vertices)
    assert (again["landmarks"], again["config"]) == (PAIRS, QUICK)
    assert len(again["result"].alternatives) == len(result.alternatives)


def matched_quickly(shapes, options):
    """Write a result into ``out``."""
    (shapes / "quick.toml").write_text(QUICKEST)
    assert main(f"match a.ply b.ply -o out --config quick.toml --quiet {options}".split()) == 0


@pytest.mark.long
def test_the_map_back_is_kept_with_the_result_that_was_opened_alone(shapes, served):
    matched_quickly(shapes, "--both")
    before, back = (json.loads((shapes / "out" / "result.json").read_text()), shapes / "out" / "map_back.npz")
    found = isomatch.Correspondence.load(back, bent().n_vertices)
    assert main(["open", "out", "--no-browser"]) == 0
    keeper, options = served[0]
    assert "removed" not in keeper.write(options["result"], PAIRS)
    assert json.loads((shapes / "out" / "result.json").read_text())["back"] == before["back"]
    np.testing.assert_array_equal(
        isomatch.Correspondence.load(back, bent().n_vertices).vertices, found.vertices
    )
    assert "map_back.npz" in zipfile.ZipFile(BytesIO(keeper.packed(options["result"], PAIRS))).namelist()
    assert keeper.write(replace(options["result"]), PAIRS).endswith("and was removed.")
    assert not back.exists()
    assert "back" not in json.loads((shapes / "out" / "result.json").read_text())


@pytest.mark.long
def test_the_mesh_file_of_a_result_that_was_opened_is_told_with_its_map_only(shapes, served):
    matched_quickly(shapes, "--as-mesh shared.ply --no-report")
    before, shared = (shapes / "shared.ply").read_bytes(), shapes / "shared.ply"
    told = json.loads((shapes / "out" / "result.json").read_text())["as_mesh"]
    assert main(["open", "out", "--no-browser"]) == 0
    keeper, options = served[0]
    result = options["result"]
    assert "shared.ply" not in keeper.write(result, PAIRS)
    assert json.loads((shapes / "out" / "result.json").read_text())["as_mesh"] == told
    assert (
        json.loads(zipfile.ZipFile(BytesIO(keeper.packed(result, PAIRS))).read("result.json"))["as_mesh"]
        == told
    )
    turned = isomatch.Correspondence(np.arange(bent().n_vertices), bent().n_vertices)
    assert "; shared.ply is of the map before and was left" in keeper.write(
        replace(result, map=turned), PAIRS
    )
    assert shared.read_bytes() == before
    assert "as_mesh" not in json.loads((shapes / "out" / "result.json").read_text())
