"""The match of a part to a whole: units, starts, refinement and choice."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from isomatch._arrays import BoolArray, IntArray
from isomatch._cached import cached_property
from isomatch._threads import parallel_map
from isomatch.correspondence import PrecisePoints, nearest_with_normals, register_as_rigid_as_possible
from isomatch.errors import NotConvergedError
from isomatch.geodesics import distance_along_edges_to_nearest
from isomatch.matching.config import Config
from isomatch.matching.parts.part_pair import NO_LANDMARKS, PartPair
from isomatch.matching.parts.part_refinement import PartRefinement, WholeCoordinates
from isomatch.matching.parts.part_starts import PartStart, PartStarts, completed, composed, self_maps
from isomatch.matching.prepared_shape import PreparedShape
from isomatch.matching.select import nearest_to_hints
from isomatch.surfaces import Mesh

ON_EDGE = 1e-6  # barycentric coordinate below which a point of a triangle lies on an edge
SHORTEST = 1e-9  # edge, in √area, so that logarithms are finite
LEAST_SCORE = 1e-12  # so that scores have a ratio where a part is copied onto itself without error
TWISTED = 10.0  # factor on the score of a map whose orientation is less than half of the clearest


@dataclass(frozen=True, eq=False)
class PartFit:
    """A refined map of a part.

    Parameters
    ----------
    pair : PartPair
        The shapes, in the unit of the map.
    image : (r,) array of int
        Vertices of the whole for the vertices of the refinement.
    misfit : float
        Mean distance of these vertices from their images in the last coordinates.
    stress : float
        Mean cost of the images of the anchors, see `PartPair.stress`.
    orientation : float
        Mean cosine of the normals.
    local_stress, curvature_mismatch : float
        See `PartRefinement`.
    hint_error : float
        Mean distance from the images that hints ask for, in √area of the whole; 0 before the end, and without hints.
    """

    pair: PartPair
    image: IntArray
    misfit: float
    stress: float
    orientation: float
    local_stress: float
    curvature_mismatch: float
    hint_error: float = 0.0

    @property
    def score(self) -> float:
        """What speaks against the map."""
        exponent = self.pair.config.parts.stress_exponent
        shape = np.sqrt(self.local_stress * self.curvature_mismatch)
        return float(max(self.misfit * self.stress**exponent * shape, LEAST_SCORE))


@dataclass(frozen=True, eq=False)
class PartMatch:
    """What the match of a part found.

    Parameters
    ----------
    refining : _Refining
    fits : tuple of PartFit
        Refined maps: the one selected, then the others, best first.
    scores : tuple of float
        What speaks against each.
    closed : float
        What speaks against the map with the holes closed, over that against the best.
    """

    refining: _Refining
    fits: tuple[PartFit, ...]
    scores: tuple[float, ...]
    closed: float = np.inf

    @property
    def pair(self) -> PartPair:
        """The shapes, in the unit of the best map."""
        return self.fits[0].pair

    @property
    def rival(self) -> float:
        """Score of the best map that differs, over that of the best; inf if none does."""
        best, whole = self.fits[0], self.pair.whole
        for fit, score in zip(self.fits[1:], self.scores[1:]):
            if whole.mean_distance(fit.image, best.image) > self.pair.config.parts.apart:
                return max(1.0, score / self.scores[0])  # one that lost to hints ties
        return np.inf

    @cached_property
    def share(self) -> float:
        """Area of the part over that of the whole, by the best map."""
        refinement = self.refining.at(self.pair, self.pair.config.n_refine)
        return refinement.local_unit(self.fits[0].image) ** 2

    @cached_property
    def bent(self) -> Mesh:
        """The part bent onto the whole by the best map."""
        (part, whole), index = self.pair.meshes, self.pair.whole.index
        everywhere = np.arange(part.n_vertices)
        refinement = self.refining.at(self.pair, self.pair.config.n_refine)
        of_part, of_whole = refinement.embedding(self.fits[0].image, 10**6, everywhere)
        start = index.points(of_whole, of_part).interpolated(whole.vertices)
        scaled, lengths = part.moved(self.pair.unit * part.vertices), self.pair.config.parts.bending
        return part.moved(register_as_rigid_as_possible(scaled, whole, index, start, lengths))

    @cached_property
    def onto_whole(self) -> PrecisePoints:
        """Points of the whole for the vertices of the part."""
        return nearest_with_normals(self.bent, self.pair.meshes[1], self.pair.whole.index)

    @property
    def bend_misfit(self) -> float:
        """What speaks against the bent part: mean |log| of the stretch of its edges × mean distance from the whole."""
        part, whole = self.pair.meshes
        after, before = (np.maximum(mesh.edge_lengths, SHORTEST) for mesh in (self.bent, part))
        stretch = np.log(after / (self.pair.unit * before))
        apart = self.onto_whole.interpolated(whole.vertices) - self.bent.vertices
        return float(np.abs(stretch).mean() * np.linalg.norm(apart, axis=1).mean())

    def onto_part(self) -> tuple[PrecisePoints, BoolArray]:
        """Points of the part for the vertices of the whole, and which of these the part covers.

        A vertex may lie somewhat off the part, but less so off its boundary, beyond which nothing is known.
        """
        bent, whole, settings = self.bent, self.pair.meshes[1], self.pair.config.parts
        points = nearest_with_normals(whole, bent, self.pair.part.index)
        gap = np.linalg.norm(points.interpolated(bent.vertices) - whole.vertices, axis=1)
        of_rim = np.zeros(bent.n_vertices, dtype=bool)
        of_rim[bent.boundary_edges] = True
        on_rim = (of_rim[points.corners] | (points.barycentric < ON_EDGE)).all(axis=1)
        return points, gap <= np.where(on_rim, settings.rim, settings.off)


def match_part(
    part: PreparedShape,
    whole: PreparedShape,
    config: Config,
    landmarks: IntArray = NO_LANDMARKS,
    closed: IntArray | None = None,
    known: IntArray = NO_LANDMARKS,
) -> PartMatch:
    """Match a part to a whole.

    Parameters
    ----------
    part, whole : PreparedShape
        Meshes, in the same units.
    config : Config
    landmarks : (l, 2) array of int
        Vertices of the bodies of part and whole that correspond.
    closed : (n_part,) array of int, optional
        The map that was found with the holes closed; it is refined and contends as well.
    known : (q, 2) array of int
        Vertices of part and whole that correspond by another map. This map contends too, and wins a tie.

    Returns
    -------
    PartMatch

    Raises
    ------
    NotConvergedError
        If no map that keeps the orientation was found.
    """
    settings = config.parts
    onto_itself = [] if len(landmarks) else self_maps(whole, config)  # landmarks tell the sides
    refining = _Refining(whole, config)
    pair = PartPair.of(part, whole, config, landmarks)
    only_known = config.hypotheses == "given" and len(known) > 0
    starts = [] if only_known else PartStarts(pair, refining.coordinates.signatures, onto_itself)()
    fits = [fit for fit in parallel_map(refining.rough, starts) if fit]
    led = _filled(part, known) if len(known) else None
    if not fits and closed is None and led is None:
        raise NotConvergedError(
            "no map of the part keeps the orientation of the faces; give three to five landmarks, or start = 'pose' if "
            "the shapes are roughly aligned in space"
        )
    fits += [
        fit
        for fit in parallel_map(
            lambda each: refining.varied(*each),
            [
                (fit, image_row)
                for fit in sorted(fits, key=_promise)[: settings.n_varied]
                for image_row in onto_itself
            ],
        )
        if fit
    ]
    fits.sort(key=_promise)
    fits = fits[: settings.n_contenders]
    measured = None
    for image in (closed, led):
        if image is not None:
            unit = pair.unit_of(image[pair.anchors])
            there = pair.with_unit(float(np.clip(unit, pair.units[0], pair.units[-1])))
            whole_map = refining.measured(there, image[part.sample_vertices[: config.n_refine]])
            fits.append(replace(whole_map, image=image[part.sample_vertices[: settings.n_rough]]))
            measured = whole_map if image is closed else measured
    fits = parallel_map(refining.fine, fits)
    if led is not None:
        asked = led[part.sample_vertices[: config.n_refine]]
        fits = [replace(fit, hint_error=whole.mean_distance(fit.image, asked)) for fit in fits]
    top = max(fit.orientation for fit in fits)

    def score(fit: PartFit) -> float:
        return fit.score * (1 if fit.orientation >= 0.5 * top else TWISTED)

    fits.sort(key=score)
    tied = [fit for fit in fits if score(fit) <= settings.tie * score(fits[0])]
    winner = nearest_to_hints(tied, config.selection)[0]
    fits.sort(key=lambda fit: fit is not winner)
    return PartMatch(
        refining,
        tuple(fits),
        tuple(score(fit) for fit in fits),
        np.inf if measured is None else score(measured) / score(fits[0]),
    )


def _fit(
    refinement: PartRefinement, pair: PartPair, image: IntArray, misfit: float, anchors: IntArray, k: int
) -> PartFit:
    """Gather the evidence for a map, and for the images that it gives the anchors."""
    return PartFit(
        pair,
        image,
        misfit,
        pair.stress(anchors),
        refinement.orientation(image, k),
        refinement.local_stress(image),
        refinement.curvature_mismatch(image),
    )


def _filled(part: PreparedShape, known: IntArray) -> IntArray:
    """Image (n_part,) of each vertex of a part under a map that is known at some: elsewhere that of the nearest one."""
    _, nearest = distance_along_edges_to_nearest(part.body, np.unique(known[:, 0]))
    image = np.zeros(part.body.n_vertices, dtype=np.int64)
    image[known[::-1, 0]] = known[::-1, 1]
    filled: IntArray = image[nearest]
    return filled


def _promise(fit: PartFit) -> float:
    # a map that is twisted in places may still become the right one, so the orientation only counts with its root
    return float(fit.score / np.sqrt(max(fit.orientation, 0.1)))


class _Refining:
    """The two refinements of a start, with what they share for all starts in the same unit."""

    def __init__(self, whole: PreparedShape, config: Config) -> None:
        self._config = config
        self.coordinates = WholeCoordinates(whole, config.refining)
        self._known: dict[tuple[float, int], PartRefinement] = {}

    def at(self, pair: PartPair, n_rows: int) -> PartRefinement:
        """Return the refinement of some vertices in the unit of a pair."""
        key = pair.unit, n_rows
        if key not in self._known:
            signatures = self.coordinates.signatures.of_part(pair)
            self._known[key] = PartRefinement(pair, self.coordinates, signatures, n_rows)
        return self._known[key]

    def rough(self, start: PartStart) -> PartFit | None:
        """Refine some vertices a little; None for a mirror image."""
        pair, refinement = start.pair, self.at(start.pair, self._config.parts.n_rough)
        vertices = refinement.vertices[: self._config.n_search]
        return self._roughly(pair, refinement.extended(vertices, start.dense(vertices), 40))

    def varied(self, fit: PartFit, image_row: IntArray) -> PartFit | None:
        """Compose a roughly refined map with a map of the whole onto itself, and refine it again."""
        return self._roughly(fit.pair, composed(fit.pair.whole, fit.image, image_row))

    def measured(self, pair: PartPair, image: IntArray) -> PartFit:
        """Measure a map of the refinement vertices that was found otherwise, as if it were refined."""
        refinement = self.at(pair, self._config.n_refine)
        _, misfit = refinement.refined(image, self._config.refining.final_sizes[-1:])
        return self._final(refinement, pair, image, misfit)

    def _final(self, refinement: PartRefinement, pair: PartPair, image: IntArray, misfit: float) -> PartFit:
        last = min(200, len(pair.whole.laplace.values))
        anchors = completed(pair, refinement.at(image, last, pair.anchors), 2)
        return _fit(refinement, pair, image, misfit, anchors, 60)

    def _roughly(self, pair: PartPair, image: IntArray) -> PartFit | None:
        refinement = self.at(pair, self._config.parts.n_rough)
        if refinement.orientation(image, 40) < 0:
            return None
        image, misfit = refinement.refined(image, self._config.parts.sizes)
        anchors = refinement.at(image, 70, pair.anchors)
        return _fit(refinement, pair, image, misfit, anchors, 40)

    def fine(self, fit: PartFit) -> PartFit:
        """Refine a roughly refined map to the end."""
        settings, rough = self._config.refining, self.at(fit.pair, self._config.parts.n_rough)
        pair = fit.pair.with_unit(rough.local_unit(fit.image))
        refinement = self.at(pair, self._config.n_refine)
        image = refinement.extended(rough.vertices, fit.image, 70)
        image, _ = refinement.refined(image, settings.sizes_without_positions, with_positions=False)
        image, misfit = refinement.refined(image, (*settings.sizes_with_positions, *settings.final_sizes))
        return self._final(refinement, pair, image, misfit)
