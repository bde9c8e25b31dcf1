"""Systems on which these tests do not run: what they lack or refuse is taken away here, and nothing else changes."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import isomatch
from isomatch._core import files
from isomatch.cli import main
from isomatch.cohort import Collection
from small_collections import arrays_of

LIKE_WINDOWS = Path(__file__).parent / "like_windows"
COMMANDS = """
match {0}/s0.ply {0}/s1.ply -o match --config {1} --force
transfer match/map.npz {0}/s0.ply {0}/s1.ply -o carried.obj
transfer match/map.npz {0}/s0.ply {0}/s1.ply -o carried.obj --force
collect three.csv -o all --pairs all --config {1} --jobs 2 --no-agree --reports none
collect export all export
collect export all export --force
check {0}/s0.ply
"""
PROGRAM = """
import sys
from isomatch.cli import main

if __name__ == "__main__":
    for line in sys.argv[1].strip().splitlines():
        code = main(line.split())
        if code:
            sys.exit(f"{line}: {code}")
"""


@pytest.mark.long
@pytest.mark.skipif(sys.platform != "linux", reason="what is simulated is found in /proc")
def test_commands_where_open_files_stay_and_posix_is_missing(small, finished, tmp_path):
    """Files are made and replaced, some by two spawned workers; the maps are the same."""
    (tmp_path / "program.py").write_text(PROGRAM)
    three = [f"{small.shapes}/s{i}.ply" for i in range(3)]
    (tmp_path / "three.csv").write_text("\n".join(["path", *three]))
    (tmp_path / "match").mkdir()
    for earlier in ("map.npz", "map.txt", "result.json", "report.html"):
        (tmp_path / "match" / earlier).write_text("earlier")
    modules = os.pathsep.join([str(LIKE_WINDOWS), str(Path(isomatch.__file__).parents[1])])
    ended = subprocess.run(
        [sys.executable, "program.py", COMMANDS.format(small.shapes, small.settings)],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": modules},
        capture_output=True,
        text=True,
        start_new_session=True,
    )
    assert ended.returncode == 0, ended.stderr[-2000:]
    assert "sitecustomize" not in ended.stderr
    expected = arrays_of(finished)
    assert arrays_of(tmp_path / "all") == {
        name: expected[name] for name in ("s0__s1.npz", "s0__s2.npz", "s1__s2.npz")
    }
    assert {path.name for path in tmp_path.iterdir()} >= {"match", "carried.obj", "all", "export"}
    assert not [path for path in tmp_path.rglob("*") if path.suffix in (".unfinished", ".lock")]
    for text in tmp_path.rglob("*.json"):
        assert b"\r" not in text.read_bytes()


def test_the_simulation_refuses_what_windows_does(tmp_path):
    """Otherwise the test above would show nothing."""
    program = """
import isomatch._core.files as files, isomatch._core.memory as memory, os, signal, pathlib
assert memory.peak_memory() is None and not hasattr(signal, "SIGHUP")
path = pathlib.Path("a"); held = path.open("w"); held.write("one\\n"); held.flush()
pathlib.Path("b").write_text("two")
assert path.read_bytes() == b"one\\r\\n"
for refused in (path.unlink, lambda: path.replace("c"), lambda: pathlib.Path("b").replace(path)):
    try:
        refused()
    except PermissionError:
        continue
    raise SystemExit("done")
with files.claimed(pathlib.Path("c")):
    try:
        with files.claimed(pathlib.Path("c")):
            raise SystemExit("claimed twice")
    except files.UnwritableFileError as error:
        assert "being written by another run" in str(error)
assert not list(pathlib.Path().glob(".c*"))
"""
    modules = os.pathsep.join([str(LIKE_WINDOWS), str(Path(isomatch.__file__).parents[1])])
    subprocess.run(
        [sys.executable, "-c", program],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": modules},
        check=True,
        start_new_session=True,
    )


@pytest.fixture
def ignoring_case(monkeypatch):
    """Imitate a file system that ignores the case of names, when it is asked what exists."""
    exists = os.path.exists
    lower = lambda path: Path(path).with_name(Path(path).name.lower())  # noqa: E731
    return lambda: monkeypatch.setattr(os.path, "exists", lambda path: exists(path) or exists(lower(path)))


def test_names_that_differ_only_in_case(small, tmp_path, ignoring_case, capsys):
    """They are different files on Linux; where they are not, no map may take the place of another."""
    folder = tmp_path / "shapes"
    folder.mkdir()
    for name, number in (("Cat", 0), ("cat", 1)):
        (folder / f"{name}.ply").write_bytes((small.shapes / f"s{number}.ply").read_bytes())
    Collection.create(tmp_path / "apart", folder)
    ignoring_case()
    assert main(["collect", str(folder), "-o", str(tmp_path / "mixed")]) == 1
    assert "Cat and cat" in capsys.readouterr().err
    assert not (tmp_path / "mixed").exists()


def test_whether_case_is_ignored(tmp_path, ignoring_case):
    """In a folder, and for one that is yet to be made."""
    new = tmp_path / "new" / "newer"
    assert not files.ignores_case(tmp_path)
    assert not files.ignores_case(new)
    ignoring_case()
    assert files.ignores_case(new)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["con", "NUL", "com1.v2", "lpt9"])
def test_names_of_devices(small, tmp_path, name):
    path = tmp_path / f"{name}.ply"
    path.write_bytes((small.shapes / "s0.ply").read_bytes())
    with pytest.raises(isomatch.InputError, match=name):
        Collection.create(tmp_path / "all", [path, small.shapes / "s1.ply"])
