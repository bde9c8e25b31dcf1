"""The program ``isomatch``: its commands, and what becomes of their errors."""

from __future__ import annotations

import sys
from ast import FunctionDef, Module, get_docstring, parse
from collections.abc import Sequence
from importlib.metadata import entry_points
from importlib.util import find_spec
from pathlib import Path

from cyclopts import App, Parameter
from cyclopts.exceptions import CycloptsError

from isomatch import __version__
from isomatch._core.errors import IsomatchError
from isomatch._core.skipped import telling_once
from isomatch.cli.terminal import complain, print_anything

DONE, BAD, MISUSED, INTERRUPTED = 0, 1, 2, 130
STRICT = "--strict"  # an option of all commands

app = App(
    name="isomatch",
    help=(
        "Point-to-point correspondence between near-isometric surfaces. Maps are found from geodesic distances, "
        "curvature and spectral signatures, and refined with vertex positions and normals. With --strict, what a command "
        "would leave out or suppose is an error."
    ),
    version=__version__,
    default_parameter=Parameter(negative=()),
)
_BY_FILE = {
    "match_command": ("match", "choose", "demo"),
    "open_command": ("open",),
    "transfer_command": ("transfer",),
    "collect_command": ("collect",),
    "statistics_command": ("statistics",),
    "asymmetry_command": ("asymmetry",),
    "distance_command": ("distance", "basis"),
    "mesh_command": ("check", "repair"),
    "evaluate_command": ("evaluate",),
    "machine_command": ("info", "warm"),
}
_FUNCTIONS = {"open": "open_page"}  # of the commands that are not named as their function
OWN = {
    name: f"isomatch.cli.{file}:{_FUNCTIONS.get(name, name)}"
    for file, names in _BY_FILE.items()
    for name in names
}
for name, place in OWN.items():  # each is imported when it is called
    app.command(place, name=name)
app.register_install_completion_command(
    help="Complete commands and options in the shell: writes a script and adds a line to the shell's start-up file."
)


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command, by default that of the process, and return its exit code.

    0 if it succeeded, 1 for bad input or a bad result, 2 for wrong usage.
    """
    print_anything()
    words = sys.argv[1:] if argv is None else list(argv)
    strict = STRICT in words
    words = [word for word in words if word != STRICT]
    if not words or words[0] not in OWN:
        # of other packages, such as isomatch_lab
        others = {each.name: each.value for each in entry_points(group="isomatch.commands")}
        is_list = not words or words[0] in app.help_flags
        for name, place in {**others, **OWN}.items() if is_list else others.items():
            if name in app:
                del app[name]
            app.command(place, name=name, help=_first_line(place) if is_list else None)
    try:
        command, bound, _ = app.parse_args(words, exit_on_error=False, print_error=False)
    except CycloptsError as error:
        return _complain(f"{error} See isomatch --help.", MISUSED)
    try:
        with telling_once(strict):
            command(*bound.args, **bound.kwargs)
    except IsomatchError as error:
        return _complain(str(error), BAD)
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        where = f"{error.filename}: " if error.filename else ""
        return _complain(f"{where}{reason}; check the name, the folder and its permissions", BAD)
    except MemoryError as error:
        what, remedy = str(error) or "no more is given", "close other programs, or give smaller shapes"
        return _complain(f"memory does not suffice ({what}); {remedy}", BAD)
    except KeyboardInterrupt:
        return _complain("interrupted", INTERRUPTED)
    return DONE


def _first_line(place: str) -> str:
    """Read what a command does from its file, without the import of all that it needs."""
    module, _, name = place.partition(":")
    spec = find_spec(module)
    tree = parse(Path(spec.origin).read_text(encoding="utf-8")) if spec and spec.origin else Module([], [])
    functions = {each.name: each for each in tree.body if isinstance(each, FunctionDef)}
    command = functions.get(name, functions.get("run"))  # a command with commands of its own runs that
    return ((command and get_docstring(command)) or "").partition("\n")[0]


def _complain(message: str, code: int) -> int:
    complain(message)
    return code
