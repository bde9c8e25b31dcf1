"""``isomatch statistics time``: area, volume, thickness and strain of a series of shapes in one topology, by region."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import isomatch
from isomatch import cohort
from isomatch._core.errors import InputError
from isomatch.cli.inputs import Force, Output
from isomatch.cli.statistics_files import StatisticsFolder
from isomatch.cli.terminal import TALK, Talk, complain, say, say_rows
from isomatch.cohort import shape_statistics
from isomatch.cohort.shape_statistics import MEASURED
from isomatch.io import Asset, Attribute, holds_values, read_asset, read_attributes, write_asset
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
        folder: Folder of meshes with the same faces, frame2 before frame10; or folder of isomatch collect.
        output: Folder for time.csv, time.png, and strain/NAME.vtp, each shape with the measures of its faces.
        regions: Labels of the vertices: a table, .npy, .annot, .label.gii, or the template's file, if it has one label.
        reference: Name of the shape that is not strained; by default the first one.
    """
    into = StatisticsFolder(output, last="time.json")
    with talk.progress() as tell, into.claimed(force) as new:
        cohort.require_unchanged(cohort.Layout(folder), ["corresponded"])
        shapes = shape_statistics.read_shapes(folder)
        meshes = {name: shapes.mesh(i) for i, name in enumerate(shapes.names)}
        is_collection = cohort.Layout(folder).plan.exists()
        order = cohort.Collection.open(folder).names if is_collection else shapes.names
        names = [name for name in order if name in meshes]
        notes = [f"left out: {reason}" for reason in shapes.left_out]
        notes += [f"missing: {name}; see shapes.csv" for name in order if name not in meshes]
        for note in notes:
            complain(note)
        if len(names) < 2:
            raise InputError(f"{folder}: a series has two shapes or more in one topology, not {len(names)}")
        first = names[0] if reference is None else reference
        if first not in meshes:
            raise InputError(f"--reference {first}: no such shape; they are {', '.join(names)}")
        labels = _labels(regions, meshes[first]) if regions else []
        rows = []
        for i, name in enumerate(names):
            tell(f"measuring {name}", i / len(names))
            motion = shape_statistics.face_motion(meshes[name], meshes[first])
            values = [Attribute(key, "face", "scalar", of) for key, of in motion.items()]
            write_asset(new.path(f"strain/{name}.vtp"), Asset.of_mesh(meshes[name], values))
            by_region = shape_statistics.motion_by_region(meshes[name], meshes[first], motion, labels)
            rows += [{"name": name, **row} for row in by_region]
        if np.isnan(rows[0]["volume"]):
            notes.append("no volume and thickness, as the surface is not closed")
        new.table("time.csv", **{key: [row[key] for row in rows] for key in rows[0]})
        shape_statistics.draw_motion(new.picture("time"), rows)
        about = {"isomatch": isomatch.__version__, "folder": str(folder), "reference": first}
        record = {**about, "shapes": names, "notes": notes}
        new.finish(record)

    def summary() -> None:
        say(f"{len(names)} shapes of {shapes.n_vertices:,} vertices; strain is relative to {first}", "bold")
        say_rows([("note", note) for note in notes])
        say(f"open first: {output / 'time.png'}; the table is time.csv")

    talk.result({**record, "output": str(output), "files": into.written}, summary)


def _labels(path: Path, mesh: Mesh) -> list[str]:
    """Read the name of the region of each vertex, "" for none."""
    found = read_attributes(path, Asset.of_mesh(mesh)) if holds_values(path) else read_asset(path).attributes
    labels = [at for at in found if at.domain == "point" and at.name != MEASURED and at.seems_labels]
    if len(labels) != 1 or len(labels[0]) != mesh.n_vertices:
        raise InputError(f"{path}: give one label for each of the {mesh.n_vertices} vertices, and no others")
    codes = np.nan_to_num(labels[0].plain, nan=-1).astype(int).tolist()
    return ["" if code < 0 else labels[0].coded.names.get(code, str(code)) for code in codes]
