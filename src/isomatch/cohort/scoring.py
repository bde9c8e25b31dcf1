"""New shapes, also of new subjects, scored in an old model; and a part of a shape completed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from isomatch._core.errors import InputError, IsomatchError, MeshError, SettingError
from isomatch._core.files import claimed, require_names, write_text
from isomatch._core.stage_timer import Progress
from isomatch._core.texts import json_text
from isomatch.cohort import shape_statistics
from isomatch.cohort.collection import Collection
from isomatch.cohort.finish import surfaces_written
from isomatch.cohort.ledger import Rows, ShapeRow
from isomatch.cohort.plan import OTHER_SHAPES, Entry, Layout, checked_units, common_unit, entries_of
from isomatch.cohort.run import Reports, follow, status_of, write_results
from isomatch.cohort.shape_statistics import ScoredShape, ShapeModel, leave_one_out, size_factors
from isomatch.cohort.snapshot import Snapshot
from isomatch.cohort.statistics_folder import VERSION, Results, StatisticsFolder
from isomatch.cohort.unusual_shapes import explain_unit
from isomatch.cohort.workers import Listener, Warn, Workers, workers_of
from isomatch.io import Asset, Attribute, mesh_from, read_mesh, write_asset
from isomatch.landmarks import Landmarks
from isomatch.settings import Config

# A model was made of another surface of the template if the template, as it is now, is farther than this from its shape
# in the model, over the largest extent of the model's mean; chosen.
MAX_TEMPLATE_CHANGE = 1e-4
LAST_FILE = "scored.json"  # file about new shapes that is written last: if it exists, all others are complete


def add(
    folder: str | Path,
    files: Sequence[str | Path],
    *,
    model: Path | None = None,
    reflect: str | Iterable[str] | None = None,
    units: Mapping[str, str] | None = None,
    reports: Reports = "doubtful",
    executor: str | Executor | Workers = "local",
    jobs: int | None = None,
    progress: Progress | None = None,
    warn: Warn | None = None,
) -> Results:
    """Match new subjects with the template of a finished collection, and score them in its model.

    Existing files stay as they are: new ones are in the folder ``added``, and nothing is fitted
    again. Nothing is done twice, and more can be added.

    Parameters
    ----------
    folder : path_like
        The folder of the collection.
    files : sequence of path_like
        Meshes, or one folder or list of them.
    model : Path, optional
        File of its `ShapeModel`; by default ``statistics/model.npz`` in the folder.
    reflect : "auto", str or iterable of str, optional
        New subjects to match as mirror images; by default "auto" if the collection has it, else
        none.
    units : mapping of str to str, optional
        Units of new subjects, by name; if the unit of the collection is not known, ``"*"`` gives
        it. The size of a subject whose unit is given is not questioned.
    reports, executor, jobs, progress, warn
        See `run`.

    Returns
    -------
    Results
        A line for each scored subject in ``record["shapes"]``. Subjects that have names of old
        ones, are no meshes, or have sizes that suggest other units are in ``record["left_out"]``,
        with the reason.

    Raises
    ------
    InputError
        If the collection is not finished, the model is missing or of another template, or all new
        subjects would be left out.
    """
    collection, to = Collection.open(folder), Listener.of(progress, warn)
    file = model or Path(folder) / "statistics" / "model.npz"
    if not file.exists():
        remedy = f"run isomatch statistics {folder} -o {file.parent}, or give it by --model"
        raise InputError(f"{file}: no model; {remedy}")
    prior = ShapeModel.load(file)
    # The ledger is claimed, so that no run of the collection removes unfinished files in the meantime.
    with claimed(collection.layout.ledger()), workers_of(executor, jobs) as workers:
        shapes = new_shapes(files)
        more, left_out = plan_added(collection, shapes, model=prior, reflect=reflect, units=units)
        for problem in left_out.values():
            to.warn(f"not added: {problem}")
        present = more.of(name for name in more.names if more.paths[name].exists())
        follow(present.run(workers), to)
        write_results(more, reports, workers, to)
        rows, written = more.rows(), surfaces_written(more)
        subjects = [name for name in more.names if name != more.template]
        paths = {name: more.layout.corresponded(name) for name in subjects if name in written}
        scored = {name: prior.score_file(path) for name, path in paths.items()}
        outcomes = {name: rows.pairs[more.template or "", name].forward.outcome for name in scored}
        landmarks = _nearest_landmarks(collection, more, scored)
        cells = {n: {"outcome": outcomes[n].name, "landmark": landmarks.get(n, "")} for n in scored}
        about = {"folder": str(more.folder), "left_out": left_out, "status": status_of(more).to_json()}
        into = StatisticsFolder(more.folder, last=LAST_FILE)
        with into.claimed(force=True) as inner:
            record = write_scored(inner, file, prior, scored, cells, about)
    for name in subjects:
        if name not in scored:
            lack = "it is not in the topology of the template"
            to.warn(f"{name} is not scored, as {lack}; see {more.layout.page}")
        elif outcomes[name].is_doubtful:
            to.warn(f"{name} may be matched wrongly ({outcomes[name].value}); see {more.layout.page}")
    return Results(more.folder, into.written, record)


def _nearest_landmarks(
    collection: Collection, more: Collection, scored: Mapping[str, ScoredShape]
) -> dict[str, str]:
    """Find the template's landmark nearest to the vertex where each new shape is farthest off."""
    template = more.template or ""
    marks_file, mesh = collection.layout.landmarks / f"{template}.mrk.json", collection.paths[template]
    if not marks_file.exists():
        return {}
    marks, vertices = Landmarks.read(marks_file, mesh), read_mesh(mesh).vertices
    if not marks.placed.any():
        return {}
    worst = {name: vertices[np.nanargmax(shape.vertex_errors)] for name, shape in scored.items()}
    distances = {name: np.linalg.norm(marks.positions - place, axis=1) for name, place in worst.items()}
    return {name: marks.names[np.nanargmin(lengths)] for name, lengths in distances.items()}


def plan_added(
    collection: Collection,
    files: str | Path | Iterable[str | Path | Entry],
    *,
    model: ShapeModel | None = None,
    units: Mapping[str, str] | None = None,
    reflect: str | Iterable[str] | None = None,
) -> tuple[Collection, dict[str, str]]:
    """Plan the matches of new subjects with the template, in a folder ``added``; tell which are left out."""
    # The new collection is a star around the same template, with the same settings and seed: in an
    # old star, the subjects would have had the same maps and surfaces.
    old = Snapshot(collection, collection.rows())
    template = _template_of(collection, old)
    if model is not None:
        _require_model_of(collection, template, model)
    new = [Entry(entry.name, entry.path.resolve()) for entry in entries_of(files)]
    inner = Layout(collection.folder / "added")
    earlier = Collection.open(inner.folder) if inner.plan.exists() else None
    known_before = earlier.rows().shapes if earlier else {}
    areas, problems = _areas(new)
    problems |= _taken_names(new, collection, earlier)
    areas = {name: area for name, area in areas.items() if name not in problems}
    given = dict(units or {})
    known = {**(earlier.units if earlier else {}), **given}
    known |= _units_of_collection(old, known, areas)
    common = known.get(OTHER_SHAPES)
    if given.get(OTHER_SHAPES, common) != common:
        raise InputError(f"{collection.folder}: is in {common}, not {given[OTHER_SHAPES]}; give that unit")
    problems |= _in_other_units(old, known, areas)
    if problems and len(problems) == len(new):
        raise InputError(f"{collection.folder}: nothing is added; {'; '.join(problems.values())}")
    new = [entry for entry in new if entry.name not in problems]
    dropped = {template, *(entry.name for entry in new)}
    dropped |= {name for name, row in known_before.items() if row.state == "failed"}
    before = [entry for entry in earlier.shapes if entry.name not in dropped] if earlier else []
    known = {name: unit for name, unit in known.items() if name not in problems}
    entries = [Entry(template, collection.paths[template]), *before, *new]
    checked_units(known, [entry.name for entry in entries])
    how: dict[str, Any] = {"template": template, "config": collection.config, "seed": collection.seed}
    how["reflect"] = _choose_reflected(reflect, collection, old.rows.reflected([template]), earlier)
    try:
        return Collection.create(inner.folder, entries, **how, units=known), problems
    except SettingError as error:
        raise SettingError(f"{error}; to add all subjects anew, move {inner.folder} away") from None


def _template_of(collection: Collection, known: Snapshot) -> str:
    template, rows = known.template, known.rows
    todo = len(rows.untried(known.wanted_pairs))
    untried = [name for name in known.names if name not in rows.shapes]
    if template is None or template not in surfaces_written(collection) or todo or untried:
        why = f"{todo} pairs are not matched" if todo else "its template is not written in its own topology"
        why = f"{len(untried)} shapes are not prepared" if untried else why
        raise InputError(f"{collection.folder}: is not finished: {why}; run isomatch collect to its end")
    path = collection.paths[template]
    if mesh_from(path).content_hash != rows.shapes[template].hash:
        raise InputError(f"{path}: the template was changed after the collection was made; put the file back")
    return template


def _require_model_of(collection: Collection, template: str, model: ShapeModel) -> None:
    """Raise `InputError` unless a model has the topology, and any surface, of the template."""
    remedy = f"give one that isomatch statistics made of {collection.folder}"
    try:
        found = model.score_file(collection.layout.corresponded(template))
    except MeshError:
        problem = f"has other faces than the template {template} of {collection.folder}"
        raise InputError(f"{model!r} {problem}; {remedy}") from None
    if template in model.names:
        within = np.linalg.norm(found.scores - model.scores[model.names.index(template)])
        off = max(float(within), found.error) / float(np.ptp(model.mean, axis=0).max())
        if off > MAX_TEMPLATE_CHANGE:
            problem = f"was made of another surface of {template}, {off:.2g} of its size away"
            raise InputError(f"{model!r} {problem}; {remedy} as it is now")


def _areas(new: Iterable[Entry]) -> tuple[dict[str, float], dict[str, str]]:
    """Measure the areas of new subjects, and tell what is wrong with other files."""
    areas, problems = dict[str, float](), dict[str, str]()
    for entry in new:
        try:
            area = mesh_from(entry.path).area
        except IsomatchError as error:
            problems[entry.name] = str(error)
            continue
        if 0 < area < np.inf:
            areas[entry.name] = area
        else:
            problem = f"has no surface, its area is {area:.4g}"
            problems[entry.name] = f"{entry.path}: {problem}; give a mesh with faces"
    return areas, problems


def _taken_names(new: Iterable[Entry], collection: Collection, earlier: Collection | None) -> dict[str, str]:
    """Tell which new subjects have names of others."""
    added_before = earlier.paths if earlier else {}
    problems = {}
    for entry in new:
        name, path = entry.name, entry.path
        if name in collection.paths:
            problems[name] = f"{name} is a shape of the collection; give {path} another name"
        elif (was := added_before.get(name, path)) != path:
            problems[name] = f"{name} was added from {was}; give {path} another name"
    return problems


def _units_of_collection(
    old: Snapshot, known: Mapping[str, str], areas: Mapping[str, float]
) -> dict[str, str]:
    """Return the unit of a collection, as ``"*"``, and the unit of its template; empty if unknown."""
    units, rows = old.plan.units, old.rows
    common = common_unit(units, rows)
    if common is None:
        if not known:
            return {}
        new = {name: ShapeRow(state="todo", area=area) for name, area in areas.items()}
        common = common_unit(known, Rows({**rows.shapes, **new}))
    if common is None:
        problem = "in units that fit no unit of the collection by their sizes"
        raise InputError(f"{', '.join(known)}: {problem}; give that too, such as mm,scan7=cm")
    return {OTHER_SHAPES: common} | {name: unit for name, unit in units.items() if name == old.template}


def _in_other_units(old: Snapshot, known: Mapping[str, str], areas: Mapping[str, float]) -> dict[str, str]:
    """Tell which new subjects have sizes that suggest other units, unless these are given."""
    shapes, scales = old.rows.shapes, old.scales
    sizes = [row.area**0.5 * scales.get(name, 1.0) for name, row in shapes.items() if row.area]
    unknown = {name: area for name, area in areas.items() if name not in known}
    factors = {name: float(size_factors(np.array([*sizes, x**0.5]))[-1]) for name, x in unknown.items()}
    return {name: f"{name} {explain_unit(name, factor)}" for name, factor in factors.items() if factor != 1}


def _choose_reflected(
    reflect: str | Iterable[str] | None, collection: Collection, turned: list[str], earlier: Collection | None
) -> str | list[str]:
    """Return the shapes to reflect: the template as in the collection, and new ones."""
    if reflect is None and earlier:
        return earlier.reflect if earlier.reflect == "auto" else list(earlier.reflect)
    if reflect == "auto" and turned:
        why = f"{turned[0]} is itself matched as its own"
        raise SettingError(f"mirror images are those of the template, but {why}; name those to reflect")
    if reflect == "auto" or (reflect is None and collection.reflect == "auto" and not turned):
        return "auto"
    named = [reflect] if isinstance(reflect, str) else list(reflect or ())
    return [*turned, *named]


def project(
    model: str | Path,
    shapes: Sequence[str | Path],
    output: str | Path,
    *,
    force: bool = False,
    progress: Progress | None = None,
) -> Results:
    """Score new shapes in an old model: distance from the mean, and what modes do not describe.

    Parameters
    ----------
    model : path_like
        File of a `ShapeModel`, which stays as it is.
    shapes : sequence of path_like
        Meshes in its topology, or one folder or list of them.
    output : path_like
        Folder for ``scored.csv``, ``scored.json``, and ``scored/NAME.ply``.
    force, progress
        Whether an earlier result is replaced; for the progress, see `run`.

    Returns
    -------
    Results
        A line for each shape in ``record["shapes"]``.

    Raises
    ------
    FormatError, MeshError
        If a file cannot be read, or has another topology.
    """
    into, listener = StatisticsFolder(Path(output), last=LAST_FILE), Listener.of(progress, None)
    with into.claimed(force) as new:
        listener.tell("reading", 0.0)
        prior = ShapeModel.load(model)
        scored = {entry.name: prior.score_file(entry.path) for entry in new_shapes(shapes)}
        record = write_scored(new, Path(model), prior, scored)
    return Results(into.folder, into.written, record)


def new_shapes(files: Sequence[str | Path]) -> tuple[Entry, ...]:
    """List new shapes, of files or of one folder or list, by the names of the files."""
    alone = Path(files[0]) if len(files) == 1 else None
    return entries_of(alone if alone and (alone.is_dir() or alone.suffix.lower() == ".csv") else files)


def write_scored(
    into: StatisticsFolder,
    file: Path,
    model: ShapeModel,
    scored: Mapping[str, ScoredShape],
    cells: Mapping[str, Mapping[str, Any]] | None = None,
    about: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Write files about new shapes: ``cells`` go into lines, values ``about`` all into the record."""
    usual = leave_one_out(model)
    lines = []
    for name, shape in scored.items():
        farthest = int(np.nanargmax(shape.vertex_errors))
        line = {
            "name": name,
            "mahalanobis": shape.mahalanobis,
            "p_value": shape.p_value,
            "as_far": int((usual.mahalanobis >= shape.mahalanobis).sum()),
            "error": shape.error,
            "as_badly_described": int((usual.errors >= shape.error).sum()),
            "farthest_vertex": farthest,
            "farthest_error": float(shape.vertex_errors[farthest]),
            "measured": 1.0 if shape.measured is None else float(shape.measured.mean()),
        }
        lines.append({**line, **(cells or {}).get(name, {})})
    into.scored(model, scored, lines)
    vectors = ({n: getattr(x, n).tolist() for n in ("scores", "deviations")} for x in scored.values())
    record = {
        "isomatch": VERSION,
        "model": str(file),
        "n_left_out": len(usual.errors),
        "n_modes": model.n_modes,
        "usual": {name: float(np.median(x)) if len(x) else None for name, x in vars(usual).items()},
        **(about or {}),
        "shapes": [line | more for line, more in zip(lines, vectors)],
    }
    into.finish(record)
    return record


def complete_file(
    model: str | Path,
    shape: str | Path,
    output: str | Path,
    *,
    landmarks: Path | None = None,
    noise: float | None = None,
    pose: Literal["fitted", "given"] = "fitted",
    config: Config | None = None,
    seed: int = 0,
    force: bool = False,
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Write the likeliest shape of a model, given a part or landmarks, and its uncertainty.

    Parameters
    ----------
    model : path_like
        File of a `ShapeModel`.
    shape : path_like
        The known part, see `read_observations`.
    output : path_like
        Surface file for the completed shape, or a folder for the structures of a subject. NAME.json
        is written beside it.
    landmarks, noise, pose, config, seed, force, progress
        As the options of ``isomatch statistics complete``; for the progress, see `run`.

    Returns
    -------
    dict of str to Any
        The values of NAME.json: scores, errors, pose, and notes.

    Raises
    ------
    FormatError, MeshError, LandmarkError
        If a file cannot be read, or has nothing that the model knows.
    """
    shape, output, to = Path(shape), Path(output), Listener.of(progress, None)
    about = output.with_suffix(".json")
    with claimed(output, [] if force else [output]), claimed(about, [] if force else [about]):
        to.tell("reading", 0.0)
        prior = ShapeModel.load(model)
        how: dict[str, Any] = {"noise": noise, "config": config, "seed": seed}
        how["progress"] = to.part(0.1, 0.8).tell
        observed = shape_statistics.read_observations(shape, prior, landmarks, **how)
        to.tell("completing", 0.8)
        completed = shape_statistics.complete(prior, observed, pose=pose)
        values = {name: getattr(completed, name) for name in ("standard_deviation", "expected_error")}
        scalars = [Attribute(name, "point", "scalar", np.asarray(array)) for name, array in values.items()]
        left: tuple[Attribute, ...] = ()
        require_names(prior.structures, "structure", model, "make the model again")
        for name, part in shape_statistics.slices_of(prior.structures).items() if shape.is_dir() else ():
            output.mkdir(parents=True, exist_ok=True)
            mesh = shape_statistics.structure_of(completed.mesh, part)
            own_scalars = [replace(scalar, values=scalar.values[part]) for scalar in scalars]
            write_asset(output / f"{name}.ply", Asset.of_mesh(mesh, own_scalars))
        if not shape.is_dir():
            left = write_asset(output, Asset.of_mesh(completed.mesh, scalars))
        placed = ("scores", "score_deviations", "scale", "rotation", "translation")
        record = {
            "isomatch": VERSION,
            "model": str(model),
            "part": str(shape),
            "file": str(output),
            **{name: getattr(completed, name) for name in ("n_points", "error", "residual")},
            "mean_standard_deviation": float(completed.standard_deviation @ prior.weights),
            "largest_standard_deviation": float(completed.standard_deviation.max()),
            **{name: np.asarray(getattr(completed, name)).tolist() for name in placed},
            "left_out": [attribute.name for attribute in left],
            "notes": [*observed.notes, *completed.notes],
        }
        write_text(about, json_text(record))
        to.tell("done", 1.0)
    return record
