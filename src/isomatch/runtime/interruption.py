"""Calls that can be given up: they run beside the thread that asked, which an interruption reaches at any moment."""

from __future__ import annotations

from collections.abc import Callable
from contextvars import copy_context
from functools import partial
from queue import Empty, SimpleQueue
from threading import Thread, local
from typing import Any, TypeVar

R = TypeVar("R")

POLL = 0.2  # seconds; where a wait cannot be interrupted, as on Windows, it is at least this short


class Abandoned(BaseException):
    """Ends a thread whose result nobody waits for; never seen outside it."""


class Call:
    """A call under way, on one thread or on several."""

    def __init__(self) -> None:
        self.abandoned = False
        self.messages: SimpleQueue[Callable[[], Any] | None] = SimpleQueue()

    def thread(self, function: Callable[[], Any]) -> Thread:
        """Make a thread that works for this call; it keeps no process alive."""

        def work() -> None:
            _here.call = self
            function()

        return Thread(target=copy_context().run, args=(work,), daemon=True)


_here = local()


def current_call() -> Call | None:
    """Return the call that this thread works for, if it is one in the background."""
    return getattr(_here, "call", None)


def stop_if_abandoned() -> None:
    """End this thread if nobody waits for it any more; to be called where a computation can stop."""
    call = current_call()
    if call is not None and call.abandoned:
        raise Abandoned


def in_background(function: Callable[[], R]) -> R:
    """Call a function on another thread and wait for its result, so that an interruption need not wait for a loop.

    When an exception, such as that of Ctrl-C, reaches the waiting thread, it goes through at once; the function ends
    at the next `stop_if_abandoned`. Within such a call, the function is called directly.
    """
    if current_call() is not None:
        return function()
    call, results, errors = Call(), [], []

    def work() -> None:
        try:
            results.append(function())
        except BaseException as error:
            errors.append(error)
        finally:
            call.messages.put(None)

    thread = call.thread(work)
    try:
        thread.start()
        while message := _next(call):
            message()
        thread.join()  # what it held is free
    except BaseException:
        call.abandoned = True
        raise
    if errors:
        raise errors.pop()
    return results.pop()


def _next(call: Call) -> Callable[[], Any] | None:
    while True:
        try:
            return call.messages.get(timeout=POLL)
        except Empty:
            continue


def tell(listener: Callable[..., Any], *values: Any) -> None:
    """Call a function of the user's, on the thread that waits for this call; what it raises gives up the call."""
    stop_if_abandoned()
    call = current_call()
    if call is None:
        listener(*values)
    else:
        call.messages.put(partial(listener, *values))
