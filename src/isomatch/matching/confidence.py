"""How far the image of each vertex may be from the right one, without knowing the truth."""

from __future__ import annotations

import numpy as np

from isomatch.correspondence import PrecisePoints
from isomatch.geodesics import distance_along_edges_to_nearest
from isomatch.loading.compiled import compiled
from isomatch.matching.pair import ShapePair, SmoothPair
from isomatch.runtime.threads import row_product
from isomatch.shapes import SmoothShape
from isomatch.values.arrays import FloatArray, IntArray, single

# a rival of score ratio r is right with chance 1 / (1 + r^exponent); one in ten at the bound of a tie
RIVAL_EXPONENT = 10.0

ERROR_RADIUS = (
    0.08  # over which it is spread, in √area; 0.05 to 0.14 tried: isomatch_lab/studies/vertex_confidence.py
)

# factor of the expected error; mean error of faust_r and creatures: isomatch_lab/studies/vertex_confidence.py
ERROR_SCALE = 0.32

TINY = 1e-12


def expected_errors(
    pair: SmoothPair, points: PrecisePoints, doubt: FloatArray | None = None, unit: float = 1.0
) -> FloatArray:
    """Estimate the geodesic error of a map of bodies at each vertex.

    The target's Laplace–Beltrami functions, pulled back by the map, are fitted by those of the source. What the fit
    leaves over, divided by its gradient, is a length: how far the image would have to move. The log ratio between the
    squared gradients of the fit and those of the source's own functions is the strain of the map. The estimate is
    proportional to the geometric mean of the two, smoothed by heat diffusion.

    Parameters
    ----------
    pair : SmoothPair
        The two shapes.
    points : PrecisePoints
        Image of each of the n_s source vertices.
    doubt : (n_s,) array of float, optional
        Error to be expected because another map may be right, see ``doubt_of``.
    unit : float
        What √area of the source is worth in √area of the target: 1 but for parts.

    Returns
    -------
    (n_s,) array of float
        In √area of the source.

    Notes
    -----
    O(n K²) for the fit of K functions. Of a map that is wrong as a whole, such as one that exchanges left and right, the
    estimate sees only what does not fit and, if it was found, the rival.
    """
    source = pair.source
    k = pair.n_functions
    functions, pulled_back = (
        source.functions[:, :k],
        single(points.interpolated(pair.target.functions[:, :k])),
    )
    coefficients = pair.spectra.source.fit(pulled_back[pair.refinement_vertices].astype(np.float64), k)
    fit = row_product(functions, coefficients)
    lengths = np.maximum(source.body.edge_lengths, TINY)
    fitted, own = (_gradient_energy(x, source.body.edges, lengths) for x in (fit, functions))
    left_over = np.sqrt(((pulled_back - fit) ** 2).sum(axis=1) / np.maximum(fitted, TINY))
    strain = np.log(np.maximum(fitted, TINY) / np.maximum(unit**2 * own, TINY))
    local = ERROR_SCALE * np.sqrt(left_over * np.abs(strain))
    return diffused(source, local if doubt is None else local + doubt, ERROR_RADIUS)


def doubt_of(pair: ShapePair, image: IntArray, rival: IntArray, ratio: float) -> FloatArray:
    """Expect the distance between two maps, times the chance that the other one is right.

    Parameters
    ----------
    pair : ShapePair
        The two shapes.
    image, rival : (n_refine,) arrays of int
        Image of each refinement vertex under the map and under its best rival.
    ratio : float
        Score of the rival over that of the map; 1 is a tie.

    Returns
    -------
    (n_s,) array of float
        That of the nearest refinement vertex, in √area.
    """
    chance = 1 / (1 + ratio**RIVAL_EXPONENT)
    return np.asarray(chance * pair.target.distance(image, rival)[nearest_refinement_rows(pair)])


def nearest_refinement_rows(pair: SmoothPair) -> IntArray:
    """Find the refinement vertex nearest to each vertex of the source: its number, (n_s,)."""
    vertices = pair.refinement_vertices
    number = np.zeros(pair.source.body.n_vertices, dtype=np.int64)
    number[vertices] = np.arange(len(vertices))
    rows: IntArray = number[distance_along_edges_to_nearest(pair.source.body, vertices)[1]]
    return rows


def _gradient_energy(x: FloatArray, edges: IntArray, lengths: FloatArray) -> FloatArray:
    """Squared slopes of all functions (n, K) along an edge, averaged over the edges at each vertex: (n,)."""
    squared = np.zeros(len(edges))
    _fill_squared(x, edges, squared)
    at = edges.ravel()
    total = np.bincount(at, np.repeat(squared / np.maximum(lengths, np.finfo(float).tiny) ** 2, 2), len(x))
    return np.asarray(total / np.maximum(np.bincount(at, minlength=len(x)), 1))


@compiled()
def _fill_squared(x: FloatArray, edges: IntArray, squared: FloatArray) -> None:
    """Compute the squared differences of all functions between the ends of each edge, without a copy of the functions."""
    for e in range(len(edges)):
        i, j = edges[e, 0], edges[e, 1]
        for c in range(x.shape[1]):
            step = np.float64(x[i, c] - x[j, c])
            squared[e] += step * step


def diffused(shape: SmoothShape, values: FloatArray, radius: float) -> FloatArray:
    """Spread values (n,) by heat diffusion over a radius; nowhere less than half the least of them."""
    time = radius**2 / 4  # the mean square distance in the plane is 4 t
    laplace = shape.laplace
    smooth: FloatArray = laplace.vectors @ (
        np.exp(-time * laplace.values) * laplace.coefficients(values[:, None])[:, 0]
    )
    return np.asarray(np.maximum(smooth, 0.5 * values.min()))
