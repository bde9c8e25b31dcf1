"""``isomatch collect``: a folder of shapes in correspondence, resumable, on one machine or many."""

from __future__ import annotations

import re
import time
from collections import Counter
from os.path import isfile
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import App, Parameter

import isomatch
from isomatch import collections
from isomatch.cli.collect_landmarks import landmark_files, landmarks, say_landmarks, write_all
from isomatch.cli.collect_status import reasons_of, status_of, tell_status, told
from isomatch.cli.inputs import read_config
from isomatch.cli.outputs import require_writable
from isomatch.cli.terminal import TALK, Talk, Tell, complain, say
from isomatch.errors import InputError, MemoryBudgetError
from isomatch.storage.texts import text_lines

Reports = int | Literal["doubtful", "all", "none"]

collect = App(name="collect", default_parameter=Parameter(negative=()))


@collect.default
def run(
    shapes: str,
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    template: str = "auto",
    pairs: str = "star",
    jobs: int | None = None,
    executor: str = "local",
    shard: str = "1/1",
    reflect: str | None = None,
    units: str | None = None,
    landmarks: Path | None = None,
    curve_points: int | None = None,
    time_limit: float | None = None,
    agree: Annotated[bool | None, Parameter(negative="--no-agree")] = None,
    reports: Reports = "doubtful",
    config: Path | None = None,
    seed: int = 0,
    talk: Talk = TALK,
) -> None:
    """Match the shapes of a folder with a template, or with one another; run it again to continue.

    Parameters
    ----------
    shapes : str
        A folder, a quoted pattern such as 'scans/*.vtp', or a list.csv with a column path and perhaps name.
    output : Path
        Folder for prepared shapes, maps, pairs.csv, index.html, and the shapes in the topology of the template.
    template : str
        Name or file of the template; by default (auto) the shape in the middle of all, by spectra and distances.
    pairs : str
        star (default): each shape with the template; all; chain: each with the next; or a CSV file with columns source
        and target.
    jobs : int
        Number of pairs to match at a time; by default one for each processor.
    executor : str
        local (default), or dask:ADDRESS, the scheduler of a Dask cluster whose workers see the same files.
    shard : str
        i/n: match the i-th of n parts of the pairs. Runs of other parts may go on at the same time, on other machines.
    reflect : str
        Shapes to match as their mirror images. auto: those that fit clearly better so, as left ones among right ones;
        none; or their names, separated by commas, or a file with a name on each line. By default as before, at first
        none.
    units : str
        Units of shapes that are in others than most, such as scan7=mm,scan9=cm: um, mm, cm, m or in. They are brought to
        that of all others, which is found by their sizes, or given first: m,scan7=mm. none: all are in one unit. By
        default as before.
    landmarks : Path
        File of landmarks and curves of the template, as of 3D Slicer, or folder of such files of several shapes, named
        like them: the folder landmarks gets a file for each shape, and tables; see isomatch collect landmarks.
    curve_points : int
        Number of equally spaced points on each curve; by default as many as it was drawn with.
    time_limit : float
        Seconds after which nothing new is begun.
    agree : bool
        Once all pairs are matched, replace maps that the others contradict, see isomatch collect agree; by default only
        if all pairs are. Maps of shards are compared by that command.
    reports : int or str
        How many of the worst pairs get a report; all; none; or doubtful (default): those on the page that did not
        converge, and three others.
    config : Path
        TOML file with settings; see isomatch.Config.
    seed : int
        Seed of the matches.
    """
    place = re.fullmatch(r"([1-9]\d{0,5})/([1-9]\d{0,5})", shard)
    if not place or int(place[1]) > int(place[2]):
        raise InputError(f"--shard {shard}: is not i/n with 1 ≤ i ≤ n, such as 2/8")
    part = int(place[1]) - 1, int(place[2])
    collection = collections.Collection.create(
        output,
        shapes,
        pairs=pairs,
        template=None if template == "auto" else template,
        config=read_config(config) or isomatch.Config(),
        seed=seed,
        reflect=_names_of(reflect),
        units=_units_of(units),
    )
    marks = {} if landmarks is None else landmark_files(landmarks, collection, collection.template)
    for name, path in marks.items():  # what is wrong with them is told before anything is done
        isomatch.Landmarks.read(path, collection.paths[name])
    carried: dict[str, Any] = {}
    end = None if time_limit is None else time.monotonic() + time_limit
    with talk.progress() as tell:
        for where in collection.rows().damaged:
            complain(f"{where} is no row of a collection, and is ignored")
        again = Counter[tuple[str, str]]()
        for event in collection.run(executor, jobs, part, time_limit):
            tell(*told(event))
            again.update((event.what, reason) for reason in reasons_of(event))
            if event.what == "misfit":
                complain(f"{event.name} {event.record['reason']}")
        for (what, reason), count in again.items():
            complain(f"{count} {what}{'s' * (count > 1)} done again, because {reason}")
        wanted = pairs == "all" if agree is None else agree
        if wanted and part[1] == 1 and "todo" not in status_of(collection)["pairs"]:
            tell("comparing maps with compositions of others", 1.0)
            try:
                for event in collections.agree(collection, executor, jobs, _until(end)):
                    tell(*told(event))
            except MemoryBudgetError as error:  # the maps are there all the same
                complain(f"maps were not compared: {error}")
        if part[1] == 1:
            _write(collection, reports, executor, jobs, end, tell)
            if marks:
                carried = write_all(
                    collection, marks, collection.layout.landmarks, tell, curve_points=curve_points
                )
    tell_status(collection, talk, carried)
    if carried and not (talk.quiet or talk.json or talk.json_lines):
        say_landmarks(carried)


@collect.command
def status(folder: Path, /, *, talk: Talk = TALK) -> None:
    """Tell how far a collection is, with the pairs that failed, from the ledgers of all shards; write its tables.

    Parameters
    ----------
    folder : Path
        The folder of the collection.
    """
    collection = collections.Collection.open(folder)
    collections.write_table(collection.rows(), collection.layout.table)
    tell_status(collection, talk, is_answer=True)


@collect.command
def retry(which: Literal["failed", "low"], folder: Path, /, *, talk: Talk = TALK) -> None:
    """Let the next run match pairs again that failed, or that ended with low confidence.

    Parameters
    ----------
    which : str
        failed, or low: with another seed, and the surer map is kept, unless others contradict it.
    folder : Path
        The folder of the collection.
    """
    again = collections.Collection.open(folder).retry(which)
    talk.result(
        {"pairs": [list(pair) for pair in again]},
        lambda: say(f"{len(again)} pairs will be matched again; run isomatch collect as before"),
    )


@collect.command
def export(
    folder: Path,
    to: Path,
    /,
    *,
    format: str = ".ply",
    maps: Literal["npz", "txt", "none"] = "npz",
    force: bool = False,
    talk: Talk = TALK,
) -> None:
    """Write the shapes in the topology of the template, and the maps, for other programs.

    Parameters
    ----------
    folder : Path
        The folder of a collection.
    to : Path
        Folder for meshes, maps, a file for each direction, and pairs.csv.
    format : str
        Suffix of the meshes, such as .ply (default), .obj, .vtp or .glb; or none.
    maps : str
        npz (default): image vertices, and precise images in triangles; txt: the image vertex of each vertex on a line;
        or none.
    force : bool
        Write over files of an earlier export; others in the folder stay.
    """
    meshes = None if format == "none" else f".{format.removeprefix('.')}"
    if meshes:
        require_writable(Path(f"mesh{meshes}"))
    collection = collections.Collection.open(folder)
    written = Counter[str]()
    with talk.progress() as tell:
        for path in collections.export(collection, to, meshes, None if maps == "none" else f".{maps}", force):
            written[path.parent.name] += 1
            tell(f"written: {path.name}", 1.0)
    left_out = sorted({*collection.names} - {*collections.surfaces_written(collection)}) if meshes else []
    result = {
        "folder": str(to),
        "meshes": written["meshes"],
        "maps": written["maps"],
        "left_out": left_out,
    }

    def summary() -> None:
        say(f"wrote {written['meshes']} meshes and {written['maps']} maps to {to}")
        if left_out:
            say(f"not in the topology of the template, see shapes.csv: {', '.join(left_out)}", "bold red")

    talk.result(result, summary)


collect.command(landmarks)


@collect.command
def agree(
    folder: Path,
    /,
    *,
    jobs: int | None = None,
    executor: str = "local",
    time_limit: float | None = None,
    reports: Reports = "doubtful",
    talk: Talk = TALK,
) -> None:
    """Find the maps that most others contradict, and replace them by compositions of others, refined.

    A map from a to c disagrees with those from a to b and b to c if one of the three is wrong; many such triangles tell
    which. Maps that stay contradicted have low confidence. Run it again to continue, or after adding shapes.

    Parameters
    ----------
    folder : Path
        The folder of a collection whose pairs make triangles, as all do; also of one matched in shards.
    jobs : int
        Number of maps to replace at a time; by default one for each processor.
    executor : str
        local (default), or dask:ADDRESS; as for isomatch collect.
    time_limit : float
        Seconds after which nothing new is begun.
    reports : int or str
        Which pairs get a report; as for isomatch collect.
    """
    collection = collections.Collection.open(folder)
    end = None if time_limit is None else time.monotonic() + time_limit
    with talk.progress() as tell:
        for event in collections.agree(collection, executor, jobs, time_limit):
            tell(*told(event))
        _write(collection, reports, executor, jobs, end, tell)
    if not collections.agreement_of(collection.rows()).compared and time_limit is None:
        raise InputError(
            f"{folder}: no three shapes are all matched with one another, so there is nothing to compare maps with; "
            "match with --pairs all"
        )
    tell_status(collection, talk)


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
    given = [each.strip().rpartition("=") for each in units.split(",")]
    return {name.strip() or "*": unit.strip() for name, _, unit in given}


def _until(end: float | None) -> float | None:
    """Seconds that are left."""
    return None if end is None else max(0.0, end - time.monotonic())


def _write(
    collection: collections.Collection,
    reports: Reports,
    executor: str,
    jobs: int | None,
    end: float | None,
    tell: Tell,
) -> None:
    if reports != "none":
        for pair, row in collections.write_reports(collection, reports, executor, jobs, _until(end)):
            failed = f", failed: {row['error']}" if row["state"] == "failed" else ""
            tell(f"report of {' and '.join(pair)}{failed}", 1.0)
    for line in collections.finish(collection, executor, jobs, _until(end)):
        again = f"; again, because {line['again']}" if "again" in line else ""
        tell(f"written in the topology of the template: {line['name']}{again}", 1.0)
        if again:
            complain(f"the surface of {line['name']} done again, because {line['again']}")
