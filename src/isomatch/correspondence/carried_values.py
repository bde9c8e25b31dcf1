"""Values carried along a map: floats interpolated, labels taken from the nearest vertex, integrals or means kept."""

from __future__ import annotations

from math import prod

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csc_array

from isomatch.errors import DescriptorError
from isomatch.values.arrays import AnyArray, BoolArray, FloatArray, IntArray, array_of, numbers_of

_FILLS = {"f": np.nan, "c": np.nan, "i": -1, "b": False, "U": "", "S": b""}  # by the kind of an array's type


def pulled_back(
    rows: AnyArray, vertices: IntArray, faces: IntArray, barycentric: FloatArray, fill: object
) -> AnyArray:
    """Interpolate floats (n_target, ...) at precise images; take labels of vertices; ``fill`` where unmatched."""
    if not len(rows):  # nothing is matched
        kind = np.result_type(rows, np.float64) if rows.dtype.kind in "fc" else rows.dtype
        carried: AnyArray = np.zeros((len(vertices), *rows.shape[1:]), kind)
    elif rows.dtype.kind in "fc":
        weights = barycentric.reshape(-1, 3, *(1,) * (rows.ndim - 1))
        carried = (weights * rows[faces]).sum(axis=1)
    else:
        carried = rows[vertices]
    holes = vertices < 0
    return _filled(carried, holes, fill) if holes.any() else carried


def pushed_forward(
    transposed: csc_array,
    matched: BoolArray,
    values: ArrayLike,
    source_areas: ArrayLike,
    target_areas: ArrayLike | None,
) -> FloatArray:
    """Push values forward by a transposed map (n_target, n_source); see `Correspondence.push_forward`."""
    n_target, n_source = transposed.shape
    rows = array_of(values, "values", DescriptorError)
    if rows.dtype.kind != "f":
        raise DescriptorError(
            f"values have type {rows.dtype}, and labels have no mean; carry them with "
            "reversed(source, target).pull_back, or give floats"
        )
    areas = numbers_of(source_areas, "source areas", DescriptorError)
    wanted = [("values", rows.shape[:1], n_source), ("source areas", areas.shape, n_source)]
    if target_areas is not None:
        total = numbers_of(target_areas, "target areas", DescriptorError)
        wanted.append(("target areas", total.shape, n_target))
    for name, shape, n in wanted:
        if shape != (n,):
            raise DescriptorError(f"{name} have shape {shape}, expected ({n},): one for each vertex")
    if target_areas is None:
        total = transposed @ areas
    weighted = rows.reshape(n_source, prod(rows.shape[1:])) * areas[:, None]
    with np.errstate(invalid="ignore", divide="ignore"):
        pushed: FloatArray = (transposed @ np.where(matched[:, None], weighted, 0.0)) / total[:, None]
    if target_areas is not None:
        pushed[transposed @ np.ones(n_source) == 0] = 0.0  # no image lies there, even if there is no area
    return pushed.reshape(n_target, *rows.shape[1:])


def _filled(labels: AnyArray, holes: BoolArray, fill: object) -> AnyArray:
    """Put a value where there is none; `DescriptorError` if the type of the values cannot hold it."""
    if fill is None:
        fill = _FILLS.get(labels.dtype.kind)
        if fill is None:
            raise DescriptorError(
                f"{holes.sum()} source vertices are unmatched, and nothing stands for that in values of type "
                f"{labels.dtype}; give fill"
            )
    value = np.asarray(fill)
    kind = np.result_type(labels, value) if labels.dtype.kind == value.dtype.kind in "US" else labels.dtype
    try:
        with np.errstate(invalid="ignore"):
            kept = value.ndim == 0 and bool(
                value.astype(kind) == value or (value != value and kind.kind in "fcmM")
            )
    except (TypeError, ValueError, OverflowError):
        kept = False
    if not kept:
        raise DescriptorError(f"fill = {fill!r} is no value of type {labels.dtype}")
    filled: AnyArray = labels.astype(kind)
    filled[holes] = value
    return filled
