"""``isomatch check``: whether a mesh is suitable for matching."""

from __future__ import annotations

from pathlib import Path

import isomatch
from isomatch.cli.terminal import say, say_json


def check(file: Path, /, *, json: bool = False) -> None:
    """Report the defects of a mesh. The exit code is 1 if it cannot be used for matching.

    Parameters
    ----------
    file : Path
        Mesh: .off, .obj, .ply or .stl.
    json : bool
        Print a single JSON object and nothing else.
    """
    report = isomatch.check(isomatch.read_mesh(file))
    if json:
        say_json({"file": str(file), **report.to_dict()})
    else:
        say(str(report))
    if report.fatal:
        raise isomatch.MeshError(f"{file}: {'; '.join(report.fatal)}")
