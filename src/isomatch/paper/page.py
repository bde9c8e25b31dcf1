"""One page of all items in a folder: picture, claims, what was measured."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

PAGE = "index.md"
TOLD = ("item", "origin", "title", "verdicts", "holds", "quick", "isomatch", "files")  # said elsewhere


def write_page(out: Path, names: Iterable[str]) -> None:
    """Write ``index.md`` about those items whose ``NAME.json`` is in the folder, in the order given."""
    records = [
        json.loads((out / f"{name}.json").read_text(encoding="utf-8"))
        for name in names
        if (out / f"{name}.json").exists()
    ]
    head = (
        "# Figures and table of *Geodesic Distance Descriptors*, made anew\n\nWritten by `isomatch paper`.\n"
    )
    (out / PAGE).write_text(head + "".join(map(_section, records)), encoding="utf-8")


def _section(record: dict[str, Any]) -> str:
    name = record["item"]
    quick = " --quick" if record["quick"] else " --data DIR"
    rows = "".join(
        f"| {verdict['claim']} | {verdict['measured']} | {'yes' if verdict['holds'] else '**no**'} |\n"
        for verdict in record["verdicts"]
    )
    facts = "; ".join(
        f"{key}: {_plain(value)}"
        for key, value in record.items()
        if key not in TOLD and value not in ({}, [], "")
    )
    return (
        f"\n## {name}: {record['origin']}\n\n{record['title']}. `isomatch paper {name}{quick} -o OUT`; numbers: "
        f"[{name}.csv]({name}.csv).\n\n![{record['title']}]({name}.png)\n\n"
        f"| claim | measured | holds |\n|---|---|---|\n{rows}\n{facts[:1].upper()}{facts[1:]}.\n"
    )


def _plain(value: Any) -> str:
    """Words for a value of a record: lists and mappings spelt out."""
    if isinstance(value, dict):
        return ", ".join(f"{key} ({_plain(one)})" for key, one in value.items())
    return ", ".join(map(str, value)) if isinstance(value, list) else str(value)
