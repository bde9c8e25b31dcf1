"""The bodies of the procedural creatures: limbs of round cones, and the natural range of each joint.

Axes: x points to the right (the mirror of a symmetric body is x → −x), y forward, z up.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from isomatch._core.arrays import FloatArray
from isomatch._core.errors import SettingError

# least and largest angle of a joint about x, y and z, in degrees
Limits = tuple[tuple[float, float], tuple[float, float], tuple[float, float]]


@dataclass(frozen=True)
class Joint:
    """A point of a limb about which everything beyond it rotates."""

    name: str  # name of the limb, unique in the body
    node: int  # number of a node of the limb; at 0 the limb grows out of its parent
    # degrees about x (pitch: > 0 raises what points forward), y (roll), z (yaw: > 0 turns left)
    limits: Limits


@dataclass(frozen=True, eq=False)
class Limb:
    """A chain of round cones through (k, 3) nodes with (k,) radii, growing out of a parent limb."""

    name: str
    parent: str | None
    nodes: FloatArray
    radii: FloatArray
    joints: tuple[Joint, ...] = ()

    def mirrored(self) -> Limb:
        """Mirror the limb to the other side: ``right_…`` becomes ``left_…``."""
        joints = tuple(
            Joint(_left(joint.name), joint.node, (pitch, _negate_limits(roll), _negate_limits(yaw)))
            for joint in self.joints
            for pitch, roll, yaw in [joint.limits]
        )
        parent = self.parent and _left(self.parent)
        return replace(
            self, name=_left(self.name), parent=parent, nodes=self.nodes * [-1.0, 1.0, 1.0], joints=joints
        )


def body(kind: str, style: int = 0, symmetric: bool = False) -> tuple[Limb, ...]:
    """Limbs of a body plan, parents before children."""
    if kind not in PLANS:
        raise SettingError(f"kind = {kind!r} is no body plan; choose one of {', '.join(map(repr, PLANS))}")
    draw = np.random.default_rng(style).uniform(-1, 1, 6) if style else np.zeros(6)
    return PLANS[kind](draw, 0.0 if symmetric else 1.0)


def _quadruped(draw: FloatArray, lopsided: float) -> tuple[Limb, ...]:
    leg, girth, neck, head, ear, tail = 1 + draw * [0.15, 0.1, 0.2, 0.12, 0.3, 0.25]
    rise = 0.5 * (leg - 1)  # height that longer legs add to the trunk

    trunk = _limb(
        "trunk", None, [[0, -0.36, 0.6], [0, 0, 0.63], [0, 0.34, 0.62]],
        girth * np.array([0.15, 0.155, 0.175]), Joint("waist", 1, ((-10, 10), (-8, 8), (-16, 16))),
    )  # fmt: skip
    base = np.array([0, 0.38, 0.68])
    nape = base + neck * np.array([0, 0.15, 0.24])
    skull = nape + np.array([0, 0.06, 0.1])
    neck_and_head = _limb(
        "head", "trunk", [base, nape, skull, skull + head * np.array([0, 0.25, -0.07])],
        [0.13 * girth, 0.1, 0.135 * head, 0.075 * head],
        Joint("neck", 0, ((-22, 16), (-8, 8), (-22, 22))),
        Joint("head", 1, ((-20, 16), (-14, 14), (-34, 34))),
    )  # fmt: skip
    nose = _limb("nose", "head", skull + head * np.array([[0, 0.3, -0.03], [0, 0.32, -0.03]]), [0.034, 0.034])
    right_ear = _limb(
        "right_ear", "head", skull + head * np.array([[0.075, -0.02, 0.08], [0.15, -0.06, 0.08 + 0.2 * ear]]),
        [0.055, 0.036], Joint("right_ear", 0, ((-25, 25), (-12, 12), (-10, 10))),
    )  # fmt: skip
    left_ear = right_ear.mirrored()
    right_foreleg = _limb(
        "right_foreleg", "trunk",
        [[0.13, 0.33, 0.54], [0.155, 0.3, 0.31 * leg], [0.155, 0.31, 0.075], [0.155, 0.39, 0.062]],
        girth * np.array([0.105, 0.072, 0.06, 0.06]),
        Joint("right_shoulder", 0, ((-24, 30), (-4, 3), (-4, 4))),
        Joint("right_elbow", 1, ((-45, 0), (0, 0), (0, 0))),
    )  # fmt: skip
    right_hindleg = _limb(
        "right_hindleg", "trunk",
        [[0.125, -0.36, 0.54], [0.155, -0.3, 0.35 * leg], [0.155, -0.41, 0.18 * leg], [0.155, -0.39, 0.07],
         [0.155, -0.3, 0.062]],
        girth * np.array([0.125, 0.085, 0.058, 0.06, 0.06]),
        Joint("right_hip", 0, ((-28, 22), (-4, 3), (-4, 4))),
        Joint("right_knee", 1, ((-28, 6), (0, 0), (0, 0))),
        Joint("right_hock", 2, ((-8, 24), (0, 0), (0, 0))),
    )  # fmt: skip
    rump = np.array([0, -0.44, 0.64])
    tail_limb = _limb(
        "tail", "trunk",
        rump + tail * np.array([[0, 0, 0], [0.02 * lopsided, -0.17, 0.06], [0.09 * lopsided, -0.33, 0.2],
                                [0.19 * lopsided, -0.38, 0.38]]),
        [0.07, 0.056, 0.05, 0.044],
        Joint("tail", 0, ((-25, 15), (0, 0), (-30, 30))),
        Joint("tail_middle", 1, ((-20, 20), (0, 0), (-25, 25))),
        Joint("tail_tip", 2, ((-20, 20), (0, 0), (-20, 20))),
    )  # fmt: skip
    limbs = [trunk, neck_and_head, nose, tail_limb, right_foreleg, right_hindleg, right_ear]
    limbs += [right_foreleg.mirrored(), right_hindleg.mirrored(), left_ear]
    if lopsided:
        limbs[6] = _stretch(right_ear, 1.55)
        limbs[7] = replace(limbs[7], radii=limbs[7].radii * [1.1, 1.3, 1.35, 1.35])
        limbs.append(_limb("hump", "trunk", [[-0.09, -0.1, 0.72], [-0.1, -0.08, 0.73]], [0.09, 0.09]))
    return tuple(replace(limb, nodes=_raise_nodes(limb, rise)) for limb in limbs)


def _biped(draw: FloatArray, lopsided: float) -> tuple[Limb, ...]:
    leg, girth, arm, head, ear, hand = 1 + draw * [0.15, 0.12, 0.12, 0.12, 0.25, 0.15]
    rise = 0.6 * (leg - 1)

    trunk = _limb(
        "trunk", None, [[0, 0, 0.68], [0, 0.02, 0.84], [0, 0, 1.06]], girth * np.array([0.135, 0.145, 0.14]),
        Joint("waist", 1, ((-14, 10), (-10, 10), (-20, 20))),
    )  # fmt: skip
    skull = np.array([0, 0.02, 1.4 + 0.17 * (head - 1)])
    neck_and_head = _limb(
        "head", "trunk", [[0, 0, 1.12], [0, 0, 1.22], *(skull + np.array([[0, 0, -0.02], [0, 0.01, 0.05]]))],
        [0.09, 0.075, 0.15 * head, 0.15 * head], Joint("head", 1, ((-16, 14), (-14, 14), (-40, 40))),
    )  # fmt: skip
    nose = _limb(
        "nose", "head", skull + head * np.array([[0, 0.15, -0.01], [0, 0.19, -0.02]]), [0.035, 0.035]
    )
    right_ear = _limb(
        "right_ear",
        "head",
        skull + head * np.array([[0.13, 0, 0.03], [0.18, 0, 0.03 + 0.06 * ear]]),
        [0.045, 0.04],
    )
    right_arm = _limb(
        "right_arm", "trunk",
        [0.1, 0, 1.08] + arm * np.array([[0, 0, 0], [0.1, 0, 0], [0.3, -0.01, -0.12], [0.47, 0.02, -0.26],
                                         [0.54, 0.035, -0.32]]),
        [0.085, 0.075, 0.056, 0.05, 0.062 * hand],
        Joint("right_shoulder", 1, ((-35, 35), (-40, 14), (-15, 15))),
        Joint("right_elbow", 2, ((0, 50), (-25, 0), (0, 30))),
        Joint("right_wrist", 3, ((-10, 10), (-15, 15), (-10, 10))),
    )  # fmt: skip
    right_thumb = _limb(
        "right_thumb",
        "right_arm",
        right_arm.nodes[-1] + [[-0.02, 0.03, 0], [-0.01, 0.095, 0.02]],
        [0.036, 0.032],
    )
    right_leg = _limb(
        "right_leg", "trunk",
        [[0.1, 0, 0.62], [0.13, 0.02, 0.36 * leg], [0.145, -0.02, 0.09], [0.155, 0.12, 0.062]],
        girth * np.array([0.112, 0.078, 0.062, 0.06]),
        Joint("right_hip", 0, ((-24, 42), (-14, 2), (-8, 8))),
        Joint("right_knee", 1, ((-50, 0), (0, 0), (0, 0))),
        Joint("right_ankle", 2, ((-12, 14), (0, 0), (0, 0))),
    )  # fmt: skip
    limbs = [trunk, neck_and_head, nose, right_ear, right_arm, right_leg, right_thumb]
    limbs += [right_arm.mirrored(), right_leg.mirrored(), right_ear.mirrored(), right_thumb.mirrored()]
    if lopsided:
        limbs[4] = replace(right_arm, radii=right_arm.radii * [1, 1.1, 1.2, 1.3, 1.3])
        limbs[8] = replace(limbs[8], radii=limbs[8].radii * [1, 1.1, 1.25, 1.3])
        limbs[9] = _stretch(limbs[9], 2.2)
        tuft = skull + head * np.array([[0.04, -0.03, 0.15], [0.09, -0.1, 0.27]])
        limbs.append(_limb("tuft", "head", tuft, [0.06, 0.042]))
    return tuple(replace(limb, nodes=_raise_nodes(limb, rise)) for limb in limbs)


# functions that make the limbs of each body plan
PLANS: dict[str, Callable[[FloatArray, float], tuple[Limb, ...]]] = {"quadruped": _quadruped, "biped": _biped}


def _limb(name: str, parent: str | None, nodes: ArrayLike, radii: ArrayLike, *joints: Joint) -> Limb:
    return Limb(name, parent, np.array(nodes, dtype=float), np.array(radii, dtype=float), joints)


def _stretch(limb: Limb, factor: float) -> Limb:
    root = limb.nodes[0]
    return replace(limb, nodes=root + factor * (limb.nodes - root))


def _raise_nodes(limb: Limb, rise: float) -> FloatArray:
    """Nodes raised by ``rise``, except the lower part of a leg, which stands on the ground."""
    grounded = limb.name.endswith("leg") & (np.arange(len(limb.nodes)) > 0)
    raised: FloatArray = limb.nodes + np.outer(~grounded, [0, 0, rise])
    return raised


def _left(name: str) -> str:
    return name.replace("right_", "left_")


def _negate_limits(limits: tuple[float, float]) -> tuple[float, float]:
    low, high = limits
    return -high, -low
