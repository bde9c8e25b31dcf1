"""Where structures of a subject touch: gaps and overlaps, in the files and in the topology of the templates."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import combinations
from typing import NamedTuple

import numpy as np

from isomatch.landmarks import nearest_on_surface
from isomatch.statistics import CorrespondedShapes, faces_within, slices_of
from isomatch.surfaces import Mesh, PrecisePoints
from isomatch.values.arrays import FloatArray, IntArray

TOUCHING = 0.05  # √area of the smaller of two structures: points nearer to the other touch it
LEAST_TOUCHING = 0.1  # share of the area of the smaller one that has to touch the other
MOST_POINTS = 500  # of a contact at which distances are measured


class ContactGap(NamedTuple):
    """How far two structures that touch are apart in a subject, in the units of the files.

    A gap is the largest distance from the outside of the other surface, an overlap the largest from its inside, 0 for
    none; the mean is that of the distances. ``before`` is in the files, ``after`` in the topology of the templates.
    ``apart`` is the distance of points of the two surfaces that lie on each other in the subject that tells where they
    touch, less the distance there.
    """

    subject: str
    structure: str
    other: str
    points: int
    mean_before: float
    gap_before: float
    overlap_before: float
    mean_after: float
    gap_after: float
    overlap_after: float
    mean_apart: float
    largest_apart: float


def contact_gaps(
    shapes: CorrespondedShapes, files: Mapping[str, Mapping[str, Mesh]], of: str | None = None
) -> Iterator[ContactGap]:
    """Measure gap and overlap of structures that touch, in each subject that has both.

    Parameters
    ----------
    shapes : CorrespondedShapes
        The subjects, see `isomatch.statistics.stacked`.
    files : mapping of str to mapping of str to Mesh
        The surfaces that they were made of, by structure and subject, in the same coordinates.
    of : str, optional
        The subject that tells where structures touch; by default that with most structures, the first of several. Points
        touch that are nearer to the other structure than 0.05 √area of the smaller one, if they are a tenth of its area.

    Notes
    -----
    At most 500 points of a contact are taken, and three times as many nearest points found for each subject.

    Examples
    --------
    >>> flat = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])
    >>> faces = np.array([[0, 1, 2], [0, 2, 3]])
    >>> below, above = (CorrespondedShapes(["s"], [flat + [0, 0, z]], faces) for z in (0, 0.01))
    >>> from isomatch.statistics import stacked
    >>> files = {"below": {"s": below.mesh(0)}, "above": {"s": above.mesh(0)}}
    >>> (found,) = contact_gaps(stacked({"below": below, "above": above}), files)
    >>> found.structure, found.other, round(found.mean_before, 6), round(found.overlap_after, 6), found.mean_apart
    ('below', 'above', 0.01, 0.01, 0.0)
    """
    parts = slices_of(shapes.structures)
    has = {name: _has(shapes, part) for name, part in parts.items()}
    counts = np.sum([*has.values()], axis=0)
    at = int(counts.argmax()) if of is None or of not in shapes.names else shapes.names.index(of)
    for one, other in combinations([name for name in parts if has[name][at]], 2):
        found = _contact(shapes, at, one, other)
        if found is None:
            continue
        one, other, rows, points, usual = found
        for i in np.flatnonzero(has[one] & has[other]).tolist():
            name = shapes.names[i]
            here = shapes.vertices[i, parts[one]][rows]
            facing = Mesh(shapes.vertices[i, parts[other]], faces_within(shapes.faces, parts[other]))
            in_file = nearest_on_surface(files[one][name], here).interpolated(files[one][name].vertices)
            before, after = _signed(files[other][name], in_file), _signed(facing, here)
            apart = np.abs(np.linalg.norm(points.interpolated(facing.vertices) - here, axis=1) - usual)
            told = [x for each in (before, after) for x in (np.abs(each).mean(), each.max(), -each.min())]
            values = [max(0.0, float(x)) for x in (*told, apart.mean(), apart.max())]
            yield ContactGap(name, one, other, len(rows), *values)


def _has(shapes: CorrespondedShapes, part: slice) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """(m,) which subjects have a structure."""
    everything = np.ones(len(shapes), dtype=bool)
    return everything if shapes.measured is None else np.asarray(shapes.measured[:, part].any(axis=1))


def _contact(
    shapes: CorrespondedShapes, at: int, one: str, other: str
) -> tuple[str, str, IntArray, PrecisePoints, FloatArray] | None:
    """Find the vertices of the smaller of two structures that touch the other, their points there, and distances."""
    parts = slices_of(shapes.structures)
    meshes = {
        n: Mesh(shapes.vertices[at, parts[n]], faces_within(shapes.faces, parts[n])) for n in (one, other)
    }
    if meshes[other].area < meshes[one].area:
        one, other = other, one
    mesh, areas = meshes[one], meshes[one].vertex_areas
    points = nearest_on_surface(meshes[other], mesh.vertices)
    distances = np.linalg.norm(points.interpolated(meshes[other].vertices) - mesh.vertices, axis=1)
    rows = np.flatnonzero(distances < TOUCHING * np.sqrt(mesh.area))
    if areas[rows].sum() < LEAST_TOUCHING * mesh.area:
        return None
    rows = rows[np.unique(np.linspace(0, len(rows) - 1, MOST_POINTS).astype(int))]
    kept = PrecisePoints(points.corners[rows], points.barycentric[rows])
    return one, other, rows, kept, distances[rows]


def _signed(mesh: Mesh, points: FloatArray) -> FloatArray:
    """Distance (q,) of points from a surface, negative on its inner side."""
    nearest = nearest_on_surface(mesh, points)
    away = points - nearest.interpolated(mesh.vertices)
    side = np.einsum("ij,ij->i", away, nearest.interpolated(mesh.vertex_normals))
    return np.asarray(np.where(side < 0, -1.0, 1.0) * np.linalg.norm(away, axis=1))
