"""The program ``isomatch``: its commands, and what becomes of their errors."""

from __future__ import annotations

import sys
from ast import FunctionDef, Module, get_docstring, parse
from collections.abc import Sequence
from importlib.metadata import entry_points
from importlib.util import find_spec
from pathlib import Path

from cyclopts import App, Group, Parameter
from cyclopts.exceptions import CoercionError, CycloptsError

from isomatch import __version__
from isomatch._core.errors import IsomatchError, NotConvergedError
from isomatch._core.skipped import telling_once
from isomatch.cli.terminal import IncompleteError, complain, print_anything, start_clock

DONE, BAD, MISUSED, INCOMPLETE, UNSURE, INTERRUPTED = 0, 1, 2, 3, 4, 130  # exit codes, see `main`
STRICT = "--strict"  # option of all commands, which turns warnings into errors

COMMANDS = (  # Each command has a group, module:function, and an example, which begins with its name.
    ("Match", "match_command:match", "match a.ply b.ply -o result"),
    ("Match", "match_command:choose", "choose result 1"),
    ("Match", "demo_command:demo", "demo"),
    ("Look", "open_command:open_page", "open a.ply b.ply"),
    ("Look", "evaluate_command:evaluate", "evaluate map.txt a.ply b.ply"),
    ("Look", "mesh_command:check", "check scans"),
    ("Use", "transfer_command:transfer", "transfer result/map.npz a.glb b.glb -o a_like_b.glb"),
    ("Use", "mesh_command:repair", "repair scan.ply -o mended.ply"),
    ("Many", "collect_command:collect", "collect scans -o cohort"),
    ("Many", "statistics_command:statistics", "statistics cohort -o statistics"),
    ("Many", "asymmetry_command:asymmetry", "asymmetry cohort -o asymmetry"),
    ("Measure", "distance_command:distance", "distance a.ply --from 0 -o distances.csv"),
    ("Measure", "distance_command:basis", "basis a.ply -o basis.npz"),
    ("Develop", "machine_command:info", "info"),
    ("Develop", "machine_command:warm", "warm"),
)
# For each command, by its name: its example, the place of its function, and its group in the help.
EXAMPLES = {example.split()[0]: example for _, _, example in COMMANDS}
COMMAND_PLACES = {name: f"isomatch.cli.{place}" for name, (_, place, _) in zip(EXAMPLES, COMMANDS)}
_GROUP_OF_TITLE = {title: Group.create_ordered(title) for title in dict.fromkeys(row[0] for row in COMMANDS)}
GROUPS = {name: _GROUP_OF_TITLE[title] for name, (title, *_) in zip(EXAMPLES, COMMANDS)}

app = App(
    name="isomatch",
    help=(
        "Point-to-point correspondence between near-isometric surfaces. Maps are found from geodesic distances, "
        "curvature and spectral signatures, and refined with vertex positions and normals. With --strict, what a command "
        "would leave out or suppose is an error."
    ),
    version=__version__,
    version_flags=["--version", "-V"],
    default_parameter=Parameter(negative=()),
)
for name, place in COMMAND_PLACES.items():  # A command is imported when it is called.
    app.command(place, name=name, group=GROUPS[name])
app.register_install_completion_command(
    help="Complete commands and options in the shell: writes a script and adds a line to the shell's start-up file."
)


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command, by default the one in ``sys.argv``, and return its exit code.

    0 if it succeeded, 1 if something cannot be read, computed or written, 2 for wrong usage, 3 if some shapes or pairs
    failed, 4 if a result is not sure.
    """
    print_anything()
    start_clock(with_process=argv is None)
    words = sys.argv[1:] if argv is None else list(argv)
    strict = STRICT in words
    words = [word for word in words if word != STRICT]
    if not words or words[0] not in COMMAND_PLACES:
        # Other packages, such as isomatch_lab, add commands as entry points.
        plugins = {point.name: point.value for point in entry_points(group="isomatch.commands")}
        is_list = not words or words[0] in app.help_flags
        for name, place in {**plugins, **COMMAND_PLACES}.items() if is_list else plugins.items():
            if name in app:
                del app[name]
            group = GROUPS.get(name, _GROUP_OF_TITLE["Develop"])
            app.command(place, name=name, group=group, help=_first_line(place) if is_list else None)
    app.help_epilogue = f"Example: isomatch {EXAMPLES.get(words[0] if words else 'demo', 'demo')}"
    try:
        command, bound, _ = app.parse_args(words, exit_on_error=False, print_error=False)
    except CycloptsError as error:
        asked = " ".join(("isomatch", *(error.command_chain or ())))
        return _complain(f"{_message_of(error)} See {asked} --help.", MISUSED)
    try:
        with telling_once(strict):
            command(*bound.args, **bound.kwargs)
    except IsomatchError as error:
        codes = {IncompleteError: INCOMPLETE, NotConvergedError: UNSURE}
        return _complain(str(error), codes.get(type(error), BAD))
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        where = f"{error.filename}: " if error.filename else ""
        wrong = "the name, the folder and its permissions"
        if isinstance(error, FileExistsError):
            reason, wrong = "is a file where a folder is to be", "the name"
        return _complain(f"{where}{reason}; check {wrong}", BAD)
    except MemoryError as error:
        what, remedy = str(error) or "no more is given", "close other programs, or give smaller shapes"
        return _complain(f"memory does not suffice ({what}); {remedy}", BAD)
    except KeyboardInterrupt:
        return _complain("interrupted", INTERRUPTED)
    return DONE


_WORDS_OF_TYPES = {int: "a whole number", float: "a number"}  # words in messages for the type of an option


def _message_of(error: CycloptsError) -> str:
    """Say what is wrong with the arguments of a command, without the names of Python's types."""
    if isinstance(error, CoercionError) and error.token and error.target_type in _WORDS_OF_TYPES:
        name = error.token.keyword or (error.argument and error.argument.name)
        return f"{name}: {error.token.value!r} is not {_WORDS_OF_TYPES[error.target_type]}."
    return str(error)


def _first_line(place: str) -> str:
    """Read the summary of a command from its source file, which is faster than to import it."""
    module, _, name = place.partition(":")
    spec = find_spec(module)
    tree = parse(Path(spec.origin).read_text(encoding="utf-8")) if spec and spec.origin else Module([], [])
    functions = {node.name: node for node in tree.body if isinstance(node, FunctionDef)}
    command = functions.get(name, functions.get("run"))  # with subcommands, it is a function `run`
    return ((command and get_docstring(command)) or "").partition("\n")[0]


def _complain(message: str, code: int) -> int:
    complain(message)
    return code
