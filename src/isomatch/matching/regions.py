"""Regions of doubt: where on the source a map may be wrong, and why."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from isomatch.correspondence import UNMATCHED
from isomatch.matching.confidence import ERROR_RADIUS, diffused
from isomatch.shapes import PreparedShape
from isomatch.surfaces import linked
from isomatch.values.arrays import FloatArray, IntArray

ANOTHER_MAP = "another map that fits nearly as well sends it elsewhere"
LOOKS_UNLIKE = "it looks unlike its image"

MAIN = 0.25  # share of a region, from which what is doubtful there is a reason
LEAST_KNOWN = 0.5  # share of a neighbourhood, below which its mismatch is not known
UNLIKE_ERROR = (
    0.2  # mean error in regions that look unlike their images: docs/benchmarks.md, regions of doubt
)
LEAST_AREA = 0.005  # share of the surface, below which no region is told; half a hand


@dataclass(frozen=True, eq=False)
class DoubtfulRegion:
    """A connected region of the source where the map may be wrong.

    Parameters
    ----------
    vertices : (m,) array of int
        Source vertices of the region, the most doubtful first.
    area : float
        Share of the source's area.
    reason : str
        Why it is doubtful, in words.
    rival : (m,) array of int, optional
        Target vertices to which another map sends them, if one is the reason.
    """

    vertices: IntArray
    area: float
    reason: str
    rival: IntArray | None = None

    def __repr__(self) -> str:
        return f"DoubtfulRegion({self})"

    def __str__(self) -> str:
        return f"{self.area:.1%} of the area around vertex {self.vertices[0]}: {self.reason}"

    def to_dict(self) -> dict[str, Any]:
        """Return its area, its size, its most doubtful vertex with the image under the other map, and the reason."""
        return {
            "area": self.area,
            "n_vertices": len(self.vertices),
            "vertex": int(self.vertices[0]),
            "rival": None if self.rival is None else int(self.rival[0]),
            "reason": self.reason,
        }

    @classmethod
    def from_dict(cls, summary: Mapping[str, Any]) -> DoubtfulRegion:
        """Restore what `to_dict` told of a region: of its vertices the most doubtful one."""
        rival = summary["rival"]
        return cls(
            np.array([summary["vertex"]]),
            summary["area"],
            summary["reason"],
            None if rival is None else np.array([rival]),
        )


def doubtful_regions(
    shape: PreparedShape,
    doubts: Mapping[str, FloatArray],
    least: float = LEAST_AREA,
    rival: IntArray | None = None,
) -> tuple[DoubtfulRegion, ...]:
    """Find the connected regions of a body where a map is doubtful for any reason, the largest first.

    Parameters
    ----------
    shape : PreparedShape
        The source.
    doubts : mapping of str to (n_s,) array of float
        How doubtful the image of each vertex is, by reason: 1 is the bound, and nan where nothing is known.
    least : float
        Share of the surface that a region has at least.
    rival : (n_s,) array of int, optional
        Image of each vertex under another map; `ANOTHER_MAP` is the reason for which regions have it.

    Returns
    -------
    tuple of DoubtfulRegion
        In vertices of the bodies.
    """
    body = shape.body
    values = np.array([np.nan_to_num(each) for each in doubts.values()]).reshape(-1, body.n_vertices)
    most = values.max(axis=0, initial=0.0)
    inside = most > 1.0
    i, j = body.edges[inside[body.edges].all(axis=1)].T
    n, label = linked(body.n_vertices, (i, j))
    shares = shape.share * np.bincount(label, inside * body.vertex_areas, n) / body.vertex_areas.sum()
    regions = []
    for region in np.argsort(-shares, kind="stable")[: (shares > least).sum()]:
        vertices = np.flatnonzero((label == region) & inside)
        vertices = vertices[np.argsort(-most[vertices], kind="stable")]
        reasons = [reason for reason, each in zip(doubts, values) if (each[vertices] > 1.0).mean() > MAIN]
        other = rival if ANOTHER_MAP in reasons else None
        regions.append(
            DoubtfulRegion(
                vertices,
                float(shares[region]),
                " and ".join(reasons),
                None if other is None else other[vertices],
            )
        )
    return tuple(regions)


def unlike(shape: PreparedShape, mismatch: FloatArray, bound: float) -> FloatArray:
    """Mean mismatch of the neighbourhood of each vertex of a body, over its bound: (n_s,), nan where little is known."""
    known = np.isfinite(mismatch)
    total, weight = (
        diffused(shape, each, ERROR_RADIUS) for each in (np.where(known, mismatch, 0.0), known.astype(float))
    )
    return np.where(weight > LEAST_KNOWN, total / np.maximum(weight, LEAST_KNOWN) / bound, np.nan)


def lifted(region: DoubtfulRegion, source: PreparedShape, target: PreparedShape) -> DoubtfulRegion:
    """Carry a region of the bodies to the users' vertices."""
    rank = np.full(source.body.n_vertices, -1)
    rank[region.vertices] = np.arange(len(region.vertices))
    ranks = source.lift(rank, -1)
    vertices = np.flatnonzero(ranks >= 0)
    vertices = vertices[np.argsort(ranks[vertices], kind="stable")]
    rival = None if region.rival is None else target.user_vertex[region.rival[ranks[vertices]]]
    return replace(region, vertices=vertices, rival=rival)


def doubt_in(regions: Sequence[DoubtfulRegion], n_vertices: int) -> FloatArray:
    """Error to be expected at the vertices of a body (n_s,) that look unlike their images."""
    doubt = np.zeros(n_vertices)
    for region in regions:
        if LOOKS_UNLIKE in region.reason:
            doubt[region.vertices] = UNLIKE_ERROR
    return doubt


def packed(regions: Sequence[DoubtfulRegion]) -> dict[str, IntArray]:
    """Arrays for a file: sizes (r,), and vertices and rivals (d,) of one region after the other; −1 is no rival."""
    vertices = [region.vertices for region in regions]
    rivals = [np.full(len(r.vertices), UNMATCHED) if r.rival is None else r.rival for r in regions]
    nothing = np.zeros(0, dtype=np.int64)
    return {
        "region_sizes": np.array([len(each) for each in vertices], dtype=np.int64),
        "region_vertices": np.concatenate([nothing, *vertices]),
        "region_rivals": np.concatenate([nothing, *rivals]),
    }


def unpacked(arrays: dict[str, Any], about: Sequence[tuple[float, str]]) -> tuple[DoubtfulRegion, ...]:
    """Take the regions out of what was read from a file; none of a file that was written before there were any."""
    if "region_sizes" not in arrays:
        return ()
    ends = np.cumsum(arrays.pop("region_sizes"))
    vertices, rivals = (np.split(arrays.pop(f"region_{name}"), ends)[:-1] for name in ("vertices", "rivals"))
    return tuple(
        DoubtfulRegion(which, area, reason, rival if (rival != UNMATCHED).any() else None)
        for which, rival, (area, reason) in zip(vertices, rivals, about, strict=True)
    )
