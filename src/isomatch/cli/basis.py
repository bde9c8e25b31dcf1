"""``isomatch basis``: a low-rank form of all geodesic distances of a mesh, in one small file."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter

import isomatch
from isomatch.bases import BasisMethod, Weighting
from isomatch.cli.distance import EngineOption
from isomatch.cli.outputs import claimed_files
from isomatch.cli.terminal import TALK, Talk, say_table

N_COLUMNS = 100


def basis(
    file: Path,
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    k: Annotated[int, Parameter(name="--k")] = 50,
    p: Annotated[int, Parameter(name="--p")] = N_COLUMNS,
    method: BasisMethod | None = None,
    weights: Weighting = "area",
    engine: EngineOption = None,
    tolerance: float | None = None,
    single: bool = False,
    canonical: Path | None = None,
    weld: Annotated[bool, Parameter(negative="--no-weld")] = True,
    seed: int = 0,
    force: bool = False,
    talk: Talk = TALK,
) -> None:
    """Compute the geodesic distance basis of a mesh: all its distances, approximately, in n × k numbers.

    Parameters
    ----------
    file : Path
        Mesh of one component: any surface file, such as .ply, .obj or .vtp.
    output : Path
        File for the basis, .npz; isomatch.DistanceBasis.load reads it.
    k : int
        Rank.
    p : int
        Number of distance columns to compute.
    method : str
        How the basis is built; by default predicted.
    weights : str
        What is approximated best: the surface (area) or its vertices (uniform).
    engine : str
        How distances are computed.
    tolerance : float
        Choose k and p so that the estimated relative error is at most this.
    single : bool
        Store single precision, which halves the size.
    canonical : Path
        Also write the canonical form: the mesh with vertices whose Euclidean distances approximate the geodesic ones.
    weld : bool
        Take vertices at exactly the same position, as along the seams of a texture, for one point.
    seed : int
        Seed of the sampling and of the error estimate.
    force : bool
        Replace existing files.
    talk : Talk
        What is told.
    """
    with claimed_files(output, canonical, force=force), talk.progress() as tell:
        tell("reading", 0.0)
        mesh = isomatch.read_mesh(file)
        tell("distances", 0.05)
        started = time.perf_counter()
        dtype = np.float32 if single else np.float64
        computed = isomatch.distance_basis(
            mesh, k, p, method, weights, seed, engine, tolerance, dtype, weld=weld
        )
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
    rows = (
        (name.replace("_", " "), f"{value:.4g}" if isinstance(value, float) else str(value), "")
        for name, value in record.items()
    )
    talk.result(record, lambda: say_table(rows))
