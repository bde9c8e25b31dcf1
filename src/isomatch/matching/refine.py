"""From a map on a few hundred vertices to a precise one on all of them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from operator import itemgetter

import numpy as np
from scipy.linalg import solve
from scipy.sparse import csr_array

from isomatch._arrays import FloatArray, IntArray
from isomatch._threads import parallel_map
from isomatch.matching import spectral
from isomatch.matching.alignment import orthogonal_alignment
from isomatch.matching.choice import ORIENTED, Judged, energy_of, orientation_of
from isomatch.matching.nearest import Coordinates, nearest_in_cells
from isomatch.matching.pair import Pair
from isomatch.matching.precise import interpolation, nearest_points
from isomatch.matching.prepare import PreparedShape
from isomatch.surfaces.mesh import vertex_normals

LAPLACE_FIRST = (15, 20, 30, 40)  # functions at first, each tried
LAPLACE_CHOICE, LAPLACE_STEP = 50, 5  # functions when one is chosen; functions added in each step
DISTANCE_STEPS = 15
STAGES = (  # functions in each step, and whether positions and normals take part
    ((20, 40, 70, 100, 140), False),
    ((50, 75, 100), True),
    ((125, 150, 200), True),
)
SETTLING_STEPS, SMOOTH_STEPS = 4, 8
HOPELESS = 1.15  # misfit after a stage, against the best, from which a map is given up
DIFFERENT = (
    0.02  # mean distance between images, in √area, from which two maps are two: one limb that is turned
)
POSITION_UNIT = 0.08  # misfit of positions, in √area, that counts like one of the spectral coordinates
NORMAL_WEIGHT = 0.3


def by_distances(pair: Pair, image: IntArray) -> Coordinates:
    """Align distance descriptors on the refinement vertices, then twice on all: the paper's plain method.

    ``image`` (m_s,) holds the target row of each search vertex of the source.
    """
    source, target = pair.source.shape, pair.target.shape

    def turned(rows: IntArray, found: IntArray) -> FloatArray:
        return target.cloud.coordinates @ orthogonal_alignment(target.cloud.at(found), source.cloud.at(rows))

    points = turned(pair.source.rows, pair.target.rows[image])
    everywhere = np.arange(source.body.n_vertices)
    for rows in (*[pair.refinement.rows] * DISTANCE_STEPS, everywhere, everywhere):
        points = turned(rows, nearest_in_cells(points, source.cloud.coordinates[rows], target.cells))
    return points, source.cloud.coordinates


def by_laplace_icp(pair: Pair, start: Coordinates) -> Coordinates:
    """Post-process by iterative closest points in the Laplace–Beltrami basis, from a map given by coordinates.

    From a few functions to all, five more in each step, on ``n_refine`` source vertices; then once on all. F is fitted by
    least squares: where shapes stretch it is not orthogonal. Few functions at first heal large errors of the start, more
    keep limbs apart: four sizes are tried, and of those that keep the side of the start the one goes on that has the
    least energy, see `energy_of`, with 50 functions.

    Notes
    -----
    Shamai & Kimmel 2017, section on post-processing, where F is orthogonal and has its size from the start; growth as in
    Melzi et al., *ZoomOut*, 2019; the choice is ours.
    """
    glimpse, source, target = pair.refinement, pair.source.shape.laplace, pair.target.shape
    most = min(len(source.values), len(target.laplace.values))
    rows = nearest_in_cells(start[0], start[1][glimpse.rows], target.cells)
    middle = min(LAPLACE_CHOICE, most)

    def side(image: IntArray) -> float:
        return float(np.sign(orientation_of(glimpse, target, image, middle)))

    def grown(first: int) -> tuple[bool, float, FloatArray]:
        small = glimpse.fit(target.laplace.vectors[rows, :first], first)
        functional_map = spectral.upsampled(pair, small, _sizes(first, middle))
        image = spectral.images(pair, functional_map)
        return side(image) != kept, energy_of(pair, glimpse.rows, image), functional_map

    kept = side(rows)
    trials = parallel_map(grown, sorted({min(first, middle) for first in LAPLACE_FIRST}))
    *_, functional_map = min(trials, key=itemgetter(0, 1))
    functional_map = spectral.upsampled(pair, functional_map, _sizes(middle, most))
    everywhere = nearest_in_cells(*spectral.coordinates(pair, functional_map), target.cells)
    return spectral.coordinates(pair, source.coefficients(target.laplace.vectors[everywhere, :most], most))


def _sizes(first: int, last: int) -> tuple[int, ...]:
    """Numbers of functions on the way from one to another, with the last."""
    return (*range(first + LAPLACE_STEP, last, LAPLACE_STEP), last) if last > first else ()


def extended(pair: Pair, image: IntArray, rows: IntArray) -> IntArray:
    """Extend a map of the search vertices, through 50 functions, to other source body vertices: target body vertices."""
    source, target = pair.source.shape, pair.target.shape
    k = min(50, len(source.laplace.values), len(target.laplace.values))
    of_target, of_source = spectral.coordinates(pair, pair.functional_map(image, k))
    return nearest_in_cells(of_target, of_source[rows], target.cells)


def extended_at(pair: Pair, image: IntArray, mesh_vertices: IntArray) -> IntArray:
    """Do the same for source vertices in the user's indices; −1 for those off the body."""
    rows = pair.source.shape.body_vertex[mesh_vertices]
    return np.where(rows >= 0, extended(pair, image, np.maximum(rows, 0)), -1)


@dataclass(frozen=True, eq=False)
class JointFit:
    """A map refined on the refinement vertices.

    Parameters
    ----------
    judged : Judged
        The hypothesis it came from.
    image : (n_refine,) array of int
        Target body vertex of each refinement vertex.
    misfit : float
        Mean distance of these vertices from their images in the joint coordinates of the last step. It judges a map by
        everything at once: spectrum, signatures, positions and normals after the best smooth fit.
    """

    judged: Judged
    image: IntArray
    misfit: float

    @property
    def side(self) -> float:
        """1 if the map keeps the outside, −1 if it mirrors."""
        return 1.0 if self.judged.orientation >= 0 else -1.0

    @property
    def residual(self) -> float:
        """That of the hypothesis, before any refinement."""
        return self.judged.hypothesis.alignment.residual


def score_of(pair: Pair, fit: JointFit) -> float:
    """Give what speaks against a refined map: its misfit × the fourth root of its energy.

    The misfit sees detail, after a fit that may have smoothed over what the distances still see.
    """
    return fit.misfit * float(energy_of(pair, pair.refinement.rows, fit.image) ** 0.25)


def jointly(pair: Pair, judged: list[Judged], both_sides: bool = False) -> list[JointFit]:
    """Upsample spectrally, joint with signatures, coordinates and normals.

    In each step the target's functions *and coordinates* are fitted on the source by least squares over the source's
    refinement vertices, F and c; the next images are nearest neighbours, among all target vertices, in

    - the spectral coordinates Φ_t Fᵀ against Φ_s, divided by √k,
    - point signatures,
    - after the first stage, positions: the smooth target against the copy of it drawn on the source, Φ_s c,
    - and normals of both.

    Positions and normals are those of the target and of its own copy, so the pose of either shape does not matter.

    Parameters
    ----------
    pair : Pair
        The two shapes.
    judged : list of Judged
        Maps to refine. The sign of their orientation tells how normals are to be compared.
    both_sides : bool
        Whether to keep the best of each side to the end, however badly it fits.

    Returns
    -------
    list of JointFit
        Best score first, without those given up on the way, because another arrived at the same or fitted much better.

    Notes
    -----
    O(n_refine √n (K + q)) a step for the nearest neighbours, O(n K²) for the coordinates.
    """
    rows = pair.refinement.rows
    fits = [JointFit(start, extended(pair, start.image, rows), np.inf) for start in judged]
    for sizes, with_positions in STAGES:
        fits = parallel_map(partial(_stepped, pair, sizes=sizes, with_positions=with_positions), fits)
        # while normals take no part a twisted map may fit well: it neither sets the standard nor replaces another
        clear = [fit for fit in fits if with_positions or abs(fit.judged.orientation) > ORIENTED] or fits
        limit = HOPELESS * min(fit.misfit for fit in clear)
        order = sorted(fits, key=lambda fit: (fit not in clear, fit.misfit))
        spared = list({fit.side: fit for fit in reversed(order)}.values()) if both_sides else []
        fits = _distinct(pair, [fit for fit in order if fit.misfit <= limit or fit in spared])
    return sorted(fits, key=partial(score_of, pair))


def _distinct(pair: Pair, fits: list[JointFit]) -> list[JointFit]:
    """Keep the first of those that coincide, as what came of the hypothesis of least residual among them.

    The refinement forgets where it came from; what refines a hypothesis without it does not.
    """
    kept: list[JointFit] = []
    for fit in fits:
        same = next((i for i, other in enumerate(kept) if not differ(pair, fit, other)), None)
        if same is None:
            kept.append(fit)
        elif fit.side == kept[same].side and fit.residual < kept[same].residual:
            kept[same] = replace(kept[same], judged=fit.judged)
    return kept


def differ(pair: Pair, a: JointFit, b: JointFit, least: float = DIFFERENT) -> bool:
    """Tell whether two fits are two maps: whether their images are at least that far apart in the mean, in √area."""
    return pair.target.shape.mean_distance(a.image, b.image) > least


def _stepped(pair: Pair, fit: JointFit, sizes: tuple[int, ...], with_positions: bool) -> JointFit:
    target, glimpse = pair.target.shape, pair.refinement
    rows, misfit = fit.image, fit.misfit
    side = fit.side if with_positions else 0.0
    limit = min(glimpse.functions.shape[1], len(target.laplace.values))
    for k in sizes:
        of_target, of_source = _joint(pair, rows, min(k, limit), side, glimpse.rows)
        rows = nearest_in_cells(of_target, of_source, target.cells)
        misfit = float(np.linalg.norm(of_target[rows] - of_source, axis=1).mean())
    return JointFit(fit.judged, rows, misfit)


def joint_coordinates(pair: Pair, fit: JointFit, with_signatures: bool = True) -> Coordinates:
    """Coordinates of all target and all source body vertices under a fit, with all functions.

    Signatures recognise points; without them, positions, normals and spectrum alone make a smoother map.
    """
    source, target = pair.source.shape, pair.target.shape
    k = min(len(source.laplace.values), len(target.laplace.values))
    coordinates = _joint(pair, fit.image, k, fit.side, np.arange(source.body.n_vertices))
    if with_signatures:
        return coordinates
    signatures = np.s_[k : k + pair.signatures[0].shape[1]]
    of_target, of_source = (np.delete(x, signatures, axis=1) for x in coordinates)
    return of_target, of_source


def settled(pair: Pair, coordinates: Coordinates, steps: int) -> Coordinates:
    """Bend the source, in the space of the coordinates, smoothly onto the target.

    In each step the refinement vertices of either surface find their nearest points on the other; the displacement, a
    combination of the source's functions, that best joins them all moves the source. As the surfaces come to coincide,
    the map between them becomes smooth, and the two directions each other's inverse.

    Parameters
    ----------
    pair : Pair
        The two shapes.
    coordinates : Coordinates
        Of all target and all source body vertices.
    steps : int
        How often to repeat this.

    Returns
    -------
    Coordinates
        Those of the target, unchanged, and those of the bent source.

    Notes
    -----
    O(n_refine √n d) a step for the nearest neighbours and O(n K d) for the displacement. Both directions are used for
    reversibility as by Ezuz, Solomon & Ben-Chen, *Reversible Harmonic Maps*, 2019; how, is ours.
    """
    source, target = pair.source.shape, pair.target.shape
    of_target, of_source = coordinates
    here, there = (shape.spread[: shape.config.n_refine] for shape in (source, target))
    functions = source.laplace.vectors
    bent = of_source
    for _ in range(steps):
        forth = _onto(target, of_target, bent[here])
        back = _onto(source, bent, of_target[there])
        design = np.vstack([functions[here], back @ functions])
        wanted = np.vstack([forth @ of_target - of_source[here], of_target[there] - back @ of_source])
        gram = design.T @ design + 1e-9 * len(design) * np.eye(design.shape[1])  # definite on any mesh
        bent = of_source + functions @ solve(gram, design.T @ wanted, assume_a="pos")
    return of_target, bent


def _onto(shape: PreparedShape, of_shape: FloatArray, points: FloatArray) -> csr_array:
    """Matrix that interpolates at the shape's point nearest to each of some points."""
    image = nearest_in_cells(of_shape, points, shape.cells)
    corners, barycentric = nearest_points(of_shape, points, shape.faces, image)
    return interpolation(corners, barycentric, len(of_shape))


def _joint(pair: Pair, image: IntArray, k: int, side: float, wanted: IntArray) -> Coordinates:
    """Coordinates of all target vertices and of the wanted source vertices; positions and normals unless side is 0."""
    glimpse, target = pair.refinement, pair.target.shape
    phi_source, phi_target = glimpse.shape.laplace.vectors[:, :k], target.laplace.vectors[:, :k]
    of_target = [phi_target @ glimpse.fit(phi_target[image], k).T / np.sqrt(k), pair.signatures[0]]
    of_source = [phi_source[wanted] / np.sqrt(k), pair.signatures[1][wanted]]
    mesh, onto = glimpse.shape.triangles, target.triangles
    if side and mesh and onto:
        smooth = target.laplace.low_passed(onto.vertices, k)
        drawn = phi_source @ glimpse.fit(onto.vertices[image], k)
        of_target += [smooth / POSITION_UNIT, NORMAL_WEIGHT * vertex_normals(smooth, onto.faces)]
        normals = side * vertex_normals(drawn, mesh.faces)[wanted]
        of_source += [drawn[wanted] / POSITION_UNIT, NORMAL_WEIGHT * normals]
    return np.hstack(of_target), np.hstack(of_source)
