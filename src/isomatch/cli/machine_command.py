"""``isomatch info`` and ``isomatch warm``: what is installed on this machine, and loops compiled ahead."""

from __future__ import annotations

import os
import platform
import time

import isomatch
from isomatch import datasets
from isomatch._core.machine import kernels, processor, versions
from isomatch._core.memory import GIB, memory_budget
from isomatch._core.threads import n_threads
from isomatch.cli.inputs import Json
from isomatch.cli.terminal import Talk, say, say_table

# packages that isomatch needs; `info` names their versions, which affect results or speed
REQUIRED = ("numpy", "scipy", "numba", "robust_laplacian", "mapbox_earcut", "matplotlib", "rich", "cyclopts")
# packages that extras of isomatch add; `info` names their versions if they are installed
OPTIONAL = ("scikit-image", "pygeodesic", "potpourri3d", "pyfmaps", "POT", "h5py")
# where numba keeps the loops that it compiled, unless NUMBA_CACHE_DIR is set
DEFAULT_CACHES = "__pycache__ next to each module, or the cache of the user"
# environment variables that set some of the facts that `info` lists, by the name of the fact
ENVIRONMENT_VARIABLES = {
    "threads": "ISOMATCH_NUM_THREADS",
    "memory_budget_gib": "ISOMATCH_MEMORY_BUDGET",
    "numba_cache": "NUMBA_CACHE_DIR",
}


def info(*, json: Json = False) -> None:
    """Print versions and settings, for bug reports."""
    facts = {
        "isomatch": isomatch.__version__,
        "python": platform.python_version(),
        **versions(REQUIRED + OPTIONAL),
        "platform": platform.platform(),
        "processor": processor(),
        "threads": n_threads(),
        "blas": kernels(),
        "numba_cache": os.environ.get("NUMBA_CACHE_DIR") or DEFAULT_CACHES,
        "memory_budget_gib": round(memory_budget() / GIB, 1),
    }
    rows = [(name, str(value), ENVIRONMENT_VARIABLES.get(name, "")) for name, value in facts.items()]
    Talk(json=json).result(facts, lambda: say_table(rows))


def warm() -> None:
    """Compile the loops of a first match now, so that it need not: for images, and before many processes start at once.

    It matches the shipped pair. python -m isomatch.warm does the same.
    """
    started = time.perf_counter()
    source, target = datasets.example_pair()
    isomatch.match(source.mesh, target.mesh)
    say(f"the loops of a match are in the cache; {time.perf_counter() - started:.1f} s")
