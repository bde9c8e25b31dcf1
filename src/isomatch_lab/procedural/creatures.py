"""Procedural articulated animals, at any resolution and in any pose, with exact ground truth."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from isomatch._core.array_file import write_arrays
from isomatch._core.errors import SettingError
from isomatch.datasets import Creature
from isomatch.surfaces import Mesh
from isomatch_lab.procedural.anatomy import body
from isomatch_lab.procedural.implicit import Skin
from isomatch_lab.procedural.posing import Pose, natural_pose, pose_points
from isomatch_lab.procedural.tessellation import tessellate

MIN_VERTICES = 1500  # smallest number of vertices at which thin limbs stay whole


def creature(
    n_vertices: int = 5000,
    *,
    pose: int | Pose = 0,
    kind: str = "quadruped",
    style: int = 0,
    symmetric: bool = False,
    triangulation: int = 0,
) -> Creature:
    """Make an animal.

    Parameters
    ----------
    n_vertices : int
        Number of vertices, at least 1500; the mesh differs from it by up to 5 %.
    pose : int or mapping of str to (3,) array_like
        Seed of a random natural pose, 0 being the rest pose; or, for each joint that turns, its angles in
        degrees about x (to the right), y (forward) and z (up). `joint_names` lists the joints.
    kind : {"quadruped", "biped"}
        Body plan.
    style : int
        Seed of the proportions; 0 is the plain design.
    symmetric : bool
        Whether the rest shape is its own mirror image. If not, an ear is longer, a leg thicker, the tail bent, and so on.
    triangulation : int
        Seed of the triangulation. With two seeds, the same surface has no vertex and no connectivity in common.

    Returns
    -------
    Creature
        About 1.2 units long (quadruped) or 1.6 tall (biped). The same arguments give the same creature.

    Raises
    ------
    MissingDependencyError
        Without scikit-image, which the extra ``creatures`` has.
    SettingError
        If an argument is out of range, or a joint is unknown.

    Notes
    -----
    Poses are near-isometric: 90 % of the edges change their length by less than 18 %, typically by less than 11 %; the
    others lie at joints bent almost to their limits. Time is linear in ``n_vertices``.

    Examples
    --------
    >>> from isomatch.datasets import ground_truth
    >>> source = creature(2000, pose=1)
    >>> target = creature(2000, pose={"head": [0, 0, 30]}, triangulation=1)
    >>> truth = ground_truth(source, target)
    >>> len(truth.vertices) == source.mesh.n_vertices
    True
    """
    if n_vertices < MIN_VERTICES:
        raise SettingError(
            f"n_vertices = {n_vertices} is too coarse for a creature's thin limbs; ask for at least {MIN_VERTICES}"
        )
    limbs = body(kind, style, symmetric)
    skin = Skin.of(limbs)
    angles = natural_pose(limbs, pose) if isinstance(pose, int | np.integer) else pose
    rest = tessellate(skin, n_vertices, triangulation)
    mesh = Mesh(pose_points(rest.vertices, limbs, skin, angles), rest.faces)
    return Creature(mesh, rest.vertices, kind, style, symmetric)


def joint_names(kind: str = "quadruped") -> tuple[str, ...]:
    """Names of the joints of a body plan, for ``creature(pose=...)``.

    Examples
    --------
    >>> joint_names()[:3]
    ('waist', 'neck', 'head')
    """
    return tuple(joint.name for limb in body(kind) for joint in limb.joints)


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
"""Pose of the second creature of the shipped pair."""


def make_example_pair() -> tuple[Creature, Creature]:
    """Make the two creatures that `example_pair` loads; needs scikit-image."""
    return creature(3000, pose=0, triangulation=1), creature(3300, pose=RUNNING, triangulation=2)


def save_example_pair(path: str = "creature_pair.npz") -> None:
    """Write the pair to a compressed file: float32 positions, uint16 faces."""
    arrays: dict[str, Any] = {}
    for name, made in zip(("source", "target"), make_example_pair()):
        arrays[f"{name}_vertices"] = made.mesh.vertices.astype(np.float32)
        arrays[f"{name}_rest"] = made.rest.astype(np.float32)
        arrays[f"{name}_faces"] = made.mesh.faces.astype(np.uint16)
    write_arrays(Path(path), arrays)
