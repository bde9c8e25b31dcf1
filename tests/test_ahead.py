"""The list of loops that are compiled ahead. Run as a script, this file records it anew."""

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from types import SimpleNamespace

import pytest

from isomatch.loading import second_process
from isomatch.loading.dispatcher import _type_of
from isomatch.loading.listed import FILES, MATCH, OTHERS, SECTIONS, listed_loops

LIST = Path(__file__).parents[1] / "src/isomatch/loading/loops.txt"
HEAD = """\
# The loops of isomatch for the types of arguments that it gives them, in the order of their first calls:
# section (see listed.py), module, name, types. Recorded by `python tests/test_ahead.py`, in some ten minutes.
"""

RECORDING = """
import os
from numba import types
from numba.core import event

def word(type):
    if isinstance(type, types.UniTuple):
        return f"{word(type.dtype)}x{type.count}"
    if not isinstance(type, types.Array):
        return "boolean" if type == types.boolean else str(type)
    return f"{word(type.dtype)}:{type.ndim}{type.layout}" + "r" * (not type.mutable)

class Recorder(event.Listener):
    depth = 0
    def on_start(self, event):
        self.depth += 1
    def on_end(self, event):
        self.depth -= 1
        function = event.data["dispatcher"].py_func
        if not self.depth and function.__module__.startswith("isomatch."):
            words = map(word, event.data["args"])
            with open(os.environ["RECORDED"], "a") as file:
                file.write(" ".join([function.__module__, function.__qualname__, *words]) + "\\n")

event.register("numba:compile", Recorder())
"""
PAIR = """
import isomatch
from isomatch.datasets import example_pair
source, target = (shape.mesh for shape in example_pair())
"""
OF_MATCH = PAIR + "isomatch.match(source, target)\n"
OF_FILES = (
    PAIR
    + """
isomatch.write_mesh("source.ply", source)
isomatch.write_mesh("target.ply", target)
from isomatch.cli import main
assert main(["match", "source.ply", "target.ply", "-o", "out"]) == 0
"""
)


OTHER_TESTS = (
    "resolution", "correspondence", "mending/test_contacts.py", "mending/test_outer.py", "assets/test_io_ply.py",
    "assets/test_concave_polygons.py", "geodesics/test_paths.py", "geodesics/test_against_exact.py", "landmarks",
    "datasets", "lab/baselines/test_gmds.py", "view/test_surface_image.py", "transfer/test_wrap.py",
    "matching/test_elastic.py", "matching/test_fused_limbs.py", "matching/test_levels.py",
)  # fmt: skip
ROOT = Path(__file__).parents[1]
OF_OTHERS = f"""
import os, sys, pytest
os.chdir({str(ROOT)!r})
sys.path.insert(0, "")
pytest.main(["-q", *("tests/" + name for name in {OTHER_TESTS})])
"""


def recorded(program, folder):
    """Lines of all loops that a program compiles where nothing is in the cache."""
    found = Path(folder, "loops.txt")
    env = os.environ | {
        "NUMBA_CACHE_DIR": str(Path(folder, "cache")),
        "ISOMATCH_NUM_THREADS": "1",
        "RECORDED": str(found),
    }
    run = subprocess.run(
        [sys.executable, "-c", RECORDING + program], cwd=folder, env=env, capture_output=True, text=True
    )
    assert run.returncode == 0, run.stderr
    return found.read_text().splitlines() if found.exists() else []


def test_what_is_listed_is_there():
    """Else record the list anew."""
    listed = listed_loops(*SECTIONS)
    assert [one[1:3] for one in listed if one.loop is None] == []
    assert [one.section for one in listed] == sorted((one.section for one in listed), key=SECTIONS.index)
    for one in listed:
        assert all(map(_type_of, one.types))
        assert len(one.types) == one.loop.py_func.__code__.co_argcount, one
    assert {MATCH, FILES, OTHERS} == {one.section for one in listed}


@pytest.mark.long
def test_a_first_match_compiles_nothing_after_warming(tmp_path):
    env = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    warm = [sys.executable, "-m", "isomatch.warm"]
    first, again = (
        subprocess.run(warm, env=env, capture_output=True, text=True, check=True) for _ in range(2)
    )
    count = len(listed_loops(MATCH, FILES))
    assert f"{count} loops are in the cache" in first.stdout
    assert "compiling" in first.stderr
    assert (again.stderr, again.stdout[: len(f"{count} ")]) == ("", f"{count} ")
    assert "0 were compiled now" in again.stdout
    assert recorded(OF_FILES, tmp_path) == []


@pytest.mark.long
def test_every_listed_loop_takes_the_listed_arguments():
    for one in listed_loops(*SECTIONS):
        one.loop.dispatcher.compile(tuple(map(_type_of, one.types)))


@pytest.mark.long
def test_warming_without_a_folder_is_an_error():
    env = os.environ | {"NUMBA_CACHE_DIR": f"{os.devnull}/cache", "ISOMATCH_NUM_THREADS": "1"}
    run = subprocess.run([sys.executable, "-m", "isomatch", "warm"], env=env, capture_output=True, text=True)
    assert run.returncode == 1
    assert (
        f"isomatch: {os.devnull}/cache: compiled loops cannot be written; set NUMBA_CACHE_DIR" in run.stderr
    )


@pytest.mark.parametrize("reason", ["one thread", "worker", "another program", "no process"])
def test_no_help_is_asked_for_where_it_is_not_wanted_or_cannot_be_had(reason, monkeypatch, tmp_path):
    monkeypatch.setenv("ISOMATCH_NUM_THREADS", "1" if reason == "one thread" else "2")
    started = []

    def start(*arguments, **options):
        started.append(arguments)
        raise OSError

    monkeypatch.setattr(second_process.subprocess, "Popen", start)
    if reason == "worker":
        monkeypatch.setattr(second_process, "current_process", lambda: SimpleNamespace(name="SpawnProcess-1"))
    if reason == "another program":
        monkeypatch.setattr(sys, "executable", "/opt/blender")
    assert not second_process.ask_for_help(str(tmp_path))
    assert len(started) == (reason == "no process")


if __name__ == "__main__":
    known, names = {}, []
    for section, program in {MATCH: OF_MATCH, FILES: OF_FILES, OTHERS: OF_OTHERS}.items():
        with tempfile.TemporaryDirectory() as folder:
            found = recorded(program, folder)
        if section == OTHERS:  # other types of arguments of the same loops are those of odd meshes
            found = [line for line in found if line.split()[:2] not in names]
        names += [line.split()[:2] for line in found]
        for line in found:
            known.setdefault(line, section)
    LIST.write_text(HEAD + "".join(f"{section} {line}\n" for line, section in known.items()))
