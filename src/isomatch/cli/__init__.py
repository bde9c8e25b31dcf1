"""The command line: one file for each command."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from cyclopts import App, Parameter
from cyclopts.exceptions import CycloptsError

from isomatch import __version__
from isomatch.cli.basis import basis
from isomatch.cli.bench import bench
from isomatch.cli.check import check
from isomatch.cli.choose import choose
from isomatch.cli.collect import collect
from isomatch.cli.demo import demo
from isomatch.cli.distance import distance
from isomatch.cli.evaluate import evaluate
from isomatch.cli.info import info
from isomatch.cli.match import match
from isomatch.cli.open import open_page
from isomatch.cli.paper import paper
from isomatch.cli.repair import repair
from isomatch.cli.statistics import statistics
from isomatch.cli.terminal import complain, print_anything
from isomatch.cli.transfer import transfer
from isomatch.cli.warm import warm
from isomatch.errors import IsomatchError

__all__ = ["main"]

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
for each in (
    match,
    choose,
    transfer,
    collect,
    basis,
    distance,
    check,
    repair,
    evaluate,
    statistics,
    demo,
    bench,
    paper,
    info,
    warm,
):
    app.command(each)
app.command(open_page, name="open")
app.register_install_completion_command(
    help="Complete commands and options in the shell: writes a script and adds a line to the shell's start-up file."
)


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command.

    Parameters
    ----------
    argv : sequence of str, optional
        Arguments after the name of the program; by default those of the process.

    Returns
    -------
    int
        Exit code: 0 if it succeeded, 1 for bad input or a bad result, 2 for wrong usage.
    """
    print_anything()
    try:
        command, bound, _ = app.parse_args(
            sys.argv[1:] if argv is None else list(argv), exit_on_error=False, print_error=False
        )
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
