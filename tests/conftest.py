"""What all tests share; ``zoo.py``, ``shapes.py`` and ``data.py`` beside this file can be imported."""

import gc
import os
import platform
import signal
from functools import partial
from pathlib import Path

import pytest
from hypothesis import settings
from threadpoolctl import threadpool_limits

import isomatch.visualization.notebook
import isomatch.visualization.report
from browser_pages import browser, visit  # noqa: F401 - fixtures
from data import real_file
from isomatch import Mesh, PointCloud, prepare
from isomatch._core.machine import kernels, processor, versions
from isomatch._core.threads import n_threads
from isomatch.cohort import shape_statistics
from isomatch.datasets import example_pair, ground_truth
from isomatch.matching import problem
from isomatch.visualization import draw_map
from small_collections import copied, finished, in_threads, small  # noqa: F401 - fixtures

LABORATORY = Path(__file__).parent / "lab"
LONGEST = (  # files in the order in which they are handed to workers, before all others
    "cohort/test_dask.py",
    "faults/test_every_step.py",
    "faults/test_other_systems.py",
    "zoo/test_every_command.py",
    "matching/test_parts.py",
    "test_code_blocks.py",
    "matching/test_match.py",
    "matching/test_levels.py",
    "spectral/test_large_distance_basis.py",
    "cohort/test_survival.py",
    "lab/baselines/test_baselines.py",
    "cohort/test_agreement.py",
    "fuzz/test_growth.py",
    "test_gallery.py",
    "transfer/test_wrap.py",
    "lab/paper/test_paper.py",
    "matching/test_hinted_side.py",
    "matching/test_hard_landmarks.py",
    "matching/test_components.py",
    "lab/evaluation/test_benchmark.py",
    "cohort/test_runs.py",
    "lab/damage/test_damage.py",
    "faults/test_killed.py",
    "matching/test_match_invariance.py",
    "cli/test_manners.py",
    "matching/test_anchors.py",
    "test_interruption.py",
    "matching/test_symmetries.py",
    "matching/test_bad_input.py",
    "spectral/test_distance_basis.py",
    "matching/test_elastic.py",
    "cli/test_cli.py",
    "lab/test_creatures.py",
    "matching/test_points_and_graphs.py",
    "fuzz/test_array_files.py",
    "matching/test_result_file.py",
    "matching/test_both.py",
    "cli/test_statistics.py",
)


settings.register_profile("the same each time", derandomize=not os.environ.get("ISOMATCH_FUZZ_EXAMPLES"))
settings.load_profile("the same each time")


def this_machine():
    """What the last digits depend on."""
    packages = {"python": platform.python_version()} | versions(["numpy", "scipy", "numba", "hypothesis"])
    numbers = ", ".join(f"{name} {number}" for name, number in packages.items())
    return f"{processor()}; {kernels()}; threads of a worker: {n_threads()}; {numbers}"


def pytest_sessionstart(session):
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")
    if reporter and not hasattr(session.config, "workerinput"):
        reporter.write_line(this_machine())


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """Keep the garbage collector from looking at what stays to the end, which took a third of the time."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item, call):
    """A failure names the machine, so that it can be seen again elsewhere."""
    report = yield
    if report.failed:
        report.sections.append(("Machine", this_machine()))
    return report


def pytest_ignore_collect(collection_path, config):
    """Import nothing of the tests of the laboratory, which are all long, where long tests are left out."""
    return True if collection_path == LABORATORY and config.option.markexpr == "not long" else None


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Leave the laboratory to the long tests; with the longest files first, no worker is left alone with one."""
    for item in items:
        if item.path.is_relative_to(LABORATORY):
            item.add_marker(pytest.mark.long)
    rank = {f"tests/{name}": i for i, name in enumerate(LONGEST)}
    items.sort(key=lambda item: rank.get(item.nodeid.partition("::")[0], len(rank)))


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


PREPARED = {}  # shapes that matches of any file of a worker were given
MOST_PREPARED = 16


def prepared_or_kept(shape, config, seed, **told):
    """Prepare a mesh or cloud that a match is given again only for other settings."""
    if not isinstance(shape, Mesh | PointCloud):
        return prepare(shape, config, seed, **told)
    key = shape.content_hash, config, seed, os.environ.get("ISOMATCH_NUM_THREADS")
    if key not in PREPARED:
        PREPARED[key] = prepare(shape, config, seed, **told)
    while len(PREPARED) > MOST_PREPARED:
        PREPARED.pop(next(iter(PREPARED)))
    return PREPARED[key]


@pytest.fixture(scope="module")
def prepared_once():
    """Matches do not prepare again what a match of any file was given before."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(problem, "prepare", prepared_or_kept)
        yield


class Doctests:
    """Those of all files prepare the shipped pair once."""

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_call(self, item):
        with pytest.MonkeyPatch.context() as patch:
            if isinstance(item, pytest.DoctestItem):
                patch.setattr(problem, "prepare", prepared_or_kept)
            return (yield)


def pytest_configure(config):
    config.pluginmanager.register(Doctests())


@pytest.fixture
def coarse_pictures(monkeypatch):
    """The pictures of statistics with a fifth of the dots in print: what is in them is tested in ``shape_statistics``."""
    monkeypatch.setattr(shape_statistics.charts, "DPI", 60)


@pytest.fixture
def small_pictures(monkeypatch):
    """The pictures of a match at a sixth of their width: what is in them is tested in ``view``."""
    monkeypatch.setattr(isomatch.visualization, "draw_map", partial(draw_map, width=300))
    monkeypatch.setattr(isomatch.visualization.report, "WIDTH", 300)
    monkeypatch.setattr(isomatch.visualization.notebook, "PAIR_WIDTH", 150)


@pytest.fixture(scope="module")
def narrow_reports():
    """The pictures in reports at a third of their width: what is in them is tested in ``test_stills``."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(isomatch.visualization.report, "WIDTH", 600)
        patch.setattr(isomatch.visualization.report, "STILL_WIDTH", 213)
        yield


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
