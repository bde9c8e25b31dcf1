"""Reproduce any of the paper's figures and its table: write picture, numbers and verdicts."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from matplotlib import rc_context

from isomatch import SettingError, __version__
from isomatch._core.files import claimed, made_folder, replaced, write_text
from isomatch._core.texts import write_csv
from isomatch_lab.paper import (
    basis_error,
    basis_vectors,
    curves_5pt,
    curves_initialised,
    descriptor_distance,
    descriptor_field,
    distortion_table,
    voronoi,
)
from isomatch_lab.paper.item import Item, Reproduction, Setting
from isomatch_lab.paper.page import PAGE_FILE, write_page

ITEMS: dict[str, Item] = {
    "basis-error": basis_error.ITEM,
    "basis-vectors": basis_vectors.ITEM,
    "descriptor-distance": descriptor_distance.ITEM,
    "descriptor-field": descriptor_field.ITEM,
    "curves-5pt": curves_5pt.ITEM,
    "distortion-table": distortion_table.ITEM,
    "voronoi": voronoi.ITEM,
    "curves-initialised": curves_initialised.ITEM,
}
SUFFIXES = ("png", "svg", "csv", "json")  # of the files of an item
DPI = 150  # dots per inch of figures; chosen
STYLE: dict[Any, Any] = {"svg.hashsalt": "isomatch", "font.size": 9, "axes.grid": True, "grid.alpha": 0.3}


def reproduce(
    names: Sequence[str], setting: Setting, out: str | Path, force: bool = False
) -> Iterator[dict[str, Any]]:
    """Reproduce items: write ``NAME.png``, ``.svg``, ``.csv`` and ``.json`` of each, and ``index.md`` about all.

    Parameters
    ----------
    names : sequence of str
        Keys of ``ITEMS``.
    setting : Setting
        Data and settings.
    out : path_like
        Folder to write to; created if it does not exist.
    force : bool
        Replace earlier files.

    Yields
    ------
    dict
        The contents of ``NAME.json``: origin, title, verdicts, facts, files.

    Raises
    ------
    SettingError
        If there is no such item.
    UnwritableFileError
        If a file already exists, or another process writes to the folder; this is checked before anything is computed.
    IsomatchError
        Whatever the item raises.
    """
    unknown = sorted(set(names) - set(ITEMS))
    if unknown:
        raise SettingError(f"unknown item {', '.join(unknown)}; choose from {', '.join(ITEMS)}, all")
    out = Path(out)
    with (
        made_folder(out),
        claimed(out / PAGE_FILE, [] if force else [path for name in names for path in _files(out, name)]),
    ):
        for name in names:
            with rc_context(STYLE):
                setting.progress(name)
                record = _write(name, ITEMS[name].make(setting), setting, out)
            write_page(out, ITEMS)
            yield record


def _files(out: Path, name: str) -> list[Path]:
    return [out / f"{name}.{suffix}" for suffix in SUFFIXES]


def _write(name: str, made: Reproduction, setting: Setting, out: Path) -> dict[str, Any]:
    """Write picture, numbers and verdicts; return the record."""
    png, svg, table, verdict = _files(out, name)
    with replaced(png) as file:
        made.figure.savefig(file, format="png", dpi=DPI)
    with replaced(svg) as file:
        made.figure.savefig(file, format="svg", dpi=DPI, metadata={"Date": None})
    rounded = (
        {key: f"{value:.5g}" if isinstance(value, float) else value for key, value in row.items()}
        for row in made.rows
    )
    write_csv(table, rounded, made.rows[0].keys())
    record = {
        "item": name,
        "origin": ITEMS[name].origin,
        "title": ITEMS[name].title,
        "verdicts": [vars(one) for one in made.verdicts],
        "holds": all(one.holds for one in made.verdicts),
        "quick": setting.quick,
        **made.facts,
        "seed": setting.seed,
        "isomatch": __version__,
        "files": [path.name for path in (png, svg, table, verdict)],
    }
    write_text(verdict, json.dumps(record, indent=2, ensure_ascii=False) + "\n")
    return record
