"""``isomatch collect``: a folder of shapes in correspondence, resumable, on one machine or many; how far it is."""

from __future__ import annotations

import re
import time
from collections import Counter
from collections.abc import Iterable, Mapping
from itertools import pairwise
from os.path import isfile
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from cyclopts import App, Parameter

import isomatch
from isomatch import cohort, visualization
from isomatch._core.errors import InputError, MemoryBudgetError
from isomatch._core.files import claimed
from isomatch._core.texts import read_csv, text_lines
from isomatch.cli.collect_landmarks import Semilandmarks, landmark_files, landmarks, say_landmarks, write_all
from isomatch.cli.inputs import ConfigFile, Force, Output, Rounded, Seed, read_config
from isomatch.cli.outputs import require_writable
from isomatch.cli.scored import LAST, new_shapes, say_scored, write_scored
from isomatch.cli.statistics_files import StatisticsFolder
from isomatch.cli.terminal import TALK, Talk, Tell, complain, say, say_rows
from isomatch.cohort.shape_statistics import ScoredShape, ShapeModel
from isomatch.matching import Outcome

Reports = Annotated[
    int | Literal["doubtful", "all", "none"],
    Parameter(
        help="How many of the worst pairs get a report; all; none; or doubtful (default): those on the page that did not "
        "converge, and three others."
    ),
]
Jobs = Annotated[int | None, Parameter(help="Pairs at a time; by default one for each processor.")]
Executor = Annotated[
    str,
    Parameter(
        help="local (default), or dask:ADDRESS, the scheduler of a Dask cluster whose workers see the same files."
    ),
]
TimeLimit = Annotated[float | None, Parameter(help="Seconds after which nothing new is begun.")]

collect = App(name="collect", default_parameter=Parameter(negative=()))


@collect.default
def run(
    shapes: str,
    /,
    *,
    output: Output,
    template: str = "auto",
    pairs: str = "star",
    jobs: Jobs = None,
    executor: Executor = "local",
    shard: str = "1/1",
    reflect: str | None = None,
    units: str | None = None,
    landmarks: Path | None = None,
    semilandmarks: Semilandmarks | None = None,
    time_limit: TimeLimit = None,
    agree: Annotated[bool | None, Parameter(negative="--no-agree")] = None,
    keep_contacts: Annotated[bool, Parameter(negative="--no-keep-contacts")] = True,
    reports: Reports = "doubtful",
    config: ConfigFile = None,
    seed: Seed = 0,
    talk: Talk = TALK,
) -> None:
    """Match the shapes of a folder with a template, or with one another; run it again to continue.

    Args:
        shapes: A folder, a quoted pattern such as 'scans/*.vtp', or a list.csv with a column path and perhaps name. Of
            subjects of several surfaces, each of which is matched by itself: a folder with a folder for each subject,
            with files named like the structures, or a list.csv with the columns subject, structure and file.
        output: Folder for prepared shapes, maps, pairs.csv, index.html, and the shapes in the topology of the template.
        template: Name or file of the template; by default (auto) the shape in the middle of all, by spectra and
            distances.
        pairs: star (default): each shape with the template; all; chain: each with the next; ring: also the last with the
            first, as of a beating heart; or a CSV file with columns source and target.
        shard: i/n: match the i-th of n parts of the pairs. Runs of other parts may go on at the same time, on other
            machines.
        reflect: Shapes to match as their mirror images. auto: those that fit clearly better so, as left ones among right
            ones; none; or their names, separated by commas, or a file with a name on each line. By default as before, at
            first none.
        units: Units of shapes that are in others than most, such as scan7=mm,scan9=cm: um, mm, cm, m or in. They are
            brought to that of all others, which is found by their sizes, or given first: m,scan7=mm. none: all are in one
            unit. By default as before.
        landmarks: File of landmarks and curves of the template, as of 3D Slicer, or folder of such files of several
            shapes, named like them: the folder landmarks gets a file for each shape, and tables; see isomatch collect
            landmarks.
        agree: Once all pairs are matched, replace maps that the others contradict, see isomatch collect agree; by default
            only if all pairs are. Maps of shards are compared by that command.
        keep_contacts: Of subjects, keep points together that lie on each other in the template; see contacts.csv.
    """
    place = re.fullmatch(r"([1-9]\d{0,5})/([1-9]\d{0,5})", shard)
    if not place or int(place[1]) > int(place[2]):
        raise InputError(f"--shard {shard}: is not i/n with 1 ≤ i ≤ n, such as 2/8")
    part = int(place[1]) - 1, int(place[2])
    settings: dict[str, Any] = {
        "pairs": pairs,
        "template": None if template == "auto" else template,
        "config": read_config(config) or isomatch.Config(),
        "seed": seed,
        "reflect": _names_of(reflect),
        "units": _units_of(units),
    }
    marks: dict[str, Path] = {}
    if semilandmarks and landmarks is None:
        raise InputError("semilandmarks come with landmarks of a shape; give these (--landmarks)")
    if subjects := cohort.structures_of(shapes):
        if landmarks is not None:
            raise InputError(
                f"--landmarks: give those of a structure to isomatch collect landmarks {output}/NAME"
            )
        for doubt in cohort.subject_doubts(subjects, settings["reflect"], settings["units"] or ()):
            complain(f"{' and '.join(doubt.names)} {doubt.reason}")
        structures = cohort.subject_collections(output, subjects, **settings)
    else:
        collection = cohort.Collection.create(output, shapes, **settings)
        structures = {"": collection}
        marks = {} if landmarks is None else landmark_files(landmarks, collection, collection.template)
        for name, path in marks.items():  # what is wrong with them is told before anything is done
            isomatch.Landmarks.read(path, collection.paths[name])
    carried: dict[str, Any] = {}
    gaps: list[cohort.Gap] = []
    end = None if time_limit is None else time.monotonic() + time_limit
    with cohort.workers_of(executor, jobs) as workers, talk.progress() as tell:
        for structure, collection in structures.items():
            tell(structure, 0.0)
            for where in collection.rows().damaged:
                complain(f"{where} is no row of a collection, and is ignored")
            _follow(collection.run(workers, None, part, _until(end)), tell)
            wanted = pairs == "all" if agree is None else agree
            if wanted and part[1] == 1 and "todo" not in status_of(collection)["pairs"]:
                tell("comparing maps with compositions of others", 1.0)
                try:
                    for event in cohort.agree(collection, workers, time_limit=_until(end)):
                        tell(*told(event))
                except MemoryBudgetError as error:  # the maps are there all the same
                    complain(f"maps were not compared: {error}")
            if part[1] == 1:
                _write(collection, reports, workers, end, tell)
                if marks:
                    to = collection.layout.landmarks
                    carried = write_all(collection, marks, to, tell, semilandmarks)
        if subjects and part[1] == 1:
            tell("bringing structures together", 1.0)
            gaps = cohort.finish_subjects(output, structures, keep_contacts=keep_contacts)
    if subjects:
        _tell_subjects(output, structures, gaps, talk)
        return
    tell_status(structures[""], talk, carried)
    if carried and not (talk.quiet or talk.json or talk.json_lines):
        say_landmarks(carried)


def _tell_subjects(
    folder: Path,
    structures: dict[str, cohort.Collection],
    gaps: list[cohort.Gap],
    talk: Talk,
    *,
    is_answer: bool = False,
) -> None:
    """Tell how far the collections of all structures are, and how structures lie on each other, on average."""
    every = {name: status_of(each, ("landmarks",)) for name, each in structures.items()}
    status: dict[str, Any] = {"folder": str(folder), "structures": every, "contacts": {}}
    for pair in dict.fromkeys(gap[1:3] for gap in gaps):
        own = [gap for gap in gaps if gap[1:3] == pair]
        names = cohort.Gap._fields[3:-1]
        means = {name: float(np.nanmean([getattr(gap, name) for gap in own])) for name in names}
        notes = {gap.subject: gap.note for gap in own if gap.note}
        status["contacts"][" on ".join(pair)] = {**means, "notes": notes}

    def summary() -> None:
        for name, collection in structures.items():
            say(name, "bold")
            _say_status(status["structures"][name], collection.layout)
        for pair, own in status["contacts"].items():
            say(f"{pair}: slip {own['slip_before']:.3g}, {own['slip_after']:.3g} after; see contacts.csv")
            for subject, note in own["notes"].items():
                say(f"{subject} is {note}", "bold red")
        say(f"subjects of all structures: {folder / 'corresponded'}; go on with isomatch statistics {folder}")

    talk.result(status, summary, is_answer=is_answer)


@collect.command
def status(folder: Path, /, *, talk: Talk = TALK) -> None:
    """Tell how far a collection is, with the pairs that failed, from the ledgers of all shards; write its tables.

    Args:
        folder: The folder of the collection, or of the collections of all structures.
    """
    plan = cohort.Layout(folder).plan
    folders = [
        path.parent for path in sorted(folder.glob(f"*/{plan.name}"))
    ]  # of structures, or what was added
    inner = {each.name: cohort.Collection.open(each) for each in folders}
    own = [] if inner and not plan.exists() else [cohort.Collection.open(folder)]
    for each in (*own, *inner.values()):
        cohort.write_table(each.rows(), each.layout.table)
    if own:
        tell_status(own[0], talk, inner=inner, is_answer=True)
    else:
        _tell_subjects(folder, inner, [], talk, is_answer=True)


@collect.command
def retry(which: Literal["failed", "low"], folder: Path, /, *, talk: Talk = TALK) -> None:
    """Let the next run match pairs again that failed, or that ended with low confidence.

    Args:
        which: failed, or low: with another seed, and the surer map is kept, unless others contradict it.
        folder: The folder of the collection.
    """
    again = cohort.Collection.open(folder).retry(which)
    told = f"{len(again)} pairs will be matched again; run isomatch collect as before"
    talk.result({"pairs": [list(pair) for pair in again]}, lambda: say(told))


@collect.command
def export(
    folder: Path,
    to: Path,
    /,
    *,
    format: str = ".ply",
    maps: Literal["npz", "txt", "none"] = "npz",
    rounded: Rounded = False,
    force: Force = False,
    talk: Talk = TALK,
) -> None:
    """Write the shapes in the topology of the template, and the maps, for other programs.

    Args:
        folder: The folder of a collection.
        to: Folder for meshes, maps, a file for each direction, and pairs.csv.
        format: Suffix of the meshes, such as .ply (default), .obj, .vtp or .glb; or none.
        maps: npz (default): image vertices, and precise images in triangles; txt: the image vertex of each vertex on a
            line; or none.
    """
    meshes = None if format == "none" else f".{format.removeprefix('.')}"
    if meshes:
        require_writable(Path(f"mesh{meshes}"))
    collection = cohort.Collection.open(folder)
    left_out = sorted({*collection.names} - {*cohort.surfaces_written(collection)}) if meshes else []
    written, lost, suffix = Counter[str](), Counter[str](), None if maps == "none" else f".{maps}"
    with talk.progress() as tell:
        for path, left in cohort.export(collection, to, meshes, suffix, force, rounded):
            written[path.parent.name] += 1
            lost.update(left)
            tell(f"written: {path.name}", 1.0)
    counts = {"meshes": written["meshes"], "maps": written["maps"]}
    result = {"folder": str(to), **counts, "left_out": left_out, "not_kept": dict(lost)}

    def summary() -> None:
        say(f"wrote {written['meshes']} meshes and {written['maps']} maps to {to}")
        for name, count in lost.items():
            say(f"not in {count} of the meshes: {name}; a {meshes} file has no place for it")
        if left_out:
            say(f"not in the topology of the template, see shapes.csv: {', '.join(left_out)}", "bold red")

    talk.result(result, summary)


collect.command(landmarks)


@collect.command
def agree(
    folder: Path,
    /,
    *,
    jobs: Jobs = None,
    executor: Executor = "local",
    time_limit: TimeLimit = None,
    reports: Reports = "doubtful",
    talk: Talk = TALK,
) -> None:
    """Find the maps that most others contradict, and replace them by compositions of others, refined.

    A map from a to c disagrees with those from a to b and b to c if one of the three is wrong; many such triangles tell
    which. Maps that stay contradicted have low confidence. Run it again to continue, or after adding shapes.

    Args:
        folder: The folder of a collection whose pairs make triangles, as all do; also of one matched in shards.
    """
    collection = cohort.Collection.open(folder)
    end = None if time_limit is None else time.monotonic() + time_limit
    with cohort.workers_of(executor, jobs) as workers, talk.progress() as tell:
        for event in cohort.agree(collection, workers, time_limit=time_limit):
            tell(*told(event))
        _write(collection, reports, workers, end, tell)
    if not cohort.agreement_of(collection.rows()).compared and time_limit is None:
        raise InputError(
            f"{folder}: no three shapes are all matched with one another, so there is nothing to compare maps with; "
            "match with --pairs all"
        )
    tell_status(collection, talk)


@collect.command
def add(
    folder: Path,
    /,
    *new: Path,
    model: Path | None = None,
    reflect: str | None = None,
    units: str | None = None,
    jobs: Jobs = None,
    executor: Executor = "local",
    reports: Reports = "doubtful",
    talk: Talk = TALK,
) -> None:
    """Match new subjects with the template of a finished collection, and tell how unusual each is to its shape model.

    All files that are there stay as they are: new ones are in the folder added, and nothing is fitted again. Run it again
    to continue, or to add more.

    Args:
        folder: The folder of a collection.
        new: Meshes, or a folder of them, or a list.csv with a column path and perhaps name. Their names, those of the
            files, are new ones.
        model: model.npz of isomatch statistics, made of this collection; by default FOLDER/statistics/model.npz.
        reflect: New subjects to match as their mirror images: auto, none, or their names. By default auto if that was
            asked for of the collection.
        units: Units of new subjects, such as scan7=mm. Where that of the collection is not known, it comes first:
            m,scan7=mm. A size whose unit is given is not questioned.
    """
    collection = cohort.Collection.open(folder)
    file = model or folder / "statistics" / "model.npz"
    if not file.exists():
        raise InputError(
            f"{file}: no model; run isomatch statistics {folder} -o {file.parent}, or give it by --model"
        )
    prior = ShapeModel.load(file)
    # no run of the collection may clear up there meanwhile
    with (
        talk.progress() as tell,
        claimed(collection.layout.ledger()),
        cohort.workers_of(executor, jobs) as workers,
    ):
        more = cohort.added(
            collection, new_shapes(new), model=prior, reflect=_names_of(reflect), units=_units_of(units)
        )
        there = more.of(name for name in more.names if more.paths[name].exists())  # others stay as they are
        _follow(there.run(workers), tell)
        _write(more, reports, workers, None, tell)
        rows, written = more.rows(), cohort.surfaces_written(more)
        subjects = [name for name in more.names if name != more.template]
        scored = {
            name: prior.score_file(more.layout.corresponded(name)) for name in subjects if name in written
        }
        outcomes = {name: rows.pairs[more.template or "", name].there.outcome.name for name in scored}
        landmarks = _nearest_landmarks(collection, more, scored)
        own = {name: {"outcome": outcomes[name], "landmark": landmarks.get(name, "")} for name in scored}
        about = {"folder": str(more.folder), "status": status_of(more)}
        into = StatisticsFolder(more.folder, last=LAST)
        with into.claimed(force=True) as inner:
            record = write_scored(inner, file, prior, scored, own, about)
    for name in subjects:
        if name not in scored:
            complain(
                f"{name} is not scored, as it is not in the topology of the template; see {more.layout.page}"
            )
        elif Outcome[outcomes[name]].is_doubtful:
            complain(
                f"{name} may be matched wrongly ({Outcome[outcomes[name]].value}); see {more.layout.page}"
            )

    def summary() -> None:
        say_scored(record, more.folder)
        say(f"the maps: {more.layout.page}; {folder} is as it was, but for {more.folder.name}")

    talk.result(record, summary)


def _nearest_landmarks(
    collection: cohort.Collection, more: cohort.Collection, scored: Mapping[str, ScoredShape]
) -> dict[str, str]:
    """Name the landmark of the template nearest to the vertex where each new shape is farthest off, if it has any."""
    template = more.template or ""
    marks_file, mesh = collection.layout.landmarks / f"{template}.mrk.json", collection.paths[template]
    if not marks_file.exists():
        return {}
    marks, vertices = isomatch.Landmarks.read(marks_file, mesh), isomatch.read_mesh(mesh).vertices
    placed = np.flatnonzero(marks.placed)
    if not len(placed):
        return {}
    worst = {name: vertices[np.nanargmax(each.vertex_errors)] for name, each in scored.items()}
    apart = {name: np.linalg.norm(marks.positions[placed] - at, axis=1) for name, at in worst.items()}
    return {name: marks.names[placed[each.argmin()]] for name, each in apart.items()}


def _follow(events: Iterable[cohort.Event], tell: Tell) -> None:
    """Tell of the steps of a run, and complain of what does not fit, and of what is done again."""
    again = Counter[tuple[str, str]]()
    for event in events:
        tell(*told(event))
        again.update((event.what, reason) for reason in reasons_of(event))
        if isinstance(event.row, cohort.Outlier):
            complain(f"{event.name} {event.row.reason}")
    for (what, reason), count in again.items():
        complain(f"{count} {what}{'s' * (count > 1)} done again, because {reason}")


def _names_of(reflect: str | None) -> str | list[str] | None:
    """Read what ``--reflect`` says."""
    if reflect is None or reflect == "auto":
        return reflect
    if reflect == "none":
        return []
    names = [line for _, line in text_lines(Path(reflect))] if isfile(reflect) else reflect.split(",")
    return [name for each in names if (name := each.strip())]


def _units_of(units: str | None) -> dict[str, str] | None:
    """Read what ``--units`` says."""
    if units is None or units == "none":
        return None if units is None else {}
    pairs = [each.strip().rpartition("=") for each in units.split(",")]
    return {name.strip() or "*": unit.strip() for name, _, unit in pairs}


def _until(end: float | None) -> float | None:
    """Seconds that are left."""
    return None if end is None else max(0.0, end - time.monotonic())


def _write(
    collection: cohort.Collection,
    reports: Reports,
    workers: cohort.Workers,
    end: float | None,
    tell: Tell,
) -> None:
    """Write reports, and the shapes in the topology of the template."""
    if reports != "none":
        for pair, error in cohort.write_reports(collection, reports, workers, time_limit=_until(end)):
            failed = f", failed: {error}" if error else ""
            tell(f"report of {' and '.join(pair)}{failed}", 1.0)
    for line in cohort.finish(collection, workers, time_limit=_until(end)):
        again = f"; again, because {line.again}" if line.again else ""
        tell(f"written in the topology of the template: {line.name}{again}", 1.0)
        if again:
            complain(f"the surface of {line.name} done again, because {line.again}")


_DONE = {"shape": "prepared", "outlier": "looked at", "pair": "matched"}
_DONE |= {"reflection": "reflected", "agreement": "compared"}
OUTCOMES = 26  # columns of a number of pairs with their outcome


def tell_status(
    collection: cohort.Collection,
    talk: Talk,
    landmarks: Mapping[str, Any] | None = None,
    *,
    inner: Mapping[str, cohort.Collection] | None = None,
    is_answer: bool = False,
) -> None:
    """Tell how far a collection is, in words or as JSON, with the landmarks that were carried, and what was added."""
    # as an answer, with all files that were damaged; a run has just compared most of them
    status = status_of(collection, cohort.KEPT if is_answer else ("landmarks",))
    if landmarks:
        status["landmarks"] = landmarks
    inner = inner or {}
    status |= {name: status_of(each) for name, each in inner.items()}

    def summary() -> None:
        _say_status(status, collection.layout)
        for name, each in inner.items():
            say(name, "bold")
            _say_status(status[name], each.layout)

    talk.result(status, summary, is_answer=is_answer)


def status_of(collection: cohort.Collection, folders: Iterable[str] = ()) -> dict[str, Any]:
    """Sum up how far a collection is, from the ledgers of all shards, with the damaged files of some folders."""
    rows = collection.rows()
    pairs = collection.wanted_pairs(rows)
    own = [rows.pairs.get(pair, cohort.PairRow(state="todo")) for pair in pairs]
    outcomes = Counter(row.ending for row in own if row.state == "done")
    changed = cohort.changed_files(collection.layout, rows, folders)
    damaged = {str(path.relative_to(collection.folder)): what for path, what in changed.items()}
    damaged |= dict.fromkeys(rows.damaged, "is no row of a collection, and was ignored")
    failures = {name: row.error for name, row in rows.shapes.items() if row.state == "failed"}
    failures |= {" and ".join(pair): row.error for pair, row in rows.pairs.items() if row.state == "failed"}
    turned = cohort.mirror_images(collection, rows)
    prepared = sum(map(rows.is_prepared, rows.shapes))
    return {
        "folder": str(collection.folder),
        "shapes": {"all": len(collection.shapes), "prepared": prepared},
        "template": collection.chosen_template(rows),
        "pairs": {"all": len(pairs), **Counter(row.verdict for row in own)},
        "outcomes": dict(outcomes),
        "reflected": rows.reflected(collection.names),
        "mirror_images": {n: rows.pairs[pair].not_reflected.get(n) for n, pair in turned.items()},
        "outliers": [outlier._asdict() for outlier in cohort.outliers(collection, rows)],
        "agreement": cohort.agreement_of(rows)._asdict(),
        "loop": _loop_of(collection, rows) if collection.pairs == "ring" else None,
        "damaged": damaged,
        "failures": failures,
    }


def _loop_of(collection: cohort.Collection, rows: cohort.Rows) -> dict[str, Any]:
    """Tell how far the template is from itself once around a ring, in √area, and where the ring is open."""
    names, table = collection.names, collection.layout.shapes_table
    legs = pairwise([*names, names[0]])
    unsure = [list(leg) for leg in legs if not rows.is_current(leg) or rows.is_doubtful(leg)]
    lines = read_csv(table) if table.exists() else []
    found = {key: float(line[key]) for line in lines for key in line if "loop" in key and line[key]}
    return {"open": unsure, **found}


def _say_status(status: dict[str, Any], layout: cohort.Layout) -> None:
    shapes, pairs, agreement = status["shapes"], status["pairs"], status["agreement"]
    done = pairs.get("done", 0) + pairs.get("low", 0)
    failed = f", {pairs['failed']} failed" if pairs.get("failed") else ""
    prepared = f"{shapes['prepared']} of {shapes['all']} shapes prepared"
    say(f"{done} of {pairs['all']} pairs matched{failed}; {prepared}", "bold")
    for outcome in Outcome:
        if count := status["outcomes"].get(outcome.name):
            say_rows([(f"{count} {outcome.value}", visualization.HEADLINES[outcome])], indent=OUTCOMES)
    say(f"template {status['template'] or 'not yet chosen'}")
    if agreement["compared"]:
        say(
            f"{agreement['compared']} pairs compared with compositions: {len(agreement['contradicted'])} contradicted, "
            f"{len(agreement['replaced'])} replaced"
        )
    loop = status["loop"] or {"open": []}
    if legs := ", ".join(" to ".join(leg) for leg in loop["open"]):
        say(f"the ring is open, so that shapes are reached one way: no sure maps {legs}", "bold red")
    elif "loop_error" in loop:
        mean, most = (f"{loop[key]:.2%}" for key in ("loop_error", "greatest_loop_error"))
        say(f"once around the ring, vertices are {mean} of √area from themselves, at most {most}")
    if turned := ", ".join(agreement["turned"]):
        say(f"maps to {turned} mostly reverse the orientation: perhaps mirrored together", "bold red")
    _say_sides(status)
    for outlier in status["outliers"]:
        if outlier["kind"] != "broken" and outlier["name"] not in status["mirror_images"]:
            say(f"look at {outlier['name']}: it {outlier['reason']}", "bold red")
    for name, what in status["damaged"].items():
        say(f"{name} {what}; run isomatch collect again, which makes it again", "bold red")
    for name, error in status["failures"].items():
        say(f"failed: {name}: {error}", "bold red")
    say(f"open first: {layout.page}; the table is {layout.table.name}")


def _say_sides(status: dict[str, Any]) -> None:
    """Name the shapes that were reflected, and those that seem to be mirror images of the others."""
    if status["reflected"]:
        say(f"reflected before they were matched: {', '.join(status['reflected'])}")
    untried = [name for name, reason in status["mirror_images"].items() if reason is None]
    if untried:
        remedy = "run again with --reflect auto, or with the names of those to reflect"
        say(f"seem to be mirror images of the others: {', '.join(untried)}; {remedy}", "bold red")
    for name, reason in status["mirror_images"].items():
        if reason is not None:
            say(f"seems to be a mirror image, but not reflected: {name}: {reason}", "bold red")


def told(event: cohort.Event) -> tuple[str, float]:
    """Describe a step of a run, with the share of its steps that are done."""
    name = event.name if isinstance(event.name, str) else " and ".join(event.name)
    reasons = reasons_of(event)
    again = f"; again, because {'; '.join(reasons)}" if reasons else ""
    step = f"{_DONE[event.what]} {event.done} of {event.of}"
    return f"{step}: {name}, {_ending(event.row)}{again}", event.done / event.of


def reasons_of(event: cohort.Event) -> tuple[str, ...]:
    """Return why a shape or a pair was done again, if it was."""
    if isinstance(event.row, cohort.Outlier) or event.what not in ("shape", "pair"):
        return ()
    return event.row.again


def _ending(row: cohort.ShapeRow | cohort.PairRow | cohort.Outlier) -> str:
    if isinstance(row, cohort.Outlier):
        return row.reason
    if row.state == "failed":
        return f"failed: {row.error}"
    if isinstance(row, cohort.ShapeRow):
        return "done"
    if row.not_reflected:
        return f"not kept: {', '.join(row.not_reflected.values())}"
    if row.agreement and row.agreement.refused:
        return f"contradicted, but not replaced: {row.agreement.refused}"
    if row.replaced_by:
        return f"replaced by the composition over {row.replaced_by[1]}"
    return row.ending.lower().replace("_", " ") if row.there.values else "done"
