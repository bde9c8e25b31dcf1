"""What changed in the tables of ``docs/results`` since they were measured before, in another revision.

`keep` puts a table aside before it is replaced; `told` renders the differences. See ``results.py``.
"""

from __future__ import annotations

import json
import re
import shutil
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from result_steps import STEPS, Step
from result_tables import markdown, read_table

NUMBERS = re.compile(r"[\d.,;:/%×≤≥<>~→–− -]*")
Row = tuple[str, ...]


def stamps_in(folder: Path) -> dict[str, dict[str, Any]]:
    """Stamps of the steps whose tables are in a folder."""
    path = folder / "stamps.json"
    return dict(json.loads(path.read_text(encoding="utf-8"))) if path.exists() else {}


def write_stamp(folder: Path, step: str, stamp: dict[str, Any]) -> None:
    """Add a stamp to those of a folder, or replace it."""
    known = dict(sorted((stamps_in(folder) | {step: stamp}).items()))
    (folder / "stamps.json").write_text(json.dumps(known, indent=1) + "\n", encoding="utf-8")


def keep(step: Step, results: Path, source: str) -> None:
    """Put the tables of a step aside, unless they are of this source, too."""
    stamp = stamps_in(results).get(step.name)
    before = results / "previous"
    if stamp is None or stamp["source"] == source or stamps_in(before).get(step.name) == stamp:
        return
    before.mkdir(exist_ok=True)
    for name in _known(step, results):
        shutil.copyfile(results / f"{name}.csv", before / f"{name}.csv")
    write_stamp(before, step.name, stamp)


def told(results: Path) -> str:
    """Render, for each step that was measured twice, the columns of its tables in which a number differs."""
    now, before = stamps_in(results), stamps_in(results / "previous")
    lines = []
    for step in STEPS:
        if step.name not in before:
            continue
        first, last = before[step.name], now[step.name]
        lines.append(f"## {step.name}: {first['revision']} → {last['revision']}\n\n")
        if (machines := [stamp["machine"] for stamp in (first, last)])[0] != machines[1]:
            lines.append(f"Measured on {machines[0]}, now on {machines[1]}.\n\n")
        lines += [_compared(*_both(results, name)) for name in _known(step, results / "previous")]
    return "".join(lines)


def _known(step: Step, folder: Path) -> list[str]:
    """Those tables of a step that a folder has: others are new."""
    return [name for name in step.tables if (folder / f"{name}.csv").exists()]


def _both(results: Path, table: str) -> list[list[Row]]:
    """Read a table as it was and as it is."""
    return [
        [tuple(row) for row in read_table(folder / f"{table}.csv")]
        for folder in (results / "previous", results)
    ]


def _compared(old: Sequence[Row], new: Sequence[Row]) -> str:
    """Render a table: names of rows, and the columns of both in which a cell differs, as "old → new"."""
    names = _n_names(new)
    before = dict(_keyed(old, names))
    shared = [column for column in new[0][names:] if column in old[0]]
    changed: list[str] = []

    def cell(key: Row, row: Row, column: str) -> str:
        value = row[new[0].index(column)]
        was = before[key][old[0].index(column)] if key in before else None
        if was not in (value, None) and column not in changed:
            changed.append(column)
        return value if was == value else f"new: {value}" if was is None else f"{was} → {value}"

    rows = {key: {column: cell(key, row, column) for column in shared} for key, row in _keyed(new, names)}
    if any(key not in before for key in rows) and not changed:
        changed = list(shared)
    changed.sort(key=shared.index)
    if not changed:
        return "No number differs.\n\n"
    lines = [(*key[:names], *(cells[column] for column in changed)) for key, cells in rows.items()]
    return markdown((*new[0][:names], *changed), lines) + "\n"


def _n_names(table: Sequence[Row]) -> int:
    """How many columns name a row: the first one, and those after it in which not every cell is made of numbers."""
    columns = list(zip(*table[1:]))
    for i in range(1, len(columns)):
        if all(NUMBERS.fullmatch(cell) for cell in columns[i]):
            return i
    return len(columns)


def _keyed(table: Sequence[Row], names: int) -> Iterator[tuple[Row, Row]]:
    """Give each row of a table with what names it; rows of one name are counted."""
    seen: Counter[Row] = Counter()
    for row in table[1:]:
        seen[row[:names]] += 1
        yield (*row[:names], str(seen[row[:names]])), row
