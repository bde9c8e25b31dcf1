"""Who is told of the steps of a study, and of what is wrong with its shapes."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

from isomatch._core.stage_timer import Progress, two_arguments

Warn: TypeAlias = Callable[[str], Any]
"""Called with a sentence about shapes or maps that a user should look at; by default they are logged."""

logger = logging.getLogger("isomatch.cohort")


@dataclass(frozen=True)
class Listener:
    """The two functions that a long step calls."""

    tell: Callable[[str, float], Any]  # with a step, and the share that is done
    warn: Warn

    @classmethod
    def of(cls, progress: Progress | None, warn: Warn | None) -> Listener:
        """Take what a user gave; steps that nobody wants to know are not told."""
        return cls(two_arguments(progress) if progress else lambda step, share: None, warn or logger.warning)

    def part(self, first: float, last: float) -> Listener:
        """Make the steps of a part of the work go from one share of it to another."""
        return replace(self, tell=lambda step, share: self.tell(step, first + (last - first) * share))
