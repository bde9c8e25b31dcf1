"""Real shapes, which are no part of the repository: found in a folder beside it, or the test is skipped."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from isomatch import Mesh

_BESIDE = Path(__file__).parents[2] / "shared" / "data"
FOLDER = Path(os.environ.get("ISOMATCH_DATA", _BESIDE))


def real_file(name: str) -> Path:
    """Path of a file of real shapes; skips the test, with the reason, where it is absent."""
    if not FOLDER.is_dir():
        pytest.skip(f"needs {name}; folder {_shown()} not found")
    if not (FOLDER / name).exists():
        pytest.skip(f"needs {name}; not in folder {_shown()}")
    return FOLDER / name


def tosca(pose: str) -> Mesh:
    """One pose, such as ``wolf1``; poses of a class share a triangulation: vertex i belongs to vertex i."""
    with np.load(real_file(f"tosca/{pose.rstrip('0123456789')}.npz"), allow_pickle=False) as poses:
        return Mesh(poses[pose], poses["faces"])


def _shown() -> str:
    return "../shared/data" if FOLDER == _BESIDE else str(FOLDER)
