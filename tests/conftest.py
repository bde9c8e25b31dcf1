"""What all tests share; ``zoo.py``, ``shapes.py`` and ``data.py`` beside this file can be imported."""

import os
import signal
from functools import partial

import pytest
from threadpoolctl import threadpool_limits

import isomatch.view.report
from data import real_file
from isomatch import Mesh, prepare
from isomatch.datasets import example_pair, ground_truth
from isomatch.matching import pair
from isomatch.view import draw_map
from small_collections import copied, finished, small  # noqa: F401 - fixtures


@pytest.fixture(scope="session", autouse=True)
def one_thread_for_matrix_products():
    """Small products stall where they share processors with other work."""
    with threadpool_limits(1, "blas"):
        yield


@pytest.fixture(scope="session", autouse=True)
def ctrl_c_is_heard():
    """A shell that starts a job in the background lets it and what it starts ignore Ctrl-C; tests need it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture(scope="module")
def prepared_once():
    """Matches of a module prepare a mesh that they are given again only for other settings."""
    kept = {}

    def once(shape, config, seed, **told):
        if not isinstance(shape, Mesh):
            return prepare(shape, config, seed, **told)
        key = shape.content_hash, config, seed, os.environ.get("ISOMATCH_NUM_THREADS")
        if key not in kept:
            kept[key] = prepare(shape, config, seed, **told)
        return kept[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pair, "prepare", once)
        yield


@pytest.fixture
def small_pictures(monkeypatch):
    """The pictures of a match at a sixth of their width: what is in them is tested in ``view``."""
    monkeypatch.setattr(isomatch.view, "draw_map", partial(draw_map, width=300))
    monkeypatch.setattr(isomatch.view.report, "WIDTH", 300)


@pytest.fixture(scope="session")
def shared_data():
    """Find a file of real shapes, which is no part of the repository; skip the test where it is absent."""
    return real_file


@pytest.fixture(scope="session")
def example():
    """The shipped pair of creatures."""
    return example_pair()


@pytest.fixture(scope="session")
def example_truth(example):
    """Target vertex of each source vertex of the shipped pair."""
    return ground_truth(*example).vertices


@pytest.fixture(scope="session")
def prepared_example(example):
    """Both shipped creatures, prepared with the default settings."""
    return tuple(prepare(made.mesh) for made in example)
