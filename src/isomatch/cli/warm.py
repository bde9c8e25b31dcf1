"""``isomatch warm``: compile ahead what a first match would compile."""

from __future__ import annotations

import time
from typing import Annotated

from cyclopts import Parameter

from isomatch.cli.terminal import say


def warm(*, everything: Annotated[bool, Parameter(name="--all")] = False) -> None:
    """Compile the loops of a first match now, so that it need not: for images, and before many processes start at once.

    python -m isomatch.warm does the same.

    Parameters
    ----------
    everything : bool
        Compile also the loops of rarer steps.
    """
    from isomatch.loading.ahead import compile_ahead  # imports numba, which is slow

    begun = since = time.perf_counter()
    total = here = 0
    for listed, compiled in compile_ahead(everything):
        now = time.perf_counter()
        if compiled:
            say(f"compiled in {now - since:.2f} s: {listed.module}.{listed.name}")
        total, here, since = total + 1, here + compiled, now
    others = f"{total - here} were compiled before or by a second process"
    say(f"{total} loops are in the cache: {here} were compiled now, {others}; {since - begun:.1f} s")
