"""Which shapes are mirror images of the others, such as left ones among right ones, by the outcomes of their pairs."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator

from isomatch.collections.ledger import Rows
from isomatch.collections.map_file import Record
from isomatch.collections.pairs import Pair
from isomatch.collections.plan import Plan
from isomatch.collections.states import is_mirrored
from isomatch.matching import Outcome


def mirror_images(collection: Plan, rows: Rows) -> dict[str, Pair]:
    """Find the shapes that seem to be mirror images of the others, each with the pair that shows it best.

    In a star, these are the mirror images of the template. Other pairs divide the shapes in two groups: pairs between
    the groups are mirror images, and pairs within them are not. Then it is the group without the template, if one was
    named; or else that of which fewer are reflected already; or else the smaller one.
    """
    pairs = [pair for pair in collection.wanted_pairs(rows) if rows.is_current(pair)]
    shown = [pair for pair in pairs if is_mirrored(rows.pairs[pair])]
    if not shown:
        return {}
    if collection.pairs == "star":
        turned = {name for pair in shown for name in pair} - {collection.chosen_template(rows)}
    else:
        turned = set(_turned(collection, rows, pairs))
    found: dict[str, Pair] = {}
    for pair in sorted(shown, key=lambda pair: _score(rows.pairs[pair])):
        for name, other in (pair, pair[::-1]):
            if name in turned and other not in turned:
                found.setdefault(name, pair)
    return {name: found[name] for name in collection.names if name in found}


def _turned(collection: Plan, rows: Rows, pairs: Iterable[Pair]) -> Iterator[str]:
    links: dict[str, dict[str, int]] = defaultdict(dict)
    for a, b in pairs:
        if link := _link(rows.pairs[a, b]):
            links[a][b] = links[b][a] = link

    def weight(group: list[str]) -> tuple[bool, int, int]:
        return collection.template in group, len(rows.reflected(group)), len(group)

    for groups in two_groups(links):
        yield from min(groups, key=weight)


def two_groups(links: dict[str, dict[str, int]]) -> Iterator[tuple[list[str], list[str]]]:
    """Divide each connected set of shapes in two groups, so that links are 1 within a group, and −1 between them.

    Each shape, from the first one outwards, joins the group that most of its links to those before ask for, and then
    that which all ask for. The first shape is in the second group.
    """
    group: dict[str, int] = {}
    for first in links:
        if first in group:
            continue
        members = [first]
        group[first] = 1
        for name in members:
            new = [other for other in links[name] if other not in group]
            for other in new:
                group[other] = _asked_for(links[other], group)
            members += new
        for name in members[1:]:
            group[name] = _asked_for(links[name], group)
        yield [name for name in members if group[name] < 0], [name for name in members if group[name] > 0]


def _asked_for(links: dict[str, int], group: dict[str, int]) -> int:
    return -1 if sum(link * group.get(other, 0) for other, link in links.items()) < 0 else 1


def _link(record: Record) -> int:
    """Return −1 for mirror images, 1 for two shapes of one side, 0 where the match does not tell."""
    if is_mirrored(record):
        return -1
    return int(Outcome[record["there"]["outcome"]].sureness >= Outcome.PARTIAL.sureness)


def _score(record: Record) -> float:
    """Score of the mirror image against the map; lower is clearer."""
    mirrored = record["there"]["quality"]["mirrored"]
    return math.inf if mirrored is None else float(mirrored)
