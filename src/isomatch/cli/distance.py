"""``isomatch distance``: geodesic distances of pairs of vertices, or from some vertices to all."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import numpy as np
from cyclopts import Group, Parameter
from cyclopts.validators import LimitedChoice

import isomatch
from isomatch import geodesics
from isomatch._array_file import write_arrays
from isomatch._arrays import FloatArray, IntArray
from isomatch._files import is_whole_number, write_text
from isomatch.cli.inputs import read_pairs, surface_of
from isomatch.cli.outputs import claimed_files
from isomatch.cli.terminal import progress, say, say_json
from isomatch.errors import FormatError
from isomatch.geodesics import engine_names

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
    json: bool = False,
    force: bool = False,
) -> None:
    """Print or write geodesic distances, in the units of the file; inf where no path leads.

    Parameters
    ----------
    file : Path
        Mesh: .off, .obj, .ply or .stl. Points without faces are joined to their nearest neighbours.
    pairs : Path
        File with two 0-based vertex indices per line, separated by a comma or blank, # comments: one distance for each.
    sources : str
        0-based vertex indices separated by commas: distances from each to all vertices.
    engine : str
        How distances are computed.
    basis : Path
        Distance basis of this mesh, written by isomatch basis: its approximate distances are used.
    output : Path
        File to write the distances to, instead of printing them: .csv, or .npz with distances and pairs or sources.
    json : bool
        Print one JSON object and nothing else.
    force : bool
        Replace an existing file.
    """
    if output is not None and output.suffix not in (".csv", ".npz"):
        raise FormatError(f"{output}: suffix {output.suffix!r} cannot be written; use .csv or .npz")
    asked = (
        read_pairs(pairs, "a pair", "separated by a comma or blank")
        if pairs is not None
        else _vertices(sources or "")
    )
    kind = "pairs" if pairs is not None else "sources"
    with claimed_files(output, force=force), progress() as stage:
        stage("reading")
        mesh = isomatch.read_mesh(file)
        stage("distances")
        name, distances = _distances(surface_of(mesh), asked, engine, basis)
        if output is not None:
            _write(output, kind, asked, distances)
    if json:
        record = {"file": str(file), "engine": name, "basis": basis and str(basis), kind: asked.tolist()}
        where = {"output": str(output)} if output is not None else {"distances": distances.tolist()}
        say_json(record | where)
    elif output is not None:
        say(f"wrote {output}: {distances.size} distances by {name}")
    else:
        say("\n".join(_lines(kind, asked, distances)))


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
) -> tuple[str, FloatArray]:
    """Name of the engine or basis, and its distances: (m,) for pairs (m, 2), (m, n) for sources (m,)."""
    if basis is None:
        chosen = isomatch.distance_engine(surface, engine)
        by_pairs = asked.ndim == 2
        return chosen.name, geodesics.pair_distances(chosen, asked) if by_pairs else chosen.distances_from(
            asked
        )
    low_rank = isomatch.DistanceBasis.load(basis)
    if len(low_rank.vectors) != surface.n_vertices:
        raise isomatch.MeshError(
            f"{basis}: a basis of {len(low_rank.vectors)} points, but the surface has {surface.n_vertices} vertices; "
            "give the mesh that it was computed from"
        )
    name = f"{low_rank.method} basis of rank {low_rank.rank} by {low_rank.engine}"
    return name, low_rank.distance(*asked.T) if asked.ndim == 2 else low_rank.row(asked)


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
