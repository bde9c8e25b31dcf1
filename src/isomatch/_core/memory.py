"""Memory that this process may use, and the budget that refuses large allocations in advance."""

from __future__ import annotations

import os
import re
import sys
from functools import cache
from pathlib import Path

from isomatch._core.errors import MemoryBudgetError, SettingError

MIB, GIB = 2**20, 2**30  # bytes of a mebibyte and of a gibibyte
ROOT = Path("/")  # the root of the file system; tests pass another folder
_MAX_SIZE_RATIO = 20  # most bytes of memory for each byte of a file; chosen, and promised by SECURITY.md
_ALLOWED_BYTES = 2**26  # bytes of memory that a file may claim in any case, however small it is; chosen


def memory_budget() -> int:
    """Return the bytes that a step may allocate: ``ISOMATCH_MEMORY_BUDGET`` or half of the memory."""
    wanted = os.environ.get("ISOMATCH_MEMORY_BUDGET", "")
    if not wanted:
        return available_memory() // 2
    if re.fullmatch(r"[0-9]{1,9}(\.[0-9]*)?|\.[0-9]+", wanted) and float(wanted) > 0:
        return int(float(wanted) * GIB)
    raise SettingError(
        f"ISOMATCH_MEMORY_BUDGET = {wanted!r} is not a positive number; give GiB, such as 8 or 0.5"
    )


def require_memory(n_bytes: float, purpose: str, instead: str) -> None:
    """Raise `MemoryBudgetError` if ``n_bytes`` exceed the budget; say what to do ``instead``."""
    budget = memory_budget()
    if n_bytes > budget:
        raise MemoryBudgetError(
            f"{purpose} needs {n_bytes / GIB:.1f} GiB, the budget is {budget / GIB:.1f} GiB "
            f"(ISOMATCH_MEMORY_BUDGET, in GiB); {instead}"
        )


def room_for(size: int) -> int:
    """Return the bytes of memory that the contents of a file of some size may claim."""
    return _MAX_SIZE_RATIO * size + _ALLOWED_BYTES


def available_memory(root: Path = ROOT) -> int:
    """Return the bytes that the machine, control groups and SLURM leave to this process."""
    groups = [int(words[0]) for words in group_limits("memory.max", root) if words[0].isdecimal()]
    cpus = slurm("SLURM_CPUS_PER_TASK") or slurm("SLURM_CPUS_ON_NODE") or 1
    job = (slurm("SLURM_MEM_PER_NODE") or slurm("SLURM_MEM_PER_CPU") * cpus) * MIB
    total = _total_memory()
    return min([total, *groups, job or total])


@cache
def _total_memory() -> int:
    import psutil

    return int(psutil.virtual_memory().total)


@cache
def group_limits(name: str, root: Path = ROOT) -> list[list[str]]:
    """Read a limit of each control group (version 2) around this process, as words; psutil does not."""
    outermost = root / "sys/fs/cgroup"
    try:
        group = (
            outermost / (root / "proc/self/cgroup").read_text(encoding="utf-8").rpartition("0::/")[2].strip()
        )
    except OSError:  # This system is not Linux.
        return []
    # In a container, the path may be a path of the host; then only the outermost folder exists.
    files = [folder / name for folder in (group, *group.parents) if folder.is_relative_to(outermost)]
    return [words for file in files if file.is_file() and (words := file.read_text(encoding="utf-8").split())]


def slurm(name: str) -> int:
    """Read a number from SLURM, 0 without one."""
    word = os.environ.get(name, "")
    return int(word) if re.fullmatch("[0-9]+", word) else 0


def peak_memory() -> int | None:
    """Return the peak memory of this process in bytes, None where it is unknown."""
    try:
        import resource
    except ImportError:  # Windows
        return None
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit
