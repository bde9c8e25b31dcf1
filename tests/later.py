"""Cases of a test that are left to `make test-long`."""

from collections.abc import Callable, Iterable
from typing import Any

import pytest


def some_later(cases: Iterable[Any], is_now: Callable[[Any], bool]) -> list[Any]:
    """Mark as long the cases that do not have to be tried each time; a tuple is several arguments."""
    return [
        case
        if is_now(case)
        else pytest.param(*(case if isinstance(case, tuple) else (case,)), marks=pytest.mark.long)
        for case in cases
    ]
