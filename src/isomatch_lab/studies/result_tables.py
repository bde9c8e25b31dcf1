"""Tables of results: read from CSV, and rendered as Markdown."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Sequence
from pathlib import Path


def read_table(path: Path) -> list[list[str]]:
    """Read all lines, the head first."""
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.reader(file))


def markdown(head: Sequence[str], lines: Iterable[Sequence[str]]) -> str:
    """Render a table."""
    rows = [f"| {' | '.join(cells)} |\n" for cells in (head, *lines)]
    return "".join([rows[0], f"|{'---|' * len(head)}\n", *rows[1:]])
