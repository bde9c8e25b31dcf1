"""A signal ends any command within a second, at any moment, and leaves nothing behind but rows that go on later."""

import os
import random
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import isomatch
from isomatch_lab.procedural import creature
from later import some_later

SOON = 3.0  # seconds
TIMES = [1, pytest.param(10, marks=pytest.mark.long)]
COMMANDS = {
    "match": "match a.ply b.ply -o out/deep",
    "match both": "match a.ply b.ply --both -o out",
    "basis": "basis a.ply --method fmds -o basis.npz",
    "distance": "distance a.ply --from 1,2,3 -o distances.csv",
    "bench": "bench --set example --points 50 --jobs 2 -o out",
    "demo": "demo -o out",
}
KEPT = {
    Path("out"),
    Path("out/rows.jsonl"),
}  # rows of pairs that `bench` measured, with which the next run goes on


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("shapes")
    for name, pose in (("a", 0), ("b", 1)):
        isomatch.write_mesh(folder / f"{name}.ply", creature(3000, pose=pose).mesh)
    return folder


def interrupted(command, folder, after, number=signal.SIGINT):
    """Start a command and signal it after some seconds; seconds until it and its workers ended, None if it was done.

    Workers inherit the standard output, so that its end means that they have ended.
    """
    argv = [sys.executable, "-m", "isomatch", *command.split()]
    process = subprocess.Popen(argv, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    time.sleep(after)
    if process.poll() is not None:
        process.communicate()
        return None
    since = time.perf_counter()
    process.send_signal(number)
    _, said = process.communicate(timeout=30)
    seconds = time.perf_counter() - since
    if process.returncode == 0:  # done, while the interpreter was ending
        return None
    assert process.returncode == 128 + number, said.decode()
    assert said.decode().endswith("isomatch: interrupted\n")
    return seconds


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.parametrize("name", some_later(COMMANDS, {"match", "basis"}.__contains__))
@pytest.mark.parametrize("times", TIMES)
def test_a_signal_at_any_moment(name, times, folder):
    rng = random.Random(f"{name} {times}")
    before = sorted(folder.rglob("*"))
    for _ in range(times):
        number = rng.choice([signal.SIGINT, signal.SIGTERM])
        seconds = interrupted(COMMANDS[name], folder, rng.uniform(0.4, 2.0 if times < 9 else 6.0), number)
        if seconds is None:  # done before the signal
            for path in sorted(set(folder.rglob("*")) - set(before), reverse=True):
                path.rmdir() if path.is_dir() else path.unlink()
        else:
            assert seconds < SOON
        left = set(folder.rglob("*")) - set(before)
        if name == "bench":
            left -= {folder / path for path in KEPT}
            shutil.rmtree(folder / "out", ignore_errors=True)
        assert not left


@pytest.mark.long
def test_an_earlier_result_stays_as_it_is(folder, tmp_path):
    """Files replace earlier ones only when all are complete."""
    out = tmp_path / "out"
    out.mkdir()
    earlier = ("map.npz", "map.txt", "result.json", "map.png", "report.html")
    for name in earlier:
        (out / name).write_text("earlier")
    argv = [sys.executable, "-m", "isomatch", *f"match a.ply b.ply --force -o {out}".split()]
    with subprocess.Popen(argv, cwd=folder, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL) as process:
        while process.poll() is None and not any(path.suffix == ".unfinished" for path in out.iterdir()):
            time.sleep(0.005)
        process.send_signal(signal.SIGINT)
    assert process.returncode == 130
    assert {path.name: path.read_text() for path in out.iterdir()} == dict.fromkeys(earlier, "earlier")


TWICE = """
import os, signal, time
from isomatch import __main__
from isomatch._core import files

abandon = files.abandon_files
files.abandon_files = lambda: (abandon(), os.kill(os.getpid(), signal.SIGTERM))
__main__._command = lambda: (os.kill(os.getpid(), signal.SIGINT), time.sleep(20))
__main__.program()
"""


@pytest.mark.skipif(os.name != "posix", reason="signals and pseudo-terminals of POSIX")
def test_a_second_signal_does_not_delay_the_end_and_the_terminal_is_as_before():
    import pty

    terminal, end = pty.openpty()
    with subprocess.Popen([sys.executable, "-c", TWICE], stderr=end) as process:
        os.close(end)
        try:
            assert process.wait(timeout=10) == 128 + signal.SIGINT
        finally:
            process.kill()
    assert os.read(terminal, 4096).startswith(b"\r\x1b[2K\x1b[?25hisomatch: interrupted")
    os.close(terminal)


def test_a_signal_waits_until_a_worker_that_starts_is_known(monkeypatch):
    """Otherwise it would outlive its parent, and complain."""
    from isomatch._core import files, processes

    held = []
    monkeypatch.setattr(processes.SpawnProcess, "start", lambda process: held.append(files.changing.locked()))
    processes._Spawning().Process(target=print).start()
    assert held == [True]
    assert not files.changing.locked()
