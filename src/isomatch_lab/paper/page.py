"""The page of all items in a folder: for each its picture, the claims and the measurements."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from isomatch._core.files import write_text

PAGE_FILE = "index.md"
LEFT_OUT = (
    "item",
    "origin",
    "title",
    "verdicts",
    "holds",
    "quick",
    "isomatch",
    "files",
    "pairs",
)  # facts that are elsewhere on the page, or too long for it; NAME.json has them


def write_page(out: Path, names: Iterable[str]) -> None:
    """Write ``index.md`` with the items whose ``NAME.json`` is in the folder, in the order given."""
    records = [
        json.loads((out / f"{name}.json").read_text(encoding="utf-8"))
        for name in names
        if (out / f"{name}.json").exists()
    ]
    head = (
        "# Figures and table of *Geodesic Distance Descriptors*, reproduced\n\n"
        "Written by `isomatch paper`; `isomatch paper NAME --data DIR -o OUT` makes one of them.\n"
    )
    write_text(out / PAGE_FILE, head + "".join(map(_section, records)))


def _section(record: dict[str, Any]) -> str:
    name = record["item"]
    rows = "".join(
        f"| {verdict['claim']} | {verdict['measured']} | {'yes' if verdict['holds'] else '**no**'} |\n"
        for verdict in record["verdicts"]
    )
    facts = "; ".join(
        f"{key}: {_plain(value)}"
        for key, value in record.items()
        if key not in LEFT_OUT and value not in ({}, [], "")
    )
    return (
        f"\n## {name}: {record['origin']}\n\n{record['title']}: [numbers]({name}.csv), "
        f"[pairs and settings]({name}.json).\n\n[![{name}]({name}.png)]({name}.png)\n\n"
        f"| claim | measured | holds |\n|---|---|---|\n{rows}\n{facts[:1].upper()}{facts[1:]}.\n"
    )


def _plain(value: Any) -> str:
    """Write a value of a record in words, with the entries of lists and mappings."""
    if isinstance(value, dict):
        return ", ".join(f"{key} ({_plain(one)})" for key, one in value.items())
    return ", ".join(map(str, value)) if isinstance(value, list) else str(value)
