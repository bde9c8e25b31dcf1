"""Seconds of each stage, reported as they start."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from typing import Any

logger = logging.getLogger(__name__)

Progress = Callable[[str], Any]


class StageTimer:
    """Times the stages of a match, one after the other.

    Parameters
    ----------
    progress : callable, optional
        Called with the name of each stage as it starts.
    """

    def __init__(self, progress: Progress | None = None) -> None:
        self._progress = progress
        self._seconds: dict[str, float] = {}
        self._stage: str | None = None
        self._since = self._begun = time.perf_counter()

    def start(self, stage: str) -> None:
        """End the stage under way and begin another."""
        self._finish()
        self._stage = stage
        logger.info("%s", stage)
        if self._progress:
            self._progress(stage)

    def stop(self) -> dict[str, float]:
        """End the last stage; give the seconds of each, and of all as ``"total"``."""
        self._finish()
        return {**self._seconds, "total": time.perf_counter() - self._begun}

    def _finish(self) -> None:
        now = time.perf_counter()
        if self._stage:
            self._seconds[self._stage] = self._seconds.get(self._stage, 0.0) + now - self._since
        self._since = now
