"""Runs that are killed or interrupted at any moment, and lose only what was in flight."""

import os
import random
import signal
import subprocess
import sys
import time
from contextlib import suppress

import pytest

from isomatch._core.errors import FormatError
from isomatch.cohort import Collection, PairMaps
from small_collections import arrays_of

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
TIMES = 6


def started(small, folder):
    """A run of the command line, in a group of its own."""
    argv = [sys.executable, "-m", "isomatch", "collect", str(small.shapes), "-o", str(folder)]
    argv += ["--pairs", "all", "--config", str(small.settings), "--jobs", "2"]
    return subprocess.Popen(argv, stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True)


def whole(folder):
    """What is recorded or whole on disk: the files with their times."""
    found = {}
    for path in (folder / "maps").glob("*.npz"):
        PairMaps.load(path)
        found[path.name] = path.stat().st_mtime_ns
    return found


def a_worker_of(process):
    while True:
        argv = ["pgrep", "-P", str(process.pid), "-f", "spawn_main"]
        found = subprocess.run(argv, capture_output=True, text=True, check=False).stdout.split()
        if found or process.poll() is not None:
            return int(found[0]) if found else None
        time.sleep(0.05)


def wait_for(folder, files, process):
    while len(list(folder.glob("*/*.npz"))) < files and process.poll() is None:
        time.sleep(0.005)


@pytest.mark.long
def test_killed_at_any_moment_a_run_is_continued_and_repeats_nothing(small, finished, tmp_path):
    rng = random.Random(TIMES)
    before = {}
    for _ in range(TIMES):
        with started(small, tmp_path) as process:
            files = len(list(tmp_path.glob("*/*.npz"))) + rng.randint(0, 3)
            wait_for(tmp_path, max(1, files), process)
            time.sleep(rng.uniform(0, 0.5))
            with suppress(ProcessLookupError):  # all was done
                os.killpg(process.pid, signal.SIGKILL)
        after = whole(tmp_path)
        assert before.items() <= after.items()
        assert set(Collection.open(tmp_path).rows().pairs) <= {
            tuple(name.removesuffix(".npz").split("__")) for name in after
        }
        before = after
    (tmp_path / "maps" / ".isomatch-0.unfinished").touch()
    with started(small, tmp_path) as process:
        if worker := a_worker_of(process):
            os.kill(worker, signal.SIGKILL)  # is replaced
        said = process.communicate()[1].decode()
    assert process.returncode == 0, said
    assert before.items() <= whole(tmp_path).items()
    assert arrays_of(tmp_path) == arrays_of(finished)
    assert {row.state for row in Collection.open(tmp_path).rows().pairs.values()} == {"done"}
    assert not list(tmp_path.glob("**/.*"))


@pytest.mark.long
def test_an_interruption_ends_a_run_at_once_and_leaves_no_worker(small, tmp_path):
    """Workers inherit the standard output, so that its end means that they have ended."""
    with started(small, tmp_path) as process:
        wait_for(tmp_path, 5, process)
        since = time.perf_counter()
        process.send_signal(signal.SIGINT)
        said = process.communicate(timeout=30)[1]
        assert time.perf_counter() - since < 5.0  # the run would go on for longer
    assert process.returncode == 130, said
    assert said.endswith(b"isomatch: interrupted\n")
    try:
        whole(tmp_path)
    except FormatError as error:
        pytest.fail(f"a map is not whole: {error}")
