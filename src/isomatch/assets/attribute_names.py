"""Names of attributes: what they tell where a format does not, and how equal ones are told apart."""

from __future__ import annotations

from collections.abc import Container, Iterable
from dataclasses import replace
from itertools import count

import numpy as np

from isomatch.assets.attribute import Attribute, Kind
from isomatch.values.arrays import AnyArray

_UV_NAMES = {
    "uv", "st", "uvs", "uvmap", "texcoord",
    "texcoords", "tcoords", "texturecoordinates", "texturecoords",
}  # fmt: skip


def guessed_kind(name: str, values: AnyArray) -> Kind:
    """Say what values mean by their name, type and width, in formats that do not tell.

    Examples
    --------
    >>> guessed_kind("Normals", np.zeros((5, 3))), guessed_kind("region", np.zeros(5, int))
    ('normal', 'label')
    """
    word = name.lower().strip("_").rstrip("0123456789").rstrip("_")
    width = values.shape[1] if values.ndim == 2 else 1
    if values.ndim == 1:
        return "label" if values.dtype.kind in "iubU" else "scalar"
    if width in (3, 4) and ("rgb" in word or "color" in word or "colour" in word):
        if values.dtype == np.uint8:
            return "colour"
        if values.dtype.kind == "f" and len(values) and values.min() >= 0 and values.max() <= 1:
            return "colour"
    if word == "weights":
        return "weights"
    if width == 3 and word in ("normal", "normals", "nxnynz", "vertex_normals", "point_normals"):
        return "normal"
    if width == 2 and word.replace(" ", "").replace("_", "") in _UV_NAMES:
        return "uv"
    return "vector"


def told_apart(attributes: Iterable[Attribute], *, of_all: bool = False) -> tuple[Attribute, ...]:
    """Return the same, numbered if one before of the same domain, or of all, has the name: uv, uv_1, uv_2."""
    found: list[Attribute] = []
    for attribute in attributes:
        taken = [other.name for other in found if of_all or other.domain == attribute.domain]
        name = unused_name(attribute.name, taken)
        found.append(attribute if name == attribute.name else replace(attribute, name=name))
    return tuple(found)


def unused_name(name: str, taken: Container[str]) -> str:
    """Return a name, with the next number if it is taken."""
    return next(each for i in count() if (each := f"{name}_{i}" if i else name) not in taken)
