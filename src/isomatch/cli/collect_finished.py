"""``isomatch collect landmarks``, ``export`` and ``add``: work with a finished collection."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any, Literal

import numpy as np

from isomatch import cohort
from isomatch.cli.collect_options import Executor, Jobs, Reports, SemilandmarkOptions, names_of, units_of
from isomatch.cli.inputs import Force, Rounded
from isomatch.cli.outputs import require_writable
from isomatch.cli.statistics_model import say_scored
from isomatch.cli.terminal import TALK, Talk, complain, require_complete, say


def landmarks(
    folder: Path,
    marks: Path,
    to: Path,
    /,
    *,
    format: str = "mrk.json",
    semilandmarks: SemilandmarkOptions = None,
    force: Force = False,
    talk: Talk = TALK,
) -> None:
    """Carry the landmarks of some shapes to all others: the median of what each of them gives.

    Args:
        folder: The folder of a collection.
        marks: Folder of the landmarks of some of its shapes, named like them, or one such file: .mrk.json or .fcsv of 3D
            Slicer, .pp of MeshLab, or a table name,x,y,z. A file of another name belongs to the template.
        to: Folder for a file of each shape, and for R's geomorph landmarks.csv, with a row for each, and landmarks.tps:
            in the unit of the collection, and reflected, x → −x, where a shape was matched as its mirror image.
            landmarks_errors.csv has the expected error of each, and the error of the marked shapes, carried from the
            others; landmarks_slid.csv how far points slid, and bending energies.
        format: Suffix of the files: mrk.json (default), fcsv, pp or csv. They have the spread over templates, but those
            of pp.
    """
    how: dict[str, Any] = {"semilandmarks": semilandmarks, "format": format, "force": force}
    with talk.progress() as tell:
        found = cohort.write_landmark_tables(folder, marks, to, **how, progress=tell)
    talk.result(found.to_json(), lambda: say_landmarks(found))


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
    counts = {kind: written[kind] for kind in ("meshes", "maps")}
    result = {"folder": str(to), **counts, "left_out": left_out, "not_kept": dict(lost)}

    def summary() -> None:
        say(f"wrote {counts['meshes']} meshes and {counts['maps']} maps to {to}")
        for name, count in lost.items():
            say(f"not in {count} of the meshes: {name}, which a {meshes} file cannot store")
        if left_out:
            say(f"not in the topology of the template, see shapes.csv: {', '.join(left_out)}", "bold red")

    talk.result(result, summary)


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
    """Match new subjects with the template of a finished collection; tell how unusual each is.

    Those that cannot be added are named, and the exit code is 3. All files that are there stay as they are: new ones are
    in the folder added, and nothing is fitted again. Run it again to continue, or to add more.

    Args:
        folder: The folder of a collection.
        new: Meshes, or a folder of them, or a list.csv with a column path and perhaps name. Their names, those of the
            files, are new ones.
        model: model.npz of isomatch statistics, made of this collection; by default FOLDER/statistics/model.npz.
        reflect: New subjects to match as their mirror images: auto, none, or their names. By default auto if that was
            asked for of the collection.
        units: Units of new subjects, such as scan7=mm. If the collection's unit is not known, give it first:
            m,scan7=mm. A size whose unit is given is not questioned.
    """
    how: dict[str, Any] = {"reflect": names_of(reflect), "units": units_of(units), "reports": reports}
    how |= {"model": model, "executor": executor, "jobs": jobs}
    with talk.progress() as tell:
        found = cohort.add(folder, new, **how, progress=tell, warn=complain)

    def summary() -> None:
        say_scored(found.record, found.folder)
        say(f"the maps: {found.folder / 'index.html'}; {folder} is as it was, but for {found.folder.name}")

    talk.result({**found.record, "files": found.files}, summary)
    require_complete([*found.record["left_out"], *found.record["status"]["failures"]], found.folder)


def say_landmarks(tables: cohort.LandmarkTables) -> None:
    """Print what was written about landmarks."""
    n = len(tables.templates)
    start = f"wrote the landmarks of {len(tables.shapes)} shapes to {tables.folder}"
    say(f"{start}, from {n} template{'s' * (n != 1)}")
    if which := ", ".join(f"{name} ({error:.3g})" for name, error in tables.check_first.items()):
        say(f"check first, by their expected errors in the units of the files: {which}")
    if tables.look_at:
        say(f"look at the landmarks in 3D: {tables.look_at}")
    for name, mean in tables.mean_spread.items():
        say(f"{name}: mean spread {mean:.4g}, largest at {tables.largest_spread[name]}")
    for name, error in tables.left_out_errors.items():
        largest = f"at most {error.largest:.4g} at {error.at}"
        say(f"{name}, carried from the others: error {error.mean:.4g} in the mean, {largest}")
    if slid := tables.slid:
        mean, _, before, after = (float(np.mean(column)) for column in [*zip(*slid)][1:])
        say(f"slid by {mean:.4g} in the mean; mean bending energy {before:.4g}, now {after:.4g}")
    doubtful, half_turned = [" and ".join(pair) for pair in tables.doubtful], tables.half_turned
    misread = "geomorph takes for other lines of landmarks.tps, so read landmarks.csv there:"
    for sentence, names, style in (
        (f"not written, because {tables.format} has no place for them:", tables.not_written, ""),
        ("with other landmarks or curves, so not in the tables:", tables.other_landmarks, ""),
        (misread, tables.misread_names, "bold red"),
        ("reflected in the tables, as they were matched:", tables.reflected, ""),
        (f"brought into {tables.axes} in the tables, from the space of their files:", half_turned, ""),
        ("not used, because they are doubtful: the maps of", doubtful, "bold red"),
        ("not slid, as they have other landmarks, or few have a place:", tables.not_slid, "bold red"),
        ("failed, or no map that is sure leads to:", tables.left_out, "bold red"),
    ):
        if names:
            say(f"{sentence} {', '.join(names)}", style)
