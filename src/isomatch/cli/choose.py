"""``isomatch choose``: continue with an alternative of a result."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from json import loads
from math import nan
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

import isomatch
from isomatch import matching, view
from isomatch.cli.inputs import naming_files, read_surface
from isomatch.cli.outputs import ResultFolder, say_files, say_result
from isomatch.cli.terminal import TALK, Talk, part
from isomatch.errors import FormatError, SettingError
from isomatch.storage.files import opened

BEFORE = "the map before, "

_NEEDED: dict[str, type] = {
    "source": str,
    "target": str,
    "match_again": str,
    "landmarks": list,
    "config": dict,
    "seed": int,
    "origin": str,
    "alternatives": list,
    "files": dict,
}


def choose(
    folder: Path,
    number: int,
    /,
    *,
    details: Annotated[bool, Parameter(negative=())] = False,
    talk: Talk = TALK,
) -> None:
    """Make an alternative the map: refine and measure it, and replace the files of the result.

    The former map becomes alternative 1, and the other alternatives follow. A map of the other direction is removed.

    Parameters
    ----------
    folder : Path
        Folder that isomatch match wrote. The two meshes are read from where they were then.
    number : int
        Number of the alternative in the report, from 1.
    details : bool
        Print every measure too, with its bound, and the seconds of each stage.
    talk : Talk
        What is told.
    """
    record = _record(ResultFolder(folder).result)
    results = ResultFolder(folder, report="report" in record["files"])
    n_saved = sum(name.startswith("alternative") for name in record["files"])
    others = record["alternatives"][:n_saved]
    if not 1 <= number <= len(others):
        raise SettingError(
            f"{folder}: there is no alternative {number}; the result has {len(others) or 'none'} of them"
        )
    source, target = Path(record["source"]), Path(record["target"])
    settings = isomatch.Config.from_dict({**record["config"], "hypotheses": "given", "start": "auto"})
    landmarks = record["landmarks"] or None
    with talk.progress() as tell, results.claimed(force=True):
        tell("reading", 0.0)
        shapes = read_surface(source), read_surface(target)
        n_target = shapes[1].n_vertices
        former = isomatch.Correspondence.load(results.files["map"], n_target)
        maps = [
            isomatch.Correspondence.load(results.alternative(i), n_target) for i, _ in enumerate(others, 1)
        ]
        former.check_fits(*shapes)
        with naming_files(source=source, target=target):
            result = isomatch.match(
                *shapes,
                landmarks=None if settings.pin is None else landmarks,
                initial_map=maps[number - 1].vertices,
                config=settings,
                seed=record["seed"],
                progress=part(tell, 0.05, 0.85),
            )
        left = [_alternative(alternative, found) for alternative, found in zip(others, maps)]
        origin = left.pop(number - 1).origin
        left.insert(0, replace(_alternative(record, former), origin=BEFORE + record["origin"]))
        chosen = f"alternative {number}, from {origin}"
        note = f"{chosen}, was chosen and refined; the map before is alternative 1"
        result = replace(result, alternatives=tuple(left), origin=origin, notes=(note, *result.notes))
        tell("writing", 0.85)
        record = results.write(
            view.drawable(shapes[0]),
            view.drawable(shapes[1]),
            result,
            names=(source.name, target.name),
            titles=(f"source: {source.name}", f"target: {target.name}"),
            facts={"source": str(source), "target": str(target), "chosen": chosen},
            more={name: record[name] for name in ("source", "target", "match_again", "landmarks")},
            landmarks=landmarks,
            command=record["match_again"],
        )

    def summary() -> None:
        say_result(result, details)
        say_files(record)

    talk.result(record, summary)


def _record(path: Path) -> dict[str, Any]:
    """Read ``result.json``, and require what a match writes."""
    with opened(path) as file:
        text = file.read()
    try:
        record = loads(text)
    except ValueError:
        record = None
    fields = record if isinstance(record, dict) else {}
    missing = [name for name, kind in _NEEDED.items() if not isinstance(fields.get(name), kind)]
    if missing:
        raise FormatError(
            f"{path}: lacks {', '.join(missing)}; give the folder of a result of isomatch match"
        )
    return fields


def _alternative(evidence: Mapping[str, Any], found: isomatch.Correspondence) -> matching.Alternative:
    energy, orientation = (
        nan if evidence.get(name) is None else evidence[name] for name in ("energy", "orientation")
    )
    return matching.Alternative(lambda: found, energy, orientation, evidence["origin"].removeprefix(BEFORE))
