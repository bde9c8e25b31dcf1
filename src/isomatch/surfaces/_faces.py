"""Faces that cannot be part of a surface: `check` reports them, `repair` removes them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isomatch.errors import MeshError, some
from isomatch.surfaces._coincident import first_equal
from isomatch.values.arrays import BoolArray, FloatArray, IntArray


@dataclass(frozen=True)
class UnsoundFaces:
    """One mask over the faces for each defect. Of several defects of a face only the first counts."""

    out_of_range: BoolArray
    non_finite: BoolArray
    repeated_index: BoolArray
    duplicate: BoolArray

    @property
    def any(self) -> BoolArray:
        """(m,) faces with a defect."""
        return self.out_of_range | self.non_finite | self.repeated_index | self.duplicate


def unsound_faces(vertices: FloatArray, faces: IntArray) -> UnsoundFaces:
    """Find the faces that cannot be part of a surface. The arrays may contain anything.

    A duplicate has the same three vertices as an earlier face, in any order. The earlier face is not a duplicate.
    """
    out_of_range: BoolArray = np.any((faces < 0) | (faces >= len(vertices)), axis=1)
    good: BoolArray = np.logical_not(out_of_range)
    non_finite, repeated, duplicate = (np.zeros(len(faces), dtype=bool) for _ in range(3))

    finite: BoolArray = np.all(np.isfinite(vertices), axis=1)
    non_finite[good] = ~finite[faces[good]].all(axis=1)
    good &= ~non_finite

    a, b, c = faces[good].T
    repeated[good] = (a == b) | (b == c) | (c == a)
    good &= ~repeated

    first = first_equal(np.sort(faces[good], axis=1))
    duplicate[good] = first != np.arange(len(first))
    return UnsoundFaces(out_of_range, non_finite, repeated, duplicate)


def require_vertices(faces: IntArray, n_vertices: int) -> None:
    """Raise `MeshError` if a vertex index is out of range."""
    bad = np.flatnonzero(((faces < 0) | (faces >= n_vertices)).any(axis=1))
    if len(bad):
        raise MeshError(
            f"faces {some(bad)} refer to vertices outside 0…{n_vertices - 1}, so the surface is "
            "undefined there; remove these faces with repair(mesh), or export the file again"
        )
