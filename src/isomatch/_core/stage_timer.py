"""The stages of a computation: their seconds, progress messages, and a line or bar that shows them."""

from __future__ import annotations

import inspect
import logging
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from html import escape
from threading import Lock
from typing import Any, TypeAlias

from isomatch._core.threads import stop_if_abandoned, tell

logger = logging.getLogger(__name__)

Progress: TypeAlias = Callable[[str, float], Any] | Callable[[str], Any]
"""Called with the name of a stage as it starts, and with the share of all work that is done, if it takes two arguments.

The share, an estimate from typical times, never falls. What the function raises ends the computation and reaches the
caller as it is.
"""

# Share of the time of a match, from 0 to 1, that has typically passed when a stage begins; measured.
MATCHING_SHARES = {"prepare": 0.0, "components": 0.5, "search": 0.55, "selection": 0.62, "refinement": 0.65}
MATCHING_SHARES |= {"quality": 0.8, "mirror images": 0.82, "precision": 0.84, "polish": 0.85, "carry": 0.95}
MATCHING_SHARES |= {"hard landmarks": 0.98}
# Share of the time of a preparation, from 0 to 1, that has typically passed when a stage begins; measured.
PREPARATION_SHARES = {"body": 0.0, "levels": 0.02, "distances": 0.3, "functions": 0.5, "samples": 0.85}


def with_two_arguments(progress: Progress) -> Callable[[str, float], Any]:
    """Wrap a function of the stage alone as one of stage and share."""
    try:
        inspect.signature(progress).bind("stage", 0.0)
    except TypeError:
        return lambda stage, share: progress(stage)  # type: ignore[call-arg]
    except ValueError:  # a built-in function without a signature
        pass
    return progress  # type: ignore[return-value]


class StageTimer:
    """Times consecutive stages, and calls ``progress`` with each and the share where it typically begins."""

    def __init__(self, progress: Progress | None = None, begins: dict[str, float] = MATCHING_SHARES) -> None:
        self._progress = with_two_arguments(progress) if progress else None
        self._begins = begins
        self._share = 0.0
        self._telling = Lock()
        self._seconds: dict[str, float] = {}
        self._beside: dict[str, float] = {}
        self._scope = ""
        self._stage: str | None = None
        self.restart()

    def restart(self) -> None:
        """Begin the total now."""
        self._since = self._begun = time.perf_counter()

    def start(self, stage: str) -> None:
        """End the stage under way and begin another."""
        stop_if_abandoned()
        self._finish()
        self._stage = self._scope + stage
        logger.info("%s", self._stage)
        self.reach(self._stage, self._begins.get(stage, 0.0))

    @contextmanager
    def within(self, what: str) -> Iterator[None]:
        """Prefix the names of stages that start in the block: ``what: stage``."""
        outside, self._scope = self._scope, f"{self._scope}{what}: "
        try:
            yield
        finally:
            self._scope = outside

    def beside(self, what: str, seconds: Mapping[str, float]) -> None:
        """Add stages that ran on another thread during the present stage, as ``what: stage``."""
        self._beside |= {f"{what}: {stage}": spent for stage, spent in seconds.items()}

    def reach(self, what: str, share: float) -> None:
        """Tell the present step and the share of the work that is done, from any thread."""
        if self._progress:
            tell(self._tell, self._progress, what, share)

    def _tell(self, progress: Callable[[str, float], Any], what: str, share: float) -> None:
        with self._telling:  # one thread at a time calls the function, which might be slow
            self._share = max(self._share, share)
            progress(what, self._share)

    def stop(self) -> dict[str, float]:
        """End the last stage; return the seconds of all stages, and of all together as ``"total"``."""
        self._finish()
        return {**self._seconds, **self._beside, "total": time.perf_counter() - self._begun}

    def _finish(self) -> None:
        now = time.perf_counter()
        if self._stage:
            self._seconds[self._stage] = self._seconds.get(self._stage, 0.0) + now - self._since
        self._since = now


class _Shown:
    """A line with stage, share and seconds, rewritten by each call."""

    def __init__(self) -> None:
        self._since = 0.0
        self._share = 1.0
        self._bar: Any = None
        self._cell: Any = None

    def __call__(self, stage: str, share: float) -> None:
        now, shell = time.perf_counter(), notebook_shell()
        cell = getattr(shell, "execution_count", None)
        if share < self._share or self._share == 1.0 or cell != self._cell:  # another computation has begun
            self._since, self._bar, self._cell = now, None, cell
        self._share = share
        if shell is None:
            end = "\n" if share == 1.0 else ""
            sys.stderr.write(f"\r{share:4.0%} {now - self._since:6.1f} s  {stage:24.24}{end}")
            sys.stderr.flush()
        else:
            self._show_bar(stage, share, now - self._since)

    def _show_bar(self, stage: str, share: float, seconds: float) -> None:
        from IPython.display import DisplayHandle

        text = f"{share:4.0%} · {seconds:.1f} s · {stage}"
        html = (
            f'<progress max="1" value="{share:.3f}" style="width:14em;vertical-align:middle"></progress> '
            f'<span style="font-variant-numeric:tabular-nums">{escape(text)}</span>'
        )
        shown = {"text/plain": text, "text/html": html}
        if self._bar is None:
            self._bar = DisplayHandle()
            self._bar.display(shown, raw=True)
        else:
            self._bar.update(shown, raw=True)


def notebook_shell() -> Any:
    """Return the shell of the notebook in which the program runs, None outside notebooks."""
    python: Any = sys.modules.get("IPython")
    shell = python.get_ipython() if python else None
    return shell if getattr(shell, "kernel", None) is not None else None


_shown = _Shown()  # the line of `show_progress`


def show_progress(stage: str, share: float) -> None:
    """Show stage, share and elapsed time, in one line of the terminal or in a bar below the cell of a notebook.

    A smaller share than before starts the clock, 1 ends the line.

    Examples
    --------
    >>> from isomatch import match
    >>> from isomatch.datasets import example_pair
    >>> source, target = example_pair()
    >>> result = match(source.mesh, target.mesh, progress=show_progress)
    """
    _shown(stage, share)
