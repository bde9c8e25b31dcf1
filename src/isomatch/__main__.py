"""The program: the command line in a process that a signal ends at once."""

from __future__ import annotations

import os
import signal
import sys
from multiprocessing import active_children
from threading import Thread
from types import FrameType

SIGNALS = ("SIGINT", "SIGTERM", "SIGHUP")  # signals that end a command: Ctrl-C, kill, closing the terminal

# bytes for the terminal that clear the line of a progress bar and show the cursor again, which the bar hides
CLEARED = b"\r\x1b[2K\x1b[?25h"


def program() -> None:
    """Run one command and exit with its code; a signal ends the process at once and leaves nothing unfinished."""
    # The command runs on another thread, so that a signal is handled even while a compiled loop runs.
    for name in SIGNALS:
        number = getattr(signal, name, None)
        # A signal that the caller set to be ignored, as nohup does, stays ignored.
        if number is not None and signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _end)
    # Python's process that removes the shared memory of workers would print a warning after a signal.
    sys.warnoptions.append("ignore:resource_tracker:UserWarning")
    codes: list[int] = []
    work = Thread(target=lambda: codes.append(_command()), daemon=True)
    work.start()
    while work.is_alive():
        work.join(0.2)  # Windows handles no signal before a wait ends.
    # The work is done; a signal while the interpreter ends would change the exit code.
    _ignore_signals()
    sys.exit(codes.pop() if codes else 1)


def _command() -> int:
    from isomatch.cli import main  # imported here, as the import is slow

    return main()


def _ignore_signals() -> None:
    for name in SIGNALS:
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)


def _end(number: int, _: FrameType | None) -> None:
    """Leave nothing behind, and end without waiting for threads."""
    _ignore_signals()
    try:
        from isomatch._core.files import abandon_files

        abandon_files()
        for worker in active_children():
            worker.kill()
        os.write(2, (CLEARED if os.isatty(2) else b"") + b"isomatch: interrupted\n")
    finally:  # Even after an error, other threads must not go on and write abandoned files.
        os._exit(128 + number)


if __name__ == "__main__":
    program()
