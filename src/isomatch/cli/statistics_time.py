"""``isomatch statistics time``: area, volume, thickness and strain of a series of shapes in one topology, by region."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

import isomatch
import isomatch.statistics as shape_statistics
from isomatch import collections
from isomatch.assets import Asset, Attribute, holds_values, read_asset, read_attributes, write_asset
from isomatch.cli.inputs import Force, Output
from isomatch.cli.statistics_files import StatisticsFolder
from isomatch.cli.terminal import TALK, Talk, complain, say, say_rows
from isomatch.errors import InputError
from isomatch.statistics import MEASURED
from isomatch.surfaces import Mesh


def over_time(
    folder: Path,
    /,
    *,
    output: Output,
    regions: Path | None = None,
    reference: str | None = None,
    force: Force = False,
    talk: Talk = TALK,
) -> None:
    """Tell how a series of shapes in one topology moves: area, volume, thickness and strain over time, by region.

    Args:
        folder: Folder of meshes with the same faces, in the order of the numbers in their names; or folder written by
            isomatch collect, in the order of its shapes.
        output: Folder for time.csv, time.png, and strain/NAME.ply, each shape with thickness, displacement and strain at
            its vertices.
        regions: File of the labels of the vertices: a table, .npy, .annot, .label.gii, or a mesh with one attribute of
            labels, such as the template's file.
        reference: Name of the shape that is not strained; by default the first one.
    """
    into = StatisticsFolder(output, last="time.json")
    with talk.progress() as tell, into.claimed(force) as new:
        tell("reading", 0.0)
        collections.require_unchanged(collections.Layout(folder), ["corresponded"])
        shapes = shape_statistics.read_shapes(folder)
        place = {name: i for i, name in enumerate(shapes.names)}
        is_collection = collections.Layout(folder).plan.exists()
        order = collections.Collection.open(folder).names if is_collection else list(place)
        names = [name for name in order if name in place]
        notes = [f"left out: {reason}" for reason in shapes.left_out]
        told = [reason.partition(": ")[0] for reason in shapes.left_out]
        notes += [f"missing: {name}; see shapes.csv" for name in order if name not in (*place, *told)]
        for note in notes:
            complain(note)
        if len(names) < 2:
            found = f"only {names[0]} is" if names else "no shape is"
            raise InputError(f"{folder}: {found} in the topology of most; a series has at least two shapes")
        first = names[0] if reference is None else reference
        if first not in place:
            raise InputError(f"--reference {first}: no such shape in {folder}; they are {', '.join(names)}")
        rest = shapes.mesh(place[first])
        labels = _labels(regions, rest) if regions else []
        rows = []
        for i, name in enumerate(names):
            tell(f"measuring {name}", i / len(names))
            mesh = shapes.mesh(place[name])
            motion = shape_statistics.vertex_motion(mesh, rest)
            values = [Attribute(key, "point", "scalar", of) for key, of in motion._asdict().items()]
            write_asset(new.path(f"strain/{name}.ply"), Asset.of_mesh(mesh, values), binary=True)
            by_region = shape_statistics.motion_by_region(mesh, rest, motion, labels)
            rows += [{"name": name, **row} for row in by_region]
        columns = {key: [row[key] if row[key] == row[key] else "" for row in rows] for key in rows[0]}
        if not any(columns["volume"]):
            notes.append("without volume and thickness: the surface is not closed")
        new.table("time.csv", **columns)
        shape_statistics.draw_motion(new.picture("time"), rows)
        about = {"isomatch": isomatch.__version__, "folder": str(folder), "reference": first, "shapes": names}
        record: dict[str, Any] = {**about, "notes": notes}
        new.finish(record)

    def summary() -> None:
        say(f"{len(names)} shapes of {shapes.n_vertices:,} vertices; strain is relative to {first}", "bold")
        whole = [row for row in rows if row["region"] == "all"]
        for key in ("area", "volume", "thickness", "area_strain"):
            known = sorted((row[key], row["name"]) for row in whole if np.isfinite(row[key]))
            if known:
                ends = " to ".join(f"{value:.4g} ({name})" for value, name in (known[0], known[-1]))
                say_rows([(key.replace("_", " "), ends)])
        say_rows([("note", note) for note in notes])
        say(f"open first: {output / 'time.png'}; the table is time.csv")

    talk.result({**record, "output": str(output), "files": into.written}, summary)


def _labels(path: Path, mesh: Mesh) -> list[str]:
    """Read the name of the region of each vertex, "" for none."""
    found = read_attributes(path, Asset.of_mesh(mesh)) if holds_values(path) else read_asset(path).attributes
    labels = [
        each for each in found if each.domain == "point" and each.name != MEASURED and each.seems_labels
    ]
    if len(labels) != 1 or len(labels[0]) != mesh.n_vertices:
        there = ", ".join(map(repr, found)) or "nothing"
        raise InputError(
            f"{path}: has {there}; give one label for each of the {mesh.n_vertices} vertices of the shapes"
        )
    of = labels[0].coded
    codes = np.nan_to_num(of.values, nan=-1).astype(int).tolist()
    return ["" if code < 0 else of.names.get(code, str(code)) for code in codes]
