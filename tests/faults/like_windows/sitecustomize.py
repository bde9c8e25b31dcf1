"""Processes that find this file on their path meet what Windows lacks or refuses, though they run on Linux.

No ``fcntl``, ``resource`` and ``SIGHUP``, and of ``os`` no ``fork``, ``sched_getaffinity`` and ``sysconf``; locks by
``msvcrt``; an open file is neither removed, nor renamed, nor replaced; new processes are spawned; a text is written with
the line ends of Windows. The rest is as it is here.
"""

import builtins
import fcntl
import functools
import io
import multiprocessing
import os
import shutil
import signal
import subprocess  # noqa: F401 - decides by msvcrt, when it is imported, on what system it is
import sys
import types

import psutil  # noqa: F401 - as it is on Linux, where it needs what is taken away below


def _locking(number, mode, count):
    try:
        fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        raise PermissionError(13, "Permission denied") from None


def _is_open(path):
    """Whether a process of this group has a file open."""
    path = os.path.realpath(path)
    for process in os.listdir("/proc"):
        if process.isdecimal():
            try:
                if os.getpgid(int(process)) != os.getpgrp():
                    continue
                folder = f"/proc/{process}/fd"
                if any(os.readlink(f"{folder}/{number}") == path for number in os.listdir(folder)):
                    return True
            except OSError:  # it has ended, or closed the file
                continue
    return False


def _refusing(function):
    @functools.wraps(function)
    def changed(*paths, **options):
        for path in paths:
            if not options and os.path.isfile(path) and _is_open(path):
                raise PermissionError(13, "it is being used by another process", os.fspath(path))
        return function(*paths, **options)

    return changed


def _ending(opened):
    @functools.wraps(opened)
    def open_(file, mode="r", buffering=-1, encoding=None, errors=None, newline=None, *more, **options):
        if newline is None and "b" not in mode and set(mode) & set("wax+"):
            newline = "\r\n"
        return opened(file, mode, buffering, encoding, errors, newline, *more, **options)

    return open_


for name in ("replace", "rename", "unlink", "remove"):
    setattr(os, name, _refusing(getattr(os, name)))
shutil._use_fd_functions = False
builtins.open = io.open = _ending(io.open)
for module in ("fcntl", "resource"):
    sys.modules[module] = None
sys.modules["msvcrt"] = types.SimpleNamespace(locking=_locking, LK_NBLCK=2)
for owner, name in ((os, "fork"), (os, "sched_getaffinity"), (os, "sysconf"), (signal, "SIGHUP")):
    delattr(owner, name)
multiprocessing.set_start_method("spawn")
