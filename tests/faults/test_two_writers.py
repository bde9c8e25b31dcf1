"""Two runs that write to one place: the second is refused before it starts to work."""

import subprocess
import sys
import time

import pytest

import isomatch
from isomatch._core.files import claimed
from isomatch.cli import main
from shapes import icosphere


@pytest.mark.parametrize(
    ("argv", "main_file"),
    [
        ("basis sphere.ply -o out/basis.npz --force", "basis.npz"),
        ("distance sphere.ply --from 0 -o out/distances.csv", "distances.csv"),
        ("repair sphere.ply -o out/repaired.ply", "repaired.ply"),
        ("demo -o out", "result.json"),
        ("bench --set example --jobs 1 -o out", "rows.jsonl"),
        ("paper voronoi --quick -o out --force", "index.md"),
    ],
)
def test_every_command_is_refused_while_another_writes(argv, main_file, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "out").mkdir()
    isomatch.write_mesh("sphere.ply", icosphere(1))
    with claimed(tmp_path / "out" / main_file):
        assert main(argv.split()) == 1
    said = capsys.readouterr().err
    assert said.startswith("isomatch: ")
    assert f"{main_file}: is being written by another run; wait until that ends" in said
    assert list((tmp_path / "out").iterdir()) == []


@pytest.mark.long
def test_of_two_matches_into_one_folder_the_second_is_refused(match_argv, tmp_path):
    out = tmp_path / "out"
    argv = [sys.executable, "-m", "isomatch", *match_argv(out)]
    with subprocess.Popen(argv, stdout=subprocess.DEVNULL) as first:
        while not (out / ".result.json.lock").exists() and first.poll() is None:
            time.sleep(0.01)
        second = subprocess.run(argv, capture_output=True, text=True)
    assert second.returncode == 1
    assert "is being written by another run" in second.stderr or "already exists" in second.stderr
    assert first.returncode == 0
    whole = {"map.npz", "map.txt", "map.png", "report.html", "result.json"}
    assert {path.name for path in out.iterdir()} >= whole
    assert not [path for path in out.iterdir() if path.name.startswith(".")]
