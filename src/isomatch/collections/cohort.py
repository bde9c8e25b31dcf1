"""What does not fit in a collection: shapes in other units, twice, mirrored, with holes, broken, unlike all others."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal, NamedTuple

import numpy as np

from isomatch.collections.ledger import Rows
from isomatch.collections.likeness import alike_shapes
from isomatch.collections.mirror_images import mirror_images
from isomatch.collections.plan import Plan
from isomatch.collections.units import common_unit, scales_of
from isomatch.mending import check, without_seams
from isomatch.statistics import likely_units, size_factors, told_factor
from isomatch.storage.texts import read_csv
from isomatch.surfaces import Mesh

RESCALED = 0.01  # factor of the sizes of copies: with less, they are of one size
WIDEST_SEAM = 0.05  # √area: length of all boundaries, with less of which a surface counts as closed

Trouble = Literal["broken", "units", "twice", "mirrored", "holes", "unlike"]
OF_SHAPES: tuple[Trouble, ...] = ("units", "twice", "mirrored", "holes")
"""What is found before anything is matched."""
NOT_UNLIKE = "no"  # in the table of shapes, of one that was compared


class Misfit(NamedTuple):
    """Why a shape does not fit in a collection as it is.

    Parameters
    ----------
    kind : {"broken", "units", "twice", "mirrored", "holes", "unlike"}
        What is wrong.
    name : str
        Of which shape.
    reason : str
        In words, with the remedy.
    """

    kind: Trouble
    name: str
    reason: str


def holes_of(surface: Mesh) -> tuple[int, float]:
    """Count the boundaries of a surface whose seams are closed, and measure their length, in √area."""
    lengths = check(without_seams(surface)[0], wall=0.0).boundary_lengths
    return len(lengths), float(lengths.sum() / np.sqrt(surface.area))


def misfits(collection: Plan, rows: Rows) -> list[Misfit]:
    """Find shapes that do not fit in a collection as they are; look at them before its statistics are believed.

    Parameters
    ----------
    collection : Collection
        The collection.
    rows : Rows
        What is known of its shapes. Those that are prepared suffice for all kinds but two.

    Returns
    -------
    list of Misfit
        - *broken*: it cannot be read or prepared.
        - *units*: its size, the root of its area, is more than twice or less than half the median, and an outlier; see
          `isomatch.statistics.size_factors`. What was said of its unit is taken into account.
        - *twice*: it is another one, but for a motion, its size, and the order of vertices and faces.
        - *mirrored*: it is the mirror image of another one; or, once they are matched, seems to be one of all others.
        - *holes*: it has a boundary, and most others have none.
        - *unlike*: in the topology of the template it is far from all others, see
          `isomatch.statistics.doubtful_shapes`.
    """
    known = {name: rows.shapes[name] for name in collection.names if name in rows.shapes}
    found = [
        Misfit("broken", name, f"cannot be used: {row['error']}")
        for name, row in known.items()
        if row["state"] == "failed"
    ]
    done = {name: row for name, row in known.items() if row["state"] == "done"}
    found += _in_other_units(collection, Rows(done))
    mirrored = dict(_mirrored(collection, rows))
    for alike in alike_shapes(done):
        if alike.kind == "mirror image":
            mirrored[alike.name] = f"is the mirror image of {alike.other}, the same shape reflected"
            continue
        how = "the same file as" if alike.is_equal else "the same shape as"
        larger = f", {alike.factor:.4g} times as large" if abs(np.log(alike.factor)) > RESCALED else ""
        found.append(Misfit("twice", alike.name, f"is {how} {alike.other}{larger}; take one of them out"))
    found += [Misfit("mirrored", name, reason) for name, reason in mirrored.items()]
    found += _with_holes(Rows(done))
    unlike = dict(_unlike(collection))
    found += [
        Misfit("unlike", name, reason) for name, reason in unlike.items() if name in done.keys() - mirrored
    ]
    return found


def _in_other_units(collection: Plan, rows: Rows) -> Iterator[Misfit]:
    scales = scales_of(collection.units, rows)
    sizes = {
        name: row["area"] ** 0.5 * scales.get(name, 1.0)
        for name, row in rows.shapes.items()
        if 0 < row["area"] < np.inf
    }
    given = {name for name in collection.units if name in sizes}
    is_unclear = bool(given) and common_unit(collection.units, rows) is None
    for name, factor in zip(sizes, size_factors(np.array(list(sizes.values()))).tolist()):
        if is_unclear and name in given:
            remedy = f"is said to be in {collection.units[name]}, which fits no unit of the others; give theirs, too"
        elif factor != 1:
            units = likely_units(factor)
            remedy = f"{told_factor(factor)} (--units {name}={units[0] if units else 'UNIT'})"
        else:
            continue
        yield Misfit("units", name, remedy)


def _mirrored(collection: Plan, rows: Rows) -> Iterator[tuple[str, str]]:
    for name, pair in mirror_images(collection, rows).items():
        why_not = rows.pairs[pair].get("not_reflected", {}).get(name)
        remedy = f"but is not reflected: {why_not}" if why_not else "run again with --reflect auto"
        yield name, f"is mirrored against the others, by its maps; {remedy}"


def _with_holes(rows: Rows) -> Iterator[Misfit]:
    holes = {name: row["holes"] for name, row in rows.shapes.items() if row.get("holes")}
    is_open = {name: length > WIDEST_SEAM for name, (_, length) in holes.items()}
    if not 0 < sum(is_open.values()) < len(is_open) / 2:
        return
    for name in (name for name, has_hole in is_open.items() if has_hole):
        count, length = holes[name]
        what = "a hole" if count == 1 else f"{count} holes"
        yield Misfit("holes", name, f"has {what}, {length:.3g} √area around, and most others are closed")


def _unlike(collection: Plan) -> Iterator[tuple[str, str]]:
    table = collection.layout.shapes_table
    for line in read_csv(table) if table.exists() else []:
        if line.get("name") and line.get("unlike", "") not in ("", NOT_UNLIKE):
            yield line["name"], line["unlike"]
