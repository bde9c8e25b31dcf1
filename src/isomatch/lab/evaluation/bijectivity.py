"""How nearly a map is bijective: the share of the target that it reaches, and its cycle error with a map back."""

from __future__ import annotations

import numpy as np

from isomatch.correspondence import Correspondence
from isomatch.errors import MapError
from isomatch.geodesics import DistanceEngine
from isomatch.lab.evaluation.princeton import geodesic_errors
from isomatch.matching import COVERAGE_RADIUS, covered_share
from isomatch.mending import without_seams
from isomatch.surfaces import Mesh
from isomatch.values.arrays import FloatArray


def coverage(target: Mesh, correspondence: Correspondence, reach: float = COVERAGE_RADIUS) -> float:
    """Share of the target's area that is near an image, as in ``Quality.coverage``.

    Parameters
    ----------
    target : Mesh
        Target surface.
    correspondence : Correspondence
        Map source → target; its vertices are judged.
    reach : float
        A target vertex is covered, with its area, when an image lies within this distance along edges, in
        √(target area). The default is that of ``Quality.coverage``. With 0, only images themselves are covered: even a
        good map between independent triangulations then stays well below 1, and a coarse source covers little of a fine
        target.

    Returns
    -------
    float
        From 0 to 1.

    Raises
    ------
    MapError
        If the map was made for a target with another number of vertices.

    Examples
    --------
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> half = Correspondence([0, 0, 1, 1], 4)
    >>> round(coverage(square, half), 3), round(coverage(square, half, reach=1.0), 3)
    (0.5, 1.0)
    """
    if correspondence.n_target != target.n_vertices:
        raise MapError(
            f"{correspondence!r} does not fit {target!r}; give the target that the map was made for"
        )
    images, (welded, seams) = correspondence.vertices[correspondence.matched], without_seams(target)
    return covered_share(welded, seams.new_index[images] if seams else images, reach)


def cycle_errors(
    source: Mesh,
    there: Correspondence,
    back: Correspondence,
    n_points: int | None = None,
    seed: int = 0,
    engine: DistanceEngine | None = None,
) -> FloatArray:
    """Geodesic distance on the source between a vertex and its image under both maps, divided by √(source area).

    Parameters
    ----------
    source : Mesh
        Source surface.
    there, back : Correspondence
        Maps source → target and target → source.
    n_points : int, optional
        Number of vertices to judge, drawn without replacement; all by default.
    seed : int
        Seed of the draw.
    engine : DistanceEngine, optional
        Distances on the source; by default by fast marching.

    Returns
    -------
    (n_source,) or (n_points,) array of float
        0 where the maps are inverse to each other; ``inf`` where either has no image.

    Raises
    ------
    MapError
        If the maps cannot be composed, or do not lead back to the source.

    Notes
    -----
    One distance column on the source for each vertex judged.

    Examples
    --------
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> cycle_errors(square, Correspondence([1, 2, 3, 0], 4), Correspondence([3, 0, 1, 1], 4))
    array([0., 0., 1., 0.])
    """
    cycle = there.then(back)
    if cycle.shape != (source.n_vertices, source.n_vertices):
        raise MapError(
            f"{there!r} and {back!r} do not lead from {source!r} to itself; give maps source → target and back"
        )
    vertices = np.arange(source.n_vertices)
    return geodesic_errors(source, cycle, np.column_stack([vertices, vertices]), n_points, seed, engine)
