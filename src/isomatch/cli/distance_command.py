"""``isomatch distance`` and ``isomatch basis``: geodesic distances and paths of points, or all in a low-rank form."""

from __future__ import annotations

import re
import time
from itertools import chain
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
from cyclopts import Group, Parameter
from cyclopts.validators import LimitedChoice

import isomatch
from isomatch import geodesics
from isomatch._core.array_file import write_arrays
from isomatch._core.arrays import FloatArray, IntArray
from isomatch._core.errors import FormatError, SettingError, some
from isomatch._core.files import write_text
from isomatch._core.tables import read_integers
from isomatch._core.texts import read_text, table_text, text_lines
from isomatch.cli.inputs import Force, OptionalOutput, Output, Seed, Weld, surface_of
from isomatch.cli.outputs import claimed_files
from isomatch.cli.terminal import TALK, Talk, Tell, complain, part, say, say_table
from isomatch.geodesics import PATH_SUFFIXES, engine_names
from isomatch.repair import without_seams
from isomatch.spectral import BasisMethod, Weighting
from isomatch.surfaces import PrecisePoints

COLUMNS_PER_UPDATE = 16  # points whose distances are computed between two updates of the progress; chosen
# Groups of options in the help: exactly one of the first group must be given, at most one of the second.
WHICH_DISTANCES = Group("Which distances (one of them)", validator=LimitedChoice(1, 1))
HOW_COMPUTED = Group("How (at most one of them)", validator=LimitedChoice(0, 1))


def _require_engine(_: object, name: str | None) -> None:
    if name is not None and name not in engine_names():
        raise ValueError(f"There is no engine {name!r}; known are {', '.join(engine_names())}.")


EngineOption = Annotated[  # option of `distance` and `basis`
    str | None,
    Parameter(
        validator=_require_engine,
        help=f"How distances are computed: {', '.join(engine_names())}. By default "
        f"{engine_names(isomatch.Mesh)[0]} for meshes, {engine_names(isomatch.PointCloud)[0]} for points.",
    ),
]


def distance(
    file: Path,
    /,
    *,
    pairs: Annotated[Path | None, Parameter(group=WHICH_DISTANCES)] = None,
    sources: Annotated[str | None, Parameter(name="--from", group=WHICH_DISTANCES)] = None,
    targets: Annotated[str | None, Parameter(name="--to")] = None,
    engine: Annotated[EngineOption, Parameter(group=HOW_COMPUTED)] = None,
    basis: Annotated[Path | None, Parameter(group=HOW_COMPUTED)] = None,
    path: Annotated[Path | None, Parameter(group=HOW_COMPUTED)] = None,
    weld: Weld = True,
    output: OptionalOutput = None,
    force: Force = False,
    talk: Talk = TALK,
) -> None:
    """Print or write geodesic distances, in the units of the file; inf where no path leads.

    A point is a 0-based vertex, such as 12, or lies in a face: f12:0.2,0.3,0.5 has these weights of the corners of face
    12.

    Args:
        file: Mesh: any surface file, such as .ply, .obj or .vtp. Points without faces are joined to their nearest
            neighbours.
        pairs: File with two points per line, separated by a comma or blank, # comments: one distance for each.
        sources: Points separated by commas: distances from each to all vertices.
        targets: With --from, points separated by commas: distances to these only.
        basis: Distance basis of this mesh, written by isomatch basis: its approximate distances are used. The distance of
            a vertex from itself is 0.
        path: File for the shortest paths of the pairs, or from --from to --to, as polylines: .obj or .vtp. The distances
            are their lengths, which are exact.
        output: File to write the distances to, instead of printing them: .csv, or .npz with distances and pairs, or
            sources and targets. Numbers beyond the last vertex stand for points in faces; the file
            then also holds their corners and weights.
    """
    if output is not None and output.suffix not in (".csv", ".npz"):
        raise FormatError(f"{output}: suffix {output.suffix!r} cannot be written; use .csv or .npz")
    if path is not None and path.suffix.lower() not in PATH_SUFFIXES:
        message = f"{path}: suffix {path.suffix!r} cannot hold paths; use {' or '.join(PATH_SUFFIXES)}"
        raise FormatError(message)
    if targets is not None and sources is None:
        raise SettingError("--to needs --from, the points to measure from")
    if path is not None and pairs is None and targets is None:
        raise SettingError("--path needs the ends of the paths: --pairs, or --from and --to")
    if pairs is not None:
        points: dict[str, list[Any]] = {"pairs": read_point_pairs(pairs)}
    else:
        points = {"sources": split_point_list(sources or "", "--from")}
    if targets is not None:
        points["targets"] = split_point_list(targets, "--to")
    with claimed_files(output, path, force=force), talk.progress() as tell:
        tell("reading", 0.0)
        request = _Request(isomatch.read_mesh(file), points)
        answer = _measure(request, engine, basis, path, weld, part(tell, 0.1, 0.9))
        if output is not None:
            tell("writing", 0.9)
            _write(output, request, answer.distances)
        tell("done", 1.0)
    record: dict[str, Any] = {"file": str(file), "engine": answer.name, "basis": basis and str(basis)}
    record |= {**points, "approximate": basis is not None, "notes": list(answer.notes)}
    optional: dict[str, Any] = {"estimated_relative_error": answer.error, "path": path and str(path)}
    optional |= {"output": str(output)} if output else {"distances": answer.distances.tolist()}
    record |= {name: value for name, value in optional.items() if value is not None}
    remark = "" if answer.error is None else f", approximate: estimated relative error {answer.error:.2%}"

    def summary() -> None:
        for note in answer.notes:
            complain(f"{file}: {note}")
        if path is not None:
            complain(f"wrote {path}")
        if output is not None:
            say(f"wrote {output}: {answer.distances.size} distances by {answer.name}{remark}")
            return
        say("\n".join(request.lines(answer.distances)))
        if remark:
            complain(f"distances by {answer.name}{remark}")

    talk.result(record, summary, is_answer=output is None)


class _Request:
    """Requested points; numbers beyond the last vertex stand for points in faces."""

    def __init__(self, mesh: isomatch.Mesh, points: dict[str, list[Any]]) -> None:
        self.mesh, self.points = mesh, points  # lists of pairs, or of sources and targets
        self._corners: list[IntArray] = []
        self._weights: list[list[float]] = []
        # Pairs have shape (m, 2), sources (s,), and targets (t,).
        self.numbers = {kind: self._numbers(kind, listed) for kind, listed in points.items()}

    def _numbers(self, kind: str, points: list[Any]) -> IntArray:
        if kind == "pairs":
            return self._numbers("vertices of pairs", [*chain(*points)]).reshape(-1, 2)
        n = self.mesh.n_vertices
        bad = np.array([v for v in points if isinstance(v, int) and not 0 <= v < n])
        if len(bad):
            raise isomatch.MeshError(f"{kind} {some(bad)} are outside 0…{n - 1}, the vertices of the surface")
        numbers = [v if isinstance(v, int) else self._number_in_face(v) for v in points]
        return np.array(numbers, dtype=np.int64)

    def _number_in_face(self, word: str) -> int:
        face, _, weights = word[1:].partition(":")
        parts = np.array(weights.split(","), dtype=np.float64)
        if int(face) >= self.mesh.n_faces:
            raise isomatch.MeshError(f"{word}: there is no such face; faces are 0…{self.mesh.n_faces - 1}")
        if not abs(parts.sum() - 1) <= WEIGHT_SUM_TOLERANCE:
            raise isomatch.MeshError(f"{word}: the weights add up to {parts.sum():g}, not to 1")
        self._corners.append(self.mesh.faces[int(face)])
        self._weights.append((parts / parts.sum()).tolist())
        return self.mesh.n_vertices + len(self._corners) - 1

    @property
    def precise(self) -> PrecisePoints | None:
        """The points in faces; None if there are none."""
        return PrecisePoints(np.array(self._corners), np.array(self._weights)) if self._corners else None

    def at(self, numbers: IntArray) -> PrecisePoints:
        """Return the points with these numbers."""
        n = self.mesh.n_vertices
        corners = [[v] * 3 if v < n else self._corners[v - n] for v in numbers]
        weights = [[1.0, 0.0, 0.0] if v < n else self._weights[v - n] for v in numbers]
        return PrecisePoints(np.array(corners).reshape(-1, 3), np.array(weights).reshape(-1, 3))

    @property
    def all_pairs(self) -> IntArray:
        """(m, 2) the pairs, or each source with each target in turn."""
        if "pairs" in self.numbers:
            return self.numbers["pairs"]
        return np.stack(np.meshgrid(*self.numbers.values(), indexing="ij"), -1).reshape(-1, 2)

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the distances of all pairs: a row for each source, if there are targets."""
        return (-1,) if "pairs" in self.numbers else tuple(map(len, self.numbers.values()))

    def lines(self, distances: FloatArray) -> list[str]:
        """Write a distance a line for pairs, or a table with a row per target, a column per source."""
        if "pairs" in self.points:
            return [repr(value) for value in distances.tolist()]
        rows = self.points.get("targets", range(distances.shape[1]))
        name = "target" if "targets" in self.points else "vertex"
        header = [name, *(f"from_{point}" for point in self.points["sources"])]
        cells = ([row, *map(repr, values)] for row, values in zip(rows, distances.T.tolist()))
        return table_text([header, *cells]).splitlines()  # Points in faces contain commas: they are quoted.


class _Answer(NamedTuple):
    """Distances, (m,) of pairs or a row per source, with method, estimated error, notes."""

    name: str
    distances: FloatArray
    error: float | None = None
    notes: tuple[str, ...] = ()


def _measure(
    request: _Request, engine: str | None, basis: Path | None, path: Path | None, weld: bool, tell: Tell
) -> _Answer:
    tell("distances", 0.0)
    mesh, precise = request.mesh, request.precise
    if path is not None:
        return _write_paths(request, path, weld, tell)
    if basis is not None:
        return _approximate(request, basis)
    chosen = isomatch.distance_engine(surface_of(mesh), engine, weld=weld, points=precise)
    notes = getattr(chosen, "notes", ())
    if "sources" not in request.numbers or "targets" in request.numbers:
        distances = geodesics.pair_distances(chosen, request.all_pairs)
        return _Answer(chosen.name, distances.reshape(request.shape), None, notes)
    rows, sources = [], request.numbers["sources"]
    for first in range(0, len(sources), COLUMNS_PER_UPDATE):
        columns = chosen.distances_from(sources[first : first + COLUMNS_PER_UPDATE])
        rows.append(columns[:, : mesh.n_vertices])
        n_done = min(first + COLUMNS_PER_UPDATE, len(sources))
        tell(f"distances from {n_done} of {len(sources)}", first / len(sources))
    return _Answer(chosen.name, np.concatenate(rows), None, notes)


def _write_paths(request: _Request, file: Path, weld: bool, tell: Tell) -> _Answer:
    """Write shortest paths, and return their lengths."""
    pairs, mesh, paths = request.all_pairs, request.mesh, []
    ends = (request.at(column) for column in pairs.T)
    for number, path in enumerate(geodesics.geodesic_paths(mesh, *ends, weld=weld), start=1):
        paths.append(path)
        tell(f"path {number} of {len(pairs)}", number / len(pairs))
    geodesics.write_paths(file, paths)
    lengths = np.array([path.length for path in paths], dtype=np.float64)
    _, seams = without_seams(mesh, weld)
    return _Answer("exact path", lengths.reshape(request.shape), None, seams.changes if seams else ())


def _approximate(request: _Request, file: Path) -> _Answer:
    """Approximate distances by a basis; the distance of a point from itself is 0."""
    low_rank, n = isomatch.DistanceBasis.load(file), request.mesh.n_vertices
    if len(low_rank.vectors) != n:
        raise isomatch.MeshError(
            f"{file}: a basis of {len(low_rank.vectors)} points, but the surface has {n} vertices; "
            "give the mesh that it was computed from"
        )
    name = f"{low_rank.method} basis of rank {low_rank.rank} by {low_rank.engine}"
    error, notes = low_rank.error_estimate(), low_rank.notes
    if (precise := request.precise) is not None:
        low_rank = low_rank.with_points(precise)
    if "pairs" in request.numbers:
        first, second = request.numbers["pairs"].T
        distances = low_rank.distance(first, second)
    else:
        sources, second = request.numbers["sources"], request.numbers.get("targets", np.arange(n))
        first, distances = sources[:, None], low_rank.between(sources, second)
    return _Answer(name, np.maximum(np.where(first == second, 0.0, distances), 0.0), error, notes)


def _write(path: Path, request: _Request, distances: FloatArray) -> None:
    if path.suffix == ".npz":
        arrays: dict[str, Any] = {"distances": distances, **request.numbers}
        if request.precise is not None:
            arrays["corners"], arrays["weights"] = request.precise
        write_arrays(path, arrays)
        return
    lines = request.lines(distances)
    if "pairs" in request.points:
        rows = ([*pair, line] for pair, line in zip(request.points["pairs"], lines))
        lines = table_text([["source", "target", "distance"], *rows]).splitlines()
    write_text(path, "\n".join([*lines, ""]))


_WEIGHT = r"(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?"  # pattern of a barycentric weight, as 0.2 or 1e-3
# pattern of one point: a vertex, or f12:0.2,0.3,0.5
_POINT = rf"f\d{{1,18}}:{_WEIGHT},{_WEIGHT},{_WEIGHT}|[+-]?\d{{1,18}}"
_POINTS = re.compile(rf"(?:{_POINT})(?:(?:\s*,\s*|\s+)(?:{_POINT}))*", re.ASCII)  # a list of points
WEIGHT_SUM_TOLERANCE = 0.01  # largest difference from 1 of the sum of a point's rounded weights; chosen
# how messages explain the notation of a point
POINT_NOTATION = "a vertex, such as 12, or a point in a face, such as f12:0.2,0.3,0.5"


def _split_points(text: str) -> list[int | str]:
    """Split a list of points into vertices and words of points in faces; return none if it contains anything else."""
    words = re.findall(_POINT, text, re.ASCII) if _POINTS.fullmatch(text.strip()) else []
    return [word if word[0] == "f" else int(word) for word in words]


def split_point_list(text: str, option: str) -> list[int | str]:
    """Split a list of points that are separated by commas."""
    points = _split_points(text)
    if not points:
        raise SettingError(
            f"{option} {text!r} is not a list of points; write 0-based indices separated by commas, such as 0,12; "
            f"each is {POINT_NOTATION}"
        )
    return points


def read_point_pairs(path: Path) -> list[list[int | str]]:
    """Read a pair of points from each line."""
    complaint = (
        "is not a pair; write two 0-based vertex indices, separated by a comma or blank; "
        f"each is {POINT_NOTATION}"
    )
    if ":" not in read_text(path):
        pairs: list[list[int | str]] = read_integers(path, 2, complaint).tolist()
        return pairs
    pairs = []
    for number, line in text_lines(path):
        pairs.append(_split_points(line))
        if len(pairs[-1]) != 2:
            raise FormatError(f"{path}:{number}: {line[:80]!r} {complaint}")
    return pairs


N_COLUMNS = 100  # default of --p of `isomatch basis`: columns of distances; as `Config.n_columns`


def basis(
    file: Path,
    /,
    *,
    output: Output,
    k: Annotated[int, Parameter(name="--k")] = 50,
    p: Annotated[int, Parameter(name="--p")] = N_COLUMNS,
    method: BasisMethod | None = None,
    weights: Weighting = "area",
    engine: EngineOption = None,
    tolerance: float | None = None,
    single: bool = False,
    canonical: Path | None = None,
    weld: Weld = True,
    seed: Seed = 0,
    force: Force = False,
    talk: Talk = TALK,
) -> None:
    """Compute the geodesic distance basis of a mesh: n × k numbers for all its distances.

    Args:
        file: Mesh of one component: any surface file, such as .ply, .obj or .vtp.
        output: File for the basis, .npz; isomatch.DistanceBasis.load reads it.
        k: Rank.
        p: Number of distance columns to compute.
        method: How the basis is built; by default predicted.
        weights: What is approximated best: the surface (area) or its vertices (uniform).
        tolerance: Choose k and p so that the estimated relative error is at most this.
        single: Store single precision, which halves the size.
        canonical: Also write the canonical form: the mesh with vertices whose Euclidean distances approximate the
            geodesic ones.
    """
    with claimed_files(output, canonical, force=force), talk.progress() as tell:
        tell("reading", 0.0)
        mesh = isomatch.read_mesh(file)
        tell("distances", 0.05)
        started = time.perf_counter()
        options = method, weights, seed, engine, tolerance, np.float32 if single else np.float64
        computed = isomatch.distance_basis(mesh, k, p, *options, weld=weld)
        seconds = time.perf_counter() - started
        tell("writing", 0.95 if canonical is None else 0.55)
        computed.save(output)
        record = {
            "file": str(file),
            "basis": str(output),
            "points": mesh.n_vertices,
            "rank": computed.rank,
            "columns": len(computed.samples),
            "method": computed.method,
            "engine": computed.engine,
            "seconds": seconds,
            "estimated_relative_error": computed.error_estimate(),
        }
        if computed.notes:
            record["notes"] = "; ".join(computed.notes)
        if canonical is not None:
            tell("canonical form", 0.6)
            form = isomatch.canonical_form(mesh, weights=weights, seed=seed, engine=engine, weld=weld)
            isomatch.write_mesh(canonical, isomatch.Mesh(form.points, mesh.faces))
            record |= {"canonical_form": str(canonical), "stress": form.stress}
        tell("done", 1.0)
    texts = {name: f"{x:.4g}" if isinstance(x, float) else str(x) for name, x in record.items()}
    talk.result(record, lambda: say_table((name.replace("_", " "), text, "") for name, text in texts.items()))
