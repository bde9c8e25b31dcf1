"""Shapes with holes matched as complete ones: caps close the holes, and what lands on a cap has no image."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from isomatch._arrays import FloatArray, IntArray
from isomatch.correspondence import Correspondence, PrecisePoints
from isomatch.errors import IsomatchError
from isomatch.geodesics import distance_along_edges_to_nearest
from isomatch.matching.complete import CompleteMatch, complete_result, match_complete
from isomatch.matching.hints import Hints
from isomatch.matching.pair import ShapePair
from isomatch.matching.parts.role import Part
from isomatch.matching.prepare import PreparedShape
from isomatch.matching.result import MatchResult
from isomatch.matching.stage_timer import StageTimer
from isomatch.surfaces import vertex_normals


@dataclass(frozen=True, eq=False)
class ClosedMatch:
    """The match of two shapes whose holes are capped.

    Parameters
    ----------
    pair : ShapePair
        The shapes as they are.
    found : CompleteMatch
        The match of the capped ones.
    """

    pair: ShapePair
    found: CompleteMatch

    def image_of(self, part: Part) -> IntArray:
        """Vertex of the other shape for each vertex of a part: the nearest one that is on no cap."""
        of_source, of_target = self.found.embedding
        if part == "source":
            return _images(self.pair.source, of_source, self.pair.target, of_target)
        return _images(self.pair.target, of_target, self.pair.source, of_source)

    def result(self, timer: StageTimer, seed: int) -> MatchResult:
        """Sum up the map, in the users' vertices; what lands on a cap is unmatched."""
        closed = complete_result(self.found, timer, seed, may_stretch=False)
        found = self._opened(closed.map)
        alternatives = tuple(replace(each, map=self._opened(each.map)) for each in closed.alternatives)
        quality = replace(closed.quality, matched=float(found.matched.mean()), coverage=self._coverage(found))
        return replace(closed, map=found, alternatives=alternatives, quality=quality)

    def _coverage(self, found: Correspondence) -> float:
        """Share of the target's area that is near an image."""
        target = self.pair.target
        images = np.unique(target.body_vertex[found.vertices[found.matched]])
        gap, _ = distance_along_edges_to_nearest(target.body, images)
        near = gap < self.pair.config.outcome.coverage_radius
        return float(target.body.vertex_areas[near].sum() / target.body.area)

    def _opened(self, closed: Correspondence) -> Correspondence:
        """Take the caps off a map of the capped bodies."""
        source, target = self.pair.source, self.pair.target
        rows = slice(source.body.n_vertices)
        n_target = target.body.n_vertices
        vertices, corners, weights = closed.vertices[rows], closed.faces[rows], closed.barycentric[rows]
        capped = target.capped.triangles
        assert capped is not None
        gap, owner = distance_along_edges_to_nearest(capped, target.capped.body_vertex[:n_target])
        gap, owner = (
            target.capped.lift(values, missing)[vertices] for values, missing in ((gap, np.inf), (owner, 0))
        )
        matched = (vertices >= 0) & (gap < capped.edge_lengths.mean())  # an edge beyond the rim is no miss
        nearest = target.capped.user_vertex[owner]
        points = PrecisePoints.at_vertices(np.where(matched, nearest, 0))
        inside = matched & (corners < n_target).all(axis=1)
        points.corners[inside], points.barycentric[inside] = corners[inside], weights[inside]
        return source.correspondence(target, points, matched)


def match_closed(pair: ShapePair, hints: Hints, timer: StageTimer) -> ClosedMatch | None:
    """Match two shapes with all their holes closed, by what is known of landmarks.

    Returns
    -------
    ClosedMatch or None
        None if caps turn a shape inside out, as where a camera saw one side of it, or if no map was found.
    """
    capped = ShapePair(pair.source.capped, pair.target.capped, pair.config)
    if _turned(pair.source) or _turned(pair.target):
        return None
    landmarks = np.column_stack(
        [capped.source.body_vertex[hints.landmarks[:, 0]], capped.target.body_vertex[hints.landmarks[:, 1]]]
    )
    nothing = tuple(np.zeros((shape.body.n_vertices, 0)) for shape in (capped.source, capped.target))
    known = Hints(landmarks, hints.known, (nothing[0], nothing[1]))
    try:
        return ClosedMatch(pair, match_complete(capped, known, timer))
    except IsomatchError:
        return None


def _turned(shape: PreparedShape) -> bool:
    """Whether the capped body has its outside where the body has its inside."""
    body, closed = shape.triangles, shape.capped.triangles
    assert body is not None
    assert closed is not None
    normals = vertex_normals(closed.vertices, closed.faces)[shape.capped.body_vertex[: body.n_vertices]]
    return bool(np.einsum("ij,ij", normals, vertex_normals(body.vertices, body.faces)) < 0)


def _images(part: PreparedShape, of_part: FloatArray, whole: PreparedShape, of_whole: FloatArray) -> IntArray:
    """Vertices (n_part,) of the body of a whole, by coordinates of the capped bodies of part and whole."""
    rows = part.capped.body_vertex[: part.body.n_vertices]
    real = whole.capped.body_vertex[: whole.body.n_vertices]
    image = whole.capped.index.vertices(of_whole, of_part[rows])
    if len(real) < whole.capped.body.n_vertices:
        image = distance_along_edges_to_nearest(whole.capped.body, real)[1][image]
    return whole.capped.user_vertex[image]
