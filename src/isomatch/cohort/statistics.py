"""The statistics of the shapes of a folder: mean, modes, groups, sizes and distances, and the files that tell of them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from isomatch._core.arrays import FloatArray
from isomatch._core.errors import InputError, IsomatchError
from isomatch._core.stage_timer import Progress
from isomatch.cohort import shape_statistics
from isomatch.cohort.listener import Listener, Warn
from isomatch.cohort.shape_statistics import (
    CorrespondedShapes,
    GroupTest,
    PictureFormat,
    ShapeModel,
    ShapeRegression,
)
from isomatch.cohort.specimens import read_specimens
from isomatch.cohort.statistics_folder import VERSION, Results, StatisticsFolder
from isomatch.correspondence import Correspondence

Scale = Literal["keep", "remove"]
Weights = Literal["area", "uniform"]
Method = Literal["permutation", "parametric"]


def statistics(
    folder: str | Path,
    output: str | Path,
    *,
    scale: Scale = "keep",
    weights: Weights = "area",
    modes: int = 3,
    groups: Path | None = None,
    test: Method = "permutation",
    mirror: str | None = None,
    align: Literal["subject", "structure"] = "subject",
    hide: str | None = None,
    pictures: PictureFormat = "png",
    seed: int = 0,
    force: bool = False,
    progress: Progress | None = None,
    warn: Warn | None = None,
) -> Results:
    """Compute the mean, the modes of variation and the distances of shapes in one topology, and write them to a folder.

    Parameters
    ----------
    folder : path_like
        Folder of meshes with the same faces, or of a collection.
    output : path_like
        Folder for mean, modes, model.npz, scores, variances, distances, pictures, and files for other tools.
    scale, weights, modes, groups, test, mirror, align, hide, pictures, seed, force
        As the options of ``isomatch statistics``.
    progress, warn : callable, optional
        Called with each step and the share that is done; and with shapes to look at first, which by default are logged.

    Returns
    -------
    Results
        The model, and the record of all numbers.

    Raises
    ------
    FormatError, MeshError, InputError
        If shapes or groups cannot be read, do not correspond, or are too few.
    """
    folder, to = Path(folder), Listener.of(progress, warn)
    into = StatisticsFolder(Path(output), pictures)
    with into.claimed(force) as new:
        to.tell("reading", 0.0)
        specimens = read_specimens(folder, groups)
        shapes, labels, doubts, notes = specimens
        for line in specimens.warnings:
            to.warn(line)
        to.tell("model", 0.1)
        if mirror is not None:
            shapes, note = _mirrored(shapes, mirror, scale, weights, seed)
            notes += note
        share = shapes.area_weights if weights == "area" else None
        shapes = shape_statistics.filled(shapes, share, scale)
        missing = _missing(shapes)
        if (hide or align == "structure") and (mirror is not None or not shapes.structures):
            raise InputError(
                "--hide and --align structure are for subjects of several surfaces, without --mirror"
            )
        hidden = shape_statistics.hidden_structures(shapes, hide.split(","), weights, scale) if hide else []
        poses = shape_statistics.aligned_structures(shapes, weights, scale) if shapes.structures else None
        shapes = poses.shapes if poses and align == "structure" else shapes
        lack = "of the vertices were not measured, and count as the mean of the others"
        notes += [f"{name}: {lacks:.1%} {lack}" for name, lacks in missing.items()]
        model = ShapeModel.fit(shapes, scale, weights)
        tested, of_groups = _tested(model, shapes, labels, test, seed) if groups else (None, None)
        groups_of = [labels.get(name, "") for name in model.names] if groups else None
        own = shapes if mirror is None else _first_half(shapes)
        sizes = shape_statistics.centroid_sizes(own.vertices, share)
        allometry, why_not = _allometry(own, sizes, share, seed)
        notes += why_not
        unlabelled = [name for name in own.names if groups and name not in labels]
        if unlabelled:
            notes.append(f"without a group: {', '.join(unlabelled)}")
        done = iter(range(len(shapes)))
        geodesic = shape_statistics.geodesic_distortions(
            shapes,
            progress=lambda name: to.tell(f"distances of {name}", 0.3 + 0.3 * next(done) / len(shapes)),
        )
        procrustes = shape_statistics.procrustes_distances(shapes.vertices, share, scale)
        to.tell("writing", 0.6)
        new.model(model, shapes, modes, groups_of)
        new.sizes(own, sizes, allometry, groups_of and groups_of[: len(own)])
        new.quality(model, seed)
        structures = new.structures(model, poses, hidden) if poses else []
        if tested:
            new.groups(model.mesh(), tested)
        new.distances(shapes, geodesic, procrustes, groups_of)
        notes += new.exports(shapes, model)
        record = {
            "isomatch": VERSION,
            "folder": str(folder),
            "shapes": list(model.names),
            "left_out": list(shapes.left_out),
            "missing": missing,
            "scale": scale,
            "weights": weights,
            "mirror": mirror,
            "align": align,
            "structures": structures,
            "seed": seed,
            "n_modes": model.n_modes,
            "total_variance": float(model.variances.sum()),
            "shares": model.variance_ratios.tolist(),
            "allometry": _of_test(allometry) if allometry else None,
            "groups": of_groups,
            "doubts": [{**doubt._asdict(), "names": list(doubt.names)} for doubt in doubts],
            "notes": notes,
        }
        told = _told_of(record)
        new.model_page(into.folder.resolve().name, record, told)
        new.finish(record)
        to.tell("done", 1.0)
    return Results(into.folder, into.written, record, told, model=model)


def _mirrored(
    shapes: CorrespondedShapes, mirror: str, scale: Scale, weights: Weights, seed: int
) -> tuple[CorrespondedShapes, list[str]]:
    """Add the mirror images by a left–right map, found or read; note of which shape it is, if not of the mean."""
    if mirror != "auto":
        given = Correspondence.load(Path(mirror), shapes.n_vertices)
        return shapes.mirrored([given] * len(shapes)), []
    mean = ShapeModel.fit(shapes, scale, weights).mesh()
    left_right, of = shape_statistics.left_right_of_shapes(shapes, mean, seed=seed)
    note = f"left and right are told by {of}, since the left–right map of the mean is not certain"
    return shapes.mirrored([left_right] * len(shapes)), [note] if of else []


def _tested(
    model: ShapeModel, shapes: CorrespondedShapes, labels: dict[str, str], method: Method, seed: int
) -> tuple[GroupTest, dict[str, Any]]:
    """Test where two groups differ, and whether they do as a whole; with plain values about it."""
    rows = [i for i, name in enumerate(model.names) if name in labels]
    listed = [labels[model.names[i]] for i in rows]
    own = None if shapes.measured is None else shapes.measured[rows]
    test = shape_statistics.group_test(model.aligned[rows], listed, method=method, seed=seed, measured=own)
    is_second = np.array([group == test.groups[1] for group in listed], dtype=np.float64)
    whole = shape_statistics.shape_regression(model.aligned[rows], is_second, model.weights, seed=seed)
    return test, {
        **_of_test(whole),
        "names": list(test.groups),
        "counts": list(test.counts),
        "test": method,
        "significant_share_of_area": float(model.weights[test.significant()].sum()),
        "least_p_value": float(test.p_values.min()),
        "least_q_value": float(test.q_values.min()),
    }


def _first_half(shapes: CorrespondedShapes) -> CorrespondedShapes:
    """Return shapes without their mirror images, which are no further specimens."""
    m = len(shapes) // 2
    measured = None if shapes.measured is None else shapes.measured[:m]
    return replace(shapes, names=shapes.names[:m], vertices=shapes.vertices[:m], measured=measured)


def _allometry(
    shapes: CorrespondedShapes, sizes: FloatArray, weights: FloatArray | None, seed: int
) -> tuple[ShapeRegression | None, list[str]]:
    """Regress shape, without size, on the logarithm of size; or say why not."""
    try:
        aligned = shape_statistics.generalised_procrustes(shapes.vertices, weights, "remove").aligned
        return shape_statistics.shape_regression(aligned, np.log(sizes), weights, seed=seed), []
    except IsomatchError as error:
        return None, [f"shape was not regressed on size: {error}"]


def _of_test(test: ShapeRegression) -> dict[str, Any]:
    return {name: getattr(test, name) for name in ("r_squared", "p_value", "n_permutations", "seed")}


def _missing(shapes: CorrespondedShapes) -> dict[str, float]:
    """Share of the vertices that each shape lacks, of those that lack any."""
    if shapes.measured is None:
        return {}
    lacks = (~shapes.measured).mean(axis=1).tolist()
    return {name: share for name, share in zip(shapes.names, lacks) if share}


def _told(test: dict[str, Any]) -> str:
    drawn = f"{test['n_permutations']} permutations, seed {test['seed']}"
    return f"{test['r_squared']:.1%} of the variance of shape, p = {test['p_value']:.4g} ({drawn})"


def _told_of(record: dict[str, Any]) -> list[str]:
    """Say what was found, one sentence each."""
    lines = list[str]()
    for own in record["structures"]:
        line = f"{own['structure']} has {own['share']:.1%} of the variance; of its own {own['pose_share']:.1%} is pose"
        if own["hidden_error"] is not None:
            line += f"; hidden, it is completed to {own['hidden_error']:.4g}, the mean to {own['hidden_mean_error']:.4g}"
        lines.append(line)
    if tested := record["groups"]:
        first, second = (f"{name} ({count})" for name, count in zip(tested["names"], tested["counts"]))
        share = tested["significant_share_of_area"]
        differ = (
            f"differ on {share:.1%} of the area" if share else "do not differ significantly at any vertex"
        )
        lines.append(f"{first} and {second} {differ}, at a false discovery rate of 5 %")
        lines.append(f"the groups describe {_told(tested)}")
    if record["allometry"]:
        lines.append(f"size describes {_told(record['allometry'])}")
    return [*lines, *(f"note: {note}" for note in record["notes"])]
