"""The mirror image of a shape that is nearly symmetric: an elastic match of the shape to itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from isomatch.correspondence import Embedding
from isomatch.matching.pair import ShapePair
from isomatch.matching.relations.elastic_fit import ElasticFit, coarse_steps
from isomatch.matching.relations.elastic_shape import N_COARSE, ElasticShape
from isomatch.matching.relations.elastic_starts import anchor_starts
from isomatch.runtime.threads import parallel_map
from isomatch.settings import Config
from isomatch.shapes import PreparedShape
from isomatch.values.arrays import FloatArray, IntArray

# up to which a map of a shape to itself is its mirror image; chosen on pairs of animals, not one by one
MIRROR_MISFIT = 0.26

MIRROR_STARTS = 24  # first maps; chosen, not measured

# relative difference of two distances that costs nothing; chosen: a shape is nearly isometric to its mirror image
MIRROR_FORGIVEN = 0.1

# from which a map to itself is a mirror image; chosen on pairs of animals, not one by one
MIRROR_ORIENTATION = 0.5

NONE = np.zeros((0, 2), dtype=np.int64)


def with_mirror(prepared: PreparedShape, config: Config) -> ElasticShape:
    """Find the map of a shape to itself that reverses its orientation and fits best, if any fits well."""
    settings = config.elastic
    shape = ElasticShape(prepared, settings)
    samples = shape.sampled(N_COARSE, False)
    signatures = Embedding(prepared.signatures, prepared.signatures)
    fit = ElasticFit(samples, samples, signatures, NONE, side=-1.0)
    steps = coarse_steps()

    def fitted(start: IntArray) -> tuple[float, FloatArray]:
        found = fit.from_pairs(start, steps[0])
        images = fit.images(found)
        if fit.orientation(found, images) < 0:
            return np.inf, found.source
        found, images = fit.run(found, steps, images)
        clear = fit.orientation(found, images) >= MIRROR_ORIENTATION
        return images.misfit if clear else np.inf, found.source

    few = replace(config, elastic=replace(settings, forgiven=MIRROR_FORGIVEN, n_starts=MIRROR_STARTS))
    rows = prepared.sample_vertices[: prepared.config.n_search]
    known = [np.column_stack([rows, rows[each.image_row]]) for each in prepared.symmetries]
    starts = [*anchor_starts(ShapePair(prepared, prepared, few), NONE), *known]
    misfit, drawn = min(parallel_map(fitted, starts), key=lambda each: each[0])
    if misfit > MIRROR_MISFIT:
        return shape
    return replace(shape, mirrored=prepared.laplace.vectors[:, : len(drawn)] @ drawn)
