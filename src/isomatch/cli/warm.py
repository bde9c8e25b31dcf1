"""``isomatch warm``: compile ahead what a first match would compile."""

from __future__ import annotations

import time

import isomatch
from isomatch import datasets
from isomatch.cli.terminal import say


def warm() -> None:
    """Compile the loops of a first match now, so that it need not: for images, and before many processes start at once.

    It matches the shipped pair. python -m isomatch.warm does the same.
    """
    begun = time.perf_counter()
    source, target = datasets.example_pair()
    isomatch.match(source.mesh, target.mesh)
    say(f"the loops of a match are in the cache; {time.perf_counter() - begun:.1f} s")
