"""Colours of the vertices of OBJ files, which no standard describes, in the ways that programs write them."""

from __future__ import annotations

import re

import numpy as np

from isomatch.assets.attribute import Attribute
from isomatch.assets.formats._text import NumberRows, bytes_or_floats
from isomatch.values.arrays import AnyArray

_BLOCK = re.compile(rb"(?m)^#MRGB[ \t]+((?:[0-9A-Fa-f]{8})+)[ \t]*$")
"""Colours of ZBrush in comments: for each vertex a mask, red, green and blue, two hexadecimal digits each."""


def read_colours(vertices: NumberRows, data: bytes) -> tuple[list[Attribute], tuple[str, ...]]:
    """Read what follows the positions, ``r g b`` or ``r g b a``, or the blocks in comments; and notes of what is missing.

    ``vertices`` are the numbers after each ``v``, and ``data`` is the whole file.
    """
    counts, n = vertices.counts, len(vertices.counts)
    coloured = counts >= 6
    notes = []
    if (counts == 4).any():
        notes.append(
            f"{int((counts == 4).sum())} vertices have a weight after the position, which is left out"
        )
    if coloured.any():
        values = vertices.columns(3, 4 if (counts > 6).any() else 3)
        values[~coloured] = np.nan
        colours = bytes_or_floats(values)
    else:
        octets = _in_comments(data)
        if not len(octets):
            return [], tuple(notes)
        coloured = np.arange(n) < len(octets)
        if len(octets) > n:
            notes.append(f"{len(octets) - n} colours in comments are left out: there are only {n} vertices")
        if (octets[:, 0] != octets[0, 0]).any():
            notes.append("the mask in the comments with colours is left out")
        colours = octets[:n, 1:]
        if len(octets) < n:
            colours = np.vstack([colours, np.full((n - len(octets), 3), np.nan)])
    attribute = Attribute("color", "point", "colour", colours)
    if note := attribute.note_of_missing:
        notes.append(note)
    return [attribute], tuple(notes)


def _in_comments(data: bytes) -> AnyArray:
    """(k, 4) mask, red, green and blue."""
    if b"#MRGB" not in data:
        return np.zeros((0, 4), np.uint8)
    lines = data.replace(b"\r", b"\n")
    digits = b"".join(block[1] for block in _BLOCK.finditer(lines)).decode()
    return np.frombuffer(bytes.fromhex(digits), np.uint8).reshape(-1, 4)
