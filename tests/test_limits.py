"""Threads and memory stay within what control groups and SLURM allow."""

import psutil
import pytest

from isomatch._core.memory import GIB, available_memory, memory_budget
from isomatch._core.threads import n_threads, processors

SLURM = (
    "SLURM_CPUS_PER_TASK",
    "SLURM_CPUS_ON_NODE",
    "SLURM_MEM_PER_CPU",
    "SLURM_MEM_PER_NODE",
    "ISOMATCH_NUM_THREADS",
    "ISOMATCH_MEMORY_BUDGET",
)
MIB = 2**20
ALL = psutil.virtual_memory().total / MIB
HERE = processors()


@pytest.fixture(autouse=True)
def no_slurm(monkeypatch):
    for name in SLURM:
        monkeypatch.delenv(name, raising=False)


GROUPS = {
    "its own": (
        {
            "proc/self/cgroup": "0::/user/job",
            "sys/fs/cgroup/user/job/cpu.max": "50000 100000",
            "sys/fs/cgroup/user/job/memory.max": str(80 * MIB),
        },
        1,
        80,
    ),
    "one around it": (
        {
            "proc/self/cgroup": "1:name=systemd:/\n0::/user/job",
            "sys/fs/cgroup/user/job/cpu.max": "max 100000",
            "sys/fs/cgroup/user/job/memory.max": "max",
            "sys/fs/cgroup/user/cpu.max": "100000 100000",
            "sys/fs/cgroup/user/memory.max": str(MIB),
        },
        1,
        1,
    ),
    "seen from a container": (
        {
            "proc/self/cgroup": "0::/docker/abc",
            "sys/fs/cgroup/cpu.max": "max 100000",
            "sys/fs/cgroup/memory.max": str(2 * MIB),
        },
        HERE,
        2,
    ),
    "outside of every folder": ({"proc/self/cgroup": "0::/../../job"}, HERE, ALL),
    "nothing that can be understood": (
        {"proc/self/cgroup": "0::/", "sys/fs/cgroup/cpu.max": "", "sys/fs/cgroup/memory.max": "²"},
        HERE,
        ALL,
    ),
    "another system": ({}, HERE, ALL),
}


@pytest.mark.parametrize(("files", "n_processors", "mib"), GROUPS.values(), ids=GROUPS)
def test_control_groups(tmp_path, files, n_processors, mib):
    for name, content in files.items():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content + "\n")
    assert processors(tmp_path) == n_processors
    assert available_memory(tmp_path) == mib * MIB


@pytest.mark.parametrize(
    ("variables", "n_processors", "mib"),
    [
        ({"SLURM_CPUS_PER_TASK": "1", "SLURM_MEM_PER_NODE": "2"}, 1, 2),
        ({"SLURM_CPUS_PER_TASK": "4", "SLURM_CPUS_ON_NODE": "8", "SLURM_MEM_PER_CPU": "1"}, min(4, HERE), 4),
        ({"SLURM_CPUS_ON_NODE": "8", "SLURM_MEM_PER_CPU": "1"}, HERE, 8),
        ({"SLURM_CPUS_PER_TASK": "9999", "SLURM_MEM_PER_NODE": "0"}, HERE, ALL),
        ({"SLURM_CPUS_PER_TASK": "many", "SLURM_MEM_PER_NODE": "-1"}, HERE, ALL),
    ],
)
def test_slurm(tmp_path, monkeypatch, variables, n_processors, mib):
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    assert processors(tmp_path) == n_processors
    assert available_memory(tmp_path) == mib * MIB


def test_the_user_comes_first(monkeypatch):
    monkeypatch.setenv("SLURM_MEM_PER_NODE", "8")
    assert (n_threads(), memory_budget()) == (HERE, 4 * MIB)
    monkeypatch.setenv("ISOMATCH_NUM_THREADS", "9")
    monkeypatch.setenv("ISOMATCH_MEMORY_BUDGET", "20")
    assert (n_threads(), memory_budget()) == (9, 20 * GIB)
