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
from isomatch.loading import dispatcher
from isomatch.loading.compiled import Loop
from isomatch.loading.dispatcher import COMPILING, COMPILING_FEW, UNCACHED, _begin_compiling, _tell
from isomatch.loading.listed import ListedLoop
from isomatch.runtime.locks import Turn
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
def loaded(tmp_path, monkeypatch, caplog):
    """Function that loads loops from a module as a new process would."""
    (tmp_path / "loops.py").write_text(LOOP)
    monkeypatch.setattr(dispatcher, "listed_loops", lambda section: [])

    def load():
        _tell.cache_clear()
        _begin_compiling.cache_clear()
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
    assert [record.message for record in caplog.records] == [COMPILING_FEW]
    caplog.clear()
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


def test_the_loops_of_a_first_match_are_counted_and_help_is_asked_for_once(loaded, monkeypatch, caplog):
    loops, asked = loaded(), []
    listed = [ListedLoop("match", "loops", name, ()) for name in ("twice", "twice", "twice_each", "gone")]
    monkeypatch.setattr(dispatcher, "listed_loops", lambda section: listed)
    monkeypatch.setattr(dispatcher, "ask_for_help", lambda folder: asked.append(folder) or True)
    monkeypatch.setitem(sys.modules, "loops", loops)
    assert loops.twice_each(np.arange(3)) == [0, 2, 4]
    assert caplog.messages == [COMPILING.format(count=2, least=1, most=2)]
    assert asked == [loops.twice.dispatcher._cache.cache_path]


@pytest.mark.parametrize("patience", [0.0, 30.0])
def test_a_loop_waits_for_another_process_that_compiles_it_but_not_for_ever(loaded, monkeypatch, patience):
    loop = loaded().twice
    lock = loop.dispatcher._cache.turn.path
    monkeypatch.setattr(dispatcher, "PATIENCE", patience)
    other = Turn(lock)
    assert other.take()
    with ThreadPoolExecutor(1) as pool:
        call = pool.submit(loop, 2)
        if patience:
            with pytest.raises(TimeoutError):
                call.result(0.2)
            other.end()
        assert call.result() == 4
    other.end()
    assert not lock.exists()


@pytest.mark.long
def test_of_several_processes_one_compiles_a_loop(loaded, tmp_path):
    loaded()
    lines = (
        "import loops\nassert loops.twice_each([1, 2]) == [2, 4]\n"
        "print(sum(loops.twice_each.dispatcher.stats.cache_misses.values()))"
    )
    started = [
        subprocess.Popen([sys.executable, "-c", lines], cwd=tmp_path, stdout=subprocess.PIPE)
        for _ in range(4)
    ]
    assert sum(int(process.communicate()[0]) for process in started) == 1
    assert not list(tmp_path.glob("**/*.lock"))


def test_a_full_disk_is_noted_once(loaded, monkeypatch, caplog):
    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(IndexDataCacheFile, "_open_for_write", full)
    loops = loaded()
    assert loops.twice(2) == loops.twice_each(np.array([2]))[0] == 4
    assert [record.message for record in caplog.records] == [COMPILING_FEW, UNCACHED]


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
