"""``isomatch statistics``: mean, modes, groups and distances of shapes in one topology."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from cyclopts import App, Parameter

import isomatch
import isomatch.statistics as shape_statistics
from isomatch import collections
from isomatch.cli.complete import complete
from isomatch.cli.group_table import read_groups
from isomatch.cli.inputs import read_initial_map
from isomatch.cli.statistics_files import StatisticsFolder
from isomatch.cli.terminal import TALK, Talk, complain, say, say_table
from isomatch.errors import IsomatchError
from isomatch.storage.texts import read_csv
from isomatch.values.arrays import FloatArray

TRUSTED = {"CONVERGED", "PARTIAL"}  # outcomes of maps that are not in doubt

statistics = App(name="statistics", default_parameter=Parameter(negative=()))
statistics.command(complete)


@statistics.default
def run(
    folder: Path,
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    scale: Literal["keep", "remove"] = "keep",
    weights: Literal["area", "uniform"] = "area",
    modes: int = 3,
    groups: Path | None = None,
    test: Literal["permutation", "parametric"] = "permutation",
    score: Annotated[tuple[Path, ...], Parameter(consume_multiple=True)] = (),
    mirror: str | None = None,
    pictures: Literal["png", "pdf", "svg"] = "png",
    seed: int = 0,
    force: bool = False,
    talk: Talk = TALK,
) -> None:
    """Compute the mean, the modes of variation and the distances of shapes in one topology.

    Parameters
    ----------
    folder : Path
        Folder of meshes with the same faces, or folder written by isomatch collect. Meshes with other faces or with
        unmatched vertices are left out.
    output : Path
        Folder for mean, modes, model.npz, scores, variances, distances, pictures, and files for other tools.
    scale : str
        keep: size is part of the shape. remove: all shapes are brought to one size.
    weights : str
        area: a vertex counts by its share of the area. uniform: all vertices count alike.
    modes : int
        Number of modes that are drawn and written as meshes. The model has all.
    groups : Path
        Table with the columns name and group, or these two without a header: test at every vertex where two groups
        differ. Commas, semicolons or tabs separate its cells; a shape without a group is left out of the test.
    test : str
        permutation: p-values from exchanged labels. parametric: from Hotelling's distribution.
    score : Path
        Further meshes in the same topology, to be described by the modes.
    mirror : str
        Add the mirror image of every shape: auto, or a file with the vertex on the other side of each vertex, as a map.
    pictures : str
        png (default): with 300 dots per inch. pdf or svg: charts as lines.
    seed : int
        Seed of all draws.
    force : bool
        Replace an earlier result.
    talk : Talk
        What is told.
    """
    if modes < 0:
        raise isomatch.SettingError(f"--modes {modes} is not a number of modes; give 0 or more")
    into = StatisticsFolder(output, pictures)
    with talk.progress() as tell, into.claimed(force) as new:
        tell("reading", 0.0)
        collections.require_unchanged(collections.Layout(folder), ["corresponded"])
        shapes = shape_statistics.read_shapes(folder)
        labels = read_groups(groups, shapes.names, shapes.left_out) if groups else {}
        doubts = shape_statistics.doubtful_shapes(shapes)
        for doubt in doubts:
            complain(f"{' and '.join(doubt.names)} {doubt.reason}")
        notes = [f"left out: {reason}" for reason in shapes.left_out]
        notes += _doubts(folder / "pairs.csv", shapes.names) + _reflected(folder / "shapes.csv", shapes.names)
        extra = {str(path): isomatch.read_mesh(path) for path in score}
        tell("model", 0.1)
        if mirror is not None:
            left_right, of = _left_right(mirror, shapes, scale, weights, seed)
            shapes = shapes.mirrored(left_right)
            if of:
                notes.append(
                    f"left and right are told by {of}, since the left–right map of the mean is not certain"
                )
        share = shapes.area_weights if weights == "area" else None
        shapes = shape_statistics.filled(shapes, share, scale)
        missing = _missing(shapes)
        notes += [
            f"{name}: {lacks:.1%} of the vertices were not measured, and count as the mean of the others"
            for name, lacks in missing.items()
        ]
        model = shape_statistics.ShapeModel.fit(shapes, scale, weights)
        scored = {name: _scored(model, name, mesh) for name, mesh in extra.items()}
        tested = _tested(model, shapes, labels, test, seed) if groups else None
        groups_of = [labels.get(name, "") for name in model.names] if groups else None
        own = shapes if mirror is None else _first_half(shapes)
        sizes = shape_statistics.centroid_sizes(own.vertices, share)
        allometry, why_not = _allometry(own, sizes, share, seed)
        notes += why_not
        turned = _asymmetry(model, seed) if mirror is not None else None
        unlabelled = [name for name in own.names if groups and name not in labels]
        if unlabelled:
            notes.append(f"without a group: {', '.join(unlabelled)}")
        done = iter(range(len(shapes)))
        geodesic = shape_statistics.geodesic_distortions(
            shapes, progress=lambda name: tell(f"distances of {name}", 0.3 + 0.3 * next(done) / len(shapes))
        )
        procrustes = shape_statistics.procrustes_distances(shapes.vertices, share, scale)
        tell("writing", 0.6)
        new.model(model, shapes, modes, groups_of)
        new.sizes(own, sizes, allometry, groups_of and groups_of[: len(own)])
        new.quality(model, seed)
        if turned:
            new.asymmetry(model, turned)
        if scored:
            new.scored(scored)
        if tested:
            new.groups(model.mesh(), tested)
        new.distances(shapes, geodesic, procrustes, groups_of)
        notes += new.exports(shapes, model)
        record = {
            "isomatch": isomatch.__version__,
            "folder": str(folder),
            "shapes": list(model.names),
            "left_out": list(shapes.left_out),
            "missing": missing,
            "scale": scale,
            "weights": weights,
            "mirror": mirror,
            "seed": seed,
            "n_modes": model.n_modes,
            "total_variance": float(model.variances.sum()),
            "shares": model.variance_ratios.tolist(),
            "scored": {name: each.error for name, each in scored.items()},
            "allometry": _of_test(allometry, "r_squared") if allometry else None,
            "asymmetry": _of_test(turned, "share") if turned else None,
            "groups": _summary(tested, model, labels, test, seed) if tested else None,
            "doubts": [{**doubt._asdict(), "names": list(doubt.names)} for doubt in doubts],
            "notes": notes,
        }
        new.page(output.resolve().name, record, _lines(record))
        new.finish(record)
        tell("done", 1.0)

    def summary() -> None:
        _say(model, record)
        say(f"open first: {output / 'index.html'}; {len(into.written)} files are there")

    talk.result({**record, "output": str(output), "files": into.written}, summary)


def _left_right(
    mirror: str,
    shapes: shape_statistics.CorrespondedShapes,
    scale: Literal["keep", "remove"],
    weights: Literal["area", "uniform"],
    seed: int,
) -> tuple[Any, str]:
    """Find or read the left–right map; also the shape that it is of, if it is not that of the mean."""
    if mirror == "auto":
        mean = shape_statistics.ShapeModel.fit(shapes, scale, weights).mesh()
        return shape_statistics.left_right_of_shapes(shapes, mean, seed=seed)
    return read_initial_map(Path(mirror), shapes.n_vertices), ""


def _scored(
    model: shape_statistics.ShapeModel, name: str, mesh: isomatch.Mesh
) -> shape_statistics.ScoredShape:
    try:
        return model.score(mesh, shape_statistics.read_measured(name))
    except IsomatchError as error:
        raise type(error)(f"{name}: {error}") from error


def _doubts(pairs: Path, names: tuple[str, ...]) -> list[str]:
    """Say which shapes of a collection rest on a map that may be wrong."""
    if not pairs.is_file():
        return []
    outcomes: dict[str, set[str]] = {}
    for row in read_csv(pairs):
        for end in ("source", "target"):
            outcomes.setdefault(row.get(end) or "", set()).add(row.get("outcome") or "FAILED")
    doubtful = {name: doubts for name in names if (doubts := outcomes.get(name)) and not doubts & TRUSTED}
    return [
        f"{name} may be matched wrongly: {', '.join(sorted(doubts))}" for name, doubts in doubtful.items()
    ]


def _reflected(table: Path, names: tuple[str, ...]) -> list[str]:
    """Say which shapes of a collection are mirror images of those in their files."""
    lines = read_csv(table) if table.is_file() else []
    turned = [name for line in lines if line.get("reflected") and (name := line.get("name")) in names]
    return [f"mirror images of the surfaces in their files: {', '.join(turned)}"] if turned else []


def _tested(
    model: shape_statistics.ShapeModel,
    shapes: shape_statistics.CorrespondedShapes,
    labels: dict[str, str],
    method: Literal["permutation", "parametric"],
    seed: int,
) -> shape_statistics.GroupTest:
    rows = [i for i, name in enumerate(model.names) if name in labels]
    listed = [labels[model.names[i]] for i in rows]
    known = None if shapes.measured is None else shapes.measured[rows]
    return shape_statistics.group_test(model.aligned[rows], listed, method=method, seed=seed, measured=known)


def _first_half(shapes: shape_statistics.CorrespondedShapes) -> shape_statistics.CorrespondedShapes:
    """Return shapes without their mirror images, which are no further specimens."""
    m = len(shapes) // 2
    known = None if shapes.measured is None else shapes.measured[:m]
    return replace(shapes, names=shapes.names[:m], vertices=shapes.vertices[:m], measured=known)


def _allometry(
    shapes: shape_statistics.CorrespondedShapes,
    sizes: FloatArray,
    weights: FloatArray | None,
    seed: int,
) -> tuple[shape_statistics.ShapeRegression | None, list[str]]:
    """Regress shape, without size, on the logarithm of size; or say why not."""
    try:
        aligned = shape_statistics.generalised_procrustes(shapes.vertices, weights, "remove").aligned
        return shape_statistics.shape_regression(aligned, np.log(sizes), weights, seed=seed), []
    except IsomatchError as error:
        return None, [f"shape was not regressed on size: {error}"]


def _asymmetry(model: shape_statistics.ShapeModel, seed: int) -> shape_statistics.Asymmetry | None:
    """Compare the shapes of a model, its first half, with their mirror images; of one shape there is no test."""
    aligned, m = model.aligned, len(model.names) // 2
    return shape_statistics.asymmetry(aligned[:m], aligned[m:], model.weights, seed=seed) if m > 1 else None


def _of_test(
    test: shape_statistics.ShapeRegression | shape_statistics.Asymmetry, share: str
) -> dict[str, Any]:
    return {name: getattr(test, name) for name in (share, "p_value", "n_permutations", "seed")}


def _missing(shapes: shape_statistics.CorrespondedShapes) -> dict[str, float]:
    """Share of the vertices that each shape lacks, of those that lack any."""
    if shapes.measured is None:
        return {}
    lacks = (~shapes.measured).mean(axis=1).tolist()
    return {name: share for name, share in zip(shapes.names, lacks) if share}


def _summary(
    test: shape_statistics.GroupTest,
    model: shape_statistics.ShapeModel,
    labels: dict[str, str],
    method: str,
    seed: int,
) -> dict[str, Any]:
    rows = [i for i, name in enumerate(model.names) if name in labels]
    is_second = np.array([labels[model.names[i]] == test.groups[1] for i in rows], dtype=np.float64)
    whole = shape_statistics.shape_regression(model.aligned[rows], is_second, model.weights, seed=seed)
    return {
        **_of_test(whole, "r_squared"),
        "names": list(test.groups),
        "counts": list(test.counts),
        "test": method,
        "significant_share_of_area": float(model.weights[test.significant()].sum()),
        "least_p_value": float(test.p_values.min()),
        "least_q_value": float(test.q_values.min()),
    }


def _told(test: dict[str, Any], share: str = "r_squared", of: str = "variance of shape") -> str:
    return (
        f"{test[share]:.1%} of the {of}, p = {test['p_value']:.4g} ({test['n_permutations']} permutations, seed "
        f"{test['seed']})"
    )


def _lines(record: dict[str, Any]) -> list[str]:
    """Say what was found, one sentence each."""
    lines = [f"{name}: error {error:.4g}" for name, error in record["scored"].items()]
    if tested := record["groups"]:
        first, second = (f"{name} ({count})" for name, count in zip(tested["names"], tested["counts"]))
        share = tested["significant_share_of_area"]
        lines += [
            f"{first} and {second} "
            + (f"differ on {share:.1%} of the area" if share else "do not differ significantly at any vertex")
            + ", at a false discovery rate of 5 %",
            f"the groups describe {_told(tested)}",
        ]
    if record["allometry"]:
        lines.append(f"size describes {_told(record['allometry'])}")
    if record["asymmetry"]:
        lines.append(f"common to all shapes is {_told(record['asymmetry'], 'share', 'asymmetry')}")
    return [*lines, *(f"note: {note}" for note in record["notes"])]


def _say(model: shape_statistics.ShapeModel, record: dict[str, Any]) -> None:
    size = f"{len(model.names)} shapes of {len(model.mean):,} vertices"
    say(f"{size} vary in {model.n_modes} mode{'s' * (model.n_modes != 1)}", "bold")
    total = 0.0
    rows = []
    for i, (share, deviation) in enumerate(zip(record["shares"][:10], model.deviations.tolist())):
        total += share
        rows.append(
            (f"mode {i + 1}", f"{share:.1%} of the variance, sd {deviation:.4g}", f"{total:.1%} so far")
        )
    say_table(rows)
    for line in _lines(record):
        say(line)
