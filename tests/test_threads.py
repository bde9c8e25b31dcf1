"""Work on several threads gives the results of one."""

import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import count
from pickle import dumps, loads
from threading import Barrier, Event
from time import sleep

import numpy as np
import pytest
import scipy.linalg  # noqa: F401 - loads a BLAS of its own
from threadpoolctl import threadpool_info, threadpool_limits

from isomatch._core.cached import cached_method, cached_property
from isomatch._core.threads import ROWS_PER_BLOCK, parallel_map, row_product, serial_blas
from isomatch.surfaces import Mesh, surface_in_use


@pytest.mark.parametrize("n", [0, 1, ROWS_PER_BLOCK, 2 * ROWS_PER_BLOCK + 3])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_product_by_blocks_of_rows(n, dtype, monkeypatch):
    rng = np.random.default_rng(n)
    a, b = rng.normal(size=(n, 30)).astype(dtype), rng.normal(size=(30, 7))
    products = []
    for threads in ("1", "2"):
        monkeypatch.setenv("ISOMATCH_NUM_THREADS", threads)
        products.append(row_product(a, b))
    assert products[0].dtype == dtype
    np.testing.assert_array_equal(*products)
    exact = a.astype(float) @ b
    np.testing.assert_allclose(products[0], exact, atol=100 * np.finfo(dtype).eps)


def test_product_with_a_part_of_the_columns():
    """Views, transposed factors and single columns, as bases are used."""
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=(5000, 40)), rng.normal(size=(9, 40))
    np.testing.assert_allclose(row_product(a[:, :20], b.T[:20]), a[:, :20] @ b.T[:20], atol=1e-12)
    np.testing.assert_allclose(row_product(a[::3], b[:1].T), a[::3] @ b[:1].T, atol=1e-12)


def threads_of_blas():
    return {pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"}


def test_blas_is_serial_where_another_thread_limited_it():
    """As where a program sets a limit of its own once, before it matches."""

    def within():
        with serial_blas():
            return threads_of_blas()

    with threadpool_limits(2), ThreadPoolExecutor(1) as other:
        assert other.submit(within).result() == {1}
        assert threads_of_blas() == {2}
        with threadpool_limits(3):
            assert threads_of_blas() == {3}


def test_blas_has_its_threads_again_when_the_last_thread_leaves():
    entered, left = Event(), Event()

    def first():
        with serial_blas():
            entered.set()
            left.wait()

    with threadpool_limits(2):
        with ThreadPoolExecutor(1) as other:
            running = other.submit(first)
            entered.wait()
            with serial_blas():
                left.set()
                running.result()
                assert threads_of_blas() == {1}
        assert threads_of_blas() == {2}


def test_results_keep_the_order_of_the_items(monkeypatch):
    monkeypatch.setenv("ISOMATCH_NUM_THREADS", "3")
    assert parallel_map(lambda i: parallel_map(lambda j: (i, j), range(3)), range(5)) == [
        [(i, j) for j in range(3)] for i in range(5)
    ]


@dataclass(frozen=True, eq=False)
class Shape:
    """Something whose property waits until that of another object is being computed too."""

    name: str
    meeting: Barrier
    asked: list

    @cached_property
    def title(self):
        """What it is called."""
        self.asked.append(self.name)
        self.meeting.wait(timeout=20)
        return self.name.title()


def test_properties_of_two_objects_are_computed_at_once():
    meeting, asked = Barrier(2), []
    shapes = [Shape(name, meeting, asked) for name in ("cat", "dog")]
    with ThreadPoolExecutor(2) as pool:
        assert list(pool.map(lambda shape: shape.title, shapes)) == ["Cat", "Dog"]
    assert [shape.title for shape in shapes] == ["Cat", "Dog"]
    assert sorted(asked) == ["cat", "dog"], "once each"


class Slow:
    """Something whose values take a while."""

    def __init__(self):
        self.asked = []

    @cached_property
    def title(self):
        self.asked.append("title")
        sleep(0.05)
        return self.name(1)

    @cached_method
    def name(self, number):
        self.asked.append(number)
        sleep(0.05)
        return number


def test_a_value_is_computed_by_one_thread_while_others_wait():
    slow = Slow()
    with ThreadPoolExecutor(6) as pool:
        values = list(pool.map(lambda i: slow.title if i % 2 else slow.name(i % 4), range(12)))
    assert values == [i % 4 if i % 2 == 0 else 1 for i in range(12)]
    assert sorted(map(str, slow.asked)) == ["0", "1", "2", "title"]
    assert loads(dumps(slow)).title == 1


def test_a_value_that_could_not_be_computed_is_computed_again():
    class Fails(Slow):
        @cached_property
        def title(self):
            self.asked.append("title")
            if len(self.asked) == 1:
                raise ValueError("not yet")
            return 1

    fails = Fails()
    with pytest.raises(ValueError, match="not yet"):
        fails.title  # noqa: B018
    assert (fails.title, fails.asked) == (1, ["title", "title"])


def test_a_property_is_known_by_its_class():
    assert Shape.title.__doc__ == "What it is called."
    assert "title" in vars(Shape)


@pytest.mark.long
def test_a_surface_is_found_by_its_hash_while_others_are_hashed():
    here = Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    known = [here.moved(here.vertices + i) for i in range(2000)]
    assert len({mesh.content_hash for mesh in known}) == 2000
    done = Event()

    def hash_others():
        for i in count():
            if done.is_set():
                return
            assert here.moved(here.vertices - i).content_hash

    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        with ThreadPoolExecutor(2) as pool:
            work = [pool.submit(hash_others) for _ in range(2)]
            try:
                assert surface_in_use(known[7].content_hash) is known[7]
                assert all(surface_in_use("none") is None for _ in range(300))
            finally:
                done.set()
        assert all(each.result() is None for each in work)
    finally:
        sys.setswitchinterval(interval)
