"""What is known of a collection at one time: its plan, its rows, and what follows from both."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass

from isomatch._core.cached import cached_property
from isomatch.cohort.ledger import Pair, Rows, SurfaceRow
from isomatch.cohort.plan import Entry, Layout, Plan, scales_of
from isomatch.matching import Outcome


@dataclass(frozen=True)
class Snapshot:
    """The plan of a collection with the rows that were read at one time."""

    plan: Plan
    rows: Rows

    @property
    def layout(self) -> Layout:
        """The paths of the files."""
        return self.plan.layout

    @property
    def names(self) -> list[str]:
        """Names of all shapes of the plan."""
        return self.plan.names

    @cached_property
    def template(self) -> str | None:
        """Name of the template; None until it can be chosen."""
        return self.plan.chosen_template(self.rows)

    @cached_property
    def wanted_pairs(self) -> list[Pair]:
        """The pairs to match whose shapes could be prepared."""
        return self.plan.wanted_pairs(self.rows)

    @property
    def is_matched(self) -> bool:
        """Whether all wanted pairs have been tried."""
        return not self.rows.untried(self.wanted_pairs)

    @cached_property
    def scales(self) -> dict[str, float]:
        """Factor to the common unit of the positions of each shape for which it is not 1."""
        return scales_of(self.plan.units, self.rows)

    @property
    def reflected(self) -> list[str]:
        """Names of the shapes that are matched as mirror images."""
        return self.rows.reflected(self.names)

    def entry(self, name: str) -> Entry:
        """Return a shape as it was matched: reflected or not."""
        return Entry(name, self.plan.paths[name], bool(self.rows.reflected([name])))

    def surface_rows(self) -> dict[str, SurfaceRow]:
        """Read the lines of ``shapes.csv``, by the names of the shapes."""
        return SurfaceRow.read(self.layout.shapes_table)

    @cached_property
    def mirror_images(self) -> dict[str, Pair]:
        """The shapes that seem to be mirror images, each with the pair that shows it best."""
        rows, pairs = self.rows, [pair for pair in self.wanted_pairs if self.rows.is_current(pair)]
        shown = [pair for pair in pairs if rows.pairs[pair].is_mirrored]
        if not shown:
            return {}
        if self.plan.pairs == "star":  # the template is taken as right, its partners as mirrored
            mirrored = {name for pair in shown for name in pair} - {self.template}
        else:
            mirrored = set(self._mirrored_group(pairs))
        clearest: dict[str, Pair] = {}
        # the measure ``mirrored``, which is low where the mirror image fits clearly better
        scores = {pair: rows.pairs[pair].forward.measures["mirrored"] for pair in shown}
        for pair in sorted(shown, key=lambda pair: math.inf if (x := scores[pair]) is None else x):
            for name, other in (pair, pair[::-1]):
                if name in mirrored and other not in mirrored:
                    clearest.setdefault(name, pair)
        return {name: clearest[name] for name in self.names if name in clearest}

    def _mirrored_group(self, pairs: list[Pair]) -> Iterator[str]:
        """Yield one of two groups: without the template, with fewer reflected, or the smaller."""
        links: dict[str, dict[str, int]] = defaultdict(dict)
        for a, b in pairs:
            row = self.rows.pairs[a, b]
            if row.is_mirrored or row.forward.outcome.sureness >= Outcome.PARTIAL.sureness:
                links[a][b] = links[b][a] = -1 if row.is_mirrored else 1

        def weight(group: list[str]) -> tuple[bool, int, int]:
            return self.plan.template in group, len(self.rows.reflected(group)), len(group)

        for groups in two_groups(links):
            yield from min(groups, key=weight)


def two_groups(links: dict[str, dict[str, int]]) -> Iterator[tuple[list[str], list[str]]]:
    """Divide connected shapes in two groups: links are 1 within them, and −1 between."""
    # The first shape is in the second group. From there outwards, each shape joins the group that
    # most of its links to earlier shapes ask for, and then the group that all its links ask for.
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
