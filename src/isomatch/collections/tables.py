"""The table of a collection: one line for each pair."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Any

from isomatch.collections.ledger import Rows
from isomatch.collections.map_file import Record
from isomatch.collections.pairs import Pair
from isomatch.matching import Outcome, Quality
from isomatch.storage.files import replaced
from isomatch.storage.texts import write_csv

MOST_SHOWN = 200  # pairs on the page
MEASURES = tuple(each.name for each in fields(Quality))
COLUMNS = (
    "source",
    "target",
    "state",
    "outcome",
    "outcome_back",
    *MEASURES,
    *(f"{name}_back" for name in MEASURES),
    "inconsistency",
    "inconsistency_before",
    "replaced_by",
    "reflected",
    "seconds",
    "memory",
    "error",
    "source_hash",
    "target_hash",
    "key",
)


def table_of(rows: Rows) -> list[dict[str, Any]]:
    """One row for each pair, with the columns ``COLUMNS``; worst first: failed, then by outcome and misfit."""
    lines = [_line(pair, record) for pair, record in rows.pairs.items()]
    return sorted(lines, key=_goodness)


def write_table(rows: Rows, path: Path) -> None:
    """Write the table as CSV, and beside it as Parquet if the package pyarrow is installed."""
    lines = table_of(rows)
    write_csv(path, lines, COLUMNS)
    try:
        from pyarrow import Table, parquet
    except ImportError:
        return
    with replaced(path.with_suffix(".parquet")) as file:
        parquet.write_table(
            Table.from_pylist([{name: line.get(name) for name in COLUMNS} for line in lines]), file
        )


def _line(pair: Pair, record: Record) -> dict[str, Any]:
    line: dict[str, Any] = {"source": pair[0], "target": pair[1], **record}
    for side, ending in (("there", ""), ("back", "_back")):
        result = record.get(side)
        if result:
            line[f"outcome{ending}"] = result["outcome"]
            line |= {f"{name}{ending}": result["quality"].get(name) for name in MEASURES}
    agreement = record.get("agreement", {})
    line |= {"inconsistency": agreement.get("inconsistency"), "inconsistency_before": agreement.get("before")}
    if "replaced_by" in record:
        line["replaced_by"] = " > ".join(record["replaced_by"])
    line["reflected"] = ", ".join(record.get("reflected", ()))
    return line


def _goodness(line: dict[str, Any]) -> tuple[bool, int, float]:
    outcome = line.get("outcome")
    return line["state"] == "done", Outcome[outcome].sureness if outcome else -1, -(line.get("misfit") or 0.0)
