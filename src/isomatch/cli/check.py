"""``isomatch check``: the defects of a mesh, and the commands that it is fit for."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Literal, get_args

from cyclopts import Parameter

import isomatch
from isomatch import bases, matching
from isomatch.cli.basis import N_COLUMNS
from isomatch.cli.inputs import surface_of
from isomatch.cli.terminal import say, say_json

Verb = Literal["distance", "basis", "match"]

# how each command sets out, which is where it refuses a mesh
_BEGINNINGS: dict[Verb, Callable[[isomatch.Mesh], object]] = {
    "distance": lambda mesh: isomatch.distance_engine(surface_of(mesh)),
    "basis": lambda mesh: bases.basis_domain(mesh, n_columns=N_COLUMNS),
    "match": lambda mesh: matching.body_of(mesh, isomatch.Config().preparation),
}


def check(
    file: Path, /, *, verb: Annotated[Verb | None, Parameter(name="--for")] = None, json: bool = False
) -> None:
    """Report the defects of a mesh, and which commands it is fit for.

    The exit code is 1 if geodesic distances are undefined; with --for, if that command would refuse the mesh.

    Parameters
    ----------
    file : Path
        Mesh: .off, .obj, .ply or .stl.
    verb : str
        The command that the exit code is about: distance, basis or match, with their default settings.
    json : bool
        Print a single JSON object and nothing else.
    """
    mesh = isomatch.read_mesh(file)
    report = isomatch.check(mesh)
    refusals = {each: reason for each in get_args(Verb) if (reason := _refusal(each, mesh))}
    if json:
        fit = {each: refusals.get(each) for each in get_args(Verb)}
        say_json({"file": str(file), **report.to_dict(), "refused_by": fit})
    else:
        say(str(report))
        for each in get_args(Verb):
            say(f"not fit for {each}: {refusals[each]}" if each in refusals else f"fit for {each}")
    reason = refusals.get(verb) if verb else "; ".join(report.fatal)
    if reason:
        raise isomatch.MeshError(f"{file}: {reason}")


def _refusal(verb: Verb, mesh: isomatch.Mesh) -> str | None:
    try:
        _BEGINNINGS[verb](mesh)
    except isomatch.MeshError as error:
        return str(error)
    return None
