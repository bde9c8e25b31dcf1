"""Compiled loops work where numba cannot keep them: nothing to write to, a full disk, a damaged cache."""

import errno
import importlib.util
import logging
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from numba.core.caching import IndexDataCacheFile

import isomatch
from isomatch._compiled import _tell_uncached
from shapes import icosphere

LOOP = "from isomatch._compiled import compiled\n@compiled()\ndef twice(x):\n    return 2 * x\n"


@pytest.fixture
def loaded(tmp_path, caplog):
    """Function that loads a loop from a module as a new process would."""
    (tmp_path / "loop.py").write_text(LOOP)
    _tell_uncached.cache_clear()

    def load():
        spec = importlib.util.spec_from_file_location("loop", tmp_path / "loop.py")
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return module.twice

    return load


def test_a_damaged_cache_is_made_anew(loaded, tmp_path, caplog):
    assert loaded()(2) == 4
    files = [file for file in (tmp_path / "__pycache__").iterdir() if file.suffix in (".nbi", ".nbc")]
    assert len(files) == 2
    for file in files:
        for damage in (b"", b"no pickle", file.read_bytes()[:-9]):
            file.write_bytes(damage)
            assert loaded()(2) == 4
            again = loaded()
            assert again(2) == 4
            assert sum(again.stats.cache_hits.values()) == 1
    assert not caplog.records


def test_a_full_disk_is_noted_once(loaded, monkeypatch, caplog):
    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(IndexDataCacheFile, "_open_for_write", full)
    with caplog.at_level(logging.WARNING):
        for loop in (loaded(), loaded()):
            assert loop(2) == 4
    (record,) = caplog.records
    assert "NUMBA_CACHE_DIR" in record.message


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
