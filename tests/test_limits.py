"""Threads and memory stay within what control groups and SLURM allow."""

import math
import os

import pytest

from isomatch.runtime import limits
from isomatch.runtime.limits import cgroup_memory, cgroup_processors, memory, processors
from isomatch.runtime.memory import GIB, memory_budget
from isomatch.runtime.threads import n_threads

SLURM = (
    "SLURM_CPUS_PER_TASK",
    "SLURM_CPUS_ON_NODE",
    "SLURM_MEM_PER_CPU",
    "SLURM_MEM_PER_NODE",
    "ISOMATCH_NUM_THREADS",
    "ISOMATCH_MEMORY_BUDGET",
)


@pytest.fixture
def machine(tmp_path, monkeypatch):
    """Function that makes a machine of 64 processors and 256 GiB with given files and variables."""
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(64)), raising=False)
    monkeypatch.setattr(limits, "_machine_memory", lambda: 256.0 * GIB)
    monkeypatch.setattr(limits, "ROOT", tmp_path)
    for cached in (cgroup_processors, cgroup_memory):
        cached.cache_clear()
    for name in SLURM:
        monkeypatch.delenv(name, raising=False)

    def make(files=(), **variables):
        for name, content in dict(files).items():
            path = tmp_path / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(content + "\n")
        for name, value in variables.items():
            monkeypatch.setenv(name, value)

    return make


GROUPS = {
    "version 2": (
        {
            "proc/self/cgroup": "0::/user/job",
            "sys/fs/cgroup/user/job/cpu.max": "350000 100000",
            "sys/fs/cgroup/user/job/memory.max": str(8 * GIB),
        },
        4,
        8,
    ),
    "version 2, limited around it": (
        {
            "proc/self/cgroup": "0::/user/job",
            "sys/fs/cgroup/user/job/cpu.max": "max 100000",
            "sys/fs/cgroup/user/job/memory.max": "max",
            "sys/fs/cgroup/user/cpu.max": "50000 100000",
            "sys/fs/cgroup/user/memory.max": str(GIB),
        },
        1,
        1,
    ),
    "version 1": (
        {
            "proc/self/cgroup": "4:memory:/job\n3:cpu,cpuacct:/job\n0::/",
            "sys/fs/cgroup/cpu/job/cpu.cfs_quota_us": "200000",
            "sys/fs/cgroup/cpu/job/cpu.cfs_period_us": "100000",
            "sys/fs/cgroup/memory/job/memory.limit_in_bytes": str(4 * GIB),
            "sys/fs/cgroup/memory/memory.limit_in_bytes": "9223372036854771712",
        },
        2,
        4,
    ),
    "version 1, seen from a container": (
        {
            "proc/self/cgroup": "4:memory:/docker/abc\n3:cpu,cpuacct:/docker/abc",
            "sys/fs/cgroup/cpu/cpu.cfs_quota_us": "-1",
            "sys/fs/cgroup/cpu/cpu.cfs_period_us": "100000",
            "sys/fs/cgroup/memory/memory.limit_in_bytes": str(2 * GIB),
        },
        64,
        2,
    ),
    "outside of every folder": ({"proc/self/cgroup": "0::/../../job"}, 64, 256),
    "nothing that can be understood": (
        {"proc/self/cgroup": "0::/", "sys/fs/cgroup/cpu.max": "", "sys/fs/cgroup/memory.max": "²"},
        64,
        256,
    ),
}


@pytest.mark.parametrize(("files", "n_processors", "gib"), GROUPS.values(), ids=GROUPS)
def test_control_groups(machine, files, n_processors, gib):
    machine(files)
    assert processors() == n_threads() == n_processors
    assert memory() == gib * GIB == 2 * memory_budget()


@pytest.mark.parametrize(
    ("variables", "n_processors", "gib"),
    [
        ({"SLURM_CPUS_PER_TASK": "6", "SLURM_MEM_PER_NODE": "2048"}, 6, 2),
        ({"SLURM_CPUS_PER_TASK": "4", "SLURM_CPUS_ON_NODE": "8", "SLURM_MEM_PER_CPU": "1024"}, 4, 4),
        ({"SLURM_CPUS_ON_NODE": "8", "SLURM_MEM_PER_CPU": "1024"}, 64, 8),
        ({"SLURM_CPUS_PER_TASK": "999", "SLURM_MEM_PER_NODE": "0"}, 64, 256),
        ({"SLURM_CPUS_PER_TASK": "many", "SLURM_MEM_PER_NODE": "-1"}, 64, 256),
    ],
)
def test_slurm(machine, variables, n_processors, gib):
    machine(**variables)
    assert processors() == n_processors
    assert memory() == gib * GIB


def test_the_user_comes_first(machine):
    machine(GROUPS["version 2"][0], ISOMATCH_NUM_THREADS="9", ISOMATCH_MEMORY_BUDGET="20")
    assert (n_threads(), memory_budget()) == (9, 20 * GIB)


def test_a_system_that_tells_nothing(machine, monkeypatch):
    machine()
    monkeypatch.delattr(os, "sched_getaffinity", raising=False)
    monkeypatch.setattr(limits, "_machine_memory", lambda: math.inf)
    assert processors() == os.cpu_count()
    assert memory_budget() == 4 * GIB
