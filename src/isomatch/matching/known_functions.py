"""Functions whose values are known on both shapes, such as thickness: further coordinates of their points."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from isomatch.correspondence import Embedding
from isomatch.errors import DescriptorError
from isomatch.geodesics import distance_along_edges_to_nearest
from isomatch.matching.hints import checked_descriptors
from isomatch.matching.pair import ShapePair
from isomatch.surfaces import Surface
from isomatch.values.arrays import FloatArray, numbers_of


def with_functions(pair: ShapePair, functions: tuple[ArrayLike, ArrayLike] | None) -> ShapePair:
    """Return a pair on which functions are known, see `match`.

    The values of both shapes together get mean 0 and variance 1, so that one value means the same on both; an unknown one
    is that of the nearest vertex where it is known.

    Raises
    ------
    DescriptorError
        If they do not fit the shapes, or a function is known nowhere on one of them, or infinite.
    """
    if functions is None:
        return pair
    if len(functions) != 2:
        raise DescriptorError(f"functions are {len(functions)} arrays; expected two, of source and target")
    given = (numbers_of(values, "functions", DescriptorError) for values in functions)
    columns = tuple(values[:, None] if values.ndim == 1 else values for values in given)
    sizes = pair.source.surface.n_vertices, pair.target.surface.n_vertices
    values = checked_descriptors(columns, *sizes, what="functions")
    for side, each in zip(("source", "target"), values):
        if np.isinf(each).any() or np.isnan(each).all(axis=0).any():
            raise DescriptorError(
                f"functions: values of the {side} are infinite, or one function is known at no vertex; give finite "
                "numbers, and nan where nothing is known"
            )
    both = np.concatenate(values)
    weight = pair.config.refining.function_weight / np.sqrt(both.shape[1])
    mean, deviation = np.nanmean(both, axis=0), np.nanstd(both, axis=0)
    unit = weight / np.where(deviation > 0, deviation, 1.0)
    sides = zip(values, (pair.source.surface, pair.target.surface))
    source, target = (_filled((each - mean) * unit, surface) for each, surface in sides)
    return replace(pair, functions=Embedding(source, target))


def _filled(values: FloatArray, surface: Surface) -> FloatArray:
    """Take unknown values (n, q) from the nearest vertices along edges that have one; 0 where none is reached."""
    filled = values.copy()
    for column in filled.T:
        unknown = np.isnan(column)
        if unknown.any():
            apart, nearest = distance_along_edges_to_nearest(surface, np.flatnonzero(~unknown), weld=True)
            reached = np.isfinite(apart)
            column[unknown & ~reached] = 0.0
            column[unknown & reached] = column[nearest[unknown & reached]]
    return filled
