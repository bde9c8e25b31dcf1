"""The jobs of an agreement, as worker processes run them: triangles of maps, and maps replaced by compositions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np

from isomatch.collections.collection import Collection
from isomatch.collections.consistency import CONTRADICTED
from isomatch.collections.jobs import loaded_shape, row_of
from isomatch.collections.kept import digest_of
from isomatch.collections.map_file import PairMaps, Record
from isomatch.collections.pairs import Pair
from isomatch.correspondence import UNMATCHED
from isomatch.matching import Evidence, Outcome, lowered, match_both
from isomatch.runtime.memory import peak_memory
from isomatch.shapes import PreparedShape
from isomatch.values.arrays import FloatArray, IntArray

N_SAMPLES = 100  # spacing 0.1 √area: enough for a mean distance
LEAST_KNOWN = 0.5  # share of the samples that two maps must both match to be compared


class Repair(NamedTuple):
    """A contradicted pair, and the shapes over which trusted maps lead around it.

    Parameters
    ----------
    pair : (str, str)
        Names of the shapes.
    middles : tuple of str
        Other shapes.
    trust : tuple of float
        Weight of the path over each.
    outcomes : tuple of str
        Name of the least sure outcome along each.
    seed : int
        Seed of the match.
    """

    pair: Pair
    middles: tuple[str, ...]
    trust: tuple[float, ...]
    outcomes: tuple[str, ...]
    seed: int


@dataclass(frozen=True)
class CycleJob:
    """What all jobs of an agreement share.

    Parameters
    ----------
    collection : Collection
        The collection.
    prepared : dict of str to str
        Key of each prepared shape, by name.
    """

    collection: Collection
    prepared: dict[str, str]

    def images(self, pairs: Sequence[Pair]) -> list[Record]:
        """Map the samples of the shapes of pairs, there and back: ``images``; with the ``record`` of the file."""
        return [row_of(partial(self._images, pair)) for pair in pairs]

    def readings(self, images: IntArray, targets: Sequence[str]) -> list[Record]:
        """Compare all maps to each target with all compositions of two maps that end there.

        Parameters
        ----------
        images : (n, n, m) array of int
            Vertex of the second shape that each of m samples of the first is mapped to, −1 if not known.
        targets : sequence of str
            Names of shapes.

        Returns
        -------
        list of dict
            ``readings``: (n, n) array, see `inconsistency`.
        """
        return [row_of(partial(self._readings, images, target)) for target in targets]

    def repaired(self, repairs: Sequence[Repair]) -> list[Record]:
        """Replace maps by compositions, refined, where these agree better with the others and fit as well.

        Returns
        -------
        list of dict
            The row of the pair as the new map makes it, or ``refused``: why the map stays.
        """
        return [row_of(partial(self._repaired, repair)) for repair in repairs]

    def _images(self, pair: Pair) -> Record:
        maps = self.collection.maps(*pair)
        images = [
            correspondence.vertices[self._samples(name)]
            for correspondence, name in zip((maps.there, maps.back), pair)
        ]
        return {
            "images": images,
            "record": {**maps.record, "file": digest_of(self.collection.layout.maps(pair))},
        }

    def _readings(self, images: IntArray, target: str) -> Record:
        names = list(self.prepared)
        shape, column = self._shape(target), names.index(target)
        readings = np.full((len(names), len(names)), np.nan)
        for b in np.flatnonzero((images[:, column] >= 0).any(axis=1)):
            onwards = self.collection.maps(names[b], target).there.vertices
            readings[:, b] = _mean_distances(shape, _mapped(onwards, images[:, b]), images[:, column])
        return {"readings": readings}

    def _repaired(self, repair: Repair) -> Record:
        pair, turned = repair.pair, repair.pair[::-1]
        old = self.collection.maps(*pair)
        paths, paths_back = (self._paths(ends, repair.middles) for ends in (pair, turned))
        source, target = map(self._shape, pair)
        samples, samples_back = map(self._samples, pair)
        trust = np.array(repair.trust)
        ends = paths[:, samples]
        apart = np.array([_mean_distances(target, end[None], ends) for end in ends])
        best = int(np.nan_to_num(apart, nan=1.0).dot(trust).argmin())
        config = self.collection.config
        rematched = match_both(
            source,
            target,
            initial_map=paths[best],
            config=replace(config, hypotheses="given"),
            seed=repair.seed,
        )

        def disagreement(there: IntArray, back: IntArray) -> float:
            forth = _mean_distances(target, ends, there[None, samples])
            home = _mean_distances(source, paths_back[:, samples_back], back[None, samples_back])
            apart, weights = np.concatenate([forth, home]), np.tile(trust, 2)
            finite = np.isfinite(apart)
            return float(np.average(apart[finite], weights=weights[finite])) if finite.any() else np.inf

        before = disagreement(old.there.vertices, old.back.vertices)
        after = disagreement(rematched.there.map.vertices, rematched.back.map.vertices)
        over = repair.middles[best]
        if not after < min(before, CONTRADICTED):
            return {
                "refused": f"the composition over {over} agrees no better once refined: {after:.2f} √area"
            }
        if any(result.outcome is Outcome.HINTS_CONTRADICTED for result in rematched):
            return {"refused": f"the composition over {over} changes when it is refined"}
        side = {"preserve": 1, "reverse": -1, "any": 0}[config.orientation]
        if any(side * result.quality.orientation < 0 for result in rematched):
            return {"refused": f"the composition over {over} does not {config.orientation} the orientation"}
        worst = float(np.nanmax([0.0, *(1 / result.quality.rival for result in rematched)]))
        if worst > config.outcome.tie:
            return {
                "refused": f"the composition over {over} fits worse than another map, by a factor {worst:.2f}"
            }
        note = (
            f"other maps contradict the map that was matched, by {before:.2f} √area; this one is their composition over "
            f"{over}, refined, and its outcome is at most as sure as theirs"
        )
        of_composition = Evidence.of(Outcome[repair.outcomes[best]])
        results = [
            replace(
                result,
                outcome=lowered(result.outcome, of_composition),
                notes=(note, *result.notes),
            )
            for result in rematched
        ]
        record = {
            **old.record,
            "there": results[0].to_dict(),
            "back": results[1].to_dict(),
            "memory": peak_memory(),
            "replaced_by": [pair[0], over, pair[1]],
        }
        file = self.collection.layout.maps(pair)
        PairMaps.of(results[0], results[1], record).save(file)
        return {**record, "file": digest_of(file)}

    def _paths(self, ends: Pair, middles: Sequence[str]) -> IntArray:
        """Image of each vertex (q, n) of the first of two shapes under the maps over each of q others."""
        first, last = ends
        maps = self.collection.maps
        return np.array(
            [_mapped(maps(b, last).there.vertices, maps(first, b).there.vertices) for b in middles]
        )

    def _shape(self, name: str) -> PreparedShape:
        file = self.collection.layout.prepared(self.prepared[name])
        return loaded_shape(file, self.collection.config)

    def _samples(self, name: str) -> IntArray:
        shape = self._shape(name)
        return np.resize(shape.user_vertex[shape.sample_vertices[:N_SAMPLES]], N_SAMPLES)


def _mapped(image: IntArray, vertices: IntArray) -> IntArray:
    """Images of vertices, of which −1 have none."""
    return np.where(vertices >= 0, image[vertices], UNMATCHED)


def _mean_distances(shape: PreparedShape, first: IntArray, second: IntArray) -> FloatArray:
    """Mean distance (q,) between vertices of a surface in rows (q, m) that broadcast; nan where few are matched."""
    a, b = (
        np.where(rows >= 0, shape.body_vertex[rows], UNMATCHED) for rows in np.broadcast_arrays(first, second)
    )
    matched = (a >= 0) & (b >= 0)
    apart = np.zeros(a.shape)
    apart[matched] = shape.distance(a[matched], b[matched])
    count = matched.sum(axis=1)
    enough = count >= LEAST_KNOWN * a.shape[1]
    return np.where(enough, apart.sum(axis=1) / np.maximum(count, 1), np.nan)
