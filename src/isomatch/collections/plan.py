"""What a collection is to hold: its shapes, and which pairs are matched with which settings."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np

from isomatch.collections.layout import Layout
from isomatch.collections.ledger import Rows
from isomatch.collections.pairs import Pair, pairs_of
from isomatch.collections.shapes import Entry
from isomatch.collections.template import medoid
from isomatch.settings import Config
from isomatch.values.cached import cached_property


@dataclass(frozen=True)
class Plan:
    """The shapes, pairs and settings of a `Collection`, whose parameters these are."""

    folder: Path
    shapes: tuple[Entry, ...]
    pairs: str
    template: str | None
    config: Config
    seed: int
    reflect: Literal["auto"] | tuple[str, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict)

    @property
    def layout(self) -> Layout:
        """Where each file is."""
        return Layout(Path(self.folder))

    @property
    def names(self) -> list[str]:
        """Names of the shapes."""
        return [entry.name for entry in self.shapes]

    @cached_property
    def paths(self) -> dict[str, Path]:
        """File of each shape, by name."""
        return {entry.name: entry.path for entry in self.shapes}

    def entry(self, name: str, rows: Rows) -> Entry:
        """Return a shape as it is to be matched: where mirror images are found automatically, as it was."""
        turned = bool(rows.reflected([name])) if self.reflect == "auto" else name in self.reflect
        return Entry(name, self.paths[name], turned)

    def chosen_template(self, rows: Rows) -> str | None:
        """Return the template asked for, or the medoid; None as long as not all shapes are prepared.

        The medoid stays the template of a star that has been begun, also where shapes are added.
        """
        if self.template is not None:
            return self.template
        known = [name for name in self.names if name in rows.shapes]
        usable = [name for name in known if rows.shapes[name]["state"] == "done"]
        possible = set(usable)
        centres = Counter(source for source, _ in rows.pairs if source in possible)
        if self.pairs == "star" and centres:
            return centres.most_common(1)[0][0]
        if not usable or len(known) < len(self.names):
            return None
        return usable[medoid(np.array([rows.shapes[name]["features"] for name in usable]))]

    def wanted_pairs(self, rows: Rows) -> list[Pair]:
        """List the pairs to match, as far as their shapes could be prepared."""
        usable = {name for name, record in rows.shapes.items() if record["state"] == "done"}
        pairs = pairs_of(self.names, self.pairs, self.chosen_template(rows))
        return [pair for pair in pairs if usable.issuperset(pair)]
