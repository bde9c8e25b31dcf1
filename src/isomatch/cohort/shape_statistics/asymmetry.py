"""Asymmetry: left–right maps, and how shapes differ from their mirror images."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import permutation_test

from isomatch._core.arrays import FloatArray
from isomatch._core.errors import InputError, MapError, SettingError
from isomatch._core.settings import generator
from isomatch.cohort.shape_statistics.linear_model import N_PERMUTATIONS, explained_squares, permutations_of
from isomatch.cohort.shape_statistics.procrustes import (
    Scale,
    aligned_to,
    generalised_procrustes,
    procrustes_distances,
    scalar_products,
    shares_of,
)
from isomatch.cohort.shape_statistics.shapes import MIRRORED, CorrespondedShapes, filled
from isomatch.correspondence import Correspondence
from isomatch.matching import MatchResult, Outcome, match
from isomatch.settings import Config
from isomatch.surfaces import Mesh, reflected

# A principal component is a rounding error if its variance, over the largest one, is below this; chosen.
MIN_VARIANCE = 1e-12
# √area: a vertex and its counterpart are wrongly on one side of the plane of symmetry if both are farther from the
# plane than this; chosen.
MIN_SIDE_DISTANCE = 0.02
# If the left–right map of the mean is not sure, the maps of at most this many shapes are tried; chosen: if none of these
# is sure, the maps of other shapes hardly are.
MAX_TRIED_SHAPES = 5
VARIATION_SOURCES = ("individuals", "sides", "individuals × sides", "error")  # rows of `Asymmetry.anova`


class SumOfSquares(NamedTuple):
    """A row of an analysis of variance."""

    source: str
    squares: float  # sum of squares, in squared units of the shapes
    share: float  # share of the total sum of squares
    degrees: int  # degrees of freedom
    mean_square: float  # sum of squares over degrees of freedom
    f: float  # mean square over the mean square of the error term; nan without an error term
    p_value: float  # probability by permutations; nan if there is no test


@dataclass(frozen=True, eq=False)
class Asymmetry:
    """Asymmetric components of m shapes: half of the difference from the mirror image."""

    symmetric: FloatArray  #: (n, 3) mean of all shapes and their mirror images
    directional: FloatArray  #: (n, 3) mean of the components: the asymmetry that all shapes share
    components: FloatArray  #: (m, n, 3) asymmetric component of each shape
    amounts: FloatArray  #: (m,) root mean square of each component, in the units of the shapes
    fluctuating: FloatArray  #: (m,) root mean square of the difference of each from the mean component
    #: individuals (symmetric variation), sides (directional asymmetry), individuals × sides
    #: (fluctuating asymmetry), and error, if individuals were measured repeatedly
    anova: tuple[SumOfSquares, ...]
    share: float  #: share of the squared asymmetry that is directional
    #: probability of as large a share if the sides of random individuals are exchanged; nan for one individual
    p_value: float
    n_permutations: int  #: number of choices of individuals that were mirrored
    seed: int  #: seed that draws these choices
    individuals: tuple[IndividualScores, ...]  #: the individuals, in the order of their names


class IndividualScores(NamedTuple):
    """Where an individual stands among others, by the means of its shapes, in their units."""

    name: str
    asymmetry: float  # root mean square of its asymmetric component
    fluctuating: float  # root mean square of its difference from the mean component
    directional: float  # part of its asymmetry in the direction of the mean component
    symmetric_scores: tuple[float, ...]  # scores along the principal components of symmetric variation
    asymmetric_scores: tuple[float, ...]  # scores along the components of fluctuating asymmetry


def asymmetry(
    aligned: FloatArray,
    mirrored: FloatArray,
    weights: FloatArray | None = None,
    *,
    individuals: Sequence[str] | None = None,
    dimensions: tuple[int, int] = (1, 1),
    n_permutations: int = N_PERMUTATIONS,
    seed: int = 0,
) -> Asymmetry:
    """Analyse the symmetric and asymmetric variation of shapes: Procrustes analysis of variance.

    Parameters
    ----------
    aligned, mirrored : (m, n, d) array of float
        Shapes and their mirror images, or right organs and reflected left ones, on their mean, see
        `align_sides`.
    weights : (n,) array of float, optional
        Weight of each vertex; by default all are equal.
    individuals : sequence of str, optional
        The individual of each shape, if some were measured repeatedly; by default each shape is
        one, and the error of measurement is part of the fluctuating asymmetry.
    dimensions : tuple of int
        Degrees of freedom of the symmetric and asymmetric components of a shape, see
        `symmetry_dimensions`; by default degrees are counted in shapes.
    n_permutations, seed : int
        Number of ways to mirror some of k individuals, all 2ᵏ if these are fewer, and what draws
        them. No p-value is below 1 / (n_permutations + 1), nor below 2^(1 − k).

    Notes
    -----
    Klingenberg, Barluenga & Meyer, *Shape analysis of symmetric structures*, Evolution 2002; for
    paired organs, Klingenberg & McIntyre 1998. With sᵢ and aᵢ half of the sum and of the difference
    of a shape and its mirror image, the squares 2 Σ ‖sᵢ − s̄‖², 2 m ‖ā‖² and 2 Σ ‖aᵢ − ā‖² add up
    to the total. Degrees of freedom are counted in shapes, as surfaces have about as many symmetric
    as asymmetric directions; they cancel in the F of sides. Fluctuating asymmetry is tested against
    the error by exchanging components aᵢ − ā between individuals. O(m² n) time.

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
    names, of, repeats = np.unique(individuals or np.arange(m), return_inverse=True, return_counts=True)
    k, parts = len(repeats), ((aligned + mirrored) / 2, (aligned - mirrored) / 2)

    def squares(part: FloatArray) -> FloatArray:
        return np.asarray(np.einsum("i,...ij,...ij->...", share, part, part))

    # For k individuals with rᵢ shapes x each, m in all, the means x̄ᵢ of individuals, and the mean x̄ of all shapes,
    # Σ |x|² = m |x̄|² + Σ rᵢ |x̄ᵢ − x̄|² + Σ |x − x̄ᵢ|². This holds for symmetric parts and for asymmetric ones.
    means = [np.array([part[of == i].mean(axis=0) for i in range(k)]) for part in parts]
    middles = [part.mean(axis=0) for part in parts]
    among = [2 * float(repeats @ squares(mean - middle)) for mean, middle in zip(means, middles)]
    within = sum(2 * float(squares(part - mean[of]).sum()) for part, mean in zip(parts, means))
    values = np.array([among[0], 2 * m * float(squares(middles[1])), among[1], within])
    even, odd = dimensions
    degrees = np.array([(k - 1) * even, odd, (k - 1) * odd, (m - k) * (even + odd)])
    with np.errstate(divide="ignore", invalid="ignore"):
        mean_squares = values / degrees
        ratios = mean_squares / np.append(mean_squares[[2, 2, 3]], np.nan)  # ratios to the error terms
    # Let aⱼ be the asymmetric component of shape j, one of m, and āᵢ the mean component of the rᵢ shapes of individual i.
    # If individual i is mirrored, āᵢ becomes −āᵢ. With sᵢ = −1 for mirrored individuals, 1 for others, and the scalar
    # products P (k, k) of the displacements rᵢ āᵢ, the directional share is (sᵀ P s) / (m Σⱼ |aⱼ|²).
    products = scalar_products(repeats[:, None, None] * means[1], share)
    total = m * float(squares(parts[1]).sum())
    share_of_mean, p_value, drawn = float(products.sum()) / total if total > 0 else 0.0, np.nan, 0
    if k > 1:
        test = permutation_test(
            (np.ones(k),),  # scipy changes the signs of these numbers at random
            lambda signs, axis: np.einsum("...i,ij,...j->...", signs, products, signs),
            permutation_type="samples",
            vectorized=True,
            n_resamples=n_permutations,
            alternative="greater",
            rng=generator(seed),
        )
        p_value, drawn = float(test.pvalue), len(test.null_distribution)
    p_values = np.array([np.nan, p_value, np.nan, np.nan])
    if k > 1 and m > k:
        # The components aⱼ are exchanged between shapes. With their mean ā over all m shapes, the squares of individuals
        # × sides are 2 Q, where Q = Σᵢ (|Σⱼ (aⱼ − ā)|² / rᵢ), and j runs over the rᵢ shapes of individual i. No exchange
        # changes the sum of 2 Q and the squares of the error, so that F grows with Q. Therefore Q is compared.
        belongs = (of[:, None] == np.arange(k)) / np.sqrt(repeats)
        orders = permutations_of(m, n_permutations, seed)
        drawn_among = explained_squares(belongs, scalar_products(parts[1] - middles[1], share), orders)
        p_values[2] = (drawn_among >= drawn_among[0] * (1 - 1e-9)).mean()
    columns = values, values / (values.sum() or 1.0), degrees, mean_squares, ratios, p_values
    values_of = zip(VARIATION_SOURCES, *(column.tolist() for column in columns))
    rows = tuple(SumOfSquares(*row) for row in values_of)
    amounts, fluctuating = np.sqrt(squares(parts[1])), np.sqrt(squares(parts[1] - middles[1]))
    shapes = middles[0], middles[1], parts[1], amounts, fluctuating
    tests = rows if m > k else rows[:3], share_of_mean, p_value, drawn, seed
    along = np.einsum("i,kij,ij->k", share, means[1], middles[1]) / (np.sqrt(squares(middles[1])) or 1.0)
    measures = np.sqrt(squares(means[1])), np.sqrt(squares(means[1] - middles[1])), along
    scores = [_principal_scores(mean - middle, share) for mean, middle in zip(means, middles)]
    columns = *(measure.tolist() for measure in measures), *(map(tuple, x.tolist()) for x in scores)
    return Asymmetry(*shapes, *tests, tuple(map(IndividualScores, map(str, names), *columns)))


def _principal_scores(parts: FloatArray, share: FloatArray) -> FloatArray:
    """Scores (k, p) of displacements (k, n, d) from their mean along their principal components."""
    values, vectors = np.linalg.eigh(scalar_products(parts - parts.mean(axis=0), share))
    kept = np.flatnonzero(values > MIN_VARIANCE * max(values[-1], np.finfo(float).tiny))[::-1]
    vectors = vectors[:, kept] * np.sign(vectors[np.abs(vectors[:, kept]).argmax(axis=0), kept])
    return np.asarray(vectors * np.sqrt(values[kept]))


def symmetry_dimensions(
    n: int, dim: int, left_right: Correspondence | None = None, *, scale: Scale = "remove"
) -> tuple[int, int]:
    """Count the dimensions in which n landmarks can vary symmetrically and asymmetrically.

    With a left–right map, they belong to one object with pairs of landmarks and others in its plane
    of symmetry; without, to organs in pairs, whose dimensions all count in both. Position and
    orientation do not count, nor does size if it is removed (Klingenberg et al. 2002).

    Examples
    --------
    >>> symmetry_dimensions(12, 3, Correspondence([5, 6, 7, 8, 9, 0, 1, 2, 3, 4, 10, 11], 12))
    (15, 14)
    """
    sized = scale == "remove"
    if left_right is None:
        of_shape = n * dim - dim * (dim + 1) // 2 - sized
        return of_shape, of_shape
    middle = int((left_right.vertices == np.arange(n)).sum())
    pairs = (n - middle) // 2
    # Of the six motions in space, three keep a plane of symmetry where it is: two shifts, and the turn about its normal.
    # In the plane, one of three motions, a shift, keeps a line of symmetry.
    moves = (3, 3) if dim == 3 else (1, 2)
    return pairs * dim + middle * (dim - 1) - moves[0] - sized, pairs * dim + middle - moves[1]


def left_right_of_pairs(n: int, pairs: Sequence[tuple[int, int]]) -> Correspondence:
    """Map n landmarks to the other side, given pairs (left, right); others are in the middle.

    `InputError` if one is in two pairs, or does not exist.

    Examples
    --------
    >>> left_right_of_pairs(4, [(0, 3)]).vertices
    array([3, 1, 2, 0])
    """
    other, taken = np.arange(n), [i for pair in pairs for i in {*pair}]
    if wrong := [i for i in taken if taken.count(i) > 1 or not 0 <= i < n]:
        problem = f"landmark {wrong[0] + 1} is in two pairs, or is none of the {n} landmarks"
        raise InputError(f"{problem}; give each once")
    for left, right in pairs:
        other[[left, right]] = right, left
    return Correspondence(other, n)


def align_sides(
    both: CorrespondedShapes,
    weights: FloatArray | None = None,
    scale: Scale = "remove",
    left_right: Sequence[Correspondence] = (),
) -> tuple[FloatArray, FloatArray]:
    """Move shapes and their mirror images, (m, n, 3) each, onto their common mean, for `asymmetry`.

    ``both`` are shapes followed by their mirror images, as `CorrespondedShapes.mirrored` and
    `paired_sides` return. A vertex that was not measured on both sides of a shape lies on the mean
    in both, and adds no asymmetry. Weights and scale are those of `generalised_procrustes`; with
    ``"remove"``, as in the source of `asymmetry`, sides differ in shape alone.

    Given the left–right maps by which shapes were mirrored, the part of a component that is equal
    on both sides is left out, as an asymmetry has opposite signs there: it comes from the corners
    of triangles, which stand out of their faces.
    """
    m = len(both) // 2
    if both.measured is not None:
        on_both = both.measured[:m] & both.measured[m:]
        both = filled(replace(both, measured=np.concatenate([on_both, on_both])), weights, scale)
    aligned = generalised_procrustes(both.vertices, weights, scale).aligned
    symmetric, part = (aligned[:m] + aligned[m:]) / 2, (aligned[:m] - aligned[m:]) / 2
    for shape, component, sides in zip(symmetric, part, left_right):
        # An asymmetric component a changes its sign if it is pulled back from the other side (P) and reflected in the
        # plane of symmetry with the normal n (F = 1 − 2 n nᵀ): the asymmetric part of any a is (a − F P a) / 2.
        normal, _ = symmetry_plane(shape, sides, weights)
        opposite = sides.pull_back(component, fill=0.0)
        component -= (component + opposite - 2 * np.outer(opposite @ normal, normal)) / 2
    return symmetric + part, symmetric - part


def paired_sides(shapes: CorrespondedShapes, pairs: Sequence[tuple[str, str]]) -> CorrespondedShapes:
    """Order organs for `align_sides`: right ones, then reflected left ones.

    Pairs are names, (left, right). Left shapes that are nearer to the right ones as they are, such
    as after ``isomatch collect --reflect``, are not reflected; the names of reflected ones end in
    ``_mirrored``.
    """
    unknown = sorted({name for pair in pairs for name in pair} - set(shapes.names))
    if unknown or not pairs:
        raise InputError(f"no pairs of left and right shapes, or none named {', '.join(unknown)}")
    left, right = ([shapes.names.index(pair[side]) for pair in pairs] for side in (0, 1))
    m, rows = len(pairs), right + left
    vertices, names = shapes.vertices[rows], [shapes.names[i] for i in rows]
    both = [procrustes_distances(vertices, scale="remove", mirrored=turn) for turn in (False, True)]
    as_they_are, turned = (distances[:m, m:].trace() for distances in both)
    if turned < as_they_are:
        vertices[m:, :, 0] *= -1.0
        names[m:] = [name + MIRRORED for name in names[m:]]
    measured = None if shapes.measured is None else shapes.measured[rows]
    return replace(shapes, names=tuple(names), vertices=vertices, measured=measured)


def symmetry_plane(
    vertices: FloatArray, left_right: Correspondence, weights: FloatArray | None = None
) -> tuple[FloatArray, float]:
    """Find the plane normal · x = offset in which a shape (n, 3) is best reflected onto itself.

    Returns the unit normal, whose largest component is positive, and the offset. The left–right map
    gives y for x: reflected points y − 2 n (n · y) are nearest to x, about the centroids, for the
    eigenvector n of the least eigenvalue of Σ wᵢ (xᵢ yᵢᵀ + yᵢ xᵢᵀ).

    Examples
    --------
    >>> points = np.array([[1.0, 0, 0], [3, 0, 0], [1, 0, 2], [3, 0, 2], [2, 5, 1]])
    >>> symmetry_plane(points, Correspondence([1, 0, 3, 2, 4], n_target=5))
    (array([1., 0., 0.]), 2.0)
    """
    matched = left_right.matched
    x, y = vertices[matched], left_right.pull_back(vertices)[matched]
    share = shares_of(x[None], None if weights is None else weights[matched])
    middles = share @ x, share @ y
    products = ((x - middles[0]) * share[:, None]).T @ (y - middles[1])
    normal = np.linalg.eigh(products + products.T)[1][:, 0]
    normal = normal * np.sign(normal[np.abs(normal).argmax()]) + 0.0
    return normal, float(normal @ (middles[0] + middles[1]) / 2)


def left_right_map(
    mesh: Mesh,
    landmarks: ArrayLike | None = None,
    *,
    config: Config | None = None,
    seed: int = 0,
    progress: Callable[[str, float], None] | None = None,
) -> MatchResult:
    """Map vertices of a nearly symmetric shape to the other side, by a match to its mirror image.

    Landmarks (q, 2) are pairs of vertices on both sides; one in the plane of symmetry is paired
    with itself. Other arguments are those of `match`. Trust the map if it converged or is partial.
    Vertices that were matched to their own side are left unmatched, with a note; if their area is
    more than `OutcomeSettings.large_component`, the outcome is ``LOW_CONFIDENCE``. It is never
    ``MIRROR_IMAGE``.
    """
    pairs = None if landmarks is None else np.asarray(landmarks)
    if pairs is not None:  # pairs in both orders, without repetitions
        pairs = np.unique(np.concatenate([pairs, pairs[:, ::-1]]), axis=0)
    config = config or Config()
    config = replace(config, outcome=replace(config.outcome, mirror_image=0.0))
    result = match(mesh, reflected(mesh), pairs, config=config, seed=seed, progress=progress)
    # A vertex and its counterpart are on two sides of the plane, unless a component of the mesh is matched to itself.
    normal, offset = symmetry_plane(mesh.vertices, result.map, mesh.vertex_areas)
    side = mesh.vertices @ normal - offset
    opposite = result.map.pull_back(side)
    distance = np.minimum(abs(side), abs(opposite))
    wrong = (side * opposite > 0) & (distance > MIN_SIDE_DISTANCE * np.sqrt(mesh.area))
    if not wrong.any():
        return result
    share = float(mesh.vertex_areas[wrong].sum() / mesh.area)
    which = f"{wrong.sum()} vertices ({share:.1%} of the area)"
    note = f"{which} had counterparts on their own side, and are left unmatched"
    least = Outcome.LOW_CONFIDENCE if share > config.outcome.large_component else result.outcome
    return replace(
        result,
        map=replace(result.map, vertices=np.where(wrong, -1, result.map.vertices)),
        expected_error=np.where(wrong, np.nan, result.expected_error),
        outcome=min(least, result.outcome, key=lambda outcome: outcome.sureness),
        notes=(*result.notes, note),
    )


def left_right_of_shapes(
    shapes: CorrespondedShapes, mean: Mesh, *, seed: int = 0
) -> tuple[Correspondence, str]:
    """Find one left–right map for shapes in one topology: of the mean or, if uncertain, a shape.

    Returns also the name of that shape, empty for the mean. Bodies in many poses have a mean with
    short limbs, which is nearer to its mirror image as it stands than any left–right map brings it.
    The five shapes nearest to the mean that are measured everywhere are tried; `MapError` if none
    is certain.
    """
    uniform, centre = np.full(shapes.n_vertices, 1 / shapes.n_vertices), mean.vertices
    distances = [np.linalg.norm(aligned_to(centre, shape, uniform) - centre) for shape in shapes.vertices]
    nearest = [int(i) for i in np.argsort(distances, kind="stable") if shapes.seen[i].all()]
    outcomes = list[Outcome]()
    for i in (None, *nearest[:MAX_TRIED_SHAPES]):
        result = left_right_map(mean if i is None else shapes.mesh(i), seed=seed)
        if result.outcome.sureness >= Outcome.PARTIAL.sureness:
            return result.map, "" if i is None else shapes.names[i]
        outcomes.append(result.outcome)
    raise MapError(f"the left–right map is not certain; give it as a file. {outcomes[0].advice}")
