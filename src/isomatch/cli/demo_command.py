"""``isomatch demo``: a first match of the shipped pair, and files to try other commands on."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from functools import partial
from pathlib import Path

import numpy as np
from cyclopts import App, Parameter

import isomatch
from isomatch import datasets, evaluation
from isomatch._core.files import made_folder
from isomatch.cli.inputs import Details, Force, Output
from isomatch.cli.outputs import claimed_files
from isomatch.cli.results import Inputs, ResultFolder, match_again, say_files, say_result
from isomatch.cli.terminal import TALK, Talk, part, say_rows

N_COMPARED = 500  # random source vertices compared with the ground truth; chosen: they take a moment
N_SPECIMENS, N_SPECIMEN_VERTICES = 5, 2000  # heads that `demo landmarks` writes, vertices of each; chosen

demo = App(name="demo", default_parameter=Parameter(negative=()))  # the command with subcommands


@demo.command
def keys(*, output: Output = Path(), force: Force = False, talk: Talk = TALK) -> None:
    """Write two rigged heads of animals: a cat with stripes and shape keys, a lion without.

    Args:
        output: Folder for cat.glb and lion.glb.
    """
    cat, lion = output / "cat.glb", output / "lion.glb"
    heads = {cat: datasets.animal_head("cat").rigged()}
    heads[lion] = datasets.animal_head("lion", 3500, triangulation=1).rigged(keys=False)
    files = {path: partial(isomatch.write_asset, asset=head) for path, head in heads.items()}
    _write(files, f"isomatch match {lion} {cat} -o {output / 'result'}", force, talk)


@demo.command
def landmarks(*, output: Output = Path(), force: Force = False, talk: Talk = TALK) -> None:
    """Write heads of five cats of other proportions, sizes and poses, and landmarks of the first.

    Args:
        output: Folder for scans/a.ply to e.ply and a.mrk.json.
    """
    scans, marks = output / "scans", output / "a.mrk.json"
    heads = [
        datasets.animal_head(n_vertices=N_SPECIMEN_VERTICES, individual=i, triangulation=i).turned(i)
        for i in range(N_SPECIMENS)
    ]
    files: dict[Path, Callable[[Path], object]] = {
        scans / f"{name}.ply": partial(isomatch.write_mesh, mesh=head.mesh)
        for name, head in zip("abcde", heads)
    }
    files[marks] = partial(isomatch.write_landmarks, landmarks=heads[0].landmarks)
    next_command = f"isomatch collect {scans} -o {output / 'cohort'} --template a --landmarks {marks}"
    _write(files, next_command, force, talk)


def _write(
    files: Mapping[Path, Callable[[Path], object]], next_command: str, force: bool, talk: Talk
) -> None:
    """Write each file by its function, and print the command to go on with."""
    with ExitStack() as made:
        for folder in dict.fromkeys(path.parent for path in files):
            made.enter_context(made_folder(folder))
        made.enter_context(claimed_files(*files, force=force))
        for path, write in files.items():
            write(path)
    names = [str(path) for path in files]
    rows = [("wrote", ", ".join(names)), ("go on with", next_command)]
    talk.result({"files": names}, lambda: say_rows(rows))


@demo.default
def run(*, output: Output = Path("demo"), details: Details = False, talk: Talk = TALK) -> None:
    """Match two poses of an animal without landmarks, and compare the map with the exact ground truth.

    Args:
        output: Folder for standing.ply and running.ply, the pair, and for map.npz, map.txt, result.json, map.png and
            report.html. Existing files are replaced.
    """
    source, target = datasets.example_pair()
    ends, shapes = (output / "standing.ply", output / "running.ply"), (source.mesh, target.mesh)
    folder = ResultFolder(output)
    with folder.claimed(force=True), talk.progress() as tell:
        result = isomatch.match(*shapes, progress=part(tell, 0.0, 0.6))
        tell("comparing", 0.6)
        truth = datasets.ground_truth(source, target).vertices
        pairs = np.column_stack([np.arange(len(truth)), truth])
        errors = evaluation.geodesic_errors(target.mesh, result.map, pairs, N_COMPARED)
        tell("writing", 0.7)
        facts = {"error, mean": f"{errors.mean():.2%} of √(target area), against the ground truth"}
        inputs = Inputs(*ends, match_again(*ends, output=output), facts=facts)
        n_source, n_target = (mesh.n_vertices for mesh in shapes)
        titles = f"source, {n_source} vertices, coloured by their images", f"target, {n_target} vertices"
        more = {"mean_error_over_sqrt_target_area": float(errors.mean())}
        meshes = {path.name: mesh for path, mesh in zip(ends, shapes)}
        record = folder.write(shapes, result, inputs, titles=titles, more=more, meshes=meshes)

    def summary() -> None:
        say_result(result, details)
        accuracy = (
            f"{errors.mean():.2%} of the size (√area) off on average, at most {np.quantile(errors, 0.95):.2%} at 95% of "
            f"the {N_COMPARED} vertices that were compared"
        )
        say_rows([("in truth", accuracy)])
        say_files(record)

    talk.result(record, summary)
