"""Tasks on workers that die."""

import os
import signal
import time
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import active_children, get_context
from pathlib import Path

import pytest

from isomatch import InputError, MissingDependencyError
from isomatch._core.processes import worker_processes
from isomatch.cohort.workers import Task, workers_of

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")


def doubled(item):
    return 2 * item


def deadly(item):
    """A job that no worker survives, among others that take a moment."""
    if item == 13:
        os.kill(os.getpid(), signal.SIGKILL)
    time.sleep(0.01)
    return doubled(item)


def deadly_once(item):
    """The first worker that comes by dies."""
    number, folder = item
    if number == 3 and not (Path(folder) / "died").exists():
        (Path(folder) / "died").touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number


@pytest.mark.long
def test_a_job_that_kills_its_workers_fails_and_all_others_are_done():
    tiles = [Task(tuple(range(i, i + 4)), deadly) for i in range(0, 20, 4)]
    others = set(active_children())
    with workers_of("local", 2) as workers:
        done = dict(workers.completed(tiles))
    assert done.pop(13).error.startswith("three workers died of it")
    assert {item: attempt.result for item, attempt in done.items()} == {
        i: 2 * i for i in range(20) if i != 13
    }
    assert others.issuperset(active_children())


@pytest.mark.long
def test_a_worker_that_dies_is_replaced(tmp_path):
    tasks = [Task(((i, str(tmp_path)),), deadly_once) for i in range(6)]
    with workers_of("local", 2) as workers:
        assert sorted(attempt.result for _, attempt in workers.completed(tasks)) == list(range(6))
        for worker in active_children():  # also one that dies between two tasks
            worker.kill()
            worker.join()
        assert [attempt.result for _, attempt in workers.completed([Task((1, 2), doubled)])] == [2, 4]


def test_an_interruption_leaves_no_worker():
    def interrupted():
        with workers_of("local", 2) as workers:
            next(workers.completed([Task((i,), doubled) for i in range(9)]))
            raise KeyboardInterrupt

    others = set(active_children())
    with pytest.raises(KeyboardInterrupt):
        interrupted()
    end = time.monotonic() + 5
    while not others.issuperset(active_children()) and time.monotonic() < end:
        time.sleep(0.01)  # the pool ends its workers in a thread of its own
    assert others.issuperset(active_children())


@pytest.mark.long
def test_an_interruption_spares_the_processes_of_others():
    def interrupted():
        with worker_processes(1) as pool:
            pool.submit(os.getpid).result()
            other.start()
            raise KeyboardInterrupt

    other = get_context("spawn").Process(target=time.sleep, args=(60,))
    try:
        others = set(active_children())
        with pytest.raises(KeyboardInterrupt):
            interrupted()
        other.join(0.5)
        assert set(active_children()) - others == {other}
    finally:
        other.kill()
        other.join()


def test_nothing_is_begun_when_it_is_late():
    with ThreadPoolExecutor(1) as pool, workers_of(pool, 1) as workers:
        found = []
        for item, _ in workers.completed([Task((i,), doubled) for i in range(9)]):
            found.append(item)
            workers.end = 0.0
    assert found == [0, 1]  # the second one was sent with the first
    with ThreadPoolExecutor(1) as pool, workers_of(pool, 1, time_limit=0.5) as workers:
        tile = Task((0.6, 0.0), time.sleep)  # the time suffices for the first item only
        assert [item for item, _ in workers.completed([tile])] == [0.6]


def test_a_given_executor_that_has_broken_is_refused():
    with ProcessPoolExecutor(1) as pool:
        task = Task((13,), deadly)
        with pytest.raises(InputError, match="give a new one"), workers_of(pool, 1) as workers:
            list(workers.completed([task]))


def test_tasks_that_are_given_up_end_the_run():
    class Lost(ThreadPoolExecutor):
        def submit(self, *given):
            future = Future()
            future.cancel()
            future.set_running_or_notify_cancel()
            return future

    with (
        Lost(1) as pool,
        workers_of(pool, 1) as workers,
        pytest.raises(InputError, match="run again to continue"),
    ):
        list(workers.completed([Task((1,), doubled)]))


@pytest.mark.parametrize("name", ["remote", "local:4", "dask", ""])
def test_unknown_executors(name):
    with pytest.raises(InputError, match="known"), workers_of(name):
        pass


def test_a_missing_package_is_named(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "distributed", None)
    with pytest.raises(MissingDependencyError, match=r"\.\[cluster\]"), workers_of("dask:tcp://x:1"):
        pass
