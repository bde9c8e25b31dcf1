"""Output of the commands: text, tables and JSON on standard output, progress on standard error."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from io import TextIOWrapper
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

_CONTROLS = {code: f"\\x{code:02x}" for code in (*range(32), *range(127, 160)) if chr(code) not in "\t\n"}


def print_anything() -> None:
    """Make both streams escape what their encoding lacks, so that no text, such as a file name, is an error."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def printable(text: str) -> str:
    """Escape control characters other than tabs and line ends: those of a file name must not reach the terminal."""
    return text.translate(_CONTROLS)


def say(text: str, style: str = "") -> None:
    """Print a text without breaking its lines."""
    Console(highlight=False).print(Text(printable(text)), style=style, soft_wrap=True)


def say_table(rows: Iterable[tuple[str, str, str]]) -> None:
    """Print a table with rows of name, value and remark."""
    table = Table(box=None, show_header=False, pad_edge=False, padding=(0, 2, 0, 0))
    table.add_column(no_wrap=True)
    table.add_column(overflow="fold")
    table.add_column(style="dim")
    for row in rows:
        table.add_row(*(Text(printable(cell)) for cell in row))
    Console(highlight=False).print(table)


def say_json(value: Any) -> None:
    """Print a value as one JSON object, in ASCII, which every encoding has."""
    sys.stdout.write(json_text(value, ascii_only=True))


def json_text(value: Any, *, ascii_only: bool = False) -> str:
    """Format plain values as JSON. Numbers that are not finite become null, because JSON does not have them."""
    return json.dumps(_finite(value), indent=2, ensure_ascii=ascii_only, allow_nan=False) + "\n"


def _finite(value: Any) -> Any:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    return value


@contextmanager
def progress() -> Iterator[Callable[[str], None]]:
    """Show the current stage on standard error if that is a terminal; give the function that sets the stage."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield lambda stage: None
        return
    with console.status("") as status:
        yield lambda stage: status.update(f"{stage} …")
