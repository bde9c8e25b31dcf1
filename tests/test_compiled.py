"""Compiled loops call each other, are kept between runs, and work where they cannot be kept."""

import gc
import importlib.util
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
import pytest
from numba.core import event

import isomatch
from shapes import icosphere

LOOP = """
from isomatch._core.compiled import compiled

@compiled(inline="always")
def doubled(x):
    return 2 * x

@compiled()
def doubled_each(values):
    return [doubled(value) for value in values]
"""


def test_a_loop_calls_another_and_is_kept_between_runs(tmp_path):
    (tmp_path / "loops.py").write_text(LOOP)
    for hits in (0, 1):
        spec = importlib.util.spec_from_file_location("loops", tmp_path / "loops.py")
        loops = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(loops)
        assert loops.doubled_each(np.arange(3)) == [0, 2, 4]
        assert sum(loops.doubled_each.stats.cache_hits.values()) == hits


@pytest.mark.parametrize("before", [True, False])
def test_the_cycle_collector_rests_while_a_loop_is_compiled_even_if_that_fails(before):
    at_work = []

    class Watch(event.Listener):
        def on_start(self, event):
            at_work.append(gc.isenabled())

        on_end = on_start

    (gc.enable if before else gc.disable)()
    try:
        with event.install_listener("numba:compile", Watch()):
            assert numba.njit(lambda x: x + 1)(1) == 2
            with pytest.raises(numba.TypingError):
                numba.njit(lambda x: x.nothing)(1)
        assert at_work[::2] == [False, False]
        assert gc.isenabled() == before
    finally:
        gc.enable()


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
