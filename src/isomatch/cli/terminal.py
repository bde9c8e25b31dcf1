"""Output of the commands: text, tables and JSON on standard output, progress on standard error."""

from __future__ import annotations

import json
import logging
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from io import TextIOWrapper
from textwrap import wrap
from typing import Any, TypeAlias

from cyclopts import Parameter
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn
from rich.table import Table
from rich.text import Text

from isomatch._core.texts import finite, json_text

Tell: TypeAlias = Callable[[str, float], None]

WIDEST = 100  # columns of text; longer lines are hard to read
LEAST_WIDTH = 20  # of a text, however narrow the terminal is
INDENT = 14  # columns of a label

_CONTROLS = {code: f"\\x{code:02x}" for code in (*range(32), *range(127, 160)) if chr(code) not in "\t\n"}


def print_anything() -> None:
    """Make both streams escape characters that their encoding lacks, so that no text, such as a file name, fails."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def printable(text: str) -> str:
    """Escape control characters other than tabs and line ends: those of a file name must not reach the terminal."""
    return text.translate(_CONTROLS)


def say(text: str, style: str = "") -> None:
    """Print a text without breaking its lines."""
    Console(highlight=False).print(Text(printable(text)), style=style, soft_wrap=True)


def say_rows(rows: Iterable[tuple[str, str]], indent: int = INDENT) -> None:
    """Print labels with texts beside them, broken between words; rows without a text are left out."""
    width = max(min(Console().width, WIDEST) - indent, LEAST_WIDTH)
    for label, text in rows:
        lines = wrap(text, width, break_long_words=False, break_on_hyphens=False)
        for start, line in zip([f"  {label}", *[""] * len(lines)], lines):
            say(f"{start:<{indent}}{line}")


def complain(message: str) -> None:
    """Write one line to standard error."""
    sys.stderr.write(f"isomatch: {printable(' '.join(message.split()))}\n")


def say_table(rows: Iterable[tuple[str, ...]]) -> None:
    """Print a table with rows of name, value and remarks."""
    rows = list(rows)
    table = Table(box=None, show_header=False, pad_edge=False, padding=(0, 2, 0, 0))
    table.add_column(no_wrap=True)
    table.add_column(overflow="fold")
    for _ in rows[0][2:] if rows else ():
        table.add_column(style="dim")
    for row in rows:
        table.add_row(*(Text(printable(cell)) for cell in row))
    Console(highlight=False).print(table)


def say_json(value: Any) -> None:
    """Print a value as one JSON object, in ASCII, which every encoding has."""
    sys.stdout.write(json_text(value, ascii_only=True))


@Parameter(name="*")
@dataclass(frozen=True)
class Talk:
    """What a command tells.

    Args:
        json: Print one JSON object and nothing else.
        json_lines: Print one JSON object a line, an event for each stage, and the result as the last one.
        quiet: Print neither progress nor a summary. Complaints are still printed, and what a command writes to no file.
        verbose: Write the log of the library to standard error, instead of progress.
    """

    json: bool = False
    json_lines: bool = False
    quiet: bool = False
    verbose: bool = False

    @contextmanager
    def progress(self) -> Iterator[Tell]:
        """Give a function that shows a stage and the share that is done, on standard error, if that is a terminal."""
        console, since = Console(stderr=True), time.perf_counter()

        def tell_event(stage: str, share: float) -> None:
            seconds = round(time.perf_counter() - since, 3)
            _say_line({"event": "stage", "stage": stage, "share": round(share, 4), "seconds": seconds})

        if self.json_lines:
            yield tell_event
        elif self.verbose:
            with _log_on(console):
                yield lambda stage, share: None
        elif self.quiet or not console.is_terminal:
            yield lambda stage, share: None
        else:
            columns = TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn()
            with Progress(*columns, console=console, transient=True) as bar:
                task = bar.add_task("", total=1.0)
                yield lambda stage, share: bar.update(task, description=printable(stage), completed=share)

    def result(self, record: dict[str, Any], summary: Callable[[], None], *, is_answer: bool = False) -> None:
        """Print plain values or a summary, as was asked for; an answer, all that a command gives, is always printed."""
        if self.json:
            say_json(record)
        elif self.json_lines:
            _say_line({"event": "result", **record})
        elif is_answer or not self.quiet:
            summary()


def _say_line(value: dict[str, Any]) -> None:
    sys.stdout.write(json.dumps(finite(value), allow_nan=False) + "\n")
    sys.stdout.flush()


@contextmanager
def _log_on(console: Console) -> Iterator[None]:
    logger, handler = logging.getLogger("isomatch"), logging.StreamHandler(console.file)
    handler.setFormatter(logging.Formatter("%(relativeCreated)7d ms  %(message)s"))
    level = logger.level
    logger.addHandler(handler)
    logger.setLevel(logging.INFO)
    try:
        yield
    finally:
        logger.removeHandler(handler)
        logger.setLevel(level)


def part(tell: Tell, first: float, last: float) -> Tell:
    """Make the progress of a part of the work progress from one share of it to another."""
    return lambda stage, share: tell(stage, first + (last - first) * share)


TALK = Talk()
"""How a command talks by default."""
