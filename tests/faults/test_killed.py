"""Processes killed at any moment leave no file or a whole one under each final name, and nothing that blocks."""

import json
import random
import subprocess
import sys
import time

import matplotlib.image
import numpy as np
import pytest

from isomatch import Correspondence, DistanceBasis
from isomatch.cli import main
from isomatch_lab.evaluation import read_rows

SAVE = """
import sys
import numpy as np
from pathlib import Path
from isomatch import Correspondence, DistanceBasis
from isomatch.geodesics import Sampling
folder, n = Path(sys.argv[1]), 20000
basis = DistanceBasis(
    np.ones((n, 9)), np.ones(9), np.ones(n), "exact", "exact", np.arange(2), Sampling(np.arange(1), np.ones((1, n)))
)
count = 0
while True:
    count += 1
    Correspondence(np.full(n, count % n), n).save(folder / "map.npz")
    Correspondence(np.full(n, count % n), n).save(folder / "map.txt")
    basis.save(folder / "basis.npz")
    print(count, flush=True)
"""
TIMES = [1, pytest.param(10, marks=pytest.mark.long)]


def started(argv):
    return subprocess.Popen([sys.executable, *argv], stdout=subprocess.PIPE, stderr=subprocess.PIPE)


def isomatch_started(argv):
    return started(["-m", "isomatch", *argv])


def wait_for(path, process):
    """Wait until a file exists or the process has ended."""
    while not path.exists() and process.poll() is None:
        time.sleep(0.005)


@pytest.mark.long
@pytest.mark.parametrize("times", TIMES)
def test_save(times, tmp_path):
    rng = random.Random(times)
    for _ in range(times):
        with started(["-c", SAVE, str(tmp_path)]) as process:
            process.stdout.readline()
            time.sleep(rng.uniform(0, 0.4))
            process.kill()
        for name in ("map.npz", "map.txt"):
            assert len(np.unique(Correspondence.load(tmp_path / name).vertices)) == 1
        assert DistanceBasis.load(tmp_path / "basis.npz").rank == 9


@pytest.mark.long
@pytest.mark.parametrize("times", TIMES)
def test_match(times, match_argv, pair, tmp_path):
    rng = random.Random(times)
    for i in range(times):
        out = tmp_path / str(i)
        with isomatch_started(match_argv(out)) as process:
            wait_for(out / rng.choice([".result.json.lock", "map.npz", "map.png"]), process)
            time.sleep(rng.uniform(0, 1))
            process.kill()
        require_whole(out, pair)
    assert main([*match_argv(out), "--force"]) == 0
    assert (out / "result.json").exists()
    require_whole(out, pair)


def require_whole(folder, pair):
    """Each file is absent or whole; ``result.json`` comes last."""
    names = {path.name for path in folder.iterdir() if not path.name.startswith((".", "alternative"))}
    shape = tuple(mesh.n_vertices for mesh in pair)
    for name in names & {"map.npz", "map.txt"}:
        assert Correspondence.load(folder / name).shape == shape
    if "map.png" in names:
        matplotlib.image.imread(folder / "map.png")
    if "report.html" in names:
        assert (folder / "report.html").read_text(encoding="utf-8").rstrip().endswith("</html>")
    if "result.json" in names:
        json.loads((folder / "result.json").read_text(encoding="utf-8"))
        assert names == {"map.npz", "map.txt", "map.png", "report.html", "result.json"}


@pytest.mark.long
@pytest.mark.parametrize("times", [1, 4])
def test_bench_is_resumed_and_its_workers_end(times, tmp_path):
    """Workers inherit the standard output, so that its end means that they have ended."""
    rng = random.Random(times)
    argv = ["bench", "--set", "example", "--points", "50", "-o", str(tmp_path)]
    for _ in range(times):
        with isomatch_started([*argv, "--jobs", "2"]) as process:
            wait_for(tmp_path / "rows.jsonl", process)
            time.sleep(rng.uniform(0, 8) if times > 1 else 2)
            process.kill()
            process.communicate(timeout=20)
    assert main([*argv, "--jobs", "1"]) == 0
    assert [row["pair"] for row in read_rows(tmp_path)] == ["standing-running"]
    assert (tmp_path / "summary.csv").read_text().count("\n") == 2
