"""Outliers of a collection: in other units, twice, mirrored, with holes, broken, unlike."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, Literal, NamedTuple

import numpy as np

from isomatch._core.errors import InputError
from isomatch.cohort.ledger import N_RANKS, Pair, Rows, ShapeRow, SurfaceRow
from isomatch.cohort.plan import Plan
from isomatch.cohort.shape_statistics import METRES, likely_units, size_factors, told_factor
from isomatch.matching import Outcome
from isomatch.repair import check, without_seams
from isomatch.surfaces import Mesh, PointCloud

MIN_RESCALING = 0.01  # logarithm of the ratio of sizes, from which a copy counts as rescaled
MAX_SEAM = 0.05  # √area: length of all boundaries, up to which a surface counts as closed
Trouble = Literal["broken", "units", "twice", "mirrored", "holes", "unlike"]
OF_SHAPES: tuple[Trouble, ...] = ("units", "twice", "mirrored", "holes")  # found before matching
NOT_UNLIKE = "no"  # cell in the table of shapes of one that was compared and is not unlike the others
MAX_SIZE_RATIO = 2.0  # ratio of sizes of one kind that no unit need explain
OTHERS = "*"  # stands for all shapes whose units are not given
SAME_DISTANCE = 1e-5  # difference of distances from the centroid, over the size, in single precision
MIN_HANDEDNESS = 1e-6  # smaller differences of handedness are rounding in a symmetric shape


class Outlier(NamedTuple):
    """A shape that does not fit in a collection: kind, name, and reason with the remedy."""

    kind: Trouble
    name: str
    reason: str


def holes_of(surface: Mesh) -> tuple[int, float]:
    """Count the boundaries of a surface without seams, and measure their length in √area."""
    lengths = check(without_seams(surface)[0], wall=0.0).boundary_lengths
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
    known = [(name, rows.shapes[name]) for name in collection.names if name in rows.shapes]
    done = {name: row for name, row in known if row.state == "done"}
    failed = [(name, row.error) for name, row in known if row.state == "failed"]
    odd = [Outlier("broken", name, f"cannot be used: {error}") for name, error in failed]
    odd += _in_other_units(collection, Rows(done))
    mirrored = dict[str, str]()
    for name, pair in mirror_images(collection, rows).items():
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
    odd += _with_holes(Rows(done))
    lines = SurfaceRow.read(collection.layout.shapes_table).values()
    unlike = [line for line in lines if line.unlike not in ("", NOT_UNLIKE)]
    return odd + [Outlier("unlike", x.name, x.unlike) for x in unlike if x.name in done.keys() - mirrored]


def _in_other_units(collection: Plan, rows: Rows) -> Iterator[Outlier]:
    scales = scales_of(collection.units, rows)
    areas = {name: row.area for name, row in rows.shapes.items() if 0 < row.area < np.inf}
    sizes = {name: area**0.5 * scales.get(name, 1.0) for name, area in areas.items()}
    is_unclear = not sizes.keys().isdisjoint(collection.units) and common_unit(collection.units, rows) is None
    for name, factor in zip(sizes, size_factors(np.array(list(sizes.values()))).tolist()):
        if is_unclear and name in collection.units:
            problem = f"is said to be in {collection.units[name]}, which fits no unit of the others"
            yield Outlier("units", name, f"{problem}; give theirs, too")
        elif factor != 1:
            yield Outlier("units", name, explain_unit(name, factor))


def explain_unit(name: str, factor: float) -> str:
    """Tell how many times as large as the others a shape is, and which unit would explain it."""
    units = likely_units(factor)
    return f"{told_factor(factor)} (--units {name}={units[0] if units else 'UNIT'})"


def _with_holes(rows: Rows) -> Iterator[Outlier]:
    holes = {name: row.holes for name, row in rows.shapes.items() if row.holes}
    is_open = {name: length > MAX_SEAM for name, (_, length) in holes.items()}
    if not 0 < sum(is_open.values()) < len(is_open) / 2:
        return
    for name, (count, length) in holes.items():
        if is_open[name]:
            what = "a hole" if count == 1 else f"{count} holes"
            yield Outlier("holes", name, f"has {what}, {length:.3g} √area around, and most others are closed")


def mirror_images(collection: Plan, rows: Rows) -> dict[str, Pair]:
    """Find shapes that seem to be mirror images, each with the pair that shows it best."""
    pairs = [pair for pair in collection.wanted_pairs(rows) if rows.is_current(pair)]
    shown = [pair for pair in pairs if rows.pairs[pair].is_mirrored]
    if not shown:
        return {}
    if collection.pairs == "star":  # mirror images of the template
        mirrored = {name for pair in shown for name in pair} - {collection.chosen_template(rows)}
    else:
        mirrored = set(_mirrored_group(collection, rows, pairs))
    clearest: dict[str, Pair] = {}
    scores = {pair: rows.pairs[pair].there.measures["mirrored"] for pair in shown}  # lower is clearer
    for pair in sorted(shown, key=lambda pair: math.inf if (x := scores[pair]) is None else x):
        for name, other in (pair, pair[::-1]):
            if name in mirrored and other not in mirrored:
                clearest.setdefault(name, pair)
    return {name: clearest[name] for name in collection.names if name in clearest}


def _mirrored_group(collection: Plan, rows: Rows, pairs: Iterable[Pair]) -> Iterator[str]:
    """Yield one of two groups: without the template, with fewer reflected, or the smaller."""
    links: dict[str, dict[str, int]] = defaultdict(dict)
    for a, b in pairs:
        row = rows.pairs[a, b]
        if row.is_mirrored or row.there.outcome.sureness >= Outcome.PARTIAL.sureness:
            links[a][b] = links[b][a] = -1 if row.is_mirrored else 1

    def weight(group: list[str]) -> tuple[bool, int, int]:
        return collection.template in group, len(rows.reflected(group)), len(group)

    for groups in two_groups(links):
        yield from min(groups, key=weight)


def two_groups(links: dict[str, dict[str, int]]) -> Iterator[tuple[list[str], list[str]]]:
    """Divide connected shapes in two groups: links are 1 within them, and −1 between."""
    # each shape, from the first one outwards, joins the group that most of its links to earlier
    # shapes ask for, and then the group that all its links ask for; the first is in the second
    # group
    group: dict[str, int] = {}

    def group_asked_for(name: str) -> int:
        return -1 if sum(link * group.get(other, 0) for other, link in links[name].items()) < 0 else 1

    for first in links:
        if first in group:
            continue
        members = [first]
        group[first] = 1
        for name in members:
            for other in links[name]:
                if other not in group:
                    group[other] = group_asked_for(other)
                    members.append(other)
        for name in members[1:]:
            group[name] = group_asked_for(name)
        yield [name for name in members if group[name] < 0], [name for name in members if group[name] > 0]


def checked_units(units: Mapping[str, str], names: Iterable[str]) -> dict[str, str]:
    """Return the units of shapes by name; `InputError` if a name or a unit is not known."""
    if strangers := sorted(set(units) - {OTHERS, *names}):
        raise InputError(f"{', '.join(strangers)}: units of no shape of this collection; give their names")
    if unknown := sorted({*units.values()} - set(METRES)):
        raise InputError(f"{', '.join(unknown)}: unknown units; known are {', '.join(METRES)}")
    return dict(units)


def common_unit(units: Mapping[str, str], rows: Rows) -> str | None:
    """Return the unit of the shapes whose unit is not given, by ``"*"`` or sizes, if clear."""
    named = {name: unit for name, unit in units.items() if name != OTHERS}
    if OTHERS in units or not named:
        return units.get(OTHERS)
    sizes = {name: row.area**0.5 for name, row in rows.shapes.items() if row.area}
    others = [size for name, size in sizes.items() if name not in named]
    in_metres = [sizes[name] * METRES[unit] for name, unit in named.items() if name in sizes]
    if not others:
        return Counter(named.values()).most_common(1)[0][0]
    if not in_metres:
        return None
    ratio = float(np.median(in_metres)) / float(np.median(others))  # metres in the unit of the others
    nearest = min(METRES, key=lambda unit: abs(np.log(ratio / METRES[unit])))
    return nearest if abs(np.log(ratio / METRES[nearest])) < np.log(MAX_SIZE_RATIO) else None


def scales_of(units: Mapping[str, str], rows: Rows) -> dict[str, float]:
    """Return the factor of the positions of each shape for which it is not 1."""
    common = common_unit(units, rows)
    if common is None:
        return {}
    named = {name: unit for name, unit in units.items() if name != OTHERS and unit != common}
    return {name: METRES[unit] / METRES[common] for name, unit in named.items()}


class Alike(NamedTuple):
    """A shape that equals an earlier one up to a motion, its size, and the order of vertices."""

    name: str
    other: str
    kind: Literal["copy", "mirror image"]
    factor: float  # its size divided by the size of the other
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
    # the product of the skewnesses along the principal axes has the opposite sign in a mirror image
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
