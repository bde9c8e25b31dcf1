"""What mypy must refuse: an ``ignore`` that nothing asks for is an error of mypy, so each of these lines is one."""

from isomatch._core import arrays
from isomatch._core.arrays import BodyVertices, SearchRows
from isomatch.matching import Problem
from isomatch.matching.isometric.candidates import energy_of, extend_map
from isomatch.matching.partial.both_seeds import CommonRegions
from isomatch.matching.partial.part_pair import PartPair
from isomatch.matching.verify import on_bodies


def refused(pair: Problem, rows: SearchRows, vertices: BodyVertices, users: arrays.UserVertices) -> None:
    """Mix rows, vertices of bodies, and vertices of the user."""
    energy_of(pair, pair.source_vertices, rows)  # type: ignore[arg-type]
    energy_of(pair, users, vertices)  # type: ignore[arg-type]
    extend_map(pair, vertices, vertices)  # type: ignore[arg-type]
    on_bodies(pair, vertices)  # type: ignore[arg-type]
    energy_of(pair, vertices, vertices[rows])  # type: ignore[arg-type]  # an array that was indexed belongs to no space


def refused_of_parts(
    pair: PartPair,
    regions: CommonRegions,
    part: arrays.PartVertices,
    whole: BodyVertices,
    rows: arrays.SampleRows,
) -> None:
    """Mix a part with its whole, and samples with vertices."""
    pair.intervals(whole)  # type: ignore[arg-type]
    pair.stress(part)  # type: ignore[arg-type]
    regions.net_evidence(whole, whole)  # type: ignore[arg-type]
    regions.net_evidence(rows, rows)  # type: ignore[arg-type]


def allowed(pair: Problem, rows: SearchRows) -> arrays.IntArray:
    """Name the index space of an index; any is an array of integers."""
    energy_of(pair, pair.source_vertices, BodyVertices(pair.target_vertices[rows]))
    return rows
