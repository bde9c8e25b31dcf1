"""Processors and memory that this process may use: by the machine, control groups (versions 1 and 2) and SLURM."""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

MIB = 2**20
ROOT = Path("/")


def processors() -> int:
    """Return the number of processors, of which a control group may allow a fraction, at least 1."""
    allowed = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return math.ceil(min(allowed, cgroup_processors(ROOT), _slurm("SLURM_CPUS_PER_TASK") or allowed))


def memory() -> float:
    """Return the number of bytes, ``inf`` if unknown."""
    share = _slurm("SLURM_MEM_PER_CPU") * (_slurm("SLURM_CPUS_PER_TASK") or _slurm("SLURM_CPUS_ON_NODE") or 1)
    job = _slurm("SLURM_MEM_PER_NODE") or share
    return min(_machine_memory(), cgroup_memory(ROOT), job * MIB or math.inf)


@cache
def cgroup_processors(root: Path) -> float:
    """Return the processors that the control groups of this process allow, ``inf`` without a limit."""
    limits = [
        _words(group / "cpu.max") or _words(group / "cpu.cfs_quota_us") + _words(group / "cpu.cfs_period_us")
        for group in _groups(root, "cpu")
    ]
    return min(
        (int(limit[0]) / int(limit[1]) for limit in limits if _are_numbers(limit, 2)), default=math.inf
    )


@cache
def cgroup_memory(root: Path) -> float:
    """Return the bytes that the control groups of this process allow, ``inf`` without a limit."""
    limits = [
        _words(group / "memory.max") or _words(group / "memory.limit_in_bytes")
        for group in _groups(root, "memory")
    ]
    return min((int(limit[0]) for limit in limits if _are_numbers(limit, 1)), default=math.inf)


def _groups(root: Path, controller: str) -> Iterator[Path]:
    """Folders of the control groups of this process and of those around them.

    In a container, the path of the group can be that outside, where only the outermost folder is visible.
    """
    for line in _lines(root / "proc/self/cgroup"):
        _, controllers, path = line.split(":", 2)
        if controller in controllers.split(",") or not controllers:  # none are named in version 2
            outermost = root / "sys/fs/cgroup" / (controller if controllers else "")
            group = outermost / path.lstrip("/")
            yield from (group, *(around for around in group.parents if around.is_relative_to(outermost)))


def _lines(path: Path) -> list[str]:
    try:
        return path.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:  # other systems, and groups without this limit
        return []


def _words(path: Path) -> list[str]:
    return [word for line in _lines(path) for word in line.split()]


def _are_numbers(words: list[str], count: int) -> bool:
    return len(words) == count and all(word.isascii() and word.isdecimal() and int(word) for word in words)


def _slurm(name: str) -> int:
    """Value of a variable of SLURM, 0 if it says nothing."""
    word = os.environ.get(name, "")
    return int(word) if _are_numbers([word], 1) else 0


def _machine_memory() -> float:
    try:
        return float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    except (AttributeError, ValueError, OSError):  # systems that do not report their memory
        return math.inf


def peak_memory() -> int | None:
    """Return the most bytes that this process has used so far; None where the system does not tell."""
    try:
        import resource
    except ImportError:  # Windows
        return None
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit
