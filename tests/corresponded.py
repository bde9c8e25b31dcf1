"""Shapes in one topology: collections whose statistics are known, and what `wrap` would return."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from isomatch import Mesh, Wrapped, WrapQuality
from isomatch.cohort.shape_statistics import CorrespondedShapes
from shapes import icosphere


def ellipsoids(lengths: list[float]) -> CorrespondedShapes:
    """Ellipsoids that differ along z alone."""
    sphere = icosphere(2)
    points = sphere.vertices * [3.0, 2.0, 1.0]
    vertices = [points * [1.0, 1.0, length] for length in lengths]
    return CorrespondedShapes(
        tuple(f"e{i:02d}" for i in range(len(lengths))), np.array(vertices), sphere.faces
    )


def random_shapes(
    n_shapes: int, n_factors: int = 100, seed: int = 0, spread: float = 0.1
) -> CorrespondedShapes:
    """Ellipsoids with random displacements, which depend on some factors."""
    sphere = icosphere(1)
    rng = np.random.default_rng(seed)
    fields = rng.normal(size=(n_factors, sphere.n_vertices, 3)) * spread / np.sqrt(n_factors)
    vertices = sphere.vertices * [3.0, 2.0, 1.0] + np.tensordot(
        rng.normal(size=(n_shapes, n_factors)), fields, 1
    )
    return CorrespondedShapes(tuple(f"s{i:03d}" for i in range(n_shapes)), vertices, sphere.faces)


def moved(shapes: CorrespondedShapes, seed: int = 0, scale: bool = False) -> CorrespondedShapes:
    """Each shape turned and shifted, and scaled if asked."""
    rng = np.random.default_rng(seed)
    turns = Rotation.random(len(shapes), random_state=seed).as_matrix()
    factors = rng.uniform(0.2, 5.0, len(shapes)) if scale else np.ones(len(shapes))
    turned = np.einsum("sij,snj->sni", turns, shapes.vertices) * factors[:, None, None]
    return shapes.moved(turned + rng.normal(size=(len(shapes), 1, 3)) * 10)


def only(shapes: CorrespondedShapes, rows: list[int]) -> CorrespondedShapes:
    """Some of the shapes, in another order."""
    return CorrespondedShapes(tuple(shapes.names[i] for i in rows), shapes.vertices[rows], shapes.faces)


def wrapped_as(mesh: Mesh) -> Wrapped:
    """A mesh as if it were what `wrap` returns."""
    return Wrapped(mesh, np.zeros(mesh.n_vertices, dtype=bool), WrapQuality(0.0, 1.0, 0.0, 0))
