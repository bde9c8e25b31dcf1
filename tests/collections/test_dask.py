"""A Dask cluster: the same maps as local workers make, also if one of its workers dies."""

import os
import signal
import threading
import time

import pytest

from isomatch import InputError
from isomatch.collections import Collection
from isomatch.collections.workers import _n_threads_of
from small_collections import arrays_of

distributed = pytest.importorskip("distributed")


@pytest.fixture
def cluster():
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
    ) as cluster:
        yield cluster


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
    assert {row["state"] for row in collection.rows().pairs.values()} == {"done"}
    assert arrays_of(tmp_path) == arrays_of(finished)
    limit = time.monotonic() + 10
    while threading.active_count() > before + 1 and time.monotonic() < limit:
        time.sleep(0.05)
    assert threading.active_count() <= before + 1


@pytest.mark.parametrize("address", ["nonsense://x", "tcp://"])
def test_a_scheduler_that_cannot_be_reached(address, small, tmp_path):
    collection = Collection.create(tmp_path, small.shapes, config=small.config)
    with pytest.raises(InputError, match=r"no Dask scheduler answers .* check the address"):
        next(collection.run(f"dask:{address}"))


def test_a_scheduler_that_is_lost_ends_the_run_in_one_line():
    class Client:
        def nthreads(self):
            raise OSError("Timed out")

    with pytest.raises(InputError, match="run again to continue"):
        _n_threads_of(Client())()
