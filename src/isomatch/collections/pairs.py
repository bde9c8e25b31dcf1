"""Which pairs of a collection are matched, and in what order."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from itertools import combinations, pairwise
from pathlib import Path

from isomatch.errors import InputError
from isomatch.storage.texts import read_csv

Pair = tuple[str, str]
"""Names of two shapes; both directions are matched."""

PATTERNS = ("star", "all", "chain")
SIDE = 8  # shapes at either side of the tiles that shards are cut from


def pairs_of(names: Sequence[str], pattern: str, template: str | None) -> list[Pair]:
    """List the pairs to match: each two shapes once.

    Parameters
    ----------
    names : sequence of str
        The shapes, in order.
    pattern : str
        "star": the template and each other shape; "all": each two; "chain": each and the next; or a CSV file with
        columns ``source`` and ``target``.
    template : str, optional
        The template of a star.

    Raises
    ------
    InputError
        If a listed pair is not of two shapes of the collection.
    """
    if pattern == "star":
        return [(template, name) for name in names if template and name != template]
    if pattern == "all":
        return list(combinations(names, 2))
    if pattern == "chain":
        return list(pairwise(names))
    return _listed(Path(pattern), names)


def _listed(path: Path, names: Collection[str]) -> list[Pair]:
    rows = read_csv(path)
    if not rows or not {"source", "target"} <= set(rows[0]):
        raise InputError(f"{path}: no pairs; give columns source and target, named in the first line")
    pairs = [(row["source"], row["target"]) for row in rows]
    strangers = sorted({name for pair in pairs for name in pair} - set(names))
    if strangers:
        raise InputError(f"{path}: {', '.join(strangers)} are no shapes of this collection; give their names")
    if any(a == b for a, b in pairs):
        raise InputError(f"{path}: a shape is paired with itself; remove these lines")
    by_ends: dict[frozenset[str], Pair] = {}
    for pair in pairs:
        by_ends.setdefault(frozenset(pair), pair)
    return list(by_ends.values())


def tiles_of(pairs: Sequence[Pair], names: Sequence[str], side: int, most: int) -> list[list[Pair]]:
    """Group pairs so that each group has few different shapes, which are loaded once.

    Parameters
    ----------
    pairs : sequence of two str
        Pairs of shapes.
    names : sequence of str
        The shapes, in order.
    side : int
        A group has pairs of at most so many shapes with as many others.
    most : int
        Pairs in a group.
    """
    block = {name: i // side for i, name in enumerate(names)}
    groups: dict[tuple[int, int], list[Pair]] = {}
    for a, b in pairs:
        groups.setdefault((block[a], block[b]), []).append((a, b))
    return [group[i : i + most] for group in groups.values() for i in range(0, len(group), most)]
