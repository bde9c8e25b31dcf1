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

    begun = time.perf_counter()
    total = here = 0
    for listed, compiled in compile_ahead(everything):
        total, here = total + 1, here + compiled
        if compiled:
            say(f"compiled {listed.module}.{listed.name}")
    seconds = time.perf_counter() - begun
    others = f"{total - here} were compiled before or by a second process"
    say(f"{total} loops are in the cache: {here} were compiled now, {others}; {seconds:.1f} s")
