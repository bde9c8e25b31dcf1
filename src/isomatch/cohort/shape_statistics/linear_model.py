"""Linear models of shape: formulas, tests of terms and of pairs of groups, classification."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import minimize_scalar
from scipy.special import boxcox

from isomatch._core.arrays import FloatArray, IntArray, numbers_of
from isomatch._core.errors import InputError, SettingError
from isomatch._core.first_use import package
from isomatch._core.settings import generator
from isomatch._core.tables import NO_TEXT
from isomatch._core.texts import natural_order
from isomatch._core.threads import serial_blas
from isomatch.cohort.shape_statistics.procrustes import scalar_products, shares_of

N_PERMUTATIONS = 4999  # random permutations of a test; chosen: p-values then have steps of 1 / 5000
MAX_NUMBERS = 2**21  # largest number of floats (16 MiB) in the permuted bases of one block; chosen
MIN_SHAPES = 3  # least number of shapes for a regression, as a line fits two shapes exactly
BOX_COX_RANGE = (-5.0, 5.0)  # least and largest power of a Box–Cox transformation; chosen
# A variable is constant if its range, over its largest absolute value, is at most this. It depends on other variables
# if the norm of its residual after a regression on them, over its own norm, is at most this; chosen.
MIN_SINGULAR = 1e-9
# the modes that classify shapes are the first that hold this share of the variance; chosen
CLASSIFIED_VARIANCE = 0.95

Terms = tuple[tuple[str, ...], ...]  # the variables of each term


class TermTest(NamedTuple):
    """A row of the analysis of variance: a term, "residuals" or "total"; nan without a value."""

    term: str
    degrees: int  # degrees of freedom
    squares: float  # sum over the shapes of the mean square over vertices, in squared units of the shapes
    mean_square: float  # squares over degrees of freedom
    r_squared: float  # share of the total squares
    f: float  # mean square over the one of the residuals
    z: float  # standard deviate of F among permutations, after a Box–Cox transformation
    p_value: float  # share of the permutations with as large an F


class PairTest(NamedTuple):
    """The distance of two groups: of their means, or of their slopes along a variable."""

    of: str  # name of the factor, or of the term with a slope for each group
    first: str
    second: str
    distance: float  # distance of means, or of slopes for one unit of the variable
    angle: float  # angle between slopes, in degrees; nan for means
    z: float  # standard deviate of the distance among permutations, as in `TermTest`
    p_value: float  # share of the permutations with as large a distance
    adjusted_p: float  # p-value adjusted for the number of pairs (Holm 1979)


@dataclass(frozen=True, eq=False)
class ShapeDesign:
    """The variables of a formula, for m shapes."""

    formula: str
    terms: Terms  #: variables of each term, terms of one variable first
    #: (m, q) numbers of each variable; a factor has a column of 0 and 1 for each group but the first
    codes: Mapping[str, FloatArray]
    levels: Mapping[str, tuple[str, ...]]  #: names of the groups of each factor

    @classmethod
    def of(cls, formula: str, table: Mapping[str, Sequence[object]]) -> ShapeDesign:
        """Read a formula such as ``size * group + age`` of columns (m,) of a table.

        ``+`` joins terms, ``a:b`` is an interaction, ``a * b`` is ``a + b + a:b``, ``log(a)`` the
        natural logarithm, ``factor(a)`` takes numbers as names of groups. Columns with words are
        factors. `InputError` if a column does not exist, lacks a value, or does not vary.

        Examples
        --------
        >>> design = ShapeDesign.of("age * sex", {"age": [1, 2, 3], "sex": ["f", "m", "f"]})
        >>> design.names, design.codes["sex"].ravel().tolist()
        (['age', 'sex', 'age:sex'], [0.0, 1.0, 0.0])
        """
        found: dict[tuple[str, ...], None] = {}
        factors = re.findall(r"factor\s*\(\s*(.+?)\s*\)", formula)
        plain = re.sub(r"factor\s*\(\s*(.+?)\s*\)", r"\1", formula.rpartition("~")[2])
        for part in plain.split("+"):
            crossed = [tuple(name.strip() for name in factor.split(":")) for factor in part.split("*")]
            for n in range(1, len(crossed) + 1):
                for chosen in combinations(crossed, n):
                    term = tuple(dict.fromkeys(name for names in chosen for name in names))
                    if not any({*term} == {*other} for other in found):
                        found[term] = None
        terms = sorted(found, key=len)
        codes, levels = dict[str, FloatArray](), dict[str, tuple[str, ...]]()
        for name in dict.fromkeys(name for term in terms for name in term):
            codes[name], levels[name] = _code_variable(name, formula, table, name in factors)
        return cls(formula, tuple(terms), codes, {name: values for name, values in levels.items() if values})

    @property
    def names(self) -> list[str]:
        """Names of the terms."""
        return [":".join(term) for term in self.terms]

    def columns(self, term: tuple[str, ...], codes: Mapping[str, FloatArray] | None = None) -> FloatArray:
        """Products (m, q) of the codes of the variables of a term, by default for all shapes."""
        factors = [(codes or self.codes)[name] for name in term]
        return reduce(lambda a, b: (a[:, :, None] * b[:, None]).reshape(len(a), -1), factors)

    def row(self, changed: Mapping[str, FloatArray], slope: str = "") -> FloatArray:
        """Coefficients of a mean or slope, with changed codes and means of other variables."""
        codes = {}
        for name, code in self.codes.items():
            levels = self.levels.get(name)
            usual = np.full(code.shape[1], 1 / len(levels)) if levels else code.mean(axis=0)
            codes[name] = np.atleast_2d(changed.get(name, usual))
        codes |= {slope: np.ones((1, 1))} if slope else {}
        rows = [self.columns(term, codes)[0] * (not slope or slope in term) for term in self.terms]
        return np.concatenate([[0.0 if slope else 1.0], *rows])


def _code_variable(
    name: str, formula: str, table: Mapping[str, Sequence[object]], is_factor: bool
) -> tuple[FloatArray, tuple[str, ...]]:
    """Return the codes (m, q) of a variable, and its levels if it is a factor."""
    call = None if name in table else re.fullmatch(r"log\s*\(\s*(.+?)\s*\)", name)
    column = call[1] if call else name
    if column not in table:
        problem = f"there is no variable {column!r}" if column else "a variable is missing"
        known = f"the table has {', '.join(table)[:80]}"
        raise InputError(f"{formula!r}: {problem}; {known}; write a formula such as size * group + age")
    cells = [str(cell).strip() for cell in table[column]]
    if lacking := [i for i, cell in enumerate(cells) if cell.lower() in NO_TEXT]:
        raise InputError(f"{column} has no value of {len(lacking)} of the shapes; give it, or leave them out")
    try:
        numbers = np.array([float(cell) for cell in cells])
    except ValueError:
        numbers = np.zeros(0)
    if is_factor or not len(numbers):
        levels = tuple(sorted({*cells}, key=natural_order))
        if call:
            raise InputError(f"{formula!r}: {column} has words, as {cells[0]!r}, which have no logarithm")
        if len(levels) < 2:
            raise InputError(f"{column} has one group, {levels[0]!r}; give two or more")
        return np.array([[float(cell == level) for level in levels[1:]] for cell in cells]), levels
    if call:
        if not (numbers > 0).all():
            raise InputError(f"{formula!r}: {column} has values not above 0, which have no logarithm")
        numbers = np.log(numbers)
    if not np.isfinite(numbers).all() or np.ptp(numbers) <= MIN_SINGULAR * np.abs(numbers).max(initial=0.0):
        raise InputError(f"{column} does not vary, or has a value that is not finite; leave it out")
    return numbers[:, None], ()


@dataclass(frozen=True, eq=False)
class ShapeAnova:
    """Sequential analysis of variance by the terms of a model, and tests of pairs of groups."""

    rows: tuple[TermTest, ...]  #: the terms in their order, residuals, total
    pairs: tuple[PairTest, ...]  #: pairs of groups of each factor, or of their slopes
    n_permutations: int  #: number of random permutations
    seed: int  #: seed that draws the permutations


def shape_anova(
    aligned: FloatArray,
    design: ShapeDesign,
    weights: FloatArray | None = None,
    *,
    n_permutations: int = N_PERMUTATIONS,
    seed: int = 0,
) -> ShapeAnova:
    """Test the variance of shapes that each term of a model describes beyond the terms before it.

    Parameters
    ----------
    aligned : (m, n, d) array of float
        Shapes moved onto their mean, such as ``generalised_procrustes(...).aligned``.
    design : ShapeDesign
        The terms, and their variables for each shape.
    weights : (n,) array of float, optional
        Weight of each vertex; by default all are equal.
    n_permutations, seed : int
        Number of random exchanges of residuals between shapes, and what draws them; see
        `group_test`.

    Raises
    ------
    InputError
        If shapes are too few, a group has one, or a term depends on those before it.

    Notes
    -----
    Sequential sums of squares; Collyer, Sekora & Adams, *A method for analysis of phenotypic change
    for phenotypes described by high-dimensional data*, Heredity 2015. The residuals of the model of
    all earlier terms are permuted and added to its fitted values, and F is compared. For pairs, the
    terms of the factor are left out, and means at the mean of other variables compared; or the term
    with a slope for each group is left out, and slopes compared. A permutation takes O(m² q) time
    for q columns.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> age = np.linspace(0, 1, 12)
    >>> shapes = age[:, None, None] + 0.01 * rng.normal(size=(12, 5, 3))
    >>> found = shape_anova(shapes, ShapeDesign.of("age + sex", {"age": age, "sex": [*"fm"] * 6}))
    >>> [(row.term, row.degrees, round(row.r_squared, 2)) for row in found.rows]
    [('age', 1, 1.0), ('sex', 1, 0.0), ('residuals', 9, 0.0), ('total', 11, 1.0)]
    """
    m = len(aligned)
    if any(len(code) != m for code in design.codes.values()):
        raise InputError(f"the variables are not of {m} shapes; give a value for each")
    for name, levels in design.levels.items():
        counts = design.codes[name].sum(axis=0)
        if alone := [level for level, n in zip(levels, [m - counts.sum(), *counts]) if n < 2]:
            remedy = "give two or more of each group, or leave it out"
            raise InputError(f"{name} {alone[0]!r} has one shape; {remedy}")
    products = scalar_products(aligned - aligned.mean(axis=0), shares_of(aligned, weights))
    return _test_terms(products, design, n_permutations, seed)


def permutations_of(m: int, n_permutations: int, seed: int) -> IntArray:
    """Return the identity and random orders of m numbers, (n_permutations + 1, m)."""
    orders = np.tile(np.arange(m), (n_permutations + 1, 1))
    generator(seed).permuted(orders[1:], axis=1, out=orders[1:])
    return orders


def _test_terms(products: FloatArray, design: ShapeDesign, n_permutations: int, seed: int) -> ShapeAnova:
    m = len(products)
    if m < MIN_SHAPES:
        raise InputError(f"{m} shapes are too few for a regression; give {MIN_SHAPES} or more")
    if n_permutations < 1:
        raise SettingError(f"n_permutations = {n_permutations} is not at least 1")
    blocks = [design.columns(term) for term in design.terms]
    parts = [*_orthonormal_parts(blocks, m)]
    if idle := [name for name, part in zip(design.names, parts[1:]) if not part.shape[1]]:
        raise InputError(f"{idle[0]} does not vary, or depends on the variables before it; leave it out")
    whole = np.hstack(parts)
    free = m - whole.shape[1]
    if free < 1:
        wanted = f"{design.formula!r}, which has {whole.shape[1]} coefficients"
        raise InputError(f"{m} shapes are too few for {wanted}; give more shapes, or fewer terms")
    orders = permutations_of(m, n_permutations, seed)
    total, rows = float(np.trace(products)), list[TermTest]()
    residual = max(total - float(np.einsum("iq,ij,jq->", whole, products, whole)), 0.0)
    for i, name in enumerate(design.names, start=1):
        # The terms before this one, with the projector H, leave the residuals E = (I − H) Y of the shapes Y, which
        # a permutation Π turns into the shapes H Y + Π E. There, the basis U of what this term adds
        # explains ‖Uᵀ Π E‖², and all terms, with the basis Q, leave ‖E‖² − ‖Qᵀ Π E‖²
        left = _residual_products(products, np.hstack(parts[:i]))
        squares = explained_squares(parts[i], left, orders)
        residuals = np.maximum(np.trace(left) - explained_squares(whole, left, orders), 0.0)
        first, degrees = float(squares[0]), parts[i].shape[1]
        with np.errstate(divide="ignore", invalid="ignore"):
            f = np.nan_to_num(squares / degrees / (residuals / free), nan=0.0, posinf=np.inf)
        row = name, degrees, first, first / degrees, first / (total or 1.0)
        rows.append(TermTest(*row, float(f[0]), *_compare_first(f)))
    none = np.nan, np.nan, np.nan
    rows.append(TermTest("residuals", free, residual, residual / free, residual / (total or 1.0), *none))
    rows.append(TermTest("total", m - 1, total, np.nan, 1.0, *none))
    # Groups are compared for terms with one factor: for the factor alone by means, with one number by slopes.
    of_one = [term for term in design.terms if len(term) < 3 and len(design.levels.keys() & {*term}) == 1]
    pairs = [pair for term in of_one for pair in _pairs(design, blocks, products, orders, term)]
    return ShapeAnova(tuple(rows), tuple(pairs), n_permutations, seed)


def _orthonormal_parts(blocks: Sequence[FloatArray], m: int) -> Iterator[FloatArray]:
    """Yield orthonormal bases (m, r) of constants, and of what each block of columns (m, q) adds."""
    basis = np.full((m, 1), m**-0.5)
    yield basis
    for block in blocks:
        scale = np.linalg.norm(block, axis=0).max(initial=0.0)
        for _ in range(2):  # the second projection removes rounding errors of the first
            block = block - basis @ (basis.T @ block)
        part, singular, _ = np.linalg.svd(block, full_matrices=False)
        part = part[:, singular > MIN_SINGULAR * scale]
        basis = np.hstack([basis, part])
        yield part


def _residual_products(products: FloatArray, basis: FloatArray) -> FloatArray:
    """Scalar products (m, m) of the residuals of shapes from an orthonormal basis (m, r)."""
    left = products - basis @ (basis.T @ products)
    return np.asarray(left - (left @ basis) @ basis.T)


def explained_squares(basis: FloatArray, products: FloatArray, orders: IntArray) -> FloatArray:
    """Squares (p,) that a basis (m, r) explains of shapes with products (m, m), in orders (p, m)."""
    width = max(MAX_NUMBERS // max(basis.size, 1), 1)
    with serial_blas():
        found = []
        for first in range(0, len(orders), width):
            # shape i goes to place orders[i], which permutes the rows of the basis
            permuted = basis[orders[first : first + width]]
            found.append(np.einsum("pmr,pmr->p", permuted, products @ permuted))
    return np.concatenate(found)


def _compare_first(values: FloatArray) -> tuple[float, float]:
    """Return the standard deviate of the first value, after a Box–Cox transformation, and p."""
    p_value = float((values >= values[0] * (1 - 1e-9)).mean())
    if not np.isfinite(values).all() or np.ptp(values[1:]) <= 1e-12 * np.abs(values).max():
        return np.nan, p_value
    positive = values if values.min() > 0 else values - values.min() + 1e-4
    positive = np.clip(positive / np.exp(np.log(positive[1:]).mean()), 1e-30, 1e30)
    # Of values with the geometric mean 1, the likeliest power is the one with the least variance.
    power = minimize_scalar(lambda x: boxcox(positive[1:], x).var(), bounds=BOX_COX_RANGE, method="bounded").x
    like_normal = boxcox(positive, power)
    deviation = float(like_normal.std())
    return float((like_normal[0] - like_normal.mean()) / deviation) if deviation > 0 else np.nan, p_value


def _pairs(
    design: ShapeDesign, blocks: list[FloatArray], products: FloatArray, orders: IntArray, of: Sequence[str]
) -> list[PairTest]:
    """Compare means, or slopes, of each pair of groups of a factor."""
    m, factor = len(products), next(name for name in of if name in design.levels)
    slope = next((name for name in of if name not in design.levels), "")
    kept = [block for block, term in zip(blocks, design.terms) if not {*of} <= {*term}]
    left = _residual_products(products, np.hstack([*_orthonormal_parts(kept, m)]))
    # The mean, or slope, of a group is cᵀ Y for the shapes Y, with c = X⁺ᵀ l, the columns X of all terms and the
    # coefficients l (`ShapeDesign.row`). Two groups whose vectors c differ by d have the distance √(dᵀ P d), with the
    # scalar products P of the shapes.
    inverse = np.linalg.pinv(np.hstack([np.ones((m, 1)), *blocks]))
    levels = design.levels[factor]
    codes = np.eye(len(levels))[:, 1:]
    of_level = np.array([design.row({factor: code}, slope) @ inverse for code in codes])
    found = []
    for i, j in combinations(range(len(levels)), 2):
        difference = of_level[j] - of_level[i]
        drawn = np.sqrt(np.maximum(explained_squares(difference[:, None], left, orders), 0.0))
        z, p_value = _compare_first(drawn)
        (ii, ij), (_, jj) = (of_level[[i, j]] @ products @ of_level[[i, j]].T).tolist()
        cosine = np.clip(ij / np.sqrt(max(ii * jj, 1e-300)), -1, 1)
        angle = float(np.degrees(np.arccos(cosine))) if slope else np.nan
        distance = float(np.sqrt(max(float(difference @ products @ difference), 0.0)))
        found.append(PairTest(":".join(of), levels[i], levels[j], distance, angle, z, p_value, p_value))
    # Holm multiplies the i-th of n ascending p-values, i from 0, by n − i, or takes the result before if it is larger
    ascending = np.argsort([pair.p_value for pair in found], kind="stable").tolist()
    least = 0.0
    for i, row in enumerate(ascending):
        least = min(max(least, found[row].p_value * (len(found) - i)), 1.0)
        found[row] = found[row]._replace(adjusted_p=least)
    return found


@dataclass(frozen=True, eq=False)
class ShapeRegression:
    """Regression of m shapes on q variables: mean + Σ (variable − its mean) · coefficient."""

    r_squared: float  #: share of the variance of shape that the variables describe
    p_value: float  #: probability of as large a share without any relation, from permutations
    n_permutations: int  #: number of random permutations
    seed: int  #: seed that draws the permutations
    mean: FloatArray  #: (n, 3) mean shape
    coefficients: FloatArray  #: (q, n, 3) displacement for one unit of each variable
    #: (m, q) regression scores of Drake & Klingenberg (2008): distance of each shape from the mean
    #: in the direction of each coefficient, in the units of the shapes, to be drawn against it
    scores: FloatArray


def shape_regression(
    aligned: FloatArray,
    variables: ArrayLike,
    weights: FloatArray | None = None,
    *,
    n_permutations: int = N_PERMUTATIONS,
    seed: int = 0,
) -> ShapeRegression:
    """Regress shapes on variables, such as the logarithm of their centroid size (allometry).

    Parameters
    ----------
    aligned : (m, n, 3) array of float
        Shapes moved onto their mean, such as ``generalised_procrustes(...).aligned``; for allometry
        with sizes removed.
    variables : (m,) or (m, q) array_like of float
        Their values. Groups are columns of 0 and 1, for all groups but one.
    weights : (n,) array of float, optional
        Weight of each vertex, such as `CorrespondedShapes.area_weights`; by default all are equal.
    n_permutations, seed : int
        Number of random exchanges of the values between shapes, and what draws them; see
        `group_test`.

    Notes
    -----
    Goodall's Procrustes regression. A permutation takes O(m² q) time.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> size = np.linspace(0, 1, 12)
    >>> shapes = size[:, None, None] * np.ones((5, 3)) + 0.01 * rng.normal(size=(12, 5, 3))
    >>> found = shape_regression(shapes, size)
    >>> round(found.r_squared, 2), found.p_value
    (1.0, 0.0002)
    """
    values = numbers_of(variables, "variables", InputError)
    values = values[:, None] if values.ndim == 1 else values
    m = len(aligned)
    if values.ndim != 2 or len(values) != m or not np.isfinite(values).all():
        remedy = f"give a finite number for each of the {m} shapes"
        raise InputError(f"variables have shape {values.shape}; {remedy}")
    centred = values - values.mean(axis=0)
    singular, scale = np.linalg.svd(centred, compute_uv=False), np.abs(values).max(initial=0.0) * np.sqrt(m)
    if m >= MIN_SHAPES and (not len(singular) or singular[-1] <= MIN_SINGULAR * max(singular[0], scale)):
        raise InputError("the variables do not vary, or one depends on the others; leave it out")
    share = shares_of(aligned, weights)
    mean = aligned.mean(axis=0)
    about_mean = aligned - mean
    design = ShapeDesign("the variables", (("variables",),), {"variables": values}, {})
    whole = _test_terms(scalar_products(about_mean, share), design, n_permutations, seed).rows[0]
    coefficients = np.tensordot(np.linalg.pinv(centred), about_mean, 1)
    length = np.sqrt(np.einsum("i,qij,qij->q", share, coefficients, coefficients))
    along = coefficients / np.where(length > 0, length, 1.0)[:, None, None]
    scores = np.einsum("i,mij,qij->mq", share, about_mean, along)
    test = whole.r_squared, whole.p_value, n_permutations, seed
    return ShapeRegression(*test, mean, coefficients, scores)


class Classification(NamedTuple):
    """Canonical variates of groups, and the group that the others predict for each shape."""

    groups: tuple[str, ...]
    variates: FloatArray  # (m, k) variates of each shape, in standard deviations within groups
    predicted: tuple[str, ...]  # predicted group of each shape
    counts: FloatArray  # (g, g) number of shapes by group and predicted group
    n_modes: int  # number of modes used

    @property
    def share_right(self) -> float:
        """Share of the shapes whose group is predicted."""
        return float(np.trace(self.counts) / self.counts.sum())


def classify(scores: FloatArray, groups: Sequence[str]) -> Classification:
    """Find the directions in which groups differ most, and predict each shape left out.

    Parameters
    ----------
    scores : (m, k) array of float
        Scores of the shapes along the modes of a model, in decreasing order of variance.
    groups : sequence of str
        Their groups, two or more, of two shapes or more.

    Notes
    -----
    Linear discriminants of the first modes: as many as hold 95 % of the variance, and at most half
    of m minus the number of groups, so that the covariance within groups is known. Groups count
    alike. Each shape is predicted by discriminants of all others. Needs scikit-learn, of the extra
    ``statistics``.

    Examples
    --------
    >>> found = classify(np.array([[0.0], [0.1], [0.2], [5.0], [5.1], [5.3]]), [*"aaabbb"])
    >>> found.share_right, found.variates.shape
    (1.0, (6, 1))
    """
    m, labels = len(scores), np.asarray(groups, dtype=str)
    names, of, counts = np.unique(labels, return_inverse=True, return_counts=True)
    g = len(names)
    if g < 2 or counts.min() < 2 or len(labels) != m:
        given = ", ".join(f"{name!r} of {count}" for name, count in zip(names.tolist(), counts))
        raise InputError(f"groups {given} for {m} shapes; give two groups or more, of two shapes or more")
    discriminant: Any = package("sklearn.discriminant_analysis", "statistics", "canonical variates")
    selection: Any = package("sklearn.model_selection", "statistics", "canonical variates")
    shares = np.cumsum((scores**2).sum(axis=0)) / max((scores**2).sum(), 1e-300)
    n_held = int(np.searchsorted(shares, CLASSIFIED_VARIANCE)) + 1
    n_modes = max(min(n_held, (m - g) // 2, scores.shape[1]), 1)
    used = scores[:, :n_modes]
    model = discriminant.LinearDiscriminantAnalysis(priors=np.full(g, 1 / g))
    with warnings.catch_warnings(action="ignore"):  # warnings of modes in which a group does not vary
        predicted = selection.cross_val_predict(model, used, labels, cv=selection.LeaveOneOut())
        variates = model.fit(used, labels).transform(used)
    within = variates - np.array([variates[of == i].mean(axis=0) for i in range(g)])[of]
    variates = variates / np.sqrt(np.maximum((within**2).sum(axis=0) / (m - g), 1e-300))
    table = np.array([[(predicted[of == i] == name).sum() for name in names] for i in range(g)])
    return Classification(tuple(names.tolist()), variates, tuple(map(str, predicted)), table, n_modes)
