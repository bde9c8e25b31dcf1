"""``isomatch statistics``: mean, modes, groups and distances of shapes in one topology, and shapes completed by them."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from itertools import accumulate
from pathlib import Path
from typing import Annotated, Any, Literal
from unicodedata import normalize

import numpy as np
from cyclopts import App, Parameter

import isomatch
from isomatch import cohort
from isomatch._core.arrays import FloatArray
from isomatch._core.errors import FormatError, InputError, IsomatchError
from isomatch._core.files import opened, write_text
from isomatch._core.texts import decoded, read_csv, separated
from isomatch.cli.inputs import ConfigFile, Force, Output, Seed, read_config
from isomatch.cli.outputs import claimed_files, require_writable, say_left_out
from isomatch.cli.scored import LAST, new_shapes, say_scored, write_scored
from isomatch.cli.statistics_files import StatisticsFolder
from isomatch.cli.statistics_time import over_time
from isomatch.cli.terminal import INDENT, TALK, Talk, complain, json_text, part, say, say_rows, say_table
from isomatch.cohort import shape_statistics
from isomatch.cohort.shape_statistics import CorrespondedShapes, GroupTest, ShapeModel, ShapeRegression
from isomatch.io import FORMATS, Asset, Attribute

Scale = Literal["keep", "remove"]
Weights = Literal["area", "uniform"]
TestMethod = Literal["permutation", "parametric"]
TRUSTED = {"CONVERGED", "PARTIAL"}  # outcomes of maps that are not in doubt

statistics = App(name="statistics", default_parameter=Parameter(negative=()))


@statistics.default
def run(
    folder: Path,
    /,
    *,
    output: Output,
    scale: Scale = "keep",
    weights: Weights = "area",
    modes: int = 3,
    groups: Path | None = None,
    test: TestMethod = "permutation",
    mirror: str | None = None,
    align: Literal["subject", "structure"] = "subject",
    hide: str | None = None,
    pictures: Literal["png", "pdf", "svg"] = "png",
    seed: Seed = 0,
    force: Force = False,
    talk: Talk = TALK,
) -> None:
    """Compute the mean, the modes of variation and the distances of shapes in one topology.

    Args:
        folder: Folder of meshes with the same faces, or folder written by isomatch collect. Meshes with other faces or
            with unmatched vertices are left out.
        output: Folder for mean, modes, model.npz, scores, variances, distances, pictures, and files for other tools.
        scale: keep: size is part of the shape. remove: all shapes are brought to one size.
        weights: area: a vertex counts by its share of the area. uniform: all vertices count alike.
        modes: Number of modes that are drawn and written as meshes. The model has all.
        groups: Table with the columns name and group, or these two without a header: test at every vertex where two
            groups differ. Commas, semicolons or tabs separate its cells; a shape without a group is left out of the test.
        test: permutation: p-values from exchanged labels. parametric: from Hotelling's distribution.
        mirror: Add the mirror image of every shape: auto, or a file with the vertex on the other side of each vertex, as
            a map.
        align: Of subjects of several surfaces. subject (default): the poses of structures among each other are part of
            the shape. structure: each is aligned by itself. Poses are in poses.csv.
        hide: Structures, separated by commas, to hide in each subject in turn and complete by a model of the others:
            hidden.csv has the errors, beside those of the mean.
        pictures: png (default): with 300 dots per inch. pdf or svg: charts as lines.
    """
    if modes < 0:
        raise isomatch.SettingError(f"--modes {modes} is not a number of modes; give 0 or more")
    into = StatisticsFolder(output, pictures)
    with talk.progress() as tell, into.claimed(force) as new:
        tell("reading", 0.0)
        shapes, labels, doubts, notes = read_cohort(folder, groups)
        for doubt in doubts:
            complain(f"{' and '.join(doubt.names)} {doubt.reason}")
        tell("model", 0.1)
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
        told = "of the vertices were not measured, and count as the mean of the others"
        notes += [f"{name}: {lacks:.1%} {told}" for name, lacks in missing.items()]
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
            shapes, progress=lambda name: tell(f"distances of {name}", 0.3 + 0.3 * next(done) / len(shapes))
        )
        procrustes = shape_statistics.procrustes_distances(shapes.vertices, share, scale)
        tell("writing", 0.6)
        new.model(model, shapes, modes, groups_of)
        new.sizes(own, sizes, allometry, groups_of and groups_of[: len(own)])
        new.quality(model, seed)
        structures = new.structures(model, poses, hidden) if poses else []
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
        new.model_page(output.resolve().name, record, _lines(record))
        new.finish(record)
        tell("done", 1.0)

    def summary() -> None:
        _say(model, record)
        say(f"open first: {output / 'index.html'}; {len(into.written)} files are there")

    talk.result({**record, "output": str(output), "files": into.written}, summary)


def read_cohort(
    folder: Path, groups: Path | None
) -> tuple[CorrespondedShapes, dict[str, str], list[shape_statistics.Doubt], list[str]]:
    """Read shapes of a folder, or one, their groups, which of them seem wrong, and notes."""
    cohort.require_unchanged(cohort.Layout(folder), ["corresponded"])
    shapes = shape_statistics.read_shapes([folder] if folder.is_file() else folder)
    labels = read_groups(groups, shapes.names, shapes.left_out) if groups else {}
    doubts = shape_statistics.doubtful_shapes(shapes)
    notes = [f"left out: {reason}" for reason in shapes.left_out]
    for own in (folder / structure for structure in shapes.structures or ("",)):
        told = _doubts(own / "pairs.csv", shapes.names) + _reflected(own / "shapes.csv", shapes.names)
        notes += [f"{own.name}: {note}" if shapes.structures else note for note in told]
    return shapes, labels, list(doubts), notes


def _mirrored(
    shapes: CorrespondedShapes, mirror: str, scale: Scale, weights: Weights, seed: int
) -> tuple[CorrespondedShapes, list[str]]:
    """Add the mirror images by a left–right map, found or read; note of which shape it is, if not of the mean."""
    if mirror != "auto":
        given = isomatch.Correspondence.load(Path(mirror), shapes.n_vertices)
        return shapes.mirrored([given] * len(shapes)), []
    mean = ShapeModel.fit(shapes, scale, weights).mesh()
    left_right, of = shape_statistics.left_right_of_shapes(shapes, mean, seed=seed)
    note = f"left and right are told by {of}, since the left–right map of the mean is not certain"
    return shapes.mirrored([left_right] * len(shapes)), [note] if of else []


def _doubts(pairs: Path, names: tuple[str, ...]) -> list[str]:
    """Say which shapes of a collection rest on a map that may be wrong."""
    if not pairs.is_file():
        return []
    outcomes: dict[str, set[str]] = {name: set() for name in names}
    for row in read_csv(pairs):
        for end in ("source", "target"):
            outcomes.get(row.get(end) or "", set()).add(row.get("outcome") or "FAILED")
    doubtful = {name: ", ".join(sorted(own)) for name, own in outcomes.items() if own and not own & TRUSTED}
    return [f"{name} may be matched wrongly: {doubts}" for name, doubts in doubtful.items()]


def _reflected(table: Path, names: tuple[str, ...]) -> list[str]:
    """Say which shapes of a collection are mirror images of those in their files."""
    lines = read_csv(table) if table.is_file() else []
    turned = [name for line in lines if line.get("reflected") and (name := line.get("name")) in names]
    return [f"mirror images of the surfaces in their files: {', '.join(turned)}"] if turned else []


def _tested(
    model: ShapeModel, shapes: CorrespondedShapes, labels: dict[str, str], method: TestMethod, seed: int
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


def _lines(record: dict[str, Any]) -> list[str]:
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


def _say(model: ShapeModel, record: dict[str, Any]) -> None:
    size = f"{len(model.names)} shapes of {len(model.mean):,} vertices"
    say(f"{size} vary in {model.n_modes} mode{'s' * (model.n_modes != 1)}", "bold")
    modes = zip(record["shares"][:10], accumulate(record["shares"]), model.deviations.tolist())
    say_table(
        (f"mode {i}", f"{share:.1%} of the variance, sd {deviation:.4g}", f"{total:.1%} so far")
        for i, (share, total, deviation) in enumerate(modes, 1)
    )
    for line in _lines(record):
        say(line)


def read_groups(path: Path, names: Collection[str], left_out: Collection[str] = ()) -> dict[str, str]:
    """Read the group of each shape from a table, as spreadsheets write them; shapes whose cell is empty have none."""
    # Columns name and group, among others, or these two without a header; names may be those of files. A line that begins
    # with # is a comment, unless a shape has that name. Rows of shapes that were left out, with reasons, are passed over.
    names_of = {normalize("NFC", name): name for name in names}
    labels: dict[str, str] = {}
    columns: tuple[int, int] | None = None
    with opened(path) as file:
        rows, _ = separated(decoded(file.read()), str(path))
    for number, row in rows:
        if not any(row):
            continue
        where, shown = f"{path}:{number}", ",".join(row)[:80]
        if row[0].startswith("#") and normalize("NFC", row[0]) not in names_of:
            continue
        if columns is None:
            lower = [cell.lower() for cell in row]
            is_header = "name" in lower and "group" in lower
            columns = (lower.index("name"), lower.index("group")) if is_header else (0, 1)
            if is_header:
                continue
            if len(row) < 2 or any(row[2:]):
                raise FormatError(
                    f"{where}: {shown!r} is not a shape and its group; write name,group, or a header with these columns"
                )
        if len(row) <= max(columns):
            raise FormatError(f"{where}: {shown!r} is not a shape and its group; write name,group")
        name, group = (row[column] for column in columns)
        shape = names_of.get(normalize("NFC", name)) or names_of.get(normalize("NFC", _stem(name)))
        if shape is None:
            if any(reason.startswith(f"{each}: ") for reason in left_out for each in (name, _stem(name))):
                continue
            raise FormatError(f"{where}: no shape is named {name!r}; shapes are named like their files")
        if labels.setdefault(shape, group) != group:
            raise FormatError(
                f"{where}: {name!r} is in group {group!r} and in {labels[shape]!r}; give each shape one group"
            )
    return {name: group for name, group in labels.items() if group}


def _stem(name: str) -> str:
    """Name of a shape from that of its file."""
    last = name.replace("\\", "/").rpartition("/")[2]
    suffix = Path(last).suffix
    return last.removesuffix(suffix) if suffix.lower() in FORMATS else last


@statistics.command
def project(
    model: Path,
    /,
    *shapes: Path,
    output: Output,
    force: Force = False,
    talk: Talk = TALK,
) -> None:
    """Score new shapes in an old model: how far each is from the mean, how well the modes describe it, and where not.

    The model stays as it is. Shapes in another topology are brought into that of the model by isomatch collect add.

    Args:
        model: model.npz of isomatch statistics.
        shapes: Meshes in the topology of the model.
        output: Folder for scored.csv, scored.json, and scored/NAME.ply: each shape moved onto the mean, with residual,
            how far each vertex is from what the modes describe, and distance_from_mean.
    """
    into = StatisticsFolder(output, last=LAST)
    with talk.progress() as tell, into.claimed(force) as new:
        tell("reading", 0.0)
        prior, new_ones = ShapeModel.load(model), new_shapes(shapes)
        scored = {entry.name: prior.score_file(entry.path) for entry in new_ones}
        record = write_scored(new, model, prior, scored)
    talk.result({**record, "output": str(output)}, lambda: say_scored(record, output))


statistics.command(over_time, name="time")


@statistics.command
def complete(
    model: Path,
    shape: Annotated[Path, Parameter(name="PART")],
    /,
    *,
    output: Output,
    landmarks: Path | None = None,
    noise: float | None = None,
    pose: Literal["fitted", "given"] = "fitted",
    config: ConfigFile = None,
    seed: Seed = 0,
    force: Force = False,
    talk: Talk = TALK,
) -> None:
    """Complete a shape: the likeliest one of a model, given a part or landmarks, and how uncertain each vertex is.

    Writes the completed mesh, where the part is, and next to it NAME.json with its scores and what was left out.

    Args:
        model: model.npz of isomatch statistics.
        shape: A mesh in the topology of the model, of which vertices are missing (not finite, or measured = 0); any other
            mesh, which is matched to the mean of the model; or landmarks: .mrk.json or .fcsv of 3D Slicer, .pp of
            MeshLab, or a table name,x,y,z. Of subjects, a folder of the structures that are known, named as in the model.
        output: Surface file for the completed shape, with the scalars standard_deviation and expected_error at its
            vertices; of subjects, a folder for a file of each structure.
        landmarks: Landmarks of mean.ply with the same names, if landmarks are given.
        noise: How far a given point may be from what the modes describe, in the units of PART; by default the error of
            the model for a shape that is left out.
        pose: fitted (default): PART may be anywhere. given: it is aligned with the model.
        config: TOML file with settings of the match.
    """
    if not shape.is_dir():
        require_writable(output)
    about = output.with_suffix(".json")
    with talk.progress() as tell, claimed_files(output, about, force=force):
        tell("reading", 0.0)
        prior = ShapeModel.load(model)
        how: dict[str, Any] = {"noise": noise, "config": read_config(config), "seed": seed}
        told = part(tell, 0.1, 0.8)
        observed = shape_statistics.read_observations(shape, prior, landmarks, **how, progress=told)
        tell("completing", 0.8)
        completed = shape_statistics.complete(prior, observed, pose=pose)
        values = {name: getattr(completed, name) for name in ("standard_deviation", "expected_error")}
        scalars = [Attribute(name, "point", "scalar", np.asarray(each)) for name, each in values.items()]
        left: tuple[Attribute, ...] = ()
        for name, own in shape_statistics.slices_of(prior.structures).items() if shape.is_dir() else ():
            output.mkdir(parents=True, exist_ok=True)
            mesh = shape_statistics.structure_of(completed.mesh, own)
            scalars_of = [replace(each, values=each.values[own]) for each in scalars]
            isomatch.write_asset(output / f"{name}.ply", Asset.of_mesh(mesh, scalars_of))
        if not shape.is_dir():
            left = isomatch.write_asset(output, Asset.of_mesh(completed.mesh, scalars))
        record = {
            "isomatch": isomatch.__version__,
            "model": str(model),
            "part": str(shape),
            "file": str(output),
            "n_points": completed.n_points,
            "error": completed.error,
            "residual": completed.residual,
            "mean_standard_deviation": float(completed.standard_deviation @ prior.weights),
            "largest_standard_deviation": float(completed.standard_deviation.max()),
            "scores": completed.scores.tolist(),
            "score_deviations": completed.score_deviations.tolist(),
            "scale": completed.scale,
            "rotation": completed.rotation.tolist(),
            "translation": completed.translation.tolist(),
            "left_out": [attribute.name for attribute in left],
            "notes": [*observed.notes, *completed.notes],
        }
        write_text(about, json_text(record))
        tell("done", 1.0)
    talk.result(record, lambda: _say_completed(record, about))


def _say_completed(record: dict[str, Any], about: Path) -> None:
    say(f"The shape is completed from {record['n_points']:,} points.", "bold")
    sure = (
        f"it passes the points at {record['error']:.4g} (root mean square); elsewhere its standard deviation is "
        f"{record['mean_standard_deviation']:.4g} on average, {record['largest_standard_deviation']:.4g} at most; "
        f"{record['residual']:.4g} is what the modes do not describe"
    )
    say_rows([("how sure", sure), *(("note", note) for note in record["notes"])])
    say(f"{'  wrote':<{INDENT}}{record['file']}, {about}")
    say_left_out(record["left_out"], record["file"])
