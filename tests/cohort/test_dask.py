"""A Dask cluster: the same maps as local workers make, also if one of its workers dies."""

import os
import random
import signal
import threading
import time
from contextlib import suppress

import pytest

from isomatch import InputError
from isomatch.cohort import Collection
from isomatch.cohort.workers import _n_threads_of
from small_collections import arrays_of, run


@pytest.fixture
def distributed():
    return pytest.importorskip("distributed")


@pytest.fixture
def cluster(distributed):
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
    ) as cluster:
        yield cluster


@pytest.mark.long
@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
def test_a_worker_that_dies_is_replaced_and_the_maps_are_those_of_local_workers(
    cluster, small, finished, tmp_path
):
    collection = Collection.create(tmp_path, small.shapes, pairs="all", config=small.config)
    before = threading.active_count()
    for event in collection.run(f"dask:{cluster.scheduler_address}"):
        if event.what == "shape" and event.done == event.of:
            victim = next(iter(cluster.workers.values()))
            os.kill(victim.process.process.pid, signal.SIGKILL)
    assert {row.state for row in collection.rows().pairs.values()} == {"done"}
    assert arrays_of(tmp_path) == arrays_of(finished)
    limit = time.monotonic() + 10
    while threading.active_count() > before + 1 and time.monotonic() < limit:
        time.sleep(0.05)
    assert threading.active_count() <= before + 1


# what is raised of a worker, or its process, that has ended or is not yet there
JUST_ENDED = AttributeError, IndexError, ProcessLookupError, ValueError


class Deaths(threading.Thread):
    """Kills a worker, drawn by chance, again and again, but each time only after the run has made progress."""

    def __init__(self, cluster, seed, seconds, most):
        super().__init__()
        self.cluster, self.seconds, self.most, self.killed = cluster, seconds, most, 0
        self.draws, self.over, self.progress = random.Random(seed), threading.Event(), threading.Event()

    def run(self):
        while self.killed < self.most and not self.over.wait(self.draws.uniform(*self.seconds)):
            if not self.progress.wait(0.1):
                continue
            with suppress(*JUST_ENDED):
                victim = self.draws.choice([*self.cluster.workers.values()])
                os.kill(victim.process.process.pid, signal.SIGKILL)
                self.progress.clear()
                self.killed += 1


@pytest.mark.long
@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.parametrize("most", [2, 1000])
def test_workers_that_die_at_random_during_a_whole_run(cluster, small, finished, tmp_path, most):
    """A job beside which workers died three times is given up by name; the next run makes it."""
    collection = Collection.create(tmp_path, small.shapes, pairs="all", config=small.config)
    deaths = Deaths(cluster, seed=0, seconds=(0.2, 1.0), most=most)
    deaths.start()
    try:
        for _ in collection.run(f"dask:{cluster.scheduler_address}"):
            deaths.progress.set()
    finally:
        deaths.over.set()
        deaths.join()
    assert deaths.killed >= 1
    rows = collection.rows()
    for row in (*rows.shapes.values(), *rows.pairs.values()):
        assert row.state == "done" or "worker" in row.error
    run(collection)
    assert {row.state for row in collection.rows().pairs.values()} == {"done"}
    assert arrays_of(tmp_path) == arrays_of(finished)


@pytest.mark.usefixtures("distributed")
@pytest.mark.parametrize("address", ["nonsense://x", "tcp://"])
def test_a_scheduler_that_cannot_be_reached(address, small, tmp_path):
    collection = Collection.create(tmp_path, small.shapes, config=small.config)
    with pytest.raises(InputError, match="scheduler"):
        next(collection.run(f"dask:{address}"))


def test_a_scheduler_that_is_lost_ends_the_run_in_one_line():
    class Client:
        def nthreads(self):
            raise OSError("Timed out")

    with pytest.raises(InputError, match="run again to continue"):
        _n_threads_of(Client())()
