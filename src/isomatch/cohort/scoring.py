"""New shapes and an old model: how unusual they are, also new subjects of a collection; and a part, completed."""

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
from isomatch.cohort.plan import Entry, Layout, entries_of
from isomatch.cohort.run import Reports, follow, status_of, write_results
from isomatch.cohort.shape_statistics import ScoredShape, ShapeModel, leave_one_out, size_factors
from isomatch.cohort.statistics_folder import VERSION, Results, StatisticsFolder
from isomatch.cohort.unusual_shapes import OTHERS, checked_units, common_unit, scales_of, told_unit
from isomatch.cohort.workers import Listener, Warn, Workers, workers_of
from isomatch.io import Asset, Attribute, mesh_from, read_mesh, write_asset
from isomatch.landmarks import Landmarks
from isomatch.settings import Config

SAME_SURFACE = 1e-4  # of the size: how far the template may be from where the model has it; files are of single precision
PLACED = (
    "scores",
    "score_deviations",
    "scale",
    "rotation",
    "translation",
)  # of a completed shape, in its file
LAST = "scored.json"  # of the files about new shapes


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
    """Match new subjects with the template of a finished collection, and score them in its shape model.

    All files that are there stay as they are: new ones are in the folder ``added``, and nothing is fitted again. What was
    done before is not done again, and more can be added.

    Parameters
    ----------
    folder : path_like
        The folder of the collection.
    files : sequence of path_like
        Meshes, or one folder or list of them.
    model : Path, optional
        File of its `ShapeModel`; by default that of `statistics` in its folder ``statistics``.
    reflect : "auto", str or iterable of str, optional
        New subjects to match as mirror images; by default "auto" if the collection has it, and otherwise none.
    units : mapping of str to str, optional
        Units of new subjects, by name; where those of the collection are not known, ``"*"`` is their unit. The size of a
        subject whose unit is given is not questioned.
    reports, executor, jobs, progress, warn
        See `run`.

    Returns
    -------
    Results
        A line for each subject that is scored in ``record["shapes"]``. Subjects that have names of old ones, are no
        meshes, or have sizes that suggest other units are in ``record["left_out"]``, with the reason.

    Raises
    ------
    InputError
        If the collection is not finished; the model is missing, or of another template; or if all new subjects would be
        left out.
    """
    collection, to = Collection.open(folder), Listener.of(progress, warn)
    file = model or Path(folder) / "statistics" / "model.npz"
    if not file.exists():
        remedy = f"run isomatch statistics {folder} -o {file.parent}, or give it by --model"
        raise InputError(f"{file}: no model; {remedy}")
    prior = ShapeModel.load(file)
    # no run of the collection may clear up there meanwhile
    with claimed(collection.layout.ledger()), workers_of(executor, jobs) as workers:
        how: dict[str, Any] = {"reflect": reflect, "units": units}
        more, left_out = added(collection, new_shapes(files), model=prior, **how)
        for problem in left_out.values():
            to.warn(f"not added: {problem}")
        present = more.of(name for name in more.names if more.paths[name].exists())  # others stay as they are
        follow(present.run(workers), to)
        write_results(more, reports, workers, to)
        rows, written = more.rows(), surfaces_written(more)
        subjects = [name for name in more.names if name != more.template]
        files_of = {name: more.layout.corresponded(name) for name in subjects if name in written}
        scored = {name: prior.score_file(path) for name, path in files_of.items()}
        outcomes = {name: rows.pairs[more.template or "", name].there.outcome for name in scored}
        landmarks = _nearest_landmarks(collection, more, scored)
        own = {n: {"outcome": outcomes[n].name, "landmark": landmarks.get(n, "")} for n in scored}
        about = {"folder": str(more.folder), "left_out": left_out, "status": status_of(more).to_json()}
        into = StatisticsFolder(more.folder, last=LAST)
        with into.claimed(force=True) as inner:
            record = write_scored(inner, file, prior, scored, own, about)
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
    """Name the landmark of the template nearest to the vertex where each new shape is farthest off, if it has any."""
    template = more.template or ""
    marks_file, mesh = collection.layout.landmarks / f"{template}.mrk.json", collection.paths[template]
    if not marks_file.exists():
        return {}
    marks, vertices = Landmarks.read(marks_file, mesh), read_mesh(mesh).vertices
    placed = np.flatnonzero(marks.placed)
    if not len(placed):
        return {}
    worst = {name: vertices[np.nanargmax(each.vertex_errors)] for name, each in scored.items()}
    apart = {name: np.linalg.norm(marks.positions[placed] - at, axis=1) for name, at in worst.items()}
    return {name: marks.names[placed[each.argmin()]] for name, each in apart.items()}


def added(
    collection: Collection,
    files: str | Path | Iterable[str | Path | Entry],
    *,
    model: ShapeModel | None = None,
    units: Mapping[str, str] | None = None,
    reflect: str | Iterable[str] | None = None,
) -> tuple[Collection, dict[str, str]]:
    """Plan the matches of new subjects with the template of a finished collection, which stays as it is.

    Give also why some are left out.
    """
    # a collection of their own, in the subfolder ``added``: a star around the same template, with the same settings and
    # seed, so its maps and surfaces are those that the subjects would have had in the collection, if that is a star
    rows = collection.rows()
    template = _template_of(collection, rows)
    if model is not None:
        _require_model_of(collection, template, model)
    new = [Entry(entry.name, entry.path.resolve()) for entry in entries_of(files)]
    inner = Layout(collection.folder / "added")
    earlier = Collection.open(inner.folder) if inner.plan.exists() else None
    known_before = earlier.rows().shapes if earlier else {}
    areas, problems = _areas(new)
    problems |= _taken(new, collection, earlier)
    areas = {name: area for name, area in areas.items() if name not in problems}
    known = {**(earlier.units if earlier else {}), **(units or {})}
    known |= _of_others(collection, rows, template, known, areas)
    if (units or {}).get(OTHERS, known.get(OTHERS)) != known.get(OTHERS):
        raise InputError(
            f"{collection.folder}: is in {known[OTHERS]}, not {(units or {})[OTHERS]}; give that unit"
        )
    problems |= _in_other_units(collection, rows, known, areas)
    if problems and len(problems) == len(new):
        raise InputError(f"{collection.folder}: nothing is added; {'; '.join(problems.values())}")
    new = [entry for entry in new if entry.name not in problems]
    others = {template, *(entry.name for entry in new)}
    others |= {name for name, row in known_before.items() if row.state == "failed"}
    before = [entry for entry in earlier.shapes if entry.name not in others] if earlier else []
    known = {name: unit for name, unit in known.items() if name not in problems}
    checked_units(known, [template, *(entry.name for entry in (*before, *new))])
    entries = [Entry(template, collection.paths[template]), *before, *new]
    turned = _reflected(reflect, collection, rows.reflected([template]), earlier)
    try:
        how: dict[str, Any] = {"template": template, "config": collection.config, "seed": collection.seed}
        return Collection.create(inner.folder, entries, **how, reflect=turned, units=known), problems
    except SettingError as error:
        raise SettingError(f"{error}; to add all subjects anew, move {inner.folder} away") from None


def _template_of(collection: Collection, rows: Rows) -> str:
    template = collection.chosen_template(rows)
    todo = len(rows.untried(collection.wanted_pairs(rows)))
    untried = [name for name in collection.names if name not in rows.shapes]
    if template is None or template not in surfaces_written(collection) or todo or untried:
        why = f"{todo} pairs are not matched" if todo else "its template is not written in its own topology"
        why = f"{len(untried)} shapes are not prepared" if untried else why
        raise InputError(f"{collection.folder}: is not finished: {why}; run isomatch collect to its end")
    if mesh_from(collection.paths[template]).content_hash != rows.shapes[template].hash:
        raise InputError(
            f"{collection.paths[template]}: the template was changed after the collection was made; put the file back"
        )
    return template


def _require_model_of(collection: Collection, template: str, model: ShapeModel) -> None:
    """Raise `InputError` unless a model has the topology of the template, and the surface where it was of one of it."""
    remedy = f"give one that isomatch statistics made of {collection.folder}"
    try:
        found = model.score_file(collection.layout.corresponded(template))
    except MeshError:
        raise InputError(
            f"{model!r} has other faces than the template {template} of {collection.folder}; {remedy}"
        ) from None
    if template in model.names:
        apart = np.linalg.norm(found.scores - model.scores[model.names.index(template)])
        off = max(float(apart), found.error) / float(np.ptp(model.mean, axis=0).max())
        if off > SAME_SURFACE:
            raise InputError(
                f"{model!r} was made of another surface of {template}, {off:.2g} of its size away; {remedy} as it is now"
            )


def _areas(new: Iterable[Entry]) -> tuple[dict[str, float], dict[str, str]]:
    """Return the areas of new subjects in their files, and what is wrong with other files."""
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
            problems[entry.name] = (
                f"{entry.path}: has no surface, its area is {area:.4g}; give a mesh with faces"
            )
    return areas, problems


def _taken(new: Iterable[Entry], collection: Collection, earlier: Collection | None) -> dict[str, str]:
    """Say which new subjects have names of others."""
    added_before = earlier.paths if earlier else {}
    problems = {}
    for entry in new:
        name, path = entry.name, entry.path
        if name in collection.paths:
            problems[name] = f"{name} is a shape of the collection; give {path} another name"
        elif (was := added_before.get(name, path)) != path:
            problems[name] = f"{name} was added from {was}; give {path} another name"
    return problems


def _of_others(
    collection: Collection, rows: Rows, template: str, known: Mapping[str, str], areas: Mapping[str, float]
) -> dict[str, str]:
    """Return the unit of the shapes of a collection, as ``"*"``, and of the template; none if nothing tells."""
    common = common_unit(collection.units, rows)
    if common is None and not known:
        return {}
    if common is None:
        new = {name: ShapeRow(state="todo", area=area) for name, area in areas.items()}
        common = common_unit(known, Rows({**rows.shapes, **new}))
        if common is None:
            problem = "in units that fit no unit of the collection by their sizes"
            raise InputError(f"{', '.join(known)}: {problem}; give that too, such as mm,scan7=cm")
    return {OTHERS: common} | {name: unit for name, unit in collection.units.items() if name == template}


def _in_other_units(
    collection: Collection, rows: Rows, known: Mapping[str, str], areas: Mapping[str, float]
) -> dict[str, str]:
    """Say which new subjects have sizes that suggest other units, unless these are given."""
    scales = scales_of(collection.units, rows)
    sizes = [row.area**0.5 * scales.get(name, 1.0) for name, row in rows.shapes.items() if row.area]
    problems = {}
    for name, area in areas.items():
        factor = float(size_factors(np.array([*sizes, area**0.5]))[-1])
        if factor != 1 and name not in known:
            problems[name] = f"{name} {told_unit(name, factor)}"
    return problems


def _reflected(
    reflect: str | Iterable[str] | None, collection: Collection, turned: list[str], earlier: Collection | None
) -> str | list[str]:
    """Return which shapes are matched as mirror images: the template as in the collection, and new ones."""
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
    """Score new shapes in an old model: how far each is from the mean, how well the modes describe it, and where not.

    Parameters
    ----------
    model : path_like
        File of a `ShapeModel`, which stays as it is.
    shapes : sequence of path_like
        Meshes in its topology, or one folder or list of them.
    output : path_like
        Folder for ``scored.csv``, ``scored.json``, and ``scored/NAME.ply``.
    force : bool
        Whether to replace an earlier result.
    progress : callable, optional
        Called with each step, and the share that is done.

    Returns
    -------
    Results
        A line for each shape in ``record["shapes"]``.

    Raises
    ------
    FormatError, MeshError
        If a file cannot be read, or has another topology.
    """
    into, listener = StatisticsFolder(Path(output), last=LAST), Listener.of(progress, None)
    with into.claimed(force) as new:
        listener.tell("reading", 0.0)
        prior = ShapeModel.load(model)
        scored = {entry.name: prior.score_file(entry.path) for entry in new_shapes(shapes)}
        record = write_scored(new, Path(model), prior, scored)
    return Results(into.folder, into.written, record)


def new_shapes(files: Sequence[str | Path]) -> tuple[Entry, ...]:
    """List new shapes, from files or from one folder or list; their names are those of the files."""
    first = Path(files[0]) if len(files) == 1 else None
    alone = first and (first.is_dir() or first.suffix.lower() == ".csv")
    return entries_of(first if first and alone else files)


def write_scored(
    into: StatisticsFolder,
    file: Path,
    model: ShapeModel,
    scored: Mapping[str, ScoredShape],
    own: Mapping[str, Mapping[str, Any]] | None = None,
    about: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """Write the table, the fields and the record of new shapes; ``own`` values go into lines, others into the record."""
    usual = leave_one_out(model)
    lines = []
    for name, each in scored.items():
        farthest = int(np.nanargmax(each.vertex_errors))
        line = {
            "name": name,
            "mahalanobis": each.mahalanobis,
            "p_value": each.p_value,
            "as_far": int((usual.mahalanobis >= each.mahalanobis).sum()),
            "error": each.error,
            "as_badly_described": int((usual.errors >= each.error).sum()),
            "farthest_vertex": farthest,
            "farthest_error": float(each.vertex_errors[farthest]),
            "measured": 1.0 if each.measured is None else float(each.measured.mean()),
        }
        lines.append({**line, **(own or {}).get(name, {})})
    into.scored(model, scored, lines)
    numbers = {name: (each.scores.tolist(), each.deviations.tolist()) for name, each in scored.items()}
    record = {
        "isomatch": VERSION,
        "model": str(file),
        "n_left_out": len(usual.errors),
        "n_modes": model.n_modes,
        "usual": {name: float(np.median(of)) if len(of) else None for name, of in vars(usual).items()},
        **(about or {}),
        "shapes": [{**line, **dict(zip(("scores", "deviations"), numbers[line["name"]]))} for line in lines],
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
    """Write the likeliest shape of a model, given a part or landmarks, with how uncertain each vertex is.

    Parameters
    ----------
    model : path_like
        File of a `ShapeModel`.
    shape : path_like
        What is known, see `read_observations`.
    output : path_like
        Surface file for the completed shape; of subjects, a folder for a file of each structure. NAME.json is beside it.
    landmarks, noise, pose, config, seed, force
        As the options of ``isomatch statistics complete``.
    progress : callable, optional
        Called with each step, and the share that is done.

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
        told = to.part(0.1, 0.8).tell
        observed = shape_statistics.read_observations(shape, prior, landmarks, **how, progress=told)
        to.tell("completing", 0.8)
        completed = shape_statistics.complete(prior, observed, pose=pose)
        values = {name: getattr(completed, name) for name in ("standard_deviation", "expected_error")}
        scalars = [Attribute(name, "point", "scalar", np.asarray(each)) for name, each in values.items()]
        left: tuple[Attribute, ...] = ()
        require_names(prior.structures, "structure", model, "make the model again")
        for name, own in shape_statistics.slices_of(prior.structures).items() if shape.is_dir() else ():
            output.mkdir(parents=True, exist_ok=True)
            mesh = shape_statistics.structure_of(completed.mesh, own)
            scalars_of = [replace(each, values=each.values[own]) for each in scalars]
            write_asset(output / f"{name}.ply", Asset.of_mesh(mesh, scalars_of))
        if not shape.is_dir():
            left = write_asset(output, Asset.of_mesh(completed.mesh, scalars))
        record = {
            "isomatch": VERSION,
            "model": str(model),
            "part": str(shape),
            "file": str(output),
            **{name: getattr(completed, name) for name in ("n_points", "error", "residual")},
            "mean_standard_deviation": float(completed.standard_deviation @ prior.weights),
            "largest_standard_deviation": float(completed.standard_deviation.max()),
            **{name: np.asarray(getattr(completed, name)).tolist() for name in PLACED},
            "left_out": [attribute.name for attribute in left],
            "notes": [*observed.notes, *completed.notes],
        }
        write_text(about, json_text(record))
        to.tell("done", 1.0)
    return record
