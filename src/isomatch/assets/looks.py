"""How a surface looks: pictures, where texture coordinates look them up, and the colours that multiply them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from isomatch.values.arrays import FloatArray, IntArray

Wrap = Literal["repeat", "clamp", "mirror"]
UNTINTED = (1.0, 1.0, 1.0, 1.0)
IN_PLACE = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))


@dataclass(frozen=True)
class Picture:
    """A picture as a file: its name, its bytes, and if these were not found, why."""

    name: str
    data: bytes = b""
    missing: str = ""


@dataclass(frozen=True)
class Layer:
    """A picture on a surface, multiplied by a tint of red to alpha, 0…1; or the tint alone.

    ``uv`` is the attribute by which it is looked up. The ``matrix`` is multiplied by columns u, v, 1 first, where v goes
    down from the top of the picture. ``wrap`` says what is beyond its borders, sideways and upwards; with ``nearest``,
    texels are not blended.
    """

    tint: tuple[float, ...] = UNTINTED
    picture: Picture | None = None
    uv: str = "uv"
    matrix: tuple[tuple[float, ...], ...] = IN_PLACE
    wrap: tuple[Wrap, Wrap] = ("repeat", "repeat")
    nearest: bool = False

    def looked_up(self, uv: FloatArray) -> FloatArray:
        """(m, 2) places in the picture of texture coordinates (m, 2 or more), both from its lower left."""
        matrix = np.array(self.matrix)
        down = np.column_stack([uv[:, 0], 1 - uv[:, 1]])
        found: FloatArray = down @ matrix[:, :2].T + matrix[:, 2]
        found[:, 1] = 1 - found[:, 1]
        return found


@dataclass(frozen=True)
class Look:
    """A material: its base colour, and the light that it emits, which is added."""

    name: str
    base: Layer
    emitted: Layer | None = None

    @property
    def main(self) -> Layer:
        """The layer that is seen where only one can be: what is emitted by a black base, or the base."""
        return self.emitted if self.emitted and max(self.base.tint[:3]) == 0 else self.base

    @property
    def pictures(self) -> tuple[Picture, ...]:
        """The pictures of its layers."""
        return tuple(layer.picture for layer in (self.base, self.emitted) if layer and layer.picture)


@dataclass(frozen=True)
class Looks:
    """The look of each triangle, (m,), −1 for none, and the looks."""

    of_triangle: IntArray
    looks: tuple[Look, ...]

    @property
    def pictures(self) -> tuple[Picture, ...]:
        """All different pictures."""
        return tuple(dict.fromkeys(picture for look in self.looks for picture in look.pictures))
