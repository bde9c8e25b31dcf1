"""What is left out or supposed is told, once in a command; where all must be used, it is an error."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

from isomatch._core.errors import InputError

_is_strict: ContextVar[bool] = ContextVar("_is_strict", default=False)
_told: ContextVar[set[str] | None] = ContextVar("_told", default=None)
logger = logging.getLogger(__name__)


@contextmanager
def telling_once(strict: bool) -> Iterator[None]:
    """Tell of everything once in a block; if ``strict``, raise `InputError` instead."""
    tokens = _is_strict.set(strict), _told.set(set())
    try:
        yield
    finally:
        _is_strict.reset(tokens[0])
        _told.reset(tokens[1])


def noted(message: str) -> str:
    """Return a sentence about what is left out or supposed; in a strict block, it is an `InputError`."""
    if _is_strict.get():
        raise InputError(f"{message}; an error, as --strict was given")
    return message


def tell_skipped(message: str, tell: Callable[[str], Any] = logger.warning) -> None:
    """Tell of what is left out or supposed, see `noted`, and of the same not again."""
    told = _told.get()
    if told is None or message not in told:
        tell(noted(message))
        if told is not None:
            told.add(message)
