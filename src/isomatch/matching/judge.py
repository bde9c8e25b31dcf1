"""`judge`: whether a map of any tool is right, compared with another map."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from isomatch._core.arrays import BodyVertices, BoolArray, FloatArray, Int, UserVertices
from isomatch._core.first_use import Shown
from isomatch._core.stage_timer import Progress
from isomatch._core.threads import in_background, serial_blas
from isomatch.correspondence import Correspondence
from isomatch.io import SurfaceLike
from isomatch.matching.assessment.confidence import DoubtfulRegion
from isomatch.matching.match import match
from isomatch.matching.parameters import JUDGING, MAP_DISTANCE
from isomatch.matching.problem import Problem, target_rows_near
from isomatch.matching.result import MatchResult
from isomatch.matching.verify import (
    Verification,
    Verifier,
    images_of,
    on_bodies,
    prepare_meshes,
    relative_cost,
)
from isomatch.settings import Config
from isomatch.shapes import PreparedShape
from isomatch.surfaces import connected_regions

Verdict = Literal["right", "doubtful", "wrong"]
MapLike: TypeAlias = Correspondence | ArrayLike | str | Path


@dataclass(frozen=True, eq=False)
class Judgement(Shown):
    """Whether a map is right, and why.

    Parameters
    ----------
    verdict : {"right", "doubtful", "wrong"}
    sentence : str
        The reason in words.
    given, reference : Verification
        Measures of the map, and of the one with which it is compared.
    ratio : float
        Cost of the map over the cost of the reference.
    distance : (n_source,) array of float
        Distance between the images of each source vertex under both maps, in √area of the target; nan unless both maps
        have an image, and on vertices that do not count.
    elsewhere : float
        Share of the area of the source that both maps send to different places, or only the reference maps.
    regions : tuple of DoubtfulRegion
        Connected regions of this area, the largest first.
    map, reference_map : Correspondence
        The map, and the one with which it is compared.
    result : MatchResult, optional
        The match that made the reference, if none was given.

    Examples
    --------
    >>> import numpy as np
    >>> from isomatch.datasets import example_pair
    >>> pose = example_pair()[0].mesh
    >>> print(judge(pose, pose, np.arange(pose.n_vertices), reference=np.arange(pose.n_vertices)))
    right: it agrees with the reference on 100.0% of the surface, and costs as much
    """

    verdict: Verdict
    sentence: str
    given: Verification
    reference: Verification
    ratio: float
    distance: FloatArray
    elsewhere: float
    regions: tuple[DoubtfulRegion, ...]
    map: Correspondence
    reference_map: Correspondence
    result: MatchResult | None = None

    def __str__(self) -> str:
        return f"{self.verdict}: {self.sentence}"


def judge(
    source: SurfaceLike | PreparedShape,
    target: SurfaceLike | PreparedShape,
    map: MapLike,
    reference: MapLike | None = None,
    config: Config | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> Judgement:
    """Judge whether a map of any tool is right, compared with isomatch's own or another map.

    Both maps are verified, see `verify`, and compared vertex by vertex. A map is wrong if it sends a region to a
    different place and costs clearly more than the reference. It is right if it agrees with the reference almost
    everywhere, and the reference is sure. Otherwise it is doubtful.

    Parameters
    ----------
    source, target : Mesh, PreparedShape, path_like, tuple or object
        As for `match`.
    map : Correspondence, (n_source,) array_like of int, or path_like
        Target vertex of each source vertex, −1 where there is none; or a file of such a map, see `read_map`.
    reference : Correspondence, array_like or path_like, optional
        A map that is assumed to be right. By default the shapes are matched.
    config, seed, progress
        As for `match`.

    Returns
    -------
    Judgement
        Printed, it gives the verdict and the reason.

    Raises
    ------
    MeshError
        If a shape is no mesh, or cannot be used.
    MapError
        If a map does not fit the shapes.

    Notes
    -----
    Takes half a second longer than a match. Only the largest component of each shape counts.

    Examples
    --------
    >>> import numpy as np
    >>> from isomatch.datasets import example_pair, ground_truth
    >>> source, target = example_pair()
    >>> true = ground_truth(source, target).vertices
    >>> judge(source.mesh, target.mesh, np.random.default_rng(0).permutation(true), reference=true).verdict
    'wrong'
    """

    def prepare_pair_and_map() -> tuple[Problem, Int[UserVertices, "n_source"]]:
        with serial_blas():
            pair = prepare_meshes(source, target, config, seed)
            return pair, images_of(map, pair)

    (pair, given), result = in_background(prepare_pair_and_map), None
    if reference is None:
        result = match(pair.source, pair.target, config=config, seed=seed, progress=progress)
        reference = result.map
    other = reference

    def compare() -> Judgement:
        with serial_blas():
            return _Comparison(pair, given, images_of(other, pair)).judgement(result)

    return in_background(compare)


class _Comparison:
    """Compares a map with a reference."""

    def __init__(self, pair: Problem, *images: Int[UserVertices, "n_source"]) -> None:
        verifier = Verifier(pair)
        self.pair, self.images = pair, images
        self.bodies = [on_bodies(pair, image) for image in self.images]
        self.given, self.reference = (verifier(image) for image in self.bodies)
        self.ratio = relative_cost(self.given.cost, self.reference.cost)

    def judgement(self, result: MatchResult | None) -> Judgement:
        """Judge the map by its cost and by where it differs from the reference."""
        source, (given, reference) = self.pair.source, self.bodies
        distance = np.full(len(given), np.nan)
        both = (given >= 0) & (reference >= 0)
        distance[both] = self.pair.target.distance(given[both], reference[both])
        images, cell = np.unique(given, return_inverse=True)
        is_coarse = len(images) < JUDGING.coarse_image_share * len(given)
        if is_coarse:  # all vertices that share an image get the least distance among them
            nearest = np.full(len(images), np.inf)
            np.fmin.at(nearest, cell, distance)
            distance = np.where(both, nearest[cell], np.nan)
        differs = (distance > MAP_DISTANCE.other_place) | ((given < 0) & (reference >= 0))
        areas = source.body.vertex_areas / source.body.area
        elsewhere = float(areas[differs].sum())
        maps = [Correspondence(image, self.pair.target.surface.n_vertices) for image in self.images]
        verdict, sentence = self._verdict(elsewhere, result)
        if is_coarse:
            sentence += f"; it is coarse, with {len(images)} different images of {len(given)} vertices"
        if elsewhere > JUDGING.min_region_area and self._exchanges_sides(given, reference):
            sentence += "; it exchanges sides that look alike, such as left and right"
        return Judgement(
            verdict,
            sentence,
            given=self.given,
            reference=self.reference,
            ratio=self.ratio,
            distance=np.where(source.body_vertex >= 0, distance[source.body_vertex], np.nan),
            elsewhere=elsewhere,
            regions=tuple(self._regions(differs, np.nan_to_num(distance, nan=np.inf), areas)),
            map=maps[0],
            reference_map=maps[1],
            result=result,
        )

    def _verdict(self, elsewhere: float, result: MatchResult | None) -> tuple[Verdict, str]:
        name = "the reference" if result is None else "isomatch's own map"
        times = f"{self.ratio:.3g}"
        cost = "costs as much" if times == "1" else f"costs {times} times as much"
        difference = f"it differs from {name} on {elsewhere:.1%} of the surface"
        if result and result.outcome.is_doubtful:
            doubt = f"that map is itself in doubt ({result.outcome.value})"
            return "doubtful", f"{difference}, and {cost}; {doubt}"
        if elsewhere <= JUDGING.min_region_area:
            agreement = f"it agrees with {name} on {1 - elsewhere:.1%} of the surface"
            if self.ratio <= JUDGING.max_right_ratio:
                return "right", f"{agreement}, and {cost}"
            return "doubtful", f"{agreement}, but {cost}"
        if self.ratio <= JUDGING.min_wrong_ratio:
            return "doubtful", f"{difference}, but {cost}; either map may be right there"
        return "wrong", f"{difference}, and {cost}"

    def _exchanges_sides(self, given: BodyVertices, reference: BodyVertices) -> bool:
        """Whether a map is much nearer to the reference composed with a symmetry of the target."""
        target, all_samples = self.pair.target, self.pair.source_vertices
        samples = all_samples[(given[all_samples] >= 0) & (reference[all_samples] >= 0)]
        if not len(samples):
            return False
        least = JUDGING.exchanged_ratio * target.mean_distance(given[samples], reference[samples])
        rows = target_rows_near(self.pair, BodyVertices(reference[samples]))
        images = (self.pair.target_vertices[s.image_row[rows]] for s in target.near_symmetries(np.inf))
        return any(target.mean_distance(given[samples], BodyVertices(image)) < least for image in images)

    def _regions(
        self, differs: BoolArray, distance: FloatArray, areas: FloatArray
    ) -> Iterator[DoubtfulRegion]:
        """Find connected regions in which maps differ, largest first, farthest vertices first."""
        source, (_, other) = self.pair.source, self.images
        found = connected_regions(source.mesh_body.edges, differs, areas)
        for members, share in islice(found, JUDGING.max_regions):
            if share >= JUDGING.min_region_area:
                users = source.user_vertex[members[np.argsort(-distance[members], kind="stable")]]
                yield DoubtfulRegion(users, share, "the two maps send it to different places", other[users])
