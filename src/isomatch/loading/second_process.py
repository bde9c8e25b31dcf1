"""A second process that compiles loops of a first match while this one compiles others: numba compiles one at a time."""

from __future__ import annotations

import atexit
import os
import subprocess
import sys
from multiprocessing import current_process
from pathlib import Path

from isomatch.runtime.threads import n_threads

_HELP = "import sys; from isomatch.loading.ahead import help_out; help_out(sys.argv[1])"


def ask_for_help(folder: str) -> bool:
    """Start the process, if this one is a program of its own that may use more than one thread; True if it was started.

    Whatever becomes of it, the loops that it has not compiled are compiled by those who call them. It ends when all are
    compiled, at once if another one helps in the folder of the cache, and is killed when this process exits.
    """
    is_python = Path(sys.executable or "").name.startswith("python")  # and no program around it
    if current_process().name != "MainProcess" or n_threads() < 2 or not is_python:
        return False
    path = os.pathsep.join(entry for entry in sys.path if isinstance(entry, str) and entry)
    try:
        process = subprocess.Popen(
            [sys.executable, "-P", "-c", _HELP, folder],
            env=os.environ | {"PYTHONPATH": path, "ISOMATCH_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
            creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
        )  # fmt: skip
    except OSError:  # as where no more processes are allowed
        return False
    atexit.register(_end, process)
    return True


def _end(process: subprocess.Popen[bytes]) -> None:
    process.kill()
    process.wait()
