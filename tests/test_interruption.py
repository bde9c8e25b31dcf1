"""An interruption reaches the caller at once, as does an exception of the caller's own; nothing keeps running."""

import subprocess
import sys
import threading
import time
from _thread import interrupt_main

import numpy as np
import pytest

from isomatch import match, match_both, prepare
from isomatch._core.stage_timer import StageTimer
from isomatch._core.threads import Abandoned, in_background, parallel_map, stop_if_abandoned, tell
from later import some_later


def spin(until, ended):
    """Work that can be given up; it adds to a list when it is."""
    try:
        while time.perf_counter() < until:
            time.sleep(0.001)
            stop_if_abandoned()
    except Abandoned:
        ended.append(1)
        raise


def wait_until(condition):
    limit = time.perf_counter() + 5
    while not condition() and time.perf_counter() < limit:
        time.sleep(0.005)
    assert condition()


def interrupt_after(seconds):
    threading.Timer(seconds, interrupt_main).start()


@pytest.mark.parametrize("items", [0, 4])
def test_ctrl_c_does_not_wait_and_ends_what_runs(items, monkeypatch):
    monkeypatch.setenv("ISOMATCH_NUM_THREADS", "2")
    ended, until = [], time.perf_counter() + 20
    work = (
        (lambda: parallel_map(lambda _: spin(until, ended), range(items)))
        if items
        else (lambda: spin(until, ended))
    )
    interrupt_after(0.1)
    with pytest.raises(KeyboardInterrupt):
        in_background(work)
    assert time.perf_counter() < until - 15
    wait_until(lambda: len(ended) == (2 if items else 1))


def test_ctrl_c_while_items_run_on_threads(monkeypatch):
    monkeypatch.setenv("ISOMATCH_NUM_THREADS", "2")
    ended, until = [], time.perf_counter() + 20
    interrupt_after(0.1)
    with pytest.raises(KeyboardInterrupt):
        parallel_map(lambda _: spin(until, ended), range(6))
    wait_until(lambda: len(ended) == 2)  # and the other four did not start


def test_results_and_errors_go_through():
    assert in_background(lambda: in_background(threading.get_ident)) != threading.get_ident()
    error = KeyError("mine")

    def fail():
        raise error

    with pytest.raises(KeyError) as caught:
        in_background(fail)
    assert caught.value is error


def test_the_error_of_the_first_item_that_fails(monkeypatch):
    monkeypatch.setenv("ISOMATCH_NUM_THREADS", "3")
    started = []

    def fail(i):
        started.append(i)
        time.sleep(0.02 * (3 - i) if i < 3 else 0)
        raise ValueError(i)

    with pytest.raises(ValueError, match="0"):
        parallel_map(fail, range(50))
    assert len(started) < 50


def test_settings_of_numpy_hold_in_the_background():
    with np.errstate(divide="raise"), pytest.raises(FloatingPointError):
        in_background(lambda: np.float64(1) / np.float64(0))


def test_what_is_told_reaches_the_thread_that_asked():
    seen = []
    in_background(lambda: tell(lambda value: seen.append((value, threading.get_ident())), 7))
    assert seen == [(7, threading.get_ident())]


def test_what_is_told_from_threads_reaches_the_thread_that_asked(monkeypatch):
    monkeypatch.setenv("ISOMATCH_NUM_THREADS", "2")
    seen = []
    parallel_map(lambda i: tell(lambda value: seen.append((value, threading.get_ident())), i), range(4))
    assert sorted(seen) == [(i, threading.get_ident()) for i in range(4)]


class Enough(Exception):
    """The caller's own."""


@pytest.mark.long
@pytest.mark.parametrize("run", [match, match_both])
def test_progress_rises_from_0_to_1(run, example):
    seen = []
    run(*(made.mesh for made in example), progress=lambda stage, share: seen.append((stage, share)))
    shares = [share for _, share in seen]
    assert shares == sorted(shares)
    assert (shares[0], shares[-1]) == (0.0, 1.0)
    assert {"prepare", "search", "selection", "refinement", "quality"} <= {stage for stage, _ in seen}


def test_progress_never_falls_where_it_is_heard_late():
    seen = []

    def slow(stage, share):
        time.sleep(0.05)
        seen.append(share)

    outer = StageTimer(slow)
    inner = StageTimer(outer.reach)

    def work():
        for timer, share in ((inner, 0.0), (inner, 0.5), (outer, 0.55), (outer, 0.65)):
            timer.reach("stage", share)

    in_background(work)
    assert seen == [0.0, 0.5, 0.55, 0.65]


def test_progress_of_a_preparation(example):
    seen = []
    prepare(example[0].mesh, progress=lambda stage, share: seen.append(share))
    assert seen == sorted(seen)
    assert (seen[0], seen[-1]) == (0.0, 1.0)


@pytest.mark.parametrize(
    "last", some_later(["prepare", "prepare: functions", "refinement"], lambda stage: stage != "refinement")
)
def test_progress_cancels_by_raising(last, example):
    """A function of one argument; its exception is the caller's, and no thread goes on."""
    before, stages = threading.active_count(), []

    def progress(stage):
        stages.append(stage)
        if stage == last:
            raise Enough(stage)

    with pytest.raises(Enough, match=last):
        match(*(made.mesh for made in example), progress=progress)
    assert stages[-1] == last
    wait_until(lambda: threading.active_count() <= before)


INTERRUPTED = """
import threading, time, _thread
from isomatch import match
from isomatch_lab.procedural import creature
shapes = [creature(3500, pose=pose).mesh for pose in (0, 1)]
match(*[creature(1500, pose=pose).mesh for pose in (0, 1)])
since = []
threading.Timer(0.3, lambda: (since.append(time.perf_counter()), _thread.interrupt_main())).start()
try:
    match(*shapes)
except KeyboardInterrupt:
    print(time.perf_counter() - since[0], flush=True)
"""


@pytest.mark.long
def test_a_script_that_is_interrupted_ends_at_once():
    """Python joins the threads of pools when it ends; ours do not keep it."""
    run = subprocess.run([sys.executable, "-c", INTERRUPTED], capture_output=True, text=True, timeout=60)
    assert float(run.stdout) < 1.0, run.stderr
