"""All steps of a study: match, compare maps, write surfaces, reports and landmarks, bring structures together."""

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
from isomatch.cohort.ledger import Rows, SurfaceRow, writing_ledger
from isomatch.cohort.map_file import KEPT, changed_files
from isomatch.cohort.plan import Layout
from isomatch.cohort.study_page import write_reports, write_table
from isomatch.cohort.subjects import (
    Gap,
    finish_subjects,
    sides_of,
    structures_of,
    subject_collections,
    subject_doubts,
)
from isomatch.cohort.unusual_shapes import Outlier, mirror_images, outliers
from isomatch.cohort.workers import Listener, Warn, Workers, workers_of
from isomatch.settings import Config

Reports = int | Literal["doubtful", "all", "none"]


@dataclass(frozen=True)
class Cohort:
    """Shapes in correspondence in a folder, or subjects of several surfaces; `run` and ``open`` make one."""

    folder: Path
    #: that of each structure; of shapes of one surface each, that of the name "", and what was added to it
    collections: Mapping[str, Collection]
    gaps: Sequence[Gap] = ()  #: how structures lie on each other; none if that was not measured now
    landmarks: LandmarkTables | None = None  #: what was written about landmarks

    @classmethod
    def open(cls, folder: str | Path) -> Cohort:
        """Open what is in a folder, and write its tables of pairs; `FormatError` if it holds no collection."""
        plan = Layout(Path(folder)).plan
        plans = sorted(plan.parent.glob(f"*/{plan.name}"))
        inner = {path.parent.name: Collection.open(path.parent) for path in plans}
        own = {} if inner and not plan.exists() else {"": Collection.open(folder)}
        for each in (own | inner).values():
            write_table(each.rows(), each.layout.table)
        return cls(Path(folder), own | inner)

    def status(self, *, thorough: bool = False) -> dict[str, Status]:
        """Tell how far each collection is, with damaged files of landmarks or, if ``thorough``, of all folders."""
        has_own = "" in self.collections
        files = KEPT if thorough and has_own else ("landmarks",)
        of = self.collections.items()
        return {name: status_of(each, files if not (has_own and name) else ()) for name, each in of}

    @property
    def contacts(self) -> dict[str, dict[str, Any]]:
        """Mean of the gaps of each two structures over the subjects, and ``notes`` on subjects."""
        found = {}
        for pair in dict.fromkeys(gap[1:3] for gap in self.gaps):
            own = [gap for gap in self.gaps if gap[1:3] == pair]
            names = Gap._fields[3:-1]
            means = {name: float(np.nanmean([getattr(gap, name) for gap in own])) for name in names}
            notes = {gap.subject: gap.note for gap in own if gap.note}
            found[" on ".join(pair)] = {**means, "notes": notes}
        return found

    def to_json(self, status: Mapping[str, Status]) -> dict[str, Any]:
        """Return a status with contacts and landmarks in plain values."""
        plain = {name: each.to_json() for name, each in status.items()}
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
    """Match the shapes of a folder with a template, or with one another, and write all that follows from the maps.

    What was done before is not done again, also where the last run was killed. These are the steps of
    `Collection.create`, `Collection.run`, `agree`, `write_reports` and `finish`, and then landmarks, or of subjects of
    several surfaces their structures together.

    Parameters
    ----------
    folder : path_like
        Where prepared shapes, maps, tables and surfaces are kept.
    shapes : path_like
        Shapes, see `Collection.create`; or subjects of several surfaces: a folder with a folder for each, whose files are
        named like the structures, or a table with the columns ``subject``, ``structure`` and ``file``.
    pairs, template, config, seed, reflect, units
        See `Collection.create`.
    landmarks, semilandmarks
        Landmarks of the template, or a folder of those of several shapes, see `write_landmark_tables`.
    agree : bool, optional
        Whether maps that the others contradict are replaced, once all pairs are matched; by default if all pairs are.
    keep_contacts : bool
        Of subjects, whether points are kept together that lie on each other in the template.
    reports : int, "doubtful", "all" or "none"
        See `write_reports`.
    executor, jobs, shard, time_limit
        See `Collection.run`; of a shard, only maps are made.
    progress, warn : callable, optional
        Called with each step and the share that is done; and with what is wrong with shapes and maps, and what is done
        again, which by default is logged.

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
            if doubt.kind == "mirrored" and reflect == "auto":
                continue  # it is reflected
            to.warn(f"{' and '.join(doubt.names)} {doubt.reason}")
        structures = subject_collections(folder, subjects, **settings)
    else:
        structures = {"": Collection.create(folder, shapes, **settings)}
        if landmarks is not None:
            marks = landmark_files(landmarks, structures[""], structures[""].template)
    carried, gaps = None, list[Gap]()
    with workers_of(executor, jobs, time_limit) as workers:
        for structure, collection in structures.items():
            to.tell(f"{structure}: starting" if structure else "starting", 0.0)
            for where in collection.rows().damaged:
                to.warn(f"{where} is no row of a collection, and is ignored")
            follow(collection.run(workers, shard=shard), to)
        if shard[1] > 1:
            return Cohort(Path(folder), structures)
        if subjects:
            _reflect_subjects(structures, mirrored, workers, to)
        for collection in structures.values():
            rows = collection.rows()
            is_matched = not rows.untried(collection.wanted_pairs(rows))
            if is_matched and (pairs == "all" if agree is None else agree):
                to.tell("comparing maps with compositions of others", 1.0)
                try:
                    follow(combine.agree(collection, workers), to)
                except MemoryBudgetError as error:  # the maps are there all the same
                    to.warn(f"maps were not compared: {error}")
            write_results(collection, reports, workers, to)
            if marks:
                carried = write_tables(collection, marks, collection.layout.landmarks, semilandmarks, to)
        if subjects:
            to.tell("bringing structures together", 1.0)
            gaps = finish_subjects(folder, structures, keep_contacts=keep_contacts)
    return Cohort(Path(folder), structures, gaps, carried)


def _reflect_subjects(
    structures: Mapping[str, Collection], mirrored: set[str], workers: Workers, to: Listener
) -> None:
    """Match all structures of a subject reflected, or none, where each was found to be a mirror image by itself."""
    are_matched = not any(each.rows().untried(each.wanted_pairs(each.rows())) for each in structures.values())
    if not are_matched or any(each.reflect != "auto" for each in structures.values()):
        return
    reflected, against = sides_of(structures, mirrored)
    sides = {name: set(each.rows().reflected(each.names)) for name, each in structures.items()}
    if all(own == reflected & set(structures[name].names) for name, own in sides.items()):
        return
    for collection in structures.values():
        turned = tuple(name for name in collection.names if name in reflected)
        follow(replace(collection, reflect=turned).run(workers), to)
    for structure, subject in against:
        how = "reflected" if subject in reflected else "not reflected"
        why = f"{subject} is {how}, as most of its structures ask for, but {structure} asks otherwise"
        to.warn(why)
        collection = structures[structure]
        pair = (collection.chosen_template(collection.rows()) or "", subject)
        with writing_ledger(collection.layout.ledger()) as ledger:  # so that the next run does not turn it
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
    """Replace maps of a collection that most others contradict, see `agree`, and write all that follows from the maps.

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
    """Tell of the steps of a run, and warn of what does not fit, and of what is done again."""
    again = Counter[tuple[str, str]]()
    for event in events:
        to.tell(*event.told)
        if event.state == "failed":
            noted(event.told[0])
        again.update((event.what, reason) for reason in event.again)
        if isinstance(event.row, Outlier):
            to.warn(f"{event.name} {event.row.reason}")
    for (what, reason), count in again.items():
        to.warn(f"{count} {what}{'s' * (count > 1)} done again, because {reason}")


def write_results(collection: Collection, reports: Reports, workers: Workers, to: Listener) -> None:
    """Write reports, and the shapes in the topology of the template."""
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
    shapes: dict[str, int]  # how many there are, ``all``, and how many are ``prepared``
    template: str | None
    pairs: dict[str, int]  # how many there are, ``all``, and of each `PairRow.verdict`
    outcomes: dict[str, int]  # how many pairs ended as each `Outcome`, by its name
    reflected: list[str]  # shapes that are matched as their mirror images
    # shapes that seem to be some, and why they are not reflected, if it was tried
    mirror_images: dict[str, str | None]
    outliers: list[Outlier]
    agreement: Agreement
    loop: dict[str, Any] | None  # of a ring: its ``open`` legs, and the errors once around it, in √area
    damaged: dict[str, str]  # files and rows that are not as they were written, with what is wrong
    failures: dict[str, str]  # shapes and pairs that failed, with the reasons

    def to_json(self) -> dict[str, Any]:
        """Return plain values."""
        odd, agreement = [outlier._asdict() for outlier in self.outliers], self.agreement._asdict()
        return {**vars(self), "folder": str(self.folder), "outliers": odd, "agreement": agreement}


def status_of(collection: Collection, folders: Iterable[str] = ()) -> Status:
    """Sum up how far a collection is, from the ledgers of all shards, with the damaged files of some `KEPT` folders."""
    rows = collection.rows()
    pairs = collection.wanted_pairs(rows)
    own = [rows.pair(pair) for pair in pairs]
    changed = changed_files(collection.layout, rows, folders)
    damaged = {str(path.relative_to(collection.folder)): what for path, what in changed.items()}
    failures = {name: row.error for name, row in rows.shapes.items() if row.state == "failed"}
    failures |= {" and ".join(pair): row.error for pair, row in rows.pairs.items() if row.state == "failed"}
    turned = mirror_images(collection, rows)
    return Status(
        folder=collection.folder,
        shapes={"all": len(collection.shapes), "prepared": sum(map(rows.is_prepared, rows.shapes))},
        template=collection.chosen_template(rows),
        pairs={"all": len(pairs), **Counter(row.verdict for row in own)},
        outcomes=dict(Counter(row.ending for row in own if row.state == "done")),
        reflected=rows.reflected(collection.names),
        mirror_images={name: rows.pairs[pair].not_reflected.get(name) for name, pair in turned.items()},
        outliers=outliers(collection, rows),
        agreement=agreement_of(rows),
        loop=_loop_of(collection, rows) if collection.pairs == "ring" else None,
        damaged=damaged | dict.fromkeys(rows.damaged, "is no row of a collection, and was ignored"),
        failures=failures,
    )


def _loop_of(collection: Collection, rows: Rows) -> dict[str, Any]:
    """Tell how far the template is from itself once around a ring, and where the ring is open."""
    legs = pairwise([*collection.names, collection.names[0]])
    unsure = [list(leg) for leg in legs if not rows.is_current(leg) or rows.is_doubtful(leg)]
    found: dict[str, Any] = {"open": unsure}
    for line in SurfaceRow.read(collection.layout.shapes_table).values():
        errors = {"loop_error": line.loop_error, "greatest_loop_error": line.greatest_loop_error}
        found |= {name: float(error) for name, error in errors.items() if error}
    return found
