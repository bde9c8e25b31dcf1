"""Poses of a creature: each joint rotates what lies beyond it, with a smooth transition at the joint.

A pose is a smooth map of space restricted to the rest surface, so it does not depend on the triangulation.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from isomatch._core.arrays import FloatArray
from isomatch._core.errors import SettingError
from isomatch._core.settings import generator
from isomatch_lab.procedural.anatomy import Joint, Limb
from isomatch_lab.procedural.implicit import Skin

Pose = Mapping[str, ArrayLike]
BEND_WIDTH = 2.3  # half of the length over which a limb bends at a joint, over its radius there; chosen


def natural_pose(limbs: tuple[Limb, ...], seed: int) -> dict[str, FloatArray]:
    """Draw the angles of every joint within its natural limits; seed 0 is the rest pose, which has no angles."""
    if seed == 0:
        return {}
    rng = generator(seed)
    return {joint.name: rng.uniform(*np.transpose(joint.limits)) for limb in limbs for joint in limb.joints}


def pose_points(rest: FloatArray, limbs: tuple[Limb, ...], skin: Skin, pose: Pose) -> FloatArray:
    """Move rest positions (n, 3) into a pose: a rotation vector in degrees about the rest axes for joints by name."""
    angles = _check_pose(pose, limbs)
    if not angles:
        return rest.copy()
    membership = skin.membership(rest)
    # A joint at c with the rotation vector θ moves x to c + R(h θ)(x − c), where R rotates by a fraction h from 0 to 1 of
    # θ. Children are rotated before their parents, so that the rotations compose to forward kinematics.
    points = rest
    for limb in reversed(limbs):
        for joint in reversed(limb.joints):
            if joint.name in angles:
                fraction = _fraction(rest, membership, limbs, limb, joint)
                points = _turn(points, limb.nodes[joint.node], angles[joint.name], fraction)
    return points


def _check_pose(pose: Pose, limbs: tuple[Limb, ...]) -> dict[str, FloatArray]:
    joints = [joint.name for limb in limbs for joint in limb.joints]
    angles = {name: np.radians(np.asarray(value, dtype=float)) for name, value in pose.items()}
    for name, value in angles.items():
        if name not in joints:
            raise SettingError(f"pose rotates {name!r}, which is no joint; choose from {', '.join(joints)}")
        if value.shape != (3,) or not np.isfinite(value).all():
            raise SettingError(
                f"pose of {name!r} is {pose[name]!r}; give three finite angles, in degrees about x, y, z"
            )
    return {name: value for name, value in angles.items() if value.any()}


def _fraction(
    rest: FloatArray, membership: FloatArray, limbs: tuple[Limb, ...], limb: Limb, joint: Joint
) -> FloatArray:
    """Fraction of a joint's rotation at each point, (n,), by the position of the point, or of its branch, on the limb."""
    fraction = np.zeros(len(rest))
    for i, other in enumerate(limbs):
        branch = _branch(limbs, other, limb)
        if other is limb:
            fraction += membership[:, i] * _beyond(rest, limb, joint.node)
        elif branch is not None:
            fraction += membership[:, i] * _beyond(branch.nodes[:1], limb, joint.node)
    return fraction


def _branch(limbs: tuple[Limb, ...], limb: Limb, ancestor: Limb) -> Limb | None:
    """Find the child of ``ancestor`` from which ``limb`` descends; None if it does not descend from it."""
    by_name = {other.name: other for other in limbs}
    while limb.parent is not None and limb.parent != ancestor.name:
        limb = by_name[limb.parent]
    return limb if limb.parent else None


def _beyond(points: FloatArray, limb: Limb, node: int) -> FloatArray:
    """0 before a node of a limb, 1 beyond it, with a smooth transition; 1 everywhere for the first node."""
    if node == 0:
        return np.ones(len(points))
    axis = sum(step / np.linalg.norm(step) for step in np.diff(limb.nodes[node - 1 : node + 2], axis=0))
    along = (points - limb.nodes[node]) @ (axis / np.linalg.norm(axis))
    s = np.clip(0.5 + along / (2 * BEND_WIDTH * limb.radii[node]), 0, 1)
    smooth: FloatArray = s * s * s * (s * (6 * s - 15) + 10)
    return smooth


def _turn(points: FloatArray, centre: FloatArray, angles: FloatArray, fraction: FloatArray) -> FloatArray:
    """Rotate each point about a centre by its fraction of a rotation vector, by Rodrigues' formula."""
    angle = np.linalg.norm(angles)
    axis = angles / angle
    sine, cosine = np.sin(angle * fraction)[:, None], np.cos(angle * fraction)[:, None]
    arm = points - centre
    across: FloatArray = np.cross(axis, arm)
    turned: FloatArray = centre + cosine * arm + sine * across + (1 - cosine) * np.outer(arm @ axis, axis)
    return turned
