"""The memory budget: large allocations are estimated first, and refused with an alternative if they exceed it."""

from __future__ import annotations

import math
import os
import re

from isomatch.errors import MemoryBudgetError, SettingError
from isomatch.runtime.limits import memory

GIB = 2**30
_MOST_TIMES = 20  # the size of a file, which SECURITY.md promises
_ANY_FILE = 2**26  # bytes, which are no harm


def memory_budget() -> int:
    """Return how many bytes one step may allocate.

    This is ``ISOMATCH_MEMORY_BUDGET``, in GiB, if it is set, and otherwise half the memory that this process may
    use, see `isomatch.runtime.limits`; 4 GiB where the system does not tell.
    """
    wanted = os.environ.get("ISOMATCH_MEMORY_BUDGET", "")
    if wanted:
        if re.fullmatch(r"[0-9]{1,9}(\.[0-9]*)?|\.[0-9]+", wanted) and float(wanted) > 0:
            return int(float(wanted) * GIB)
        raise SettingError(
            f"ISOMATCH_MEMORY_BUDGET = {wanted!r} is not a positive number; give GiB, such as 8 or 0.5"
        )
    available = memory()
    return int(available / 2) if math.isfinite(available) else 4 * GIB


def require_memory(n_bytes: float, purpose: str, instead: str) -> None:
    """Raise `MemoryBudgetError` if an allocation exceeds the budget.

    Parameters
    ----------
    n_bytes : float
        Estimated size of the allocation.
    purpose : str
        What needs it, for the message.
    instead : str
        What the user can do instead, for the message.
    """
    budget = memory_budget()
    if n_bytes > budget:
        raise MemoryBudgetError(
            f"{purpose} needs {n_bytes / GIB:.1f} GiB, the budget is {budget / GIB:.1f} GiB "
            f"(ISOMATCH_MEMORY_BUDGET, in GiB); {instead}"
        )


def room_for(size: int) -> int:
    """Return how many bytes of memory what is in a file of a size may claim: many times that, and some of any file."""
    return _MOST_TIMES * size + _ANY_FILE
