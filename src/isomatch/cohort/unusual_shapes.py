"""Outliers of a collection: in other units, twice, mirrored, with holes, broken, unlike."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from typing import Any, Literal, NamedTuple

import numpy as np

from isomatch.cohort.ledger import N_RANKS, Rows, ShapeRow
from isomatch.cohort.plan import Plan, common_unit
from isomatch.cohort.shape_statistics import likely_units, size_factors, size_in_words
from isomatch.cohort.snapshot import Snapshot
from isomatch.repair import without_seams
from isomatch.surfaces import Mesh, PointCloud

# A copy has another size than its original if the logarithm of the ratio of their sizes exceeds this, 1 %; chosen.
MIN_RESCALING = 0.01
MAX_CLOSED_BOUNDARY = 0.05  # √area; largest total length of the boundaries of a surface called closed; chosen
OutlierKind = Literal["broken", "units", "twice", "mirrored", "holes", "unlike"]  # kinds of outliers
# kinds that a run reports before it matches; broken shapes are reported when their preparation fails
KINDS_BEFORE_MATCHING: tuple[OutlierKind, ...] = ("units", "twice", "mirrored", "holes")
NOT_UNLIKE = "no"  # value in the column ``unlike`` of a shape that was compared and is like the others
# Share of a shape's size: distances of vertices from the centroid that differ by at most this are taken as equal, since
# files may have single precision.
SAME_DISTANCE = 1e-5
# The ``handedness`` of mirror images differs by more than this (it has no unit); less is a rounding error; chosen.
MIN_HANDEDNESS = 1e-6


class Outlier(NamedTuple):
    """A shape that does not fit in a collection: kind, name, and reason with the remedy."""

    kind: OutlierKind
    name: str
    reason: str


def holes_of(surface: Mesh) -> tuple[int, float]:
    """Count the boundaries of a surface without seams, and measure their length in √area."""
    lengths = without_seams(surface)[0].boundary_lengths
    return len(lengths), float(lengths.sum() / np.sqrt(surface.area))


def outliers(collection: Plan, rows: Rows) -> list[Outlier]:
    """Find shapes that do not fit in a collection as they are; look at them before its statistics.

    - *broken*: it cannot be read or prepared.
    - *units*: its size, the root of its area, is more than twice or less than half the median, and
      an outlier, see `size_factors`. A given unit is taken into account.
    - *twice*: it equals another shape up to a motion, its size, and the order of vertices and
      faces.
    - *mirrored*: it is the mirror image of another shape or, by the maps, of most others.
    - *holes*: it has a boundary, and most others have none.
    - *unlike*: in the topology of the template it is far from all others, see `doubtful_shapes`.

    Rows of prepared shapes suffice for all kinds but *unlike* and the maps of *mirrored*.
    """
    known = Snapshot(collection, rows)
    tried = [(name, rows.shapes[name]) for name in collection.names if name in rows.shapes]
    done = {name: row for name, row in tried if row.state == "done"}
    failed = [(name, row.error) for name, row in tried if row.state == "failed"]
    odd = [Outlier("broken", name, f"cannot be used: {error}") for name, error in failed]
    odd += _in_other_units(Snapshot(collection, Rows(done)))
    mirrored = dict[str, str]()
    for name, pair in known.mirror_images.items():
        why_not = rows.pairs[pair].not_reflected.get(name)
        remedy = f"but is not reflected: {why_not}" if why_not else "run again with --reflect auto"
        mirrored[name] = f"is mirrored against the others, by its maps; {remedy}"
    for alike in alike_shapes(done):
        if alike.kind == "mirror image":
            mirrored[alike.name] = f"is the mirror image of {alike.other}, the same shape reflected"
            continue
        how = "the same file as" if alike.is_equal else "the same shape as"
        larger = f", {alike.factor:.4g} times as large" if abs(np.log(alike.factor)) > MIN_RESCALING else ""
        odd.append(Outlier("twice", alike.name, f"is {how} {alike.other}{larger}; remove one of them"))
    odd += [Outlier("mirrored", name, reason) for name, reason in mirrored.items()]
    odd += _with_holes(done)
    unlike = [line for line in known.surface_rows().values() if line.unlike not in ("", NOT_UNLIKE)]
    return odd + [Outlier("unlike", x.name, x.unlike) for x in unlike if x.name in done.keys() - mirrored]


def _in_other_units(known: Snapshot) -> Iterator[Outlier]:
    units, rows = known.plan.units, known.rows
    areas = {name: row.area for name, row in rows.shapes.items() if 0 < row.area < np.inf}
    sizes = {name: area**0.5 * known.scales.get(name, 1.0) for name, area in areas.items()}
    is_unclear = not sizes.keys().isdisjoint(units) and common_unit(units, rows) is None
    for name, factor in zip(sizes, size_factors(np.array(list(sizes.values()))).tolist()):
        if is_unclear and name in units:
            problem = f"is said to be in {units[name]}, which fits no unit of the others"
            yield Outlier("units", name, f"{problem}; give theirs, too")
        elif factor != 1:
            yield Outlier("units", name, explain_unit(name, factor))


def explain_unit(name: str, factor: float) -> str:
    """Tell how many times as large as the others a shape is, and which unit would explain it."""
    units = likely_units(factor)
    return f"{size_in_words(factor)} (--units {name}={units[0] if units else 'UNIT'})"


def _with_holes(shapes: dict[str, ShapeRow]) -> Iterator[Outlier]:
    holes = {name: row.holes for name, row in shapes.items() if row.holes}
    is_open = {name: length > MAX_CLOSED_BOUNDARY for name, (_, length) in holes.items()}
    if not 0 < sum(is_open.values()) < len(is_open) / 2:
        return
    for name, (count, length) in holes.items():
        if is_open[name]:
            what = "a hole" if count == 1 else f"{count} holes"
            yield Outlier("holes", name, f"has {what}, {length:.3g} √area around, and most others are closed")


class Alike(NamedTuple):
    """A shape that equals an earlier one up to a motion, its size, and the order of vertices."""

    name: str
    other: str
    kind: Literal["copy", "mirror image"]
    factor: float  # size of the shape divided by the size of the other
    is_equal: bool  # whether vertices and faces are equal, also in their order


def likeness_of(surface: Mesh | PointCloud) -> dict[str, Any]:
    """Describe the vertices of a surface, for a `ShapeRow`, by numbers that no motion changes."""
    used = np.isfinite(surface.vertices).all(axis=1)
    if isinstance(surface, Mesh):
        is_corner = np.zeros(surface.n_vertices, dtype=bool)
        is_corner[surface.faces[((surface.faces >= 0) & (surface.faces < len(is_corner))).all(axis=1)]] = True
        used &= is_corner
    points = np.unique(surface.vertices[used], axis=0)  # vertices at one position, as at seams, count once
    if len(points) < 2:
        return {}
    centred = points - points.mean(axis=0)
    distances = np.sort(np.linalg.norm(centred, axis=1))
    spread = float(np.sqrt((distances**2).mean()))  # root mean square distance from the centroid
    ranks = np.round(np.linspace(0, len(points) - 1, N_RANKS)).astype(int)
    axes = np.linalg.svd(centred.T @ centred)[0]
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    along = centred @ axes / spread
    # the handedness, the product of the skewnesses along the principal axes, changes its sign by a reflection
    skewness = (along**3).mean(axis=0) / np.maximum((along**2).mean(axis=0), SAME_DISTANCE**2) ** 1.5
    scaled = tuple(np.round(distances[ranks] / spread, 8).tolist())
    return {"n_points": len(points), "spread": spread, "ranks": scaled, "handedness": float(skewness.prod())}


def alike_shapes(shapes: dict[str, ShapeRow]) -> list[Alike]:
    """Find from their rows the shapes that are the same, each with the first that it equals."""
    groups = defaultdict[int, list[str]](list)
    for name, row in shapes.items():
        if row.ranks:
            groups[row.n_points].append(name)
    alike = []
    for names in groups.values():
        ranks = np.array([shapes[name].ranks for name in names])
        for i, name in enumerate(names[1:], 1):
            near = np.flatnonzero(np.abs(ranks[:i] - ranks[i]).max(axis=1) <= SAME_DISTANCE)
            if len(near):
                one, other = shapes[name], shapes[names[near[0]]]
                hands = one.handedness or 0.0, other.handedness or 0.0
                is_mirrored = abs(sum(hands)) < abs(hands[0] - hands[1]) > MIN_HANDEDNESS
                kind: Literal["copy", "mirror image"] = "mirror image" if is_mirrored else "copy"
                factor, is_equal = one.spread / other.spread, one.hash == other.hash
                alike.append(Alike(name, names[near[0]], kind, factor, is_equal))
    return alike
