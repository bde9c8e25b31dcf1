"""Progress that is shown while it happens: a line of a terminal, or a bar below the cell of a notebook."""

from __future__ import annotations

import sys
import time
from html import escape
from typing import Any


class _Shown:
    """One line with stage, share and seconds, which each call writes anew."""

    def __init__(self) -> None:
        self._since = 0.0
        self._share = 1.0
        self._bar: Any = None
        self._cell: Any = None

    def __call__(self, stage: str, share: float) -> None:
        now, shell = time.perf_counter(), _notebook()
        cell = getattr(shell, "execution_count", None)
        if share < self._share or self._share == 1.0 or cell != self._cell:  # another computation
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
        told = {"text/plain": text, "text/html": html}
        if self._bar is None:
            self._bar = DisplayHandle()
            self._bar.display(told, raw=True)
        else:
            self._bar.update(told, raw=True)


def _notebook() -> Any:
    """Return the shell of the notebook in which the program runs, if it does."""
    python: Any = sys.modules.get("IPython")
    shell = python.get_ipython() if python else None
    return shell if getattr(shell, "kernel", None) is not None else None


_shown = _Shown()


def show_progress(stage: str, share: float) -> None:
    """Show stage, share and elapsed time, in one line of the terminal or in a bar below the cell of a notebook.

    Parameters
    ----------
    stage : str
        What is being done.
    share : float
        Share of the work that is done; a smaller one than before starts the clock, 1 ends the line.

    Examples
    --------
    >>> from isomatch import match
    >>> from isomatch.datasets import example_pair
    >>> source, target = example_pair()
    >>> result = match(source.mesh, target.mesh, progress=show_progress)
    """
    _shown(stage, share)
