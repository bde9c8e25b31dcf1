"""Tell the user once what is left out or assumed; in strict mode, raise an error."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

from isomatch._core.errors import InputError

_is_strict: ContextVar[bool] = ContextVar("_is_strict", default=False)  # whether a message is an error
_told: ContextVar[set[str] | None] = ContextVar("_told", default=None)  # messages told so far in a block
logger = logging.getLogger(__name__)


@contextmanager
def telling_once(strict: bool) -> Iterator[None]:
    """Tell each message once in a block; if ``strict``, raise `InputError` instead."""
    tokens = _is_strict.set(strict), _told.set(set())
    try:
        yield
    finally:
        _is_strict.reset(tokens[0])
        _told.reset(tokens[1])


def noted(message: str) -> str:
    """Return a message about something left out or assumed; in a strict block, raise `InputError`."""
    if _is_strict.get():
        raise InputError(f"{message}; an error, as --strict was given")
    return message


def tell_skipped(message: str, tell: Callable[[str], Any] = logger.warning) -> None:
    """Tell a message about something left out or assumed, see `noted`, unless it was told before."""
    already_told = _told.get()
    if already_told is None or message not in already_told:
        tell(noted(message))
        if already_told is not None:
            already_told.add(message)
