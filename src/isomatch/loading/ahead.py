"""Loops that are compiled before they are called."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

from isomatch.loading.dispatcher import compile_for, is_being_compiled
from isomatch.loading.listed import FILES, MATCH, OTHERS, ListedLoop, listed_loops
from isomatch.runtime.locks import Turn


def compile_ahead(everything: bool = False) -> Iterator[tuple[ListedLoop, bool]]:
    """Compile the loops of a first match that the cache lacks, or all loops.

    Yields
    ------
    ListedLoop, bool
        Each loop that is in the cache now, and whether this process compiled it.

    Raises
    ------
    UnwritableFileError
        If the cache cannot be written.
    """
    for listed in listed_loops(MATCH, FILES, *([OTHERS] if everything else [])):
        if listed.loop:
            yield listed, compile_for(listed.loop.dispatcher, listed.types, must_be_kept=True)


def help_out(folder: str) -> None:
    """Compile loops of a first match from the last one on, for a process that begins with the first."""
    turn, parent = Turn(Path(folder, "helper.lock")), os.getppid()
    if not turn.take():
        return
    for listed in (*reversed(listed_loops(MATCH)), *listed_loops(FILES)):
        if os.getppid() != parent:  # which was killed
            break
        if listed.loop and not is_being_compiled(listed.loop.dispatcher):
            compile_for(listed.loop.dispatcher, listed.types)
    turn.end()
