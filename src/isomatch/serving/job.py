"""A computation beside the server: what it does now, how it ended, and how to give it up."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from isomatch.runtime.threads import Abandoned, Call, stop_if_abandoned

Tell = Callable[[str, float], None]
POLL = 0.05  # seconds between two looks at a job that is waited for


class Job:
    """Runs a function on a thread of its own.

    Parameters
    ----------
    name : str
        What is done, such as ``"match"``.
    work : callable
        Called with a function of the stage and of the share of the work that is done.

    Attributes
    ----------
    succeeded : bool
        Whether it has come to a result, even if it was given up before.
    """

    def __init__(self, name: str, work: Callable[[Tell], Any]) -> None:
        self.name = name
        self._result: Any = None
        self._error: Exception | None = None
        self.succeeded = False
        self._now = ("", 0.0)
        self._since = time.perf_counter()
        self._seconds: float | None = None
        self._call = Call()

        def run() -> None:
            try:
                self._result = work(self._tell)
                self.succeeded = True
            except Abandoned:
                pass
            except Exception as error:
                self._error = error
            finally:
                self._seconds = time.perf_counter() - self._since

        self._thread = self._call.thread(run)
        self._thread.start()

    def _tell(self, stage: str, share: float) -> None:
        self._now = stage, share

    def give_up(self) -> None:
        """Let it end at the next place where it can stop."""
        self._call.abandoned = True

    @property
    def is_over(self) -> bool:
        """Whether its thread has ended."""
        return not self._thread.is_alive()

    @property
    def seconds(self) -> float:
        """How long it has run."""
        return time.perf_counter() - self._since if self._seconds is None else self._seconds

    def join(self) -> None:
        """Wait until it is over, however it ended; a wait within a job ends with that job."""
        while not self.is_over:
            stop_if_abandoned()
            self._thread.join(POLL)

    def wait(self) -> Any:
        """Wait until it is over (`join`), and return its result or raise its error."""
        self.join()
        if self._error:
            raise self._error
        return self._result

    def now(self) -> tuple[str, float]:
        """Return the stage, and the share of the work that is done."""
        while not self._call.messages.empty():
            message = self._call.messages.get()
            if message is not None:
                message()
        return self._now
