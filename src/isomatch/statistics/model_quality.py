"""How good a shape model is: compactness, generalisation and specificity."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isomatch.runtime.threads import serial_blas
from isomatch.statistics.shape_model import ShapeModel
from isomatch.statistics.shapes import MIRRORED
from isomatch.values.arrays import FloatArray
from isomatch.values.settings import generator

MOST_LEFT_OUT = 100  # shapes that are left out in turn; the standard error of their mean is then small
N_SAMPLES = 1000  # Styner et al. 2003 draw 10 000; with 1000 the mean is known to about 1 %


@dataclass(frozen=True, eq=False)
class ModelCurve:
    """A measure for each number of modes, in the units of the shapes.

    Parameters
    ----------
    mean : (k,) array of float
        ``mean[j]`` is the mean with j modes.
    standard_error : (k,) array of float
        Standard error of these means.
    """

    mean: FloatArray
    standard_error: FloatArray

    @classmethod
    def of_rows(cls, rows: FloatArray) -> ModelCurve:
        """Make a curve of the values of each case, (cases, k)."""
        return cls(rows.mean(axis=0), rows.std(axis=0) / np.sqrt(max(len(rows) - 1, 1)))


def compactness(model: ShapeModel) -> FloatArray:
    """Compute the share of the total variance that the first j modes have, (k + 1,) for j = 0…k.

    Examples
    --------
    >>> from isomatch.statistics import CorrespondedShapes
    >>> triangle = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    >>> compactness(ShapeModel.fit(CorrespondedShapes(("a", "b"), [triangle, 2 * triangle], [[0, 1, 2]])))
    array([0., 1.])
    """
    return np.concatenate([[0.0], np.cumsum(model.variance_ratios)])


def generalisation(model: ShapeModel, *, seed: int = 0) -> ModelCurve:
    """Measure how well the model describes shapes that it was not made from, leaving out one at a time.

    Parameters
    ----------
    model : ShapeModel
        A model of m shapes, with all its modes.
    seed : int
        Draws the shapes that are left out, if there are more than 100.

    Returns
    -------
    ModelCurve
        Root mean square distance between a shape left out and its nearest in the span of j modes of the others, for
        j = 0…m − 2; it never increases with j. Empty for one shape.

    Notes
    -----
    Davies, *Learning shape: optimal models for analysing natural variability*, 2002; Styner et al., IPMI 2003. Alignment
    is not repeated without the shape left out. Its mirror image (`CorrespondedShapes.mirrored`) is left out with it.
    """
    m = len(model.names)
    if m < 2:
        return ModelCurve(np.zeros(0), np.zeros(0))
    chosen = np.arange(m)
    if m > MOST_LEFT_OUT:
        chosen = np.sort(generator(seed).choice(m, MOST_LEFT_OUT, replace=False))
    rows = np.zeros((len(chosen), m - 1))
    number = {name: i for i, name in enumerate(model.names)}
    both = [sorted({i, number.get(_other_side(name), i)}) for name, i in number.items()]
    with serial_blas():
        for row, left_out in zip(rows, chosen):
            others = np.delete(model.scores, both[left_out], axis=0)
            mean = others.mean(axis=0)
            _, values, axes = np.linalg.svd(others - mean, full_matrices=False)
            missed = model.scores[left_out] - mean
            row[:] = np.linalg.norm(missed)
            used = axes[: m - 2][values[: m - 2] > 1e-10 * max(values.max(initial=0.0), 1e-300)]
            for j, axis in enumerate(used, start=1):
                missed = missed - (missed @ axis) * axis
                row[j:] = np.linalg.norm(missed)
    return ModelCurve.of_rows(rows)


def specificity(model: ShapeModel, *, n_samples: int = N_SAMPLES, seed: int = 0) -> ModelCurve:
    """Measure how much random shapes of the model look like those that it was made from.

    Parameters
    ----------
    model : ShapeModel
        A model of m shapes, with all its k modes.
    n_samples : int
        Number of random shapes; their scores are independent and normally distributed.
    seed : int
        Draws them.

    Returns
    -------
    ModelCurve
        Root mean square distance of a random shape of j modes from the nearest of the m shapes, for j = 0…k.

    Notes
    -----
    Davies 2002; Styner et al. 2003. O(n_samples m k) time: distances are those of the scores.
    """
    draws = generator(seed).standard_normal((n_samples, model.n_modes)) * model.deviations
    squares = np.broadcast_to((model.scores**2).sum(axis=1), (n_samples, len(model.names))).copy()
    rows = [np.sqrt(squares.min(axis=1))]
    for drawn, scores in zip(draws.T, model.scores.T):
        squares += drawn[:, None] * (drawn[:, None] - 2 * scores)  # (z − b)² instead of b²
        rows.append(np.sqrt(np.maximum(squares.min(axis=1), 0.0)))
    return ModelCurve.of_rows(np.array(rows).T)


def _other_side(name: str) -> str:
    """Name of the mirror image of a shape, or of the shape that it is the mirror image of."""
    return name.removesuffix(MIRRORED) if name.endswith(MIRRORED) else name + MIRRORED
