"""The skin of a creature: the zero set of a smooth union of round cones."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from isomatch._core.arrays import FloatArray, IntArray
from isomatch._core.compiled import compiled
from isomatch._core.threads import parallel_map
from isomatch_lab.procedural.anatomy import Limb

CHUNK = 2048  # number of points that a thread handles at a time; chosen
BLEND = 0.022  # width of the fillets between limbs, in body units: a quadruped is about 1.2 long; chosen
# distance from a bone, in body units, over which its share in a pose falls to 1/e; chosen
TRANSITION_WIDTH = 0.05


@dataclass(frozen=True, eq=False)
class Skin:
    """A blended implicit surface."""

    # With the signed distance dᵢ to bone i and the width b of fillets, the field is f = −b log Σᵢ exp(−dᵢ/b): smooth,
    # negative inside, and at most b log(number of bones) below the distance to the union of the bones.
    cones: FloatArray  # (m, 8) start point, end point, start radius and end radius of each bone
    owner: IntArray  # (m,) limb that each bone belongs to
    blend: float = BLEND  # width b of the fillets between limbs

    @classmethod
    def of(cls, limbs: tuple[Limb, ...]) -> Skin:
        """Make the skin around the bones of all limbs."""
        bones = [np.c_[limb.nodes[:-1], limb.nodes[1:], limb.radii[:-1], limb.radii[1:]] for limb in limbs]
        return cls(np.concatenate(bones), np.repeat(np.arange(len(limbs)), [len(b) for b in bones]))

    def field(self, points: FloatArray) -> FloatArray:
        """Value and gradient, (n, 4), of the field at (n, 3) points, in O(n m)."""
        return np.concatenate(
            parallel_map(lambda part: _field(part, self.cones, self.blend), _chunks(points))
        )

    def project(self, points: FloatArray, steps: int = 3) -> FloatArray:
        """Move (n, 3) points near the surface onto it by Newton steps along the gradient."""
        for _ in range(steps):
            value, gradient = np.split(self.field(points), [1], axis=1)
            points = points - value * gradient / np.maximum((gradient**2).sum(axis=1, keepdims=True), 0.1)
        return points

    def membership(self, points: FloatArray) -> FloatArray:
        """Share of each limb in each point, (n, n_limbs); rows are positive and add up to one."""
        n_limbs = int(self.owner.max()) + 1
        parts = parallel_map(
            lambda part: _membership(part, self.cones, self.owner, n_limbs, TRANSITION_WIDTH), _chunks(points)
        )
        return np.concatenate(parts)


def _chunks(points: FloatArray) -> list[FloatArray]:
    return np.array_split(points, len(points) // CHUNK + 1)


@compiled()
def _to_cone(x: float, y: float, z: float, cone: FloatArray) -> tuple[float, float, float, float]:
    """Signed distance to a round cone and its gradient."""
    # A round cone from a to a + l u, with a unit vector u, is the union of the balls with the centres a + t u and the
    # radii r(t) = r₀ − s t, 0 ≤ t ≤ l: the distance of p is the least |p − a − t u| − r(t). With the coordinates h and g
    # of p − a along and across u, it is at t = h − g s/√(1 − s²), and the gradient points from that ball's centre to p.
    ux, uy, uz = cone[3] - cone[0], cone[4] - cone[1], cone[5] - cone[2]
    px, py, pz = x - cone[0], y - cone[1], z - cone[2]
    length = math.sqrt(ux * ux + uy * uy + uz * uz)
    slope = (cone[6] - cone[7]) / length
    along = (px * ux + py * uy + pz * uz) / length
    across = math.sqrt(max(px * px + py * py + pz * pz - along * along, 0.0))
    t = min(max(along - across * slope / math.sqrt(1 - slope * slope), 0.0), length) / length
    px, py, pz = px - t * ux, py - t * uy, pz - t * uz
    reach = math.sqrt(px * px + py * py + pz * pz) + 1e-300
    return reach - cone[6] + slope * t * length, px / reach, py / reach, pz / reach


@compiled()
def _field(points: FloatArray, cones: FloatArray, blend: float) -> FloatArray:
    result = np.zeros((len(points), 4))
    for i in range(len(points)):
        total, gx, gy, gz = 1e-300, 0.0, 0.0, 0.0
        for j in range(len(cones)):
            d, dx, dy, dz = _to_cone(points[i, 0], points[i, 1], points[i, 2], cones[j])
            weight = math.exp(-d / blend)
            total += weight
            gx, gy, gz = gx + weight * dx, gy + weight * dy, gz + weight * dz
        result[i, 0] = -blend * math.log(total)
        result[i, 1], result[i, 2], result[i, 3] = gx / total, gy / total, gz / total
    return result


@compiled()
def _membership(
    points: FloatArray, cones: FloatArray, owner: IntArray, n_limbs: int, reach: float
) -> FloatArray:
    result = np.zeros((len(points), n_limbs))
    for i in range(len(points)):
        total = 0.0
        for j in range(len(cones)):
            d = _to_cone(points[i, 0], points[i, 1], points[i, 2], cones[j])[0]
            weight = math.exp(-d / reach)
            total += weight
            result[i, owner[j]] += weight
        for j in range(n_limbs):
            result[i, j] /= total
    return result
