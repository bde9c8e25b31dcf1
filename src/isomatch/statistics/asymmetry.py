"""Asymmetry: the left–right map of a shape, how far shapes are from their mirror images, and in which direction."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import permutation_test

from isomatch.correspondence import Correspondence
from isomatch.errors import InputError, SettingError
from isomatch.matching import MatchResult, Outcome, match
from isomatch.settings import Config
from isomatch.statistics.group_test import N_PERMUTATIONS
from isomatch.statistics.procrustes import (
    Scale,
    aligned_to,
    generalised_procrustes,
    procrustes_distances,
    scalar_products,
    shares_of,
)
from isomatch.statistics.shapes import CorrespondedShapes, filled
from isomatch.surfaces import Mesh, reflected
from isomatch.values.arrays import FloatArray
from isomatch.values.settings import generator


class SumOfSquares(NamedTuple):
    """A row of an analysis of variance: one source of the squared distances of shapes and mirror images from their mean.

    ``squares`` and ``share`` of all; ``degrees`` of freedom, counted in shapes; ``mean_square`` = squares / degrees, and
    ``f`` over the mean square of the row that it is compared with, nan if there is none.
    """

    source: str
    squares: float
    share: float
    degrees: int
    mean_square: float
    f: float


@dataclass(frozen=True, eq=False)
class Asymmetry:
    """Asymmetric components of m shapes of n vertices: half of the difference of each shape from its mirror image.

    Parameters
    ----------
    symmetric : (n, 3) array of float
        Mean of all shapes and their mirror images.
    directional : (n, 3) array of float
        Mean of the components: what is asymmetric in all shapes alike.
    components : (m, n, 3) array of float
    amounts, fluctuating : (m,) array of float
        Root mean square of each component, and of its difference from the mean one, in the units of the shapes.
    anova : tuple of SumOfSquares
        Individuals (symmetric variation), sides (directional asymmetry), individuals × sides (fluctuating asymmetry),
        and error, if individuals were measured repeatedly.
    share : float
        Share of the asymmetry that is directional: squares of the mean component, over those of all.
    p_value : float
        Probability of as large a share if left and right are exchangeable, from mirrored individuals; nan of one.
    null : (n_permutations,) array of float
        The shares of mirrored individuals.
    is_exact : bool
        Whether these are all ways to mirror some of the individuals, and not drawn ones.
    seed : int
        What drew them.
    """

    symmetric: FloatArray
    directional: FloatArray
    components: FloatArray
    amounts: FloatArray
    fluctuating: FloatArray
    anova: tuple[SumOfSquares, ...]
    share: float
    p_value: float
    null: FloatArray
    is_exact: bool
    seed: int

    @property
    def n_permutations(self) -> int:
        """How often some of the individuals were mirrored."""
        return len(self.null)


def asymmetry(
    aligned: FloatArray,
    mirrored: FloatArray,
    weights: FloatArray | None = None,
    *,
    individuals: Sequence[str] | None = None,
    n_permutations: int = N_PERMUTATIONS,
    seed: int = 0,
) -> Asymmetry:
    """Split shapes into symmetric and asymmetric components: Procrustes analysis of variance of individuals and sides.

    Parameters
    ----------
    aligned, mirrored : (m, n, 3) array of float
        Shapes moved onto a symmetric mean, and their mirror images, moved onto it too, with the vertices of the other
        side, see `align_sides`. Of paired organs: those of the right, and the reflected ones of the left.
    weights : (n,) array of float, optional
        Weight of each vertex; by default all are equal.
    individuals : sequence of str, optional
        The individual of each shape, where some were measured repeatedly; by default each is one of its own, and the
        error of measurement is part of the fluctuating asymmetry.
    n_permutations : int
        How often some of the individuals are mirrored: all ways, if there are no more than that; otherwise drawn ones.
        No p-value is below 1 / (n_permutations + 1), nor below 2^(1 − number of individuals).
    seed : int
        Draws them.

    Raises
    ------
    InputError
        If the arrays do not fit each other.
    SettingError
        If there are no permutations, or weights that cannot be.

    Notes
    -----
    Klingenberg, Barluenga & Meyer, *Shape analysis of symmetric structures*, Evolution 2002; of paired organs
    Klingenberg & McIntyre 1998. With sᵢ and aᵢ half of the sum and of the difference of a shape and its mirror image,
    the squares 2 Σ |sᵢ − s̄|², 2 m |ā|² and 2 Σ |aᵢ − ā|² add up to all. Degrees of freedom are counted in shapes, as
    surfaces have about as many symmetric as asymmetric directions; in the F of sides they cancel. O(m² n) time, and O(m²)
    for each permutation.

    Examples
    --------
    >>> shapes = np.zeros((6, 4, 3))
    >>> shapes[:, 1] = [0.2, 0, 0]
    >>> found = asymmetry(shapes, -shapes)
    >>> round(found.share, 6), found.directional[1].round(6).tolist(), found.amounts.round(3).tolist()
    (1.0, [0.2, 0.0, 0.0], [0.1, 0.1, 0.1, 0.1, 0.1, 0.1])
    >>> found.p_value, found.n_permutations  # 2 of 2⁶ ways mirror all or none
    (0.03125, 64)
    """
    if aligned.shape != mirrored.shape or aligned.ndim != 3 or not len(aligned):
        raise InputError(f"{aligned.shape} and {mirrored.shape} are not shapes and as many mirror images")
    m = len(aligned)
    if individuals is not None and len(individuals) != m:
        raise InputError(f"{len(individuals)} individuals for {m} shapes; give one for each")
    if n_permutations < 1:
        raise SettingError(f"n_permutations = {n_permutations} is not at least 1")
    share = shares_of(aligned, weights)
    _, of, repeats = np.unique(individuals or np.arange(m), return_inverse=True, return_counts=True)
    parts = (aligned + mirrored) / 2, (aligned - mirrored) / 2

    def squares(part: FloatArray) -> FloatArray:
        return np.asarray(np.einsum("i,...ij,...ij->...", share, part, part))

    # of a group of rᵢ shapes with mean x̄ᵢ, in all N: Σ |x|² = N |x̄|² + Σ rᵢ |x̄ᵢ − x̄|² + Σ |x − x̄ᵢ|², for s and for a
    means = [np.array([part[of == i].mean(axis=0) for i in range(len(repeats))]) for part in parts]
    middles = [part.mean(axis=0) for part in parts]
    among = [2 * float(repeats @ squares(mean - middle)) for mean, middle in zip(means, middles)]
    error = sum(2 * float(squares(part - mean[of]).sum()) for part, mean in zip(parts, means))
    k = len(repeats)
    found = [
        ("individuals", among[0], k - 1),
        ("sides", 2 * m * float(squares(middles[1])), 1),
        ("individuals × sides", among[1], k - 1),
        *([("error", error, 2 * (m - k))] if m > k else []),
    ]
    every = sum(each[1] for each in found)
    mean_squares = [_ratio(each[1], each[2]) for each in found]
    below = [2, 2, 3 if m > k else None, None]  # the row that each is compared with
    f = [np.nan if j is None else _ratio(mean_squares[i], mean_squares[j]) for i, j in enumerate(below)]
    rows = tuple(
        SumOfSquares(name, value, value / every if every > 0 else 0.0, degrees, mean_squares[i], f[i])
        for i, (name, value, degrees) in enumerate(found)
    )
    # a mirrored individual has the component −āᵢ, so that the share is |Σ ± rᵢ āᵢ|² / (N Σ |a|²) = ±ᵀ P ± / (N Σ |a|²)
    products = scalar_products(repeats[:, None, None] * means[1], share)
    total = m * float(squares(parts[1]).sum())
    amounts, fluctuating = np.sqrt(squares(parts[1])), np.sqrt(squares(parts[1] - middles[1]))
    common = float(products.sum()) / total if total > 0 else 0.0
    p_value, null = np.nan, np.empty(0)
    if k > 1:
        test = permutation_test(
            (np.ones(k),),  # of one sample, signs are exchanged
            lambda signs, axis: np.einsum("...i,ij,...j->...", signs, products, signs) / (total or 1.0),
            permutation_type="samples",
            vectorized=True,
            n_resamples=n_permutations,
            alternative="greater",
            rng=generator(seed),
        )
        p_value, null = float(test.pvalue), np.asarray(test.null_distribution)
    is_exact = 2**k <= n_permutations
    return Asymmetry(
        middles[0], middles[1], parts[1], amounts, fluctuating, rows, common, p_value, null, is_exact, seed
    )


def _ratio(above: float, below: float) -> float:
    return above / below if below > 0 else np.nan


def align_sides(
    both: CorrespondedShapes,
    weights: FloatArray | None = None,
    scale: Scale = "remove",
    left_right: Correspondence | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Move shapes and their mirror images onto their common mean, for `asymmetry`.

    Parameters
    ----------
    both : CorrespondedShapes
        Shapes followed by as many mirror images, as `CorrespondedShapes.mirrored` and `paired_sides` return.
    weights, scale
        As for `generalised_procrustes`. With ``"remove"``, as in the source of `asymmetry`, sides differ in shape alone.
    left_right : Correspondence, optional
        The map by which shapes were mirrored. What asymmetric components have alike on both sides, where an asymmetry has
        opposite signs, is then left out: it comes from the corners of triangles, which stand out of their faces.

    Returns
    -------
    aligned, mirrored : (m, n, 3) array of float
        A vertex that was not measured on both sides of a shape lies on the mean in both: it adds no asymmetry.

    Examples
    --------
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> other = Correspondence([1, 0, 3, 2], n_target=4)
    >>> one, image = align_sides(CorrespondedShapes.of_meshes({"a": square}).mirrored(other), left_right=other)
    >>> bool(np.allclose(one, image))
    True
    """
    m = len(both) // 2
    if both.measured is not None:
        on_both = both.measured[:m] & both.measured[m:]
        both = filled(replace(both, measured=np.concatenate([on_both, on_both])), weights, scale)
    aligned = generalised_procrustes(both.vertices, weights, scale).aligned
    one, other = aligned[:m], aligned[m:]
    if left_right is None:
        return one, other
    # reflected and seen from the other side, a component a is −a: a ← (a − F P a) / 2, F = 1 − 2 n nᵀ
    normal = symmetry_plane(aligned.mean(axis=0), left_right, weights).normal
    symmetric, part = (one + other) / 2, (one - other) / 2
    for each in part:
        there = left_right.pull_back(each, fill=0.0)
        each -= (each + there - 2 * np.outer(there @ normal, normal)) / 2
    return symmetric + part, symmetric - part


def paired_sides(
    shapes: CorrespondedShapes, pairs: Sequence[tuple[str, str]]
) -> tuple[CorrespondedShapes, bool]:
    """Take left and right organs as shapes and mirror images, for `align_sides`: the right ones, then the left ones.

    Parameters
    ----------
    shapes : CorrespondedShapes
    pairs : sequence of (str, str)
        Names of a left shape and of the right one of the same individual.

    Returns
    -------
    CorrespondedShapes
    bool
        Whether the left ones were reflected; not if they are nearer to the right ones as they are, as after ``isomatch
        collect --reflect``.

    Raises
    ------
    InputError
        If there is no pair, or no shape of a name.
    """
    unknown = sorted({name for pair in pairs for name in pair} - set(shapes.names))
    if unknown or not pairs:
        raise InputError(
            f"no pairs, or no shapes named {', '.join(unknown)}; give pairs (left, right) of names"
        )
    row = {name: i for i, name in enumerate(shapes.names)}
    left, right = ([row[pair[side]] for pair in pairs] for side in (0, 1))
    ends = [shapes.vertices[[i, j]] for i, j in zip(left, right)]
    as_they_are, turned = (
        sum(procrustes_distances(end, scale="remove", mirrored=turn)[0, 1] for end in ends)
        for turn in (False, True)
    )
    of_left = shapes.vertices[left] * ([-1.0, 1.0, 1.0] if turned < as_they_are else 1.0)
    measured = None if shapes.measured is None else shapes.measured[right + left]
    vertices = np.concatenate([shapes.vertices[right], of_left])
    names = tuple(shapes.names[i] for i in right + left)
    return replace(shapes, names=names, vertices=vertices, measured=measured), bool(turned < as_they_are)


class SymmetryPlane(NamedTuple):
    """The plane normal · x = offset; ``normal`` (3,) is a unit vector whose largest component is positive."""

    normal: FloatArray
    offset: float


def symmetry_plane(
    vertices: FloatArray, left_right: Correspondence, weights: FloatArray | None = None
) -> SymmetryPlane:
    """Find the plane by which a shape (n, 3) is reflected so that it is nearest to itself, by its left–right map.

    Notes
    -----
    The reflection y → y − 2 n (n · y) of points yᵢ onto xᵢ about the centroids has the least squares for the eigenvector
    n of the least eigenvalue of Σ wᵢ (xᵢ yᵢᵀ + yᵢ xᵢᵀ).

    Examples
    --------
    >>> points = np.array([[1.0, 0, 0], [3, 0, 0], [1, 0, 2], [3, 0, 2], [2, 5, 1]])
    >>> symmetry_plane(points, Correspondence([1, 0, 3, 2, 4], n_target=5))
    SymmetryPlane(normal=array([1., 0., 0.]), offset=2.0)
    """
    held = left_right.matched
    x, y = vertices[held], left_right.pull_back(vertices)[held]
    share = shares_of(x[None], None if weights is None else weights[held])
    middles = share @ x, share @ y
    products = ((x - middles[0]) * share[:, None]).T @ (y - middles[1])
    normal = np.linalg.eigh(products + products.T)[1][:, 0]
    normal = normal * np.sign(normal[np.abs(normal).argmax()]) + 0.0
    return SymmetryPlane(normal, float(normal @ (middles[0] + middles[1]) / 2))


SURE = (Outcome.CONVERGED, Outcome.PARTIAL)
SAME_SIDE = (
    0.02  # √area: so far from the plane of symmetry, a point and its counterpart lie on either side of it
)
MOST_TRIED = 5  # shapes of which none is certain; further ones hardly are


def left_right_map(
    mesh: Mesh,
    landmarks: ArrayLike | None = None,
    *,
    config: Config | None = None,
    seed: int = 0,
    progress: Callable[[str, float], None] | None = None,
) -> MatchResult:
    """Find the point on the other side of each vertex, by matching a nearly symmetric shape to its mirror image.

    Parameters
    ----------
    mesh : Mesh
    landmarks : (q, 2) array_like of int, optional
        Pairs of vertices: one, and its counterpart on the other side; one in the plane of symmetry is its own.
    config, seed, progress
        As for `match`.

    Returns
    -------
    MatchResult
        Never with the outcome ``MIRROR_IMAGE``, as every shape is the mirror image of its mirror image. Trust the map if
        it converged; if it is partial, what has no counterpart is unmatched. So is what was matched to its own side, with
        a note; if it is more than `OutcomeSettings.large_component`, the outcome is ``LOW_CONFIDENCE``.
    """
    pairs = None if landmarks is None else np.asarray(landmarks)
    if pairs is not None:  # both ways, each once
        pairs = np.unique(np.concatenate([pairs, pairs[:, ::-1]]), axis=0)
    config = config or Config()
    config = replace(config, outcome=replace(config.outcome, mirror_image=0.0))
    result = match(mesh, reflected(mesh), pairs, config=config, seed=seed, progress=progress)
    # what lies left has its counterpart right; a small component may be matched to its own image, on its own side
    plane = symmetry_plane(mesh.vertices, result.map, mesh.vertex_areas)
    side = mesh.vertices @ plane.normal - plane.offset
    there = result.map.pull_back(side)
    wrong = (side * there > 0) & (np.minimum(abs(side), abs(there)) > SAME_SIDE * np.sqrt(mesh.area))
    share = float(mesh.vertex_areas[wrong].sum() / mesh.area)
    if not wrong.any():
        return result
    kept = [
        np.where(wrong[:, None], hole, of)
        for of, hole in ((result.map.faces, -1), (result.map.barycentric, 0))
    ]
    found = replace(
        result.map, vertices=np.where(wrong, -1, result.map.vertices), faces=kept[0], barycentric=kept[1]
    )
    told = f"{wrong.sum()} vertices ({share:.1%} of the area) had counterparts on their own side, and are left unmatched"
    outcome = Outcome.LOW_CONFIDENCE if share > config.outcome.large_component else result.outcome
    return replace(
        result,
        map=found,
        expected_error=np.where(wrong, np.nan, result.expected_error),
        outcome=min(outcome, result.outcome, key=lambda each: each.sureness),
        notes=(*result.notes, told),
    )


def left_right_of_shapes(
    shapes: CorrespondedShapes,
    mean: Mesh,
    landmarks: ArrayLike | None = None,
    *,
    config: Config | None = None,
    seed: int = 0,
    progress: Callable[[str, float], None] | None = None,
) -> tuple[MatchResult, str]:
    """Find the left–right map of shapes in one topology: of their mean, or of one of them if that is not certain.

    Returns also the name of the shape that it is the map of; empty for the mean. Bodies in many poses have a mean with
    short limbs, which is nearer to its mirror image as it stands than any map from left to right brings it. Of the
    shapes that are measured everywhere, the five nearest to the mean are tried; if none is certain, the map of the mean
    is returned, whose outcome says so. The other arguments are those of `left_right_map`.
    """
    of_mean = left_right_map(mean, landmarks, config=config, seed=seed, progress=progress)
    if of_mean.outcome in SURE:
        return of_mean, ""
    uniform, centre = np.full(shapes.n_vertices, 1 / shapes.n_vertices), mean.vertices
    apart = [np.linalg.norm(aligned_to(centre, shape, uniform) - centre) for shape in shapes.vertices]
    lacks = np.zeros((len(shapes), 1), dtype=bool) if shapes.measured is None else ~shapes.measured
    nearest = [int(i) for i in np.argsort(apart, kind="stable") if not lacks[i].any()]
    for i in nearest[:MOST_TRIED]:
        result = left_right_map(shapes.mesh(i), landmarks, config=config, seed=seed, progress=progress)
        if result.outcome in SURE:
            return result, shapes.names[i]
    return of_mean, ""
