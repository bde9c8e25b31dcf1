"""The program ``isomatch``: its commands, and what becomes of their errors."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib.metadata import entry_points

from cyclopts import App, Parameter
from cyclopts.exceptions import CycloptsError

from isomatch import __version__
from isomatch.cli.terminal import complain, print_anything
from isomatch.errors import IsomatchError

DONE, BAD, MISUSED, INTERRUPTED = 0, 1, 2, 130

app = App(
    name="isomatch",
    help=(
        "Point-to-point correspondence between near-isometric surfaces. Maps are found from geodesic distances, "
        "curvature and spectral signatures, and refined with vertex positions and normals."
    ),
    version=__version__,
    default_parameter=Parameter(negative=()),
)
COMMANDS = {  # by the file that has them, each imported when it is called
    "match": ("match", "choose", "demo"),
    "open": ("open",),
    "transfer": ("transfer",),
    "collect": ("collect",),
    "statistics": ("statistics",),
    "distance": ("distance", "basis"),
    "mesh": ("check", "repair"),
    "evaluate": ("evaluate",),
    "machine": ("info", "warm"),
}
for file, names in COMMANDS.items():
    for name in names:
        app.command(f"isomatch.cli.{file}:{name}", name=name)
for entry in entry_points(group="isomatch.commands"):  # of other packages, such as isomatch_lab
    app.command(entry.value, name=entry.name)
app.register_install_completion_command(
    help="Complete commands and options in the shell: writes a script and adds a line to the shell's start-up file."
)


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command, by default that of the process, and return its exit code.

    0 if it succeeded, 1 for bad input or a bad result, 2 for wrong usage.
    """
    print_anything()
    words = sys.argv[1:] if argv is None else list(argv)
    if not words or words[0] in app.help_flags:
        for name in app:
            app[name]  # the list of all commands has the first line of each
    try:
        command, bound, _ = app.parse_args(words, exit_on_error=False, print_error=False)
    except CycloptsError as error:
        return _complain(f"{error} See isomatch --help.", MISUSED)
    try:
        command(*bound.args, **bound.kwargs)
    except IsomatchError as error:
        return _complain(str(error), BAD)
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        where = f"{error.filename}: " if error.filename else ""
        return _complain(f"{where}{reason}; check the name, the folder and its permissions", BAD)
    except MemoryError as error:
        return _complain(
            f"memory does not suffice ({str(error) or 'no more is given'}); close other programs, or give smaller shapes",
            BAD,
        )
    except KeyboardInterrupt:
        return _complain("interrupted", INTERRUPTED)
    return DONE


def _complain(message: str, code: int) -> int:
    complain(message)
    return code
