"""Output of the commands: text, tables and JSON on standard output, progress on standard error."""

from __future__ import annotations

import json
import logging
import re
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from datetime import datetime, timedelta
from io import TextIOWrapper
from pathlib import Path
from textwrap import wrap
from threading import Event, Thread
from typing import Annotated, Any, TypeAlias

from cyclopts import Parameter
from psutil import Process
from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, Task, TaskProgressColumn, TextColumn
from rich.table import Table
from rich.text import Text

from isomatch._core.errors import IsomatchError
from isomatch._core.texts import json_text, without_nonfinite

Tell: TypeAlias = Callable[[str, float], None]  # a function that is called with a stage and the share done

# Texts are broken to the width of the terminal in columns, but at most and at least to these widths; chosen.
MAX_TEXT_COLUMNS, MIN_TEXT_COLUMNS = 100, 20
MAX_NAMED = 5  # largest number of failed shapes and pairs that an error names; chosen
INDENT = 14  # columns of the terminal for a label, before its text; chosen to hold the longest one
# visible text in place of each control character, by its code
_CONTROLS = {code: f"\\x{code:02x}" for code in (*range(32), *range(127, 160)) if chr(code) not in "\t\n"}


def print_anything() -> None:
    """Make both streams escape characters that their encoding lacks."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def printable(text: str) -> str:
    """Escape control characters but tabs and line ends: no file name controls the terminal."""
    return text.translate(_CONTROLS)


def say(text: str, style: str = "") -> None:
    """Print a text without breaking its lines."""
    Console(highlight=False).print(Text(printable(text)), style=style, soft_wrap=True)


def say_rows(rows: Iterable[tuple[str, str]], indent: int = INDENT) -> None:
    """Print labels with texts beside them, broken between words; rows without a text are left out."""
    width = max(min(Console().width, MAX_TEXT_COLUMNS) - indent, MIN_TEXT_COLUMNS)
    for label, text in rows:
        lines = wrap(text, width, break_long_words=False, break_on_hyphens=False)
        for start, line in zip([f"  {label}", *[""] * len(lines)], lines):
            say(f"{start:<{indent}}{line}")


def complain(message: str) -> None:
    """Write one line to standard error."""
    sys.stderr.write(f"isomatch: {printable(' '.join(in_shell(message).split()))}\n")


_SHELL_WORDS = (  # Each row has a pattern of a Python call or setting, and what to type in a shell instead.
    (r"repair\(mesh, outer=True\)", "isomatch repair --outer"),
    (r"repair\(mesh, without_base=True\)", "isomatch repair --without-base"),
    (r"repair\(mesh, weld=(\S+)\)", r"isomatch repair --weld \1"),
    (r"repair\(mesh\)", "isomatch repair"),
    (r"\b(hypotheses|orientation|refinement|resolution|start) = '(\w+)'", r"--\1 \2"),
)


def in_shell(text: str) -> str:
    """Replace Python calls and settings in a text by commands and options."""
    for call, typed in _SHELL_WORDS:
        text = re.sub(call, typed, text)
    return text


class IncompleteError(IsomatchError):
    """Some of many shapes failed; the results of the others are written."""


def require_complete(failed: Sequence[str], folder: Path) -> None:
    """Raise `IncompleteError` if shapes or pairs failed, and name the first."""
    if failed:
        what = "1 shape or pair" if len(failed) == 1 else f"{len(failed)} shapes or pairs"
        more = f" and {len(failed) - MAX_NAMED} more" if len(failed) > MAX_NAMED else ""
        raise IncompleteError(
            f"{what} failed: {', '.join(failed[:MAX_NAMED])}{more}; the rest is in {folder}, and isomatch collect "
            "status says why"
        )


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


_STARTED = [time.time()]  # seconds since the epoch when the command was called; in a list, to be changed


def start_clock(*, with_process: bool) -> None:
    """Begin to count the wait for a command: now, or when the process began, before imports."""
    _STARTED[0] = Process().create_time() if with_process else time.time()


def waited() -> float:
    """Seconds since the command was called."""
    return time.time() - _STARTED[0]


class _Clock(ProgressColumn):
    """Time since the start and, if a stage counts its steps, their rate and the time left."""

    def __init__(self) -> None:
        super().__init__()
        self.stage, self.share = "starting", 0.0
        self._begun = self._last = self._since = time.monotonic()
        self._kind, self._steps = "", [0, 0]

    def tell(self, stage: str, share: float) -> None:
        """Note a stage, such as "matched 3 of 8: a and b", and the share of work done."""
        counted = _COUNTED.match(stage)
        kind = counted[1] if counted else stage
        if kind != self._kind:  # the first step of this kind begins when the previous step ends
            self._kind, self._since = kind, self._last
        self._steps = [int(counted[2]), int(counted[3])] if counted else [0, 0]
        self.stage, self.share, self._last = stage, share, time.monotonic()

    def __str__(self) -> str:
        now = time.monotonic()
        texts, (done, n_steps) = [str(timedelta(seconds=round(now - self._begun)))], self._steps
        if done and self._last > self._since:
            seconds = (self._last - self._since) / done  # mean time of one step
            left = timedelta(seconds=round(max((n_steps - done) * seconds - (now - self._last), 0)))
            texts += [f"{60 / seconds:.3g} a minute", f"{left} left"]
        return ", ".join(texts)

    def render(self, task: Task) -> Text:
        """Show it in a bar."""
        return Text(str(self))


_COUNTED = re.compile(r"(.+?) (\d+) of (\d+)")  # the name of a stage that counts steps: "matched 3 of 8"
SECONDS_BETWEEN_LINES = 60.0  # seconds between two lines of progress in a log; chosen


@contextmanager
def _bar_on(console: Console, clock: _Clock) -> Iterator[Tell]:
    """Give a function that shows a stage in a bar."""
    columns = TextColumn("{task.description}"), BarColumn(), TaskProgressColumn(), clock
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("starting", total=1.0)

        def show(stage: str, share: float) -> None:
            clock.tell(stage, share)
            bar.update(task, description=printable(stage), completed=share)

        yield show


@contextmanager
def _lines_on(console: Console, clock: _Clock) -> Iterator[Tell]:
    """Give a function that notes a stage, and write a dated line every `SECONDS_BETWEEN_LINES`."""
    ended = Event()

    def write() -> None:
        while not ended.wait(SECONDS_BETWEEN_LINES):
            now = datetime.now().astimezone().isoformat(" ", "seconds")
            console.file.write(f"{now}  {printable(clock.stage)}  {clock.share:.0%}  {clock}\n")
            console.file.flush()

    Thread(target=write, daemon=True).start()
    try:
        yield clock.tell
    finally:
        ended.set()


@Parameter(name="*")
@dataclass(frozen=True)
class Talk:
    """What a command tells.

    Args:
        json: Print one JSON object, and nothing else on standard output.
        json_lines: Print one JSON object a line, an event for each stage, and the result as the last one.
        quiet: Print neither progress nor a summary; only warnings, errors, and what a command writes to no file.
        verbose: Write the log of the library to standard error, instead of progress.
    """

    json: Annotated[bool, Parameter(alias="-j")] = False
    json_lines: bool = False
    quiet: Annotated[bool, Parameter(alias="-q")] = False
    verbose: Annotated[bool, Parameter(alias="-v")] = False

    @contextmanager
    def progress(self) -> Iterator[Tell]:
        """Give a function that shows a stage and the share of work done, on standard error.

        A terminal has a bar; elsewhere, as in the log of a cluster, there is a dated line each minute.
        """
        console, since = Console(stderr=True), time.perf_counter()

        def tell_event(stage: str, share: float) -> None:
            seconds = round(time.perf_counter() - since, 3)
            _say_line({"event": "stage", "stage": stage, "share": round(share, 4), "seconds": seconds})

        if self.json_lines:
            yield tell_event
        elif self.verbose or self.quiet:
            with _log_on(console) if self.verbose else nullcontext():
                yield lambda stage, share: None
        else:
            with (_bar_on if console.is_terminal else _lines_on)(console, _Clock()) as tell:
                yield tell

    def result(self, record: Any, summary: Callable[[], None], *, is_answer: bool = False) -> None:
        """Print plain values or a summary; ``quiet`` does not suppress an answer."""
        if self.json:
            sys.stdout.write(json_text(record, ascii_only=True))  # every encoding includes ASCII
        elif self.json_lines:
            _say_line({"event": "result", **record})
        elif is_answer or not self.quiet:
            summary()


def _say_line(value: dict[str, Any]) -> None:
    sys.stdout.write(json.dumps(without_nonfinite(value), allow_nan=False) + "\n")
    sys.stdout.flush()


@contextmanager
def _log_on(console: Console) -> Iterator[None]:
    logger, handler = logging.getLogger("isomatch"), logging.StreamHandler(console.file)
    handler.setFormatter(logging.Formatter("%(asctime)s  %(levelname)s  %(message)s"))
    level = logger.level
    logger.addHandler(handler)
    logger.setLevel(logging.INFO)
    try:
        yield
    finally:
        logger.removeHandler(handler)
        logger.setLevel(level)


def part(tell: Tell, first: float, last: float) -> Tell:
    """Map the progress of a part of the work to the range of shares ``first`` to ``last``."""

    def tell_part(stage: str, share: float) -> None:  # the stage "done" ends only this part, and is not told
        tell("finishing" if stage == "done" else stage, first + (last - first) * share)

    return tell_part


TALK = Talk()
"""The default of the options that say what a command prints."""
