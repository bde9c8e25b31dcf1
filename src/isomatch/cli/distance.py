"""``isomatch distance``: geodesic distances of pairs of vertices, or from some vertices to all."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import numpy as np
from cyclopts import Group, Parameter
from cyclopts.validators import LimitedChoice

import isomatch
from isomatch import geodesics
from isomatch.cli.inputs import read_pairs, surface_of
from isomatch.cli.outputs import claimed_files
from isomatch.cli.terminal import TALK, Talk, Tell, complain, part, say
from isomatch.errors import FormatError
from isomatch.geodesics import engine_names
from isomatch.storage.array_file import write_arrays
from isomatch.storage.files import is_whole_number, write_text
from isomatch.values.arrays import FloatArray, IntArray

AT_ONCE = 16  # columns between two announcements of progress
WHICH = Group("Which distances (one of them)", validator=LimitedChoice(1, 1))
HOW = Group("How (at most one of them)", validator=LimitedChoice(0, 1))


def _require_known(_: object, name: str | None) -> None:
    if name is not None and name not in engine_names():
        raise ValueError(f"There is no engine {name!r}; known are {', '.join(engine_names())}.")


EngineOption = Annotated[
    str | None,
    Parameter(
        validator=_require_known,
        help=f"How distances are computed: {', '.join(engine_names())}. By default "
        f"{engine_names(isomatch.Mesh)[0]} for meshes, {engine_names(isomatch.PointCloud)[0]} for points.",
    ),
]


def distance(
    file: Path,
    /,
    *,
    pairs: Annotated[Path | None, Parameter(group=WHICH)] = None,
    sources: Annotated[str | None, Parameter(name="--from", group=WHICH)] = None,
    engine: Annotated[EngineOption, Parameter(group=HOW)] = None,
    basis: Annotated[Path | None, Parameter(group=HOW)] = None,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"])] = None,
    force: bool = False,
    talk: Talk = TALK,
) -> None:
    """Print or write geodesic distances, in the units of the file; inf where no path leads.

    Parameters
    ----------
    file : Path
        Mesh: any surface file, such as .ply, .obj or .vtp. Points without faces are joined to their nearest neighbours.
    pairs : Path
        File with two 0-based vertex indices per line, separated by a comma or blank, # comments: one distance for each.
    sources : str
        0-based vertex indices separated by commas: distances from each to all vertices.
    engine : str
        How distances are computed.
    basis : Path
        Distance basis of this mesh, written by isomatch basis: its approximate distances are used.
        The distance of a vertex from itself is 0.
    output : Path
        File to write the distances to, instead of printing them: .csv, or .npz with distances and pairs or sources.
    force : bool
        Replace an existing file.
    talk : Talk
        What is told.
    """
    if output is not None and output.suffix not in (".csv", ".npz"):
        raise FormatError(f"{output}: suffix {output.suffix!r} cannot be written; use .csv or .npz")
    asked = (
        read_pairs(pairs, "a pair", "separated by a comma or blank")
        if pairs is not None
        else _vertices(sources or "")
    )
    kind = "pairs" if pairs is not None else "sources"
    with claimed_files(output, force=force), talk.progress() as tell:
        tell("reading", 0.0)
        mesh = isomatch.read_mesh(file)
        name, distances, error = _distances(surface_of(mesh), asked, engine, basis, part(tell, 0.1, 0.9))
        if output is not None:
            tell("writing", 0.9)
            _write(output, kind, asked, distances)
        tell("done", 1.0)
    record = {"file": str(file), "engine": name, "basis": basis and str(basis), kind: asked.tolist()}
    record["approximate"] = basis is not None
    if error is not None:
        record["estimated_relative_error"] = error
    if output is None:
        record["distances"] = distances.tolist()
    else:
        record["output"] = str(output)
    remark = "" if error is None else f", approximate: estimated relative error {error:.2%}"

    def summary() -> None:
        if output is not None:
            say(f"wrote {output}: {distances.size} distances by {name}{remark}")
            return
        say("\n".join(_lines(kind, asked, distances)))
        if remark:
            complain(f"distances by {name}{remark}")

    talk.result(record, summary, is_answer=output is None)


def _vertices(words: str) -> IntArray:
    listed = [word.strip() for word in words.split(",")]
    if not all(map(is_whole_number, listed)):
        raise isomatch.SettingError(
            f"--from {words!r} is not a list of vertices; write 0-based indices separated by commas, such as 0,12"
        )
    return np.array([int(word) for word in listed], dtype=np.int64)


def _distances(
    surface: isomatch.Mesh | isomatch.PointCloud,
    asked: IntArray,
    engine: str | None,
    basis: Path | None,
    tell: Tell,
) -> tuple[str, FloatArray, float | None]:
    """Name of the engine or basis, its distances, (m,) for pairs (m, 2), (m, n) for sources (m,), and a basis's error."""
    tell("distances", 0.0)
    if basis is None:
        chosen = isomatch.distance_engine(surface, engine)
        if asked.ndim == 2:
            return chosen.name, geodesics.pair_distances(chosen, asked), None
        rows = []
        for first in range(0, len(asked), AT_ONCE):
            rows.append(chosen.distances_from(asked[first : first + AT_ONCE]))
            tell(f"distances from {min(first + AT_ONCE, len(asked))} of {len(asked)}", first / len(asked))
        return chosen.name, np.concatenate(rows), None
    low_rank = isomatch.DistanceBasis.load(basis)
    if len(low_rank.vectors) != surface.n_vertices:
        raise isomatch.MeshError(
            f"{basis}: a basis of {len(low_rank.vectors)} points, but the surface has {surface.n_vertices} vertices; "
            "give the mesh that it was computed from"
        )
    name = f"{low_rank.method} basis of rank {low_rank.rank} by {low_rank.engine}"
    error = low_rank.error_estimate()
    if asked.ndim == 2:
        apart = np.where(asked[:, 0] == asked[:, 1], 0.0, low_rank.distance(*asked.T))
    else:
        apart = low_rank.row(asked)
        apart[np.arange(len(asked)), asked] = 0.0
    return name, np.maximum(apart, 0.0), error


def _lines(kind: str, asked: IntArray, distances: FloatArray) -> list[str]:
    """One distance per line for pairs; for sources a table with a row for each vertex and a column for each source."""
    if kind == "pairs":
        return [repr(value) for value in distances.tolist()]
    header = ",".join(["vertex", *(f"from_{source}" for source in asked)])
    return [header, *(",".join([str(i), *map(repr, row)]) for i, row in enumerate(distances.T.tolist()))]


def _write(path: Path, kind: str, asked: IntArray, distances: FloatArray) -> None:
    if path.suffix == ".npz":
        arrays: dict[str, Any] = {kind: asked, "distances": distances}
        write_arrays(path, arrays)
        return
    lines = _lines(kind, asked, distances)
    if kind == "pairs":
        lines = ["source,target,distance", *(f"{i},{j},{line}" for (i, j), line in zip(asked, lines))]
    write_text(path, "\n".join([*lines, ""]))
