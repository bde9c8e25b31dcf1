"""What all tests share: ``zoo.py`` beside this file can be imported, and real shapes are found or skipped."""

import os
from pathlib import Path

import pytest

_BESIDE = Path(__file__).parents[2] / "shared" / "data"
SHARED_DATA = Path(os.environ.get("ISOMATCH_SHARED_DATA", _BESIDE))


@pytest.fixture(scope="session")
def shared_data():
    """Find a file of real shapes, which is no part of the repository; skip the test where it is absent."""

    def find(name):
        if not (SHARED_DATA / name).exists():
            pytest.skip(f"needs {name}; folder {SHARED_DATA} not found or incomplete")
        return SHARED_DATA / name

    return find
