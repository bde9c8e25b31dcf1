"""Both sides: search also from the target, and exchange regions, such as two legs, between maps."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from operator import attrgetter

import numpy as np

from isomatch._core.arrays import BodyVertices, FloatArray, Int, IntArray
from isomatch._core.stage_timer import StageTimer
from isomatch.correspondence import UNMATCHED, Embedding
from isomatch.matching.isometric.candidates import is_another
from isomatch.matching.isometric.isometry import IsometricMatch, Isometry
from isomatch.matching.maps import Fit
from isomatch.matching.model import Proposals
from isomatch.matching.parameters import EXCHANGE
from isomatch.matching.problem import Problem
from isomatch.matching.selection import Ranking
from isomatch.matching.verify import Verifier, invert_map, relative_cost, verifier_of
from isomatch.surfaces import connected_regions, label_components


@dataclass(frozen=True, eq=False)
class VerifiedFit:
    """A refined map, the images of all vertices, and its cost by `verify`."""

    fit: Fit
    image: Int[BodyVertices, "n_s"]
    cost: float


class BothSides(Isometry):
    """An unsure isometry, improved by maps found from the target, and by regions of other maps.

    Parameters
    ----------
    found : Match
        The match under an `Isometry`.

    Notes
    -----
    The maps that tie, and the maps of a search from the target, are verified. The best takes regions from the others
    while its cost falls. Its lead in this cost over other maps decides how sure it is.
    """

    def __init__(self, found: IsometricMatch) -> None:
        super().__init__(found.model.problem)
        self.found = found

    def propose(self, timer: StageTimer) -> Proposals[Fit]:
        """Return the proposals of the match before; nothing is left to refine."""
        return replace(self.found.proposals, contenders=(), rivals=())

    def rank(
        self, maps: list[Fit], rivals: list[Fit], proposals: Proposals[Fit], timer: StageTimer
    ) -> Ranking[Fit]:
        """Select the best verified map: ties, maps from the target, and an exchange of regions."""
        ranking = self.found.ranking
        first = ranking.best
        tied = [*self.find_tied(ranking), *self._search_from_target(first.side)]
        verified = [self._verify(fit) for fit in tied]
        best = min(verified, key=attrgetter("cost"))
        exchanged = self._exchange(best, verified)
        if exchanged:
            verified.append(exchanged)
            best = min(best, exchanged, key=attrgetter("cost"))
        fits = dict.fromkeys([first, *ranking.others, *(other.fit for other in verified)])
        others = tuple(fit for fit in fits if fit is not best.fit)
        ratio, against = self._compare(ranking, best, verified)
        return replace(ranking, best=best.fit, others=others, runner_up=ratio, against=against)

    def coordinates(self, best: Fit) -> Embedding:
        """Coordinates of all vertices in which images are nearest points."""
        return self.found.coordinates if best is self.found.ranking.best else super().coordinates(best)

    def _search_from_target(self, side: float) -> list[Fit]:
        """Search from target to source; invert the maps that tie, and refine them locally."""
        model = Isometry(self.pair.turned)
        maps = model.refine(model.propose(StageTimer()).contenders)
        tied = model.find_tied(model.select_fit(maps, [True] * len(maps)))
        found = []
        for fit in tied[: EXCHANGE.max_maps_from_target]:
            known = BodyVertices(np.full(self.target.body.n_vertices, UNMATCHED))
            known[model.vertices] = fit.image
            image, _ = invert_map(self.source, known)
            found.append(self._refine_locally(replace(fit, candidate=None), image))
        return [fit for fit in found if fit.side == side]

    def _exchange(self, best: VerifiedFit, verified: Sequence[VerifiedFit]) -> VerifiedFit | None:
        """Exchange regions of the best map with the others."""
        others = [other.image for other in verified if other is not best]
        image = exchange_regions(self.pair, best.image, best.cost, others)
        return None if image is None else self._verify(self._refine_locally(best.fit, image))

    def _compare(
        self, ranking: Ranking[Fit], best: VerifiedFit, verified: Sequence[VerifiedFit]
    ) -> tuple[float, Fit | None]:
        """Compare the best map with the runner-up, by scores, and with other maps by costs; return the least ratio."""
        first, ratio, against = ranking.best, ranking.runner_up, ranking.against
        if best.fit is not first:
            against = first if against in (None, best.fit) else against
            if is_another(self, best.fit, first):
                ratio = np.inf
        for other in verified:
            cost_ratio = relative_cost(other.cost, best.cost)
            if cost_ratio < ratio and is_another(self, other.fit, best.fit):
                ratio, against = cost_ratio, other.fit
        return ratio, against

    def _refine_locally(self, fit: Fit, image: BodyVertices) -> Fit:
        """Refine a map of all vertices by the last step alone, which changes only details."""
        moved = replace(fit, image=BodyVertices(image[self.vertices]))
        if self.refinement.polishes:
            moved = self.step(moved, *self.pair.config.refining.last_step)
        return self.measure_fit(moved, moved.image)

    def _verify(self, fit: Fit) -> VerifiedFit:
        image = self.image(fit)
        return VerifiedFit(fit, image, verifier_of(self.pair)(image).cost)


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
        """Take regions from other maps, unless they then look less like their images, or the coarse cost rises."""
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
        """Find regions in which two maps differ; regions that exchange their images are also joined."""
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
        """Whether many of a region's images lie where the images of another region do."""
        few, among = (x[:: max(1, len(x) // EXCHANGE.n_compared_vertices)] for x in (images, others))
        unit = np.sqrt(self.pair.target.body.area)
        distances: FloatArray = self.pair.target.distances.between(few, among) / unit
        return bool((distances.min(axis=1) < EXCHANGE.other_place / 2).mean() > EXCHANGE.min_overlap)
