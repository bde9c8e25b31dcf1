"""The pair of creatures shipped with the package.

To make it again::

    python -c "from isomatch.datasets.example import save_example_pair; save_example_pair()"
"""

from __future__ import annotations

from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

import numpy as np

from isomatch.datasets.creatures import Creature, creature
from isomatch.storage.array_file import write_arrays
from isomatch.surfaces import Mesh

FILE = files("isomatch.datasets") / "shipped" / "creature_pair.npz"

RUNNING = {
    "waist": [-8, 0, 0],
    "neck": [12, 0, 14],
    "head": [4, 6, 30],
    "tail": [-18, 0, -20],
    "tail_middle": [12, 0, 18],
    "left_ear": [-18, 0, 0],
    "right_ear": [-22, 0, 0],
    "left_shoulder": [28, 0, 0],
    "left_elbow": [-14, 0, 0],
    "right_shoulder": [-20, 0, 0],
    "right_elbow": [-36, 0, 0],
    "left_hip": [-26, 0, 0],
    "left_knee": [-12, 0, 0],
    "right_hip": [18, 0, 0],
    "right_knee": [-14, 0, 0],
    "right_hock": [14, 0, 0],
}


def example_pair() -> tuple[Creature, Creature]:
    """Load two poses of one asymmetric animal with different triangulations; only numpy is needed.

    Returns
    -------
    source, target : Creature
        Standing, and running with its head turned; `ground_truth` gives their correspondence.

    Examples
    --------
    >>> source, target = example_pair()
    >>> source, target
    (Creature(quadruped, style 0, 2968 vertices), Creature(quadruped, style 0, 3242 vertices))
    """
    with as_file(FILE) as path, np.load(path) as stored:
        source, target = (
            Creature(
                mesh=Mesh(stored[f"{name}_vertices"], stored[f"{name}_faces"]),
                rest=stored[f"{name}_rest"].astype(np.float64),
                kind="quadruped",
                style=0,
                symmetric=False,
            )
            for name in ("source", "target")
        )
    return source, target


def make_example_pair() -> tuple[Creature, Creature]:
    """Make the two creatures that `example_pair` loads; needs scikit-image."""
    return creature(3000, pose=0, triangulation=1), creature(3300, pose=RUNNING, triangulation=2)


def save_example_pair(path: str = str(FILE)) -> None:
    """Write the pair to a compressed file: float32 positions, uint16 faces."""
    arrays: dict[str, Any] = {}
    for name, made in zip(("source", "target"), make_example_pair()):
        arrays[f"{name}_vertices"] = made.mesh.vertices.astype(np.float32)
        arrays[f"{name}_rest"] = made.rest.astype(np.float32)
        arrays[f"{name}_faces"] = made.mesh.faces.astype(np.uint16)
    write_arrays(Path(path), arrays)
