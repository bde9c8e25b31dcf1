"""Names are imported when they are first used: starting is quick, and nobody sees the difference."""

import ast
import importlib
import pickle
import subprocess
import sys
from pathlib import Path

import pytest

import isomatch

STUBS = sorted(Path(isomatch.__file__).parent.rglob("__init__.pyi"))
PACKAGES = [".".join(stub.parent.relative_to(Path(isomatch.__file__).parents[1]).parts) for stub in STUBS]
SLOW = ("numba", "matplotlib", "scipy.sparse", "scipy.linalg", "scipy.spatial", "scipy.optimize", "scipy.special",
        "skimage", "multiprocessing")  # fmt: skip


def loaded_by(source):
    """Which slow modules a new process has loaded after some lines."""
    told = f"{source}\nimport sys\nsys.stderr.write(' '.join(m for m in {SLOW} if m in sys.modules))"
    return subprocess.run(
        [sys.executable, "-W", "error", "-c", told], capture_output=True, text=True, check=True
    ).stderr.split()


@pytest.mark.parametrize("words", ["--help", "--version"])
def test_help_loads_nothing_slow(words):
    run = f"from isomatch.cli import main\nassert main({words.split()}) == 0"
    assert loaded_by(run) == []


def test_the_import_loads_nothing_slow():
    assert (
        loaded_by("import isomatch, isomatch.matching, isomatch.visualization, isomatch_lab.evaluation") == []
    )


def test_packages_travel_by_name():
    """As modules in functions that are sent to other processes."""
    for package in (isomatch, isomatch.matching):
        assert pickle.loads(pickle.dumps(package)) is package


def test_serial_blas_holds_for_what_is_loaded_later():
    loaded_by(
        "from isomatch._core.threads import serial_blas\nfrom threadpoolctl import threadpool_info\n"
        "with serial_blas():\n"
        "    import scipy.linalg\n"
        "    assert {pool['num_threads'] for pool in threadpool_info() if pool['user_api'] == 'blas'} == {1}"
    )


@pytest.mark.long
def test_what_matches_loads_no_pictures_and_no_data():
    """But numba, by which the loops of a match are compiled."""
    slow = loaded_by("import isomatch\nisomatch.match, isomatch.prepare")
    assert not {"matplotlib", "skimage"} & set(slow)


@pytest.mark.parametrize("name", PACKAGES)
def test_a_package_has_the_names_of_its_stub_and_no_others(name):
    package = importlib.import_module(name)
    stub = ast.parse(Path(package.__file__).with_suffix(".pyi").read_text(encoding="utf-8"))
    homes = {
        alias.name: node.module
        for node in stub.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert sorted(homes) == sorted(package.__all__)
    listed = {name for name in dir(package) if not (name.startswith("__") and name.endswith("__"))}
    assert listed == set(package.__all__), "no private name, and no module that was imported on the way"
    for public, home in homes.items():
        assert getattr(package, public) is getattr(importlib.import_module(home), public)


def test_a_star_imports_all_public_names():
    names = {}
    exec("from isomatch import *", names)
    assert set(isomatch.__all__) <= set(names)


@pytest.mark.long
@pytest.mark.parametrize(
    ("module", "name"),
    [
        ("repair.check", "check"),  # the function `repair` hides the subpackage as an attribute
        ("matching.match", "matching.match"),
        ("spectral.distance_basis", "spectral.distance_basis"),
        (
            "spectral.build",
            "spectral.distance_basis",
        ),  # of the module build, which imports the module distance_basis
    ],
)
def test_a_module_does_not_hide_the_function_of_its_name(module, name):
    loaded_by(f"import isomatch.{module}\nassert callable(isomatch.{name})")


@pytest.mark.long
def test_subpackages_are_attributes_of_the_package():
    loaded_by("import isomatch\nisomatch.geodesics.geodesic_distances, isomatch._core.errors.MeshError")


def test_public_classes_are_pickled_by_name():
    for name in isomatch.__all__:
        assert pickle.loads(pickle.dumps(getattr(isomatch, name))) is getattr(isomatch, name)
