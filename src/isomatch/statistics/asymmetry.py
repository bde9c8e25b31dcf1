"""Asymmetry: the left–right map of a shape, how far shapes are from their mirror images, and in which direction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isomatch.errors import InputError, MapError, SettingError
from isomatch.matching import Outcome, match
from isomatch.statistics.group_test import N_PERMUTATIONS
from isomatch.statistics.procrustes import aligned_to, scalar_products, shares_of
from isomatch.statistics.shapes import CorrespondedShapes
from isomatch.surfaces import Mesh, reflected
from isomatch.values.arrays import FloatArray, IntArray
from isomatch.values.settings import generator

FEWEST = 2  # shapes: of one, what is common to all is all there is


@dataclass(frozen=True, eq=False)
class Asymmetry:
    """Asymmetric components of m shapes of n vertices: half of the difference of each shape from its mirror image.

    Parameters
    ----------
    directional : (n, 3) array of float
        Mean of the components: what is asymmetric in all shapes alike.
    amounts, fluctuating : (m,) array of float
        Root mean square of each component, and of its difference from the mean one, in the units of the shapes.
    share : float
        Share of the asymmetry that is directional: squares of the mean component, over those of all.
    p_value : float
        Probability of as large a share if left and right are exchangeable, from mirrored shapes.
    n_permutations, seed : int
        How often some shapes were mirrored, and what drew them.
    """

    directional: FloatArray
    amounts: FloatArray
    fluctuating: FloatArray
    share: float
    p_value: float
    n_permutations: int
    seed: int


def asymmetry(
    aligned: FloatArray,
    mirrored: FloatArray,
    weights: FloatArray | None = None,
    *,
    n_permutations: int = N_PERMUTATIONS,
    seed: int = 0,
) -> Asymmetry:
    """Split shapes into symmetric and asymmetric components.

    Parameters
    ----------
    aligned, mirrored : (m, n, 3) array of float
        Two or more shapes moved onto a symmetric mean, and their mirror images, moved onto it too, with the vertices of
        the other side: both halves of ``ShapeModel.fit(shapes.mirrored(left_right)).aligned``.
    weights : (n,) array of float, optional
        Weight of each vertex; by default all are equal.
    n_permutations : int
        How often some of the shapes are mirrored; no p-value is below 1 / (n_permutations + 1), nor much below 2^(1 −
        m).
    seed : int
        Draws them.

    Notes
    -----
    Object symmetry after Klingenberg, Barluenga & Meyer, *Shape analysis of symmetric structures*, Evolution 2002.
    O(m² n) time, and O(m²) for each permutation.

    Examples
    --------
    >>> shapes = np.zeros((6, 4, 3))
    >>> shapes[:, 1] = [0.2, 0, 0]
    >>> found = asymmetry(shapes, -shapes)
    >>> round(found.share, 6), found.directional[1].round(6).tolist(), found.amounts.round(3).tolist()
    (1.0, [0.2, 0.0, 0.0], [0.1, 0.1, 0.1, 0.1, 0.1, 0.1])
    """
    if aligned.shape != mirrored.shape or aligned.ndim != 3:
        raise InputError(f"{aligned.shape} and {mirrored.shape} are not shapes and as many mirror images")
    m = len(aligned)
    if m < FEWEST:
        raise InputError(f"{m} shapes are too few to tell what is asymmetric in all; give {FEWEST} or more")
    if n_permutations < 1:
        raise SettingError(f"n_permutations = {n_permutations} is not at least 1")
    share = shares_of(aligned, weights)
    components = (aligned - mirrored) / 2
    directional: FloatArray = components.mean(axis=0)

    def size(part: FloatArray) -> FloatArray:
        return np.asarray(np.sqrt(np.einsum("i,...ij,...ij->...", share, part, part)))

    # a mirrored shape has the component −aᵢ, so that |Σ ± aᵢ|² = Σᵢⱼ ±ᵢ ±ⱼ aᵢ·aⱼ, and the share |Σ aᵢ|² / (m Σ |aᵢ|²)
    products = scalar_products(components, share)
    total = float(np.trace(products))
    signs = generator(seed).choice([-1.0, 1.0], (n_permutations, m))
    drawn = np.einsum("pi,ij,pj->p", signs, products, signs, optimize=True)
    reached = 1 + int((drawn >= products.sum() * (1 - 1e-9)).sum())  # the shapes as they are
    amounts, fluctuating = size(components), size(components - directional)
    common = float(products.sum()) / (m * total) if total > 0 else 0.0
    p_value = reached / (n_permutations + 1)
    return Asymmetry(directional, amounts, fluctuating, common, p_value, n_permutations, seed)


MOST_TRIED = 5  # shapes of which none is certain; further ones hardly are


def left_right_map(mesh: Mesh, *, seed: int = 0) -> IntArray:
    """Find the vertex on the other side of each vertex, (n,), by matching a nearly symmetric shape to its mirror image.

    The seed draws the starts of the search. `MapError` if the match cannot be trusted, or leaves vertices unmatched.
    """
    result = match(mesh, reflected(mesh), seed=seed)
    if result.outcome is not Outcome.CONVERGED or not result.map.matched.all():
        raise MapError(
            f"the left–right map is not certain ({result.outcome.value}: {result.outcome.advice}); give it as a file"
        )
    return result.map.vertices


def left_right_of_shapes(shapes: CorrespondedShapes, mean: Mesh, *, seed: int = 0) -> tuple[IntArray, str]:
    """Find the left–right map of shapes in one topology: of their mean, or of one of them if that is not certain.

    Returns also the name of the shape that it is the map of; empty for the mean. Bodies in many poses have a mean with
    short limbs, which is nearer to its mirror image as it stands than any map from left to right brings it. Of the
    shapes that are measured everywhere, the five nearest to the mean are tried; `MapError` if none is certain.
    """
    try:
        return left_right_map(mean, seed=seed), ""
    except MapError as error:
        uncertain = error
    uniform, centre = np.full(shapes.n_vertices, 1 / shapes.n_vertices), mean.vertices
    apart = [np.linalg.norm(aligned_to(centre, shape, uniform) - centre) for shape in shapes.vertices]
    lacks = np.zeros((len(shapes), 1), dtype=bool) if shapes.measured is None else ~shapes.measured
    nearest = [int(i) for i in np.argsort(apart, kind="stable") if not lacks[i].any()]
    for i in nearest[:MOST_TRIED]:
        try:
            return left_right_map(shapes.mesh(i), seed=seed), shapes.names[i]
        except MapError:
            continue
    raise uncertain
