"""``isomatch collect landmarks``: landmarks of some shapes of a collection, carried to all others."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import isomatch
import isomatch.landmarks as shape_landmarks
from isomatch import collections
from isomatch.cli.terminal import TALK, Talk, say
from isomatch.errors import InputError
from isomatch.storage.files import claimed, made_folder

SUFFIXES = (".mrk.json", ".json", ".fcsv", ".pp", ".csv", ".txt")


def landmarks(
    folder: Path,
    marks: Path,
    to: Path,
    /,
    *,
    format: str = "mrk.json",
    curve_points: int | None = None,
    force: bool = False,
    talk: Talk = TALK,
) -> None:
    """Carry the landmarks of some shapes to all others: the median of what each of them gives.

    Parameters
    ----------
    folder : Path
        The folder of a collection.
    marks : Path
        Folder of the landmarks of some of its shapes, named like them: .mrk.json or .fcsv of 3D Slicer, .pp of MeshLab,
        or a table name,x,y,z.
    to : Path
        Folder for a file of each shape, landmarks.csv with a row for each, and landmarks.tps, for R's geomorph: there
        shapes that were matched as their mirror images are reflected, x → −x.
    format : str
        Suffix of the files: mrk.json (default), fcsv, pp or csv. They have the spread over templates, but those of pp.
    curve_points : int
        Number of equally spaced points on each curve; by default as many as it was drawn with.
    force : bool
        Write over files of an earlier run; others in the folder stay.
    """
    suffix = f".{format.removeprefix('.')}"
    shape_landmarks.writer_of(Path(f"landmarks{suffix}"))
    collection = collections.Collection.open(folder)
    files = _files_of(marks, collection.names)
    rows = collection.rows()
    ends = {*files, collection.chosen_template(rows)}
    found: dict[str, isomatch.Landmarks] = {}
    lost: set[str] = set()
    last = to / "landmarks.tps"
    tables = [to / "landmarks.csv", last]
    earlier = [*tables, *(to / f"{name}{suffix}" for name in collection.names)]
    with talk.progress() as tell, made_folder(to), claimed(last, [] if force else earlier):
        for name, carried in collections.collected_landmarks(collection, files, curve_points):
            lost |= {*isomatch.write_landmarks(to / f"{name}{suffix}", carried)}
            found[name] = carried
            tell(f"written: {name}", len(found) / len(collection.names))
        first = next(iter(found.values()))
        turned = rows.reflected(found)
        alike = {
            name: replace(each, positions=each.positions * [-1.0, 1.0, 1.0]) if name in turned else each
            for name, each in found.items()
            if (each.names, each.curves) == (first.names, first.curves)
        }
        for table in tables:
            shape_landmarks.write_specimens(table, alike)
    spread = {name: each.spread for name, each in found.items() if np.isfinite(each.spread).any()}
    record: dict[str, Any] = {
        "folder": str(to),
        "templates": sorted(files),
        "shapes": list(found),
        "mean_spread": {name: float(np.nanmean(each)) for name, each in spread.items()},
        "largest_spread": {name: found[name].names[int(np.nanargmax(each))] for name, each in spread.items()},
        "not_written": sorted(lost),
        "other_landmarks": [name for name in found if name not in alike],
        "reflected": turned,
        "doubtful": [pair for pair in rows.pairs if rows.is_doubtful(pair) and not ends.isdisjoint(pair)],
        "left_out": [name for name in collection.names if name not in found],
    }

    def summary() -> None:
        say(f"wrote the landmarks of {len(found)} shapes to {to}, from {len(files)} templates")
        if len(files) > 1:
            for name, mean in record["mean_spread"].items():
                say(f"{name}: mean spread {mean:.4g}, largest at {record['largest_spread'][name]}")
        if lost:
            say(f"not written, because {suffix} has no place for them: {', '.join(record['not_written'])}")
        if record["other_landmarks"]:
            say(
                f"with other landmarks or curves, so not in the tables: {', '.join(record['other_landmarks'])}"
            )
        if turned:
            say(f"reflected in the tables, as they were matched: {', '.join(turned)}")
        if record["doubtful"]:
            pairs = ", ".join(" and ".join(pair) for pair in record["doubtful"])
            say(f"not used, because they are doubtful: the maps of {pairs}", "bold red")
        if record["left_out"]:
            say(f"no map that is sure leads to: {', '.join(record['left_out'])}", "bold red")

    talk.result(record, summary)


def _files_of(marks: Path, names: list[str]) -> dict[str, Path]:
    """Find the file of landmarks of each shape that has one, in the order of the shapes."""
    present = {path.name: path for path in marks.iterdir()} if marks.is_dir() else {}
    found = {
        name: next((present[name + suffix] for suffix in SUFFIXES if name + suffix in present), None)
        for name in names
    }
    files = {name: path for name, path in found.items() if path is not None}
    if not files:
        raise InputError(
            f"{marks}: no landmarks of a shape of the collection; give a folder of files such as {names[0]}.mrk.json"
        )
    return files
