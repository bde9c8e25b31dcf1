"""The statistics of shapes in a folder: mean, modes, groups, sizes, distances, and motion."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import partial
from itertools import compress
from pathlib import Path
from typing import Any, Literal

import numpy as np

from isomatch._core.arrays import FloatArray
from isomatch._core.errors import InputError, IsomatchError, MissingDependencyError
from isomatch._core.skipped import noted
from isomatch._core.stage_timer import Progress
from isomatch._core.tables import NO_TEXT
from isomatch.cohort import shape_statistics
from isomatch.cohort.collection import Collection
from isomatch.cohort.map_file import require_unchanged
from isomatch.cohort.plan import Layout
from isomatch.cohort.shape_statistics import MEASURED, CorrespondedShapes, Criterion, ShapeDesign, ShapeModel
from isomatch.cohort.statistics_folder import VERSION, Results, StatisticsFolder
from isomatch.cohort.study_input import Study, doubts_in_words, read_study
from isomatch.cohort.workers import Listener, Warn
from isomatch.correspondence import Correspondence
from isomatch.io import Asset, Attribute, holds_values, read_asset, read_attributes, write_asset
from isomatch.landmarks import read_landmark_pairs
from isomatch.surfaces import Mesh

Scale = Literal["keep", "remove"]  # whether shapes keep their sizes, or are brought to one size
Weights = Literal["area", "uniform"]  # whether a vertex counts by its area, or all count alike
TestMethod = Literal["permutation", "parametric"]  # method that gives the p-values of a test
GROUP_PATTERN = r"factor\s*\(\s*group\s*\)|(?<![\w.])group(?![\w.])"  # matches ``group`` in a formula
LOG_SIZE = "size"  # name in formulas of the logarithm of the centroid size


def statistics(
    folder: str | Path,
    output: str | Path,
    *,
    scale: Scale = "keep",
    weights: Weights = "area",
    modes: int = 3,
    groups: Path | None = None,
    model: str | None = None,
    test: TestMethod = "permutation",
    tangent: bool = False,
    slide: Criterion | None = None,
    wireframe: Path | None = None,
    mirror: str | None = None,
    align: Literal["subject", "structure"] = "subject",
    hide: str | None = None,
    pictures: shape_statistics.PictureFormat = "png",
    seed: int = 0,
    force: bool = False,
    progress: Progress | None = None,
    warn: Warn | None = None,
) -> Results:
    """Write the mean, modes of variation and distances of shapes in one topology to a folder.

    Parameters
    ----------
    folder : path_like
        Folder of meshes with the same faces, or of a collection; or landmarks, see
        `isomatch.landmarks.read_specimens`.
    output : path_like
        Folder for mean, modes, model.npz, scores, variances, distances, pictures, and files for
        other tools.
    scale, weights, modes, groups, model, test, tangent, slide, wireframe, mirror, align, hide, pictures, seed, force
        As the options of ``isomatch statistics``.
    progress, warn
        See `run`; warnings are about shapes to look at first.

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
        needed = () if model and groups else ("group",)
        study = read_study(folder, groups, needed, wireframe=wireframe, slide=slide)
        shapes, labels, notes = study.shapes, study.groups, study.notes
        weights = weights if len(shapes.faces) else "uniform"
        for line in doubts_in_words(study.doubts):
            to.warn(line)
        to.tell("model", 0.1)
        if mirror is not None:
            shapes, note = _add_mirror_images(shapes, mirror, scale, weights, seed)
            notes += note
        share = shapes.area_weights if weights == "area" else None
        shapes = shape_statistics.filled(shapes, share, scale)
        missing_shares = (~shapes.seen).mean(axis=1).tolist()
        missing = {name: share for name, share in zip(shapes.names, missing_shares) if share}
        if (hide or align == "structure") and (mirror is not None or not shapes.structures):
            use = "subjects of several surfaces, without --mirror"
            raise InputError(f"--hide and --align structure are for {use}")
        hidden = shape_statistics.hidden_structures(shapes, hide.split(","), weights, scale) if hide else []
        poses = shape_statistics.aligned_structures(shapes, weights, scale) if shapes.structures else None
        shapes = poses.shapes if poses and align == "structure" else shapes
        reason = f"of the {shapes.points} were not measured, and count as the mean of the others"
        notes += [f"{name}: {lacking:.1%} {reason}" for name, lacking in missing.items()]
        modelled = ShapeModel.fit(shapes, scale, weights, tangent=tangent)
        if groups and not labels and not model:
            raise InputError(f"{groups}: no shape has a group; write the group of each in the column group")
        groups_of = [labels.get(name, "") for name in modelled.names] if labels else None
        group_test, of_groups = _test_groups(modelled, shapes, labels, test, seed) if labels else (None, None)
        specimens = shapes if mirror is None else _without_images(shapes)
        sizes = shape_statistics.centroid_sizes(specimens.vertices, share)
        allometry, why_not = _allometry(specimens, sizes, share, seed, tangent)
        notes += why_not
        if unlabelled := [name for name in specimens.names if labels and name not in labels]:
            notes.append(noted(f"without a group: {', '.join(unlabelled)}"))
        fit = partial(_fit_linear, modelled, study=study, log_sizes=np.log(sizes), seed=seed, notes=notes)
        by_group = fit("factor(group)") if labels else None
        linear, classes = fit(model) if model else by_group, _classify(modelled, labels, notes)
        done, geodesic = iter(range(len(shapes))), None

        def tell_distances(name: str) -> None:
            to.tell(f"distances of {name}", 0.3 + 0.3 * next(done) / len(shapes))

        if len(shapes.faces):
            geodesic = shape_statistics.geodesic_distortions(shapes, progress=tell_distances)
        procrustes = shape_statistics.procrustes_distances(shapes.vertices, share, scale)
        to.tell("writing", 0.6)
        new.model(modelled, shapes, modes, groups_of)
        new.sizes(specimens, sizes, allometry, groups_of and groups_of[: len(specimens)])
        new.quality(modelled, seed)
        structures = new.structures(modelled, poses, hidden) if poses else []
        if group_test:
            new.groups(shapes, modelled, group_test)
        sections = new.linear(linear, classes, [n for n in modelled.names if n in labels], labels)
        new.distances(shapes, geodesic, procrustes, groups_of)
        if study.slid:
            new.table("slid.csv", **dict(zip(study.slid[0]._fields, zip(*study.slid))))
        notes += new.exports(shapes, modelled)
        record = {
            "isomatch": VERSION,
            "folder": str(folder),
            "of": shapes.points,
            "shapes": list(modelled.names),
            "left_out": list(shapes.left_out),
            "missing": missing,
            "scale": scale,
            "weights": weights,
            "tangent": tangent,
            "slide": slide,
            "mirror": mirror,
            "align": align,
            "structures": structures,
            "seed": seed,
            "n_modes": modelled.n_modes,
            "total_variance": float(modelled.variances.sum()),
            "shares": modelled.variance_ratios.tolist(),
            "allometry": _numbers_of(allometry) if allometry else None,
            "groups": of_groups and {**of_groups, **_numbers_of(by_group)},
            "model": model,
            "terms": [row._asdict() for row in linear.rows] if linear else [],
            "pairs": [pair._asdict() for pair in linear.pairs] if linear else [],
            "classified": classes and {"share_right": classes.share_right, "n_modes": classes.n_modes},
            "doubts": [{**doubt._asdict(), "names": list(doubt.names)} for doubt in study.doubts],
            "notes": notes,
        }
        sentences = _sentences(record)
        new.model_page(into.folder.resolve().name, modelled, {**record, "modes": modes}, sentences, sections)
        new.finish(record)
        to.tell("done", 1.0)
    return Results(into.folder, into.written, record, sentences, model=modelled)


def _add_mirror_images(
    shapes: CorrespondedShapes, mirror: str, scale: Scale, weights: Weights, seed: int
) -> tuple[CorrespondedShapes, list[str]]:
    """Add mirror images by a left–right map; a note names the shape it is of, if not the mean."""
    is_mesh = len(shapes.faces) > 0
    if mirror != "auto":
        n = shapes.n_vertices
        if is_mesh:
            given = Correspondence.load(Path(mirror), n)
        else:
            pairs = read_landmark_pairs(Path(mirror), shapes.marks)
            given = shape_statistics.left_right_of_pairs(n, pairs)
        return shapes.mirrored([given] * len(shapes)), []
    if not is_mesh:
        remedy = "of landmarks, give a table of pairs of left and right ones"
        raise InputError(f"--mirror auto is for meshes; {remedy}")
    mean = ShapeModel.fit(shapes, scale, weights).mesh()
    left_right, of = shape_statistics.left_right_of_shapes(shapes, mean, seed=seed)
    note = f"left and right are told by {of}, since the left–right map of the mean is not certain"
    return shapes.mirrored([left_right] * len(shapes)), [note] if of else []


def _test_groups(
    model: ShapeModel, shapes: CorrespondedShapes, labels: dict[str, str], method: TestMethod, seed: int
) -> tuple[shape_statistics.GroupTest | None, dict[str, Any]]:
    """Test where two groups differ; with plain values about the groups, also if there are more."""
    rows = [i for i, name in enumerate(model.names) if name in labels]
    groups = [labels[model.names[i]] for i in rows]
    names, counts = np.unique(groups, return_counts=True)
    about = {"names": names.tolist(), "counts": counts.tolist(), "test": method}
    if len(names) > 2:
        return None, about
    measured = None if shapes.measured is None else shapes.measured[rows]
    how: dict[str, Any] = {"method": method, "seed": seed, "measured": measured}
    test = shape_statistics.group_test(model.aligned[rows], groups, **how)
    share = float(model.weights[test.significant()].sum())
    least = {"least_p_value": float(test.p_values.min()), "least_q_value": float(test.q_values.min())}
    return test, {**about, "significant_share_of_area": share, **least}


def _fit_linear(
    model: ShapeModel, formula: str, study: Study, log_sizes: FloatArray, seed: int, notes: list[str]
) -> shape_statistics.ShapeAnova:
    """Test the terms of a model in the shapes that have all values."""
    names = model.names[: len(log_sizes)]  # mirror images come after these and are left out
    cells = [{LOG_SIZE: size, **study.table.get(name, {})} for name, size in zip(names, log_sizes.tolist())]
    columns = dict.fromkeys(column for row in cells for column in row if column != "name")
    # the variable ``group``, in capitals or not, is a factor, even if the names of the groups are numbers
    formula = re.sub(GROUP_PATTERN, "factor(group)", formula, flags=re.IGNORECASE)
    used = {word.strip() for word in re.split(r"[+*:()~]", formula)} & {*columns}
    lacks = [any(str(row.get(column, "")).lower() in NO_TEXT for column in used) for row in cells]
    if without := [*compress(names, lacks)]:
        notes.append(f"not in the model {formula!r}, as a value is missing: {', '.join(without)}")
    full = [i for i, is_missing in enumerate(lacks) if not is_missing]
    table = {column: [cells[i].get(column, "") for i in full] for column in columns}
    design = ShapeDesign.of(formula, table)
    return shape_statistics.shape_anova(model.aligned[full], design, model.weights, seed=seed)


def _classify(
    model: ShapeModel, labels: dict[str, str], notes: list[str]
) -> shape_statistics.Classification | None:
    """Classify the shapes that have a group, if there are modes, and scikit-learn is installed."""
    rows = [i for i, name in enumerate(model.names) if name in labels]
    if len(rows) < 3 or not model.n_modes:
        return None
    try:
        return shape_statistics.classify(model.scores[rows], [labels[model.names[i]] for i in rows])
    except MissingDependencyError as error:
        notes.append(f"canonical variates are not computed: {error}")
        return None


def _without_images(shapes: CorrespondedShapes) -> CorrespondedShapes:
    """Return shapes without their mirror images, which are no further specimens."""
    m = len(shapes) // 2
    measured = None if shapes.measured is None else shapes.measured[:m]
    return replace(shapes, names=shapes.names[:m], vertices=shapes.vertices[:m], measured=measured)


def _allometry(
    shapes: CorrespondedShapes, sizes: FloatArray, weights: FloatArray | None, seed: int, tangent: bool
) -> tuple[shape_statistics.ShapeRegression | None, list[str]]:
    """Regress shape, without size, on the logarithm of size; or tell why not."""
    how: dict[str, Any] = {"scale": "remove", "tangent": tangent}
    try:
        aligned = shape_statistics.generalised_procrustes(shapes.vertices, weights, **how).aligned
        return shape_statistics.shape_regression(aligned, np.log(sizes), weights, seed=seed), []
    except IsomatchError as error:
        return None, [f"shape was not regressed on size: {error}"]


def _numbers_of(
    test: shape_statistics.ShapeRegression | shape_statistics.ShapeAnova | None,
) -> dict[str, Any]:
    whole = test.rows[0] if isinstance(test, shape_statistics.ShapeAnova) else test
    settings = {name: getattr(test, name) for name in ("n_permutations", "seed")}
    return {name: getattr(whole, name) for name in ("r_squared", "p_value")} | settings


def _test_in_words(test: dict[str, Any]) -> str:
    settings = f"{test['n_permutations']} permutations, seed {test['seed']}"
    return f"{test['r_squared']:.1%} of the variance of shape, p = {test['p_value']:.4g} ({settings})"


def _sentences(record: dict[str, Any]) -> list[str]:
    lines = list[str]()
    for structure in record["structures"]:
        share, pose = structure["share"], structure["pose_share"]
        line = f"{structure['structure']} has {share:.1%} of the variance; of its own {pose:.1%} is pose"
        error, mean_error = structure["hidden_error"], structure["hidden_mean_error"]
        if error is not None:
            line += f"; hidden, it is completed to {error:.4g}, the mean to {mean_error:.4g}"
        lines.append(line)
    if tested := record["groups"]:
        if len(tested["names"]) == 2:
            first, second = (f"{name} ({count})" for name, count in zip(tested["names"], tested["counts"]))
            share, is_mesh = tested["significant_share_of_area"], record["of"] == "vertices"
            none = f"do not differ significantly at any {'vertex' if is_mesh else 'landmark'}"
            differ = f"differ on {share:.1%} of the {'area' if is_mesh else 'landmarks'}" if share else none
            lines.append(f"{first} and {second} {differ}, at a false discovery rate of 5 %")
        lines.append(f"the groups describe {_test_in_words(tested)}")
    for row in record["terms"][:-2] if record["model"] else []:
        value = f"F = {row['f']:.4g} on {row['degrees']}, Z = {row['z']:.3g}, p = {row['p_value']:.4g}"
        lines.append(f"{row['term']} describes {row['r_squared']:.1%} of the variance of shape, {value}")
    if record["classified"]:
        share, n_modes = record["classified"]["share_right"], record["classified"]["n_modes"]
        where = f"in the group that the others predict, by {n_modes} modes"
        lines.append(f"{share:.0%} of the shapes are {where}")
    if record["allometry"]:
        lines.append(f"size describes {_test_in_words(record['allometry'])}")
    return [*lines, *(f"note: {note}" for note in record["notes"])]


def series(
    folder: str | Path,
    output: str | Path,
    *,
    regions: Path | None = None,
    reference: str | None = None,
    force: bool = False,
    progress: Progress | None = None,
    warn: Warn | None = None,
) -> Results:
    """Measure how a series of shapes moves: area, volume, thickness and strain, by region.

    Parameters
    ----------
    folder : path_like
        Folder of meshes with the same faces, frame2 before frame10; or of a collection.
    output : path_like
        Folder for time.csv, time.png, and strain/NAME.vtp, each shape with the measures of its
        faces.
    regions, reference, force
        As the options of ``isomatch statistics time``.
    progress, warn
        See `run`; warnings are about shapes that are left out.

    Returns
    -------
    Results
        The names of the shapes, the reference, and notes.

    Raises
    ------
    InputError
        If there are fewer than two shapes in one topology, or the reference is none of them.
    """
    folder, to = Path(folder), Listener.of(progress, warn)
    into = StatisticsFolder(Path(output), last="time.json")
    with into.claimed(force) as new:
        require_unchanged(Layout(folder), ["corresponded"])
        shapes = shape_statistics.read_shapes(folder)
        meshes = {name: shapes.mesh(i) for i, name in enumerate(shapes.names)}
        is_collection = Layout(folder).plan.exists()
        order = Collection.open(folder).names if is_collection else shapes.names
        names = [name for name in order if name in meshes]
        notes = [f"left out: {reason}" for reason in shapes.left_out]
        notes += [f"missing: {name}; see shapes.csv" for name in order if name not in meshes]
        doubts = shape_statistics.doubtful_shapes(shapes)
        notes += doubts_in_words(doubt for doubt in doubts if doubt.kind == "units")
        for note in notes:
            to.warn(note)
        if len(names) < 2:
            raise InputError(f"{folder}: a series has two shapes or more in one topology, not {len(names)}")
        first = names[0] if reference is None else reference
        if first not in meshes:
            raise InputError(f"--reference {first}: no such shape; they are {', '.join(names)}")
        labels = _labels(regions, meshes[first]) if regions else []
        rows = []
        for i, name in enumerate(names):
            to.tell(f"measuring {name}", i / len(names))
            motion = shape_statistics.face_motion(meshes[name], meshes[first])
            values = [Attribute(key, "face", "scalar", of) for key, of in motion.items()]
            write_asset(new.path(f"strain/{name}.vtp"), Asset.of_mesh(meshes[name], values))
            by_region = shape_statistics.motion_by_region(meshes[name], meshes[first], motion, labels)
            rows += [{"name": name, **row} for row in by_region]
        if np.isnan(rows[0]["volume"]):
            notes.append("no volume and thickness, as the surface is not closed")
        new.table("time.csv", **{key: [row[key] for row in rows] for key in rows[0]})
        shape_statistics.draw_motion(new.picture("time"), rows)
        about = {"isomatch": VERSION, "folder": str(folder), "reference": first}
        record = {**about, "shapes": names, "notes": notes}
        new.finish(record)
    sentence = f"{len(names)} shapes of {shapes.n_vertices:,} vertices; strain is relative to {first}"
    return Results(into.folder, into.written, record, [sentence])


def _labels(path: Path, mesh: Mesh) -> list[str]:
    """Read the name of the region of each vertex, "" without a region."""
    found = read_attributes(path, Asset.of_mesh(mesh)) if holds_values(path) else read_asset(path).attributes
    labels = [x for x in found if x.domain == "point" and x.name != MEASURED and x.seems_labels]
    if len(labels) != 1 or len(labels[0]) != mesh.n_vertices:
        raise InputError(f"{path}: give one label for each of the {mesh.n_vertices} vertices, and no others")
    codes = np.nan_to_num(labels[0].plain, nan=-1).astype(int).tolist()
    return ["" if code < 0 else labels[0].coded.names.get(code, str(code)) for code in codes]
