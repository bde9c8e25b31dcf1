"""Compiled loops work where numba cannot keep them: nothing to write to, a full disk, a damaged cache."""

import errno
import importlib.util
import os
import pickle
import shutil
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Barrier

import numpy as np
import pytest
from numba.core.caching import IndexDataCacheFile

import isomatch
from isomatch.geodesics.front import march
from isomatch.loading.compiled import Loop
from isomatch.loading.dispatcher import COMPILING, UNCACHED, _tell
from shapes import icosphere

LOOP = """
from isomatch.loading.compiled import compiled

@compiled(inline="always")
def doubled(x):
    return 2 * x

@compiled()
def twice(x):
    return doubled(x)

@compiled()
def twice_each(values):
    return [twice(value) for value in values]
"""


@pytest.fixture
def loaded(tmp_path, caplog):
    """Function that loads loops from a module as a new process would."""
    (tmp_path / "loops.py").write_text(LOOP)
    _tell.cache_clear()

    def load():
        spec = importlib.util.spec_from_file_location("loops", tmp_path / "loops.py")
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return module

    return load


def test_a_loop_sees_the_loops_that_it_calls(loaded):
    loops = loaded()
    assert loops.twice_each(np.arange(3)) == [0, 2, 4]
    assert isinstance(loops.twice, Loop), "what the module holds stays as it was"


def test_a_loop_keeps_what_was_written(loaded):
    loop = loaded().twice
    assert (loop.__name__, loop.__module__) == ("twice", "loops")
    assert loop.py_func.__code__.co_name == "twice"


def test_a_loop_is_pickled_by_name():
    assert pickle.loads(pickle.dumps(march)) is march


def test_threads_may_make_the_first_call_at_once(loaded):
    for _ in range(5):
        loops, start = loaded(), Barrier(8)

        def call(x, loops=loops, start=start):
            start.wait()
            return loops.twice_each(np.array([x]))

        with ThreadPoolExecutor(8) as pool:
            assert list(pool.map(call, range(8))) == [[2 * x] for x in range(8)]
        assert len(loops.twice_each.dispatcher.signatures) == 1


@pytest.mark.long
def test_loops_run_uncompiled_where_numba_is_told_so(loaded, tmp_path):
    loaded()
    lines = "import loops\nassert loops.twice_each([1, 2]) == [2, 4]\nassert not hasattr(loops.twice.dispatcher, 'stats')"
    env = os.environ | {"NUMBA_DISABLE_JIT": "1"}
    subprocess.run([sys.executable, "-c", lines], cwd=tmp_path, env=env, check=True)


def test_compilation_is_announced_once_and_a_cache_hit_is_not(loaded, tmp_path, caplog):
    loops = loaded()
    assert not list(tmp_path.glob("__pycache__/*.nbi"))
    assert loops.twice(2) == loops.twice(2.0) == 4
    assert [record.message for record in caplog.records] == [COMPILING]
    caplog.clear()
    _tell.cache_clear()
    assert loaded().twice(2) == 4
    assert not caplog.records


def test_a_damaged_cache_is_made_anew(loaded, tmp_path, caplog):
    assert loaded().twice(2) == 4
    files = [file for file in (tmp_path / "__pycache__").iterdir() if file.suffix in (".nbi", ".nbc")]
    assert len(files) == 2
    for file in files:
        for damage in (b"", b"no pickle", file.read_bytes()[:-9]):
            file.write_bytes(damage)
            assert loaded().twice(2) == 4
            again = loaded().twice
            assert again(2) == 4
            assert sum(again.dispatcher.stats.cache_hits.values()) == 1
    assert UNCACHED not in caplog.text


def test_a_full_disk_is_noted_once(loaded, monkeypatch, caplog):
    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(IndexDataCacheFile, "_open_for_write", full)
    for loops in (loaded(), loaded()):
        assert loops.twice(2) == 4
    assert [record.message for record in caplog.records] == [COMPILING, UNCACHED]


@pytest.mark.long
@pytest.mark.skipif(os.name == "nt", reason="the folders that cannot be written are made the POSIX way")
def test_every_command_works_without_any_folder_for_the_cache(tmp_path):
    """A file where numba wants a folder stops even the superuser."""
    shutil.copytree(Path(isomatch.__file__).parent, tmp_path / "isomatch", ignore=lambda *_: ["__pycache__"])
    for folder in [tmp_path / "isomatch", *(tmp_path / "isomatch").glob("**/")]:
        (folder / "__pycache__").touch()
    isomatch.write_mesh(tmp_path / "sphere.ply", icosphere(1))
    env = {name: value for name, value in os.environ.items() if name != "XDG_CACHE_HOME"}
    env |= {"PYTHONPATH": str(tmp_path), "HOME": os.devnull, "NUMBA_CACHE_DIR": f"{os.devnull}/cache"}
    run = subprocess.run(
        [sys.executable, "-W", "error", "-m", "isomatch", "distance", "sphere.ply", "--from", "0"],
        cwd=tmp_path, env=env, capture_output=True, text=True,
    )  # fmt: skip
    assert run.returncode == 0, run.stderr
    assert run.stdout.startswith("vertex,from_0\n0,0.0\n")
    assert run.stderr.count("\n") == 1
    assert "set NUMBA_CACHE_DIR to a folder" in run.stderr
