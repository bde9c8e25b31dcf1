"""A study: match, compare maps, write results, bring structures together; its status."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

import numpy as np

from isomatch._core.errors import InputError, MemoryBudgetError
from isomatch._core.skipped import noted
from isomatch._core.stage_timer import Progress
from isomatch.cohort import combine
from isomatch.cohort.collection import Collection
from isomatch.cohort.combine import Agreement, agreement_of
from isomatch.cohort.finish import finish
from isomatch.cohort.jobs import Event
from isomatch.cohort.landmarks import LandmarkTables, Semilandmarks, landmark_files, write_tables
from isomatch.cohort.ledger import writing_ledger
from isomatch.cohort.map_file import DIGESTED_FOLDERS, changed_files
from isomatch.cohort.plan import Layout
from isomatch.cohort.snapshot import Snapshot
from isomatch.cohort.study_page import write_reports, write_table
from isomatch.cohort.subjects import (
    Gap,
    finish_subjects,
    sides_of,
    structures_of,
    subject_collections,
    subject_doubts,
)
from isomatch.cohort.unusual_shapes import Outlier, outliers
from isomatch.cohort.workers import Listener, Warn, Workers, workers_of
from isomatch.settings import Config

Reports = int | Literal["doubtful", "all", "none"]  # pairs that get a report, or their number


@dataclass(frozen=True)
class Cohort:
    """Shapes, or subjects of several surfaces, in correspondence; `run` and ``open`` make one."""

    folder: Path
    #: collection of each structure; "" for shapes of one surface, "added" for what was added to them
    collections: Mapping[str, Collection]
    gaps: Sequence[Gap] = ()  #: gaps between structures of subjects; empty if not measured in this run
    landmarks: LandmarkTables | None = None  #: what was written about landmarks

    @classmethod
    def open(cls, folder: str | Path) -> Cohort:
        """Open a folder, and write its tables of pairs; `FormatError` if it holds no collection."""
        plan = Layout(Path(folder)).plan
        plans = sorted(plan.parent.glob(f"*/{plan.name}"))
        inner = {path.parent.name: Collection.open(path.parent) for path in plans}
        outer = {} if inner and not plan.exists() else {"": Collection.open(folder)}
        for collection in (outer | inner).values():
            write_table(collection.rows(), collection.layout.table)
        return cls(Path(folder), outer | inner)

    def status(self, *, thorough: bool = False) -> dict[str, Status]:
        """Sum up each collection, with damaged landmarks or, if ``thorough``, all damaged files."""
        has_own = "" in self.collections
        files = DIGESTED_FOLDERS if thorough and has_own else ("landmarks",)
        return {name: status_of(x, () if has_own and name else files) for name, x in self.collections.items()}

    @property
    def contacts(self) -> dict[str, dict[str, Any]]:
        """Mean of the gaps of each two structures over the subjects, and ``notes`` on subjects."""
        found, measures = {}, Gap._fields[3:-1]
        for pair in dict.fromkeys(gap[1:3] for gap in self.gaps):
            gaps = [gap for gap in self.gaps if gap[1:3] == pair]
            means = {name: float(np.nanmean([getattr(gap, name) for gap in gaps])) for name in measures}
            found[" on ".join(pair)] = {**means, "notes": {gap.subject: gap.note for gap in gaps if gap.note}}
        return found

    def to_json(self, status: Mapping[str, Status]) -> dict[str, Any]:
        """Return a status with contacts and landmarks in plain values."""
        plain = {name: summary.to_json() for name, summary in status.items()}
        if "" not in plain:
            return {"folder": str(self.folder), "structures": plain, "contacts": self.contacts}
        marks = {"landmarks": self.landmarks.to_json()} if self.landmarks else {}
        return {**plain.pop(""), **marks, **plain}


def run(
    folder: str | Path,
    shapes: str | Path,
    *,
    pairs: str = "star",
    template: str | None = None,
    config: Config | None = None,
    seed: int = 0,
    reflect: Literal["auto"] | Sequence[str] | None = None,
    units: Mapping[str, str] | None = None,
    landmarks: Path | None = None,
    semilandmarks: Semilandmarks | None = None,
    agree: bool | None = None,
    keep_contacts: bool = True,
    reports: Reports = "doubtful",
    executor: str | Executor | Workers = "local",
    jobs: int | None = None,
    shard: tuple[int, int] = (0, 1),
    time_limit: float | None = None,
    progress: Progress | None = None,
    warn: Warn | None = None,
) -> Cohort:
    """Match the shapes of a folder with a template, or with one another, and write all results.

    Nothing is done twice, also if the last run was killed. The steps are those of
    `Collection.create`, `Collection.run`, `agree`, `write_reports` and `finish`; landmarks follow
    or, for subjects of several surfaces, the structures of each together.

    Parameters
    ----------
    folder : path_like
        Where prepared shapes, maps, tables and surfaces are kept.
    shapes : path_like
        Shapes, see `Collection.create`; or subjects of several surfaces: a folder with a folder for
        each, whose files are named like the structures, or a table with the columns ``subject``,
        ``structure`` and ``file``.
    pairs, template, config, seed, reflect, units
        See `Collection.create`.
    landmarks, semilandmarks
        Landmarks of the template, or a folder of landmarks of several shapes, see
        `write_landmark_tables`.
    agree : bool, optional
        Whether maps that the others contradict are replaced, once all wanted pairs are matched; by
        default if ``pairs`` is "all".
    keep_contacts : bool
        For subjects, whether points that lie on each other in the template are kept together.
    reports : int, "doubtful", "all" or "none"
        See `write_reports`.
    executor, jobs, shard, time_limit
        See `Collection.run`; a shard makes only maps.
    progress, warn : callable, optional
        Called with each step and the share that is done; and with what is wrong with shapes and
        maps, and what is done again, which by default is logged.

    Returns
    -------
    Cohort
        The collections, and what was found of contacts and landmarks.

    Raises
    ------
    InputError
        If shapes, pairs, names, units or landmarks are not usable.
    SettingError
        If the folder holds a collection with other settings.
    """
    if semilandmarks and landmarks is None:
        raise InputError("semilandmarks come with landmarks of a shape; give these (--landmarks)")
    to, subjects = Listener.of(progress, warn), structures_of(shapes)
    settings: dict[str, Any] = {"pairs": pairs, "template": template, "config": config, "seed": seed}
    settings |= {"reflect": reflect, "units": units}
    marks, mirrored = dict[str, Path](), set[str]()
    if subjects and landmarks is not None:
        remedy = f"isomatch collect landmarks {folder}/NAME"
        raise InputError(f"--landmarks: give those of a structure to {remedy}")
    if subjects:
        doubts = subject_doubts(subjects, reflect, units or ())
        mirrored = {doubt.names[0] for doubt in doubts if doubt.kind == "mirrored"}
        for doubt in doubts:
            if doubt.kind != "mirrored" or reflect != "auto":  # "auto" reflects mirrored subjects
                to.warn(f"{' and '.join(doubt.names)} {doubt.reason}")
        cohort = Cohort(Path(folder), subject_collections(folder, subjects, **settings))
    else:
        cohort = Cohort(Path(folder), {"": Collection.create(folder, shapes, **settings)})
    if landmarks is not None:
        whole = cohort.collections[""]
        marks = landmark_files(landmarks, whole, whole.template)
    with workers_of(executor, jobs, time_limit) as workers:
        for structure, collection in cohort.collections.items():
            to.tell(f"{structure}: starting" if structure else "starting", 0.0)
            for where in collection.rows().damaged:
                to.warn(f"{where} is no row of a collection, and is ignored")
            follow(collection.run(workers, shard=shard), to)
        if shard[1] > 1:
            return cohort
        if subjects:
            _reflect_subjects(cohort.collections, mirrored, workers, to)
        for collection in cohort.collections.values():
            known = Snapshot(collection, collection.rows())
            if known.is_matched and (pairs == "all" if agree is None else agree):
                to.tell("comparing maps with compositions of others", 1.0)
                try:
                    follow(combine.agree(collection, workers), to)
                except MemoryBudgetError as error:  # the maps are usable without a comparison
                    to.warn(f"maps were not compared: {error}")
            write_results(collection, reports, workers, to)
            if marks:
                known = Snapshot(collection, collection.rows())
                tables = write_tables(known, marks, known.layout.landmarks, semilandmarks, to)
                cohort = replace(cohort, landmarks=tables)
        if subjects:
            to.tell("bringing structures together", 1.0)
            gaps = finish_subjects(cohort.folder, cohort.collections, keep_contacts=keep_contacts)
            cohort = replace(cohort, gaps=gaps)
    return cohort


def _reflect_subjects(
    structures: Mapping[str, Collection], mirrored: set[str], workers: Workers, to: Listener
) -> None:
    """Reflect all structures of a subject or none, where each was judged by itself."""
    found = {name: Snapshot(collection, collection.rows()) for name, collection in structures.items()}
    if not all(known.plan.reflect == "auto" and known.is_matched for known in found.values()):
        return
    reflected, against = sides_of(found, mirrored)
    if all({*known.reflected} == reflected & {*known.names} for known in found.values()):
        return
    for collection in structures.values():
        sides = tuple(name for name in collection.names if name in reflected)
        follow(replace(collection, reflect=sides).run(workers), to)
    for structure, subject in against:
        how = "reflected" if subject in reflected else "not reflected"
        why = f"{subject} is {how}, as most of its structures ask for, but {structure} asks otherwise"
        to.warn(why)
        pair = (found[structure].template or "", subject)
        # the reason in the row keeps the next run from reflecting the surface
        with writing_ledger(found[structure].layout.ledger()) as ledger:
            if row := ledger.rows.pairs.get(pair):
                ledger.put(pair, replace(row, not_reflected={subject: why}))


def reconcile(
    folder: str | Path,
    *,
    reports: Reports = "doubtful",
    executor: str | Executor | Workers = "local",
    jobs: int | None = None,
    time_limit: float | None = None,
    progress: Progress | None = None,
    warn: Warn | None = None,
) -> Cohort:
    """Replace maps of a collection that most others contradict, see `agree`, and write all results.

    Parameters
    ----------
    folder : path_like
        The folder of a collection whose pairs make triangles.
    reports, executor, jobs, time_limit, progress, warn
        See `run`.

    Returns
    -------
    Cohort
        The collection.

    Raises
    ------
    InputError
        If no three shapes are all matched with one another.
    """
    collection, to = Collection.open(folder), Listener.of(progress, warn)
    with workers_of(executor, jobs, time_limit) as workers:
        follow(combine.agree(collection, workers), to)
        write_results(collection, reports, workers, to)
    if not combine.agreement_of(collection.rows()).compared and time_limit is None:
        problem = "no three shapes are all matched with one another, so there is nothing to compare maps with"
        raise InputError(f"{folder}: {problem}; match with --pairs all")
    return Cohort(Path(folder), {"": collection})


def follow(events: Iterable[Event], to: Listener) -> None:
    """Tell the steps of a run, and warn of outliers and of what is done again."""
    again = Counter[tuple[str, str]]()
    for event in events:
        to.tell(*event.progress)
        if event.state == "failed":
            noted(event.progress[0])
        again.update((event.what, reason) for reason in event.again)
        if isinstance(event.row, Outlier):
            to.warn(f"{event.name} {event.row.reason}")
    for (what, reason), count in again.items():
        to.warn(f"{count} {what}{'s' * (count > 1)} done again, because {reason}")


def write_results(collection: Collection, reports: Reports, workers: Workers, to: Listener) -> None:
    """Write the reports, and the shapes in the topology of the template."""
    if reports != "none":
        for pair, error in write_reports(collection, reports, workers):
            to.tell(f"report of {' and '.join(pair)}{f', failed: {error}' if error else ''}", 1.0)
    for line in finish(collection, workers):
        again = f"; again, because {line.again}" if line.again else ""
        to.tell(f"written in the topology of the template: {line.name}{again}", 1.0)
        if again:
            to.warn(f"the surface of {line.name} done again, because {line.again}")


@dataclass(frozen=True)
class Status:
    """How far a collection is."""

    folder: Path
    shapes: dict[str, int]  # number of ``all``, and of those ``prepared``
    template: str | None
    pairs: dict[str, int]  # number of ``all``, and of each `PairRow.verdict`
    outcomes: dict[str, int]  # number of pairs with each `Outcome`, by its name
    reflected: list[str]  # shapes that are matched as mirror images
    # shapes that seem to be mirror images, and why they are not reflected, if it was tried
    mirror_images: dict[str, str | None]
    outliers: list[Outlier]
    agreement: Agreement
    loop: dict[str, Any] | None  # for pairs in a ring: ``open`` legs, and the errors once around it, in √area
    damaged: dict[str, str]  # what is wrong with files and rows that are not as they were written
    failures: dict[str, str]  # why shapes and pairs failed

    def to_json(self) -> dict[str, Any]:
        """Return plain values."""
        odd, agreement = [outlier._asdict() for outlier in self.outliers], self.agreement._asdict()
        return {**vars(self), "folder": str(self.folder), "outliers": odd, "agreement": agreement}


def status_of(collection: Collection, folders: Iterable[str] = ()) -> Status:
    """Sum up a collection from all ledgers, with the damaged files of some `DIGESTED_FOLDERS` folders."""
    known = Snapshot(collection, collection.rows())
    rows, pairs = known.rows, [known.rows.pair(pair) for pair in known.wanted_pairs]
    changed = changed_files(known.layout, rows, folders)
    damaged = {str(path.relative_to(collection.folder)): what for path, what in changed.items()}
    failures = {name: row.error for name, row in rows.shapes.items() if row.state == "failed"}
    failures |= {" and ".join(pair): row.error for pair, row in rows.pairs.items() if row.state == "failed"}
    mirrored = known.mirror_images
    return Status(
        folder=collection.folder,
        shapes={"all": len(collection.shapes), "prepared": sum(map(rows.is_prepared, rows.shapes))},
        template=known.template,
        pairs={"all": len(pairs), **Counter(row.verdict for row in pairs)},
        outcomes=dict(Counter(row.ending for row in pairs if row.state == "done")),
        reflected=known.reflected,
        mirror_images={name: rows.pairs[pair].not_reflected.get(name) for name, pair in mirrored.items()},
        outliers=outliers(collection, rows),
        agreement=agreement_of(rows),
        loop=_loop_of(known) if collection.pairs == "ring" else None,
        damaged=damaged | dict.fromkeys(rows.damaged, "is no row of a collection, and was ignored"),
        failures=failures,
    )


def _loop_of(known: Snapshot) -> dict[str, Any]:
    """Measure how far the template is from itself once around a ring, and list its open legs."""
    rows, legs = known.rows, pairwise([*known.names, known.names[0]])
    unsure = [list(leg) for leg in legs if not rows.is_current(leg) or rows.is_doubtful(leg)]
    loop: dict[str, Any] = {"open": unsure}
    for line in known.surface_rows().values():
        errors = {"loop_error": line.loop_error, "greatest_loop_error": line.greatest_loop_error}
        loop |= {name: float(error) for name, error in errors.items() if error}
    return loop
