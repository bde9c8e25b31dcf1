"""``isomatch demo``: match the shipped pair and compare the result with the exact ground truth."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
from cyclopts import Parameter

import isomatch
from isomatch import datasets, evaluation
from isomatch.cli.match import with_landmarks
from isomatch.cli.outputs import ResultFolder, say_files, say_result
from isomatch.cli.terminal import TALK, Talk, part, say_rows

N_JUDGED = 500  # source vertices, drawn with seed 0, whose images are compared with the ground truth


def demo(
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])] = Path("demo"),
    details: Annotated[bool, Parameter(negative=())] = False,
    talk: Talk = TALK,
) -> None:
    """Match two poses of an animal without landmarks, and compare the map with the exact ground truth.

    Parameters
    ----------
    output : Path
        Folder for standing.ply and running.ply, the pair, and for map.npz, map.txt, result.json, map.png and report.html.
        Existing files are replaced.
    details : bool
        Print every measure too, with its bound, and the seconds of each stage.
    talk : Talk
        What is told.
    """
    source, target = datasets.example_pair()
    paths = output / "standing.ply", output / "running.ply"
    again = with_landmarks(*paths, output=output)
    folder = ResultFolder(output)
    with folder.claimed(force=True), talk.progress() as tell:
        result = isomatch.match(source.mesh, target.mesh, progress=part(tell, 0.0, 0.6))
        tell("comparing", 0.6)
        truth = datasets.ground_truth(source, target).vertices
        pairs = np.column_stack([np.arange(len(truth)), truth])
        errors = evaluation.geodesic_errors(target.mesh, result.map, pairs, N_JUDGED)
        tell("writing", 0.7)
        for path, animal in zip(paths, (source, target)):
            isomatch.write_mesh(path, animal.mesh)
        record = folder.write(
            source.mesh,
            target.mesh,
            result,
            names=(paths[0].name, paths[1].name),
            titles=(
                f"source, {source.mesh.n_vertices} vertices, coloured by their images",
                f"target, {target.mesh.n_vertices} vertices",
            ),
            facts={"error, mean": f"{errors.mean():.2%} of √(target area), against the ground truth"},
            more={
                "source": str(paths[0]),
                "target": str(paths[1]),
                "match_again": again,
                "landmarks": [],
                "mean_error_over_sqrt_target_area": float(errors.mean()),
            },
            command=again,
        )

    def summary() -> None:
        say_result(result, details)
        say_rows(
            [
                (
                    "in truth",
                    f"{errors.mean():.2%} of the size (√area) off on average, at most {np.quantile(errors, 0.95):.2%} at "
                    f"95% of the {N_JUDGED} vertices that were compared",
                ),
            ]
        )
        say_files(record)

    talk.result(record, summary)
