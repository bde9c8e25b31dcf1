"""The mirror image of a shape that is nearly symmetric: an elastic match of the shape to itself."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from isomatch.correspondence import Embedding
from isomatch.matching.pair import ShapePair
from isomatch.matching.relations.elastic_fit import Coefficients, ElasticFit, Images, Step, coarse_steps
from isomatch.matching.relations.elastic_shape import N_COARSE, ElasticShape
from isomatch.matching.relations.elastic_starts import anchor_starts
from isomatch.runtime.threads import parallel_map
from isomatch.settings import Config
from isomatch.shapes import PreparedShape
from isomatch.values.arrays import IntArray

# up to which a map of a shape to itself is its mirror image; chosen on pairs of animals, not one by one
MIRROR_MISFIT = 0.26

MIRROR_STARTS = 24  # first maps; chosen, not measured

# relative difference of two distances that costs nothing; chosen: a shape is nearly isometric to its mirror image
MIRROR_FORGIVEN = 0.1

# from which a map to itself is a mirror image; chosen on pairs of animals, not one by one
MIRROR_ORIENTATION = 0.5

N_FOLLOWED = (12, 4, 4)  # of these that go on after each step; docs/lab/design_notes.md

NONE = np.zeros((0, 2), dtype=np.int64)


class _SelfMap(NamedTuple):
    """A map of a shape to itself."""

    coefficients: Coefficients
    images: Images


def with_mirror(prepared: PreparedShape, config: Config) -> ElasticShape:
    """Find the map of a shape to itself that reverses its orientation and fits best, if any fits well."""
    settings = config.elastic
    shape = ElasticShape(prepared, settings)
    samples = shape.sampled(N_COARSE, False)
    signatures = Embedding(prepared.signatures, prepared.signatures)
    fit = ElasticFit(samples, samples, signatures, NONE, side=-1.0)
    steps = coarse_steps()

    def first(start: IntArray) -> _SelfMap | None:
        found = fit.from_pairs(start, steps[0])
        images = fit.images(found)
        return None if images.orientation < 0 else _SelfMap(found, images)

    def stepped(known: _SelfMap, step: Step) -> _SelfMap:
        return _SelfMap(*fit.run(known.coefficients, (step,), known.images))

    few = replace(config, elastic=replace(settings, forgiven=MIRROR_FORGIVEN, n_starts=MIRROR_STARTS))
    rows = prepared.sample_vertices[: prepared.config.n_search]
    known = [np.column_stack([rows, rows[each.image_row]]) for each in prepared.symmetries]
    starts = [*anchor_starts(ShapePair(prepared, prepared, few), NONE), *known]
    maps = [each for each in parallel_map(first, starts) if each]
    for step, most in zip(steps, N_FOLLOWED):
        maps = parallel_map(partial(stepped, step=step), maps)
        maps = sorted(maps, key=lambda each: each.images.misfit)[:most]
    clear = [each for each in maps if each.images.orientation >= MIRROR_ORIENTATION]
    if not clear or clear[0].images.misfit > MIRROR_MISFIT:
        return shape
    drawn = clear[0].coefficients.source
    return replace(shape, mirrored=prepared.laplace.vectors[:, : len(drawn)] @ drawn)
