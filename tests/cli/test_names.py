"""File names that are no text, or mean something to a printer, and output that has few characters."""

import csv
import io
import json
import os
from contextlib import redirect_stdout

import numpy as np
import pytest

import isomatch
from command_line import QUICKEST, write_pair
from isomatch.cli import main
from isomatch.visualization import draw_map
from isomatch_lab.evaluation import (
    METHODS,
    BenchmarkRun,
    Method,
    run_benchmark,
    write_tables,
)
from isomatch_lab.evaluation.curves import PublishedCurve
from isomatch_lab.sets import BenchmarkPair, BenchmarkSet
from isomatch_lab.sets.benchmarks import MADE
from shapes import icosphere

pytestmark = pytest.mark.usefixtures("prepared_once", "small_pictures")
NAMES = {
    "not UTF-8": os.fsdecode(b"no\xfftext"),
    "emoji": "wolf🐺",
    "newline": "two\nlines",
    "formula": "do$l$ar_{",
    "colour": "\x1b[31mred",
    "markup": "[bold]x:cat:\\",
}
each_name = pytest.mark.parametrize("name", NAMES.values(), ids=NAMES)


def printed(argv):
    """Run a command; return its exit code and what it printed to an output that has few characters."""
    stdout = io.TextIOWrapper(io.BytesIO(), "cp1252", newline="")
    with redirect_stdout(stdout):
        code = main(argv)
    stdout.flush()
    return code, stdout.buffer.getvalue().decode("cp1252")


@each_name
@pytest.mark.parametrize(
    "argv",
    [
        "check {}.off",
        "basis {}.off -o {}.npz",
        "repair {}.off -o {}.ply",
        "distance {}.off --from 0 -o {}.csv",
    ],
)
def test_commands(argv, name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    isomatch.write_mesh(f"{name}.off", icosphere(2))
    words = [word.format(name) for word in argv.split()]
    code, said = printed(words)
    assert code == 0
    assert "\x1b" not in said
    if "-o" in words:
        assert words[words.index("-o") + 1] in os.listdir()


@each_name
def test_json_names_the_file_exactly(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    isomatch.write_mesh(f"{name}.off", icosphere(2))
    assert json.loads(printed(["check", f"{name}.off", "--json"])[1])["file"] == f"{name}.off"


@each_name
def test_a_complaint_is_one_printable_line(name, capsys):
    assert main(["check", f"{name}.off"]) == 1
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "\x1b" not in said


@pytest.mark.long
def test_match_writes_everything(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    ends = [f"{NAMES['not UTF-8']}.ply", f"{NAMES['emoji']}{NAMES['newline']}{NAMES['formula']}.ply"]
    write_pair(tmp_path, [end.removesuffix(".ply") for end in ends], QUICKEST)
    out = NAMES["not UTF-8"]
    code, said = printed(["match", *ends, "-o", out, "--config", "quick.toml"])
    assert code == 0
    assert "open first  no\\udcfftext" in said
    record = json.loads((tmp_path / out / "result.json").read_text(encoding="utf-8"))
    assert [record["source"], record["target"]] == ends
    assert "wolf🐺" in (tmp_path / out / "report.html").read_text(encoding="utf-8")


@each_name
def test_pictures(name, tmp_path):
    mesh = icosphere(1)
    every = isomatch.Correspondence(np.arange(mesh.n_vertices), mesh.n_vertices)
    draw_map(mesh, mesh, every, tmp_path / "map.png", titles=(name, name), width=400)


def test_tables_of_a_benchmark(tmp_path, monkeypatch):
    mesh = icosphere(2)
    every = np.arange(mesh.n_vertices)
    ends = ("".join(NAMES.values()), NAMES["formula"])
    pair = BenchmarkPair("-".join(ends), mesh, mesh, np.column_stack([every, every]))
    chosen = BenchmarkSet("odd", (ends,), lambda *_: pair)
    monkeypatch.setitem(MADE, "odd", lambda: chosen)
    method = Method(lambda *_: isomatch.Correspondence(every, len(every)), preparation=None)
    monkeypatch.setitem(METHODS, "right", method)
    run = BenchmarkRun("odd", ("right",), n_points=20, jobs=1)
    assert [row["pair"] for row in run_benchmark(run, tmp_path)] == ["-".join(ends)]
    errors = np.linspace(0, 0.25, 5)
    write_tables(tmp_path, [PublishedCurve("odd", "do$l$ar_{", errors, errors)])
    with (tmp_path / "pairs.csv").open(newline="", encoding="utf-8") as file:
        (row,) = csv.DictReader(file)
    assert row["pair"] == "-".join(ends).replace("\udcff", "\\udcff")
    assert list(run_benchmark(run, tmp_path)) == [], "the row is recognised"
