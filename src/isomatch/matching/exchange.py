"""Exchange of regions: a map takes regions, such as two legs, from other maps."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import islice

import numpy as np

from isomatch._core.arrays import BodyVertices, FloatArray, Int, IntArray
from isomatch.matching.parameters import EXCHANGE
from isomatch.matching.problem import Problem
from isomatch.matching.verify import Verifier, verifier_of
from isomatch.surfaces import connected_regions, label_components


def exchange_regions(
    pair: Problem, image: Int[BodyVertices, "n_s"], cost: float, others: Sequence[Int[BodyVertices, "n_s"]]
) -> Int[BodyVertices, "n_s"] | None:
    """Take regions from other maps while the cost of a map falls; None if it never does."""
    exchange = _Exchange(pair, others)
    best = image
    for _ in range(EXCHANGE.max_exchanges if np.isfinite(cost) else 0):
        tried = [(exchange.verifier(moved).cost, i, moved) for i, moved in enumerate(exchange.moves(best))]
        least, _, moved = min(tried, default=(np.inf, 0, best))
        if not least <= EXCHANGE.max_cost_ratio * cost:
            break
        best, cost = moved, least
    return None if best is image else best


class _Exchange:
    """Computes exchanges of one map with others."""

    def __init__(self, pair: Problem, others: Sequence[Int[BodyVertices, "n_s"]]) -> None:
        self.pair, self.verifier = pair, verifier_of(pair)
        self.others = [(other, self.verifier.descriptor_distances(other)) for other in others]
        self.coarse = Verifier(pair, EXCHANGE.n_coarse_vertices)
        self.mesh, self.areas = pair.source.mesh_body, pair.source.body.vertex_areas / pair.source.body.area

    def moves(self, image: BodyVertices) -> Iterator[BodyVertices]:
        """Take regions from other maps, unless images look unlike them or the coarse cost rises."""
        cost, distances = self.coarse(image).cost, self.verifier.descriptor_distances(image)
        for other, other_distances in self.others:
            for region in self._regions(image, other):
                weights = self.areas[region]
                before, after = (np.nansum(x[region] * weights) for x in (distances, other_distances))
                is_unlike = after > EXCHANGE.max_unlikeness_ratio * before
                if weights.sum() <= EXCHANGE.max_region_area and not is_unlike:
                    moved = image.copy()
                    moved[region] = other[region]
                    if self.coarse(BodyVertices(moved)).cost <= cost:
                        yield BodyVertices(moved)

    def _regions(self, image: BodyVertices, other: BodyVertices) -> list[IntArray]:
        """Find regions in which maps differ, joining those that take each other's images."""
        both = (image >= 0) & (other >= 0)
        differs = np.zeros(len(image), dtype=bool)
        differs[both] = self.pair.target.distance(image[both], other[both]) > EXCHANGE.other_place
        largest = islice(connected_regions(self.mesh.edges, differs, self.areas), EXCHANGE.max_regions)
        regions = [region for region, share in largest if share >= EXCHANGE.min_region_area]
        links = [
            (i, j)
            for i, one in enumerate(regions)
            for j, two in enumerate(regions)
            if i != j and self._lies_on(other[one], image[two])
        ]
        ends = np.array(links, dtype=np.int64).reshape(-1, 2)
        _, group = label_components(len(regions), (ends[:, 0], ends[:, 1]))
        together = [[i for i, g in enumerate(group) if g == c] for c in sorted(set(group.tolist()))]
        joined = [np.concatenate([regions[i] for i in members]) for members in together]
        return joined + [regions[i] for members in together if len(members) > 1 for i in members]

    def _lies_on(self, images: IntArray, others: IntArray) -> bool:
        """Whether enough of some images lie where others do."""
        few, among = (x[:: max(1, len(x) // EXCHANGE.n_compared_vertices)] for x in (images, others))
        unit = np.sqrt(self.pair.target.body.area)
        distances: FloatArray = self.pair.target.distances.between(few, among) / unit
        return bool((distances.min(axis=1) < EXCHANGE.other_place / 2).mean() > EXCHANGE.min_overlap)
