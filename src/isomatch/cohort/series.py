"""Series: how shapes in one topology move, by area, volume, thickness and strain over time and by region."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from isomatch._core.errors import InputError
from isomatch._core.stage_timer import Progress
from isomatch.cohort import shape_statistics
from isomatch.cohort.collection import Collection
from isomatch.cohort.listener import Listener, Warn
from isomatch.cohort.map_file import require_unchanged
from isomatch.cohort.plan import Layout
from isomatch.cohort.shape_statistics import MEASURED
from isomatch.cohort.statistics_folder import VERSION, Results, StatisticsFolder
from isomatch.io import Asset, Attribute, holds_values, read_asset, read_attributes, write_asset
from isomatch.surfaces import Mesh


def series(
    folder: str | Path,
    output: str | Path,
    *,
    regions: Path | None = None,
    reference: str | None = None,
    force: bool = False,
    progress: Progress | None = None,
    warn: Warn | None = None,
) -> Results:
    """Tell how a series of shapes in one topology moves: area, volume, thickness and strain over time, by region.

    Parameters
    ----------
    folder : path_like
        Folder of meshes with the same faces, frame2 before frame10; or of a collection.
    output : path_like
        Folder for time.csv, time.png, and strain/NAME.vtp, each shape with the measures of its faces.
    regions, reference, force
        As the options of ``isomatch statistics time``.
    progress, warn : callable, optional
        Called with each step and the share that is done; and with shapes that are left out, which by default are logged.

    Returns
    -------
    Results
        The names of the shapes, the reference, and notes.

    Raises
    ------
    InputError
        If there are fewer than two shapes in one topology, or the reference is none of them.
    """
    folder, to = Path(folder), Listener.of(progress, warn)
    into = StatisticsFolder(Path(output), last="time.json")
    with into.claimed(force) as new:
        require_unchanged(Layout(folder), ["corresponded"])
        shapes = shape_statistics.read_shapes(folder)
        meshes = {name: shapes.mesh(i) for i, name in enumerate(shapes.names)}
        is_collection = Layout(folder).plan.exists()
        order = Collection.open(folder).names if is_collection else shapes.names
        names = [name for name in order if name in meshes]
        notes = [f"left out: {reason}" for reason in shapes.left_out]
        notes += [f"missing: {name}; see shapes.csv" for name in order if name not in meshes]
        for note in notes:
            to.warn(note)
        if len(names) < 2:
            raise InputError(f"{folder}: a series has two shapes or more in one topology, not {len(names)}")
        first = names[0] if reference is None else reference
        if first not in meshes:
            raise InputError(f"--reference {first}: no such shape; they are {', '.join(names)}")
        labels = _labels(regions, meshes[first]) if regions else []
        rows = []
        for i, name in enumerate(names):
            to.tell(f"measuring {name}", i / len(names))
            motion = shape_statistics.face_motion(meshes[name], meshes[first])
            values = [Attribute(key, "face", "scalar", of) for key, of in motion.items()]
            write_asset(new.path(f"strain/{name}.vtp"), Asset.of_mesh(meshes[name], values))
            by_region = shape_statistics.motion_by_region(meshes[name], meshes[first], motion, labels)
            rows += [{"name": name, **row} for row in by_region]
        if np.isnan(rows[0]["volume"]):
            notes.append("no volume and thickness, as the surface is not closed")
        new.table("time.csv", **{key: [row[key] for row in rows] for key in rows[0]})
        shape_statistics.draw_motion(new.picture("time"), rows)
        about = {"isomatch": VERSION, "folder": str(folder), "reference": first}
        record = {**about, "shapes": names, "notes": notes}
        new.finish(record)
    told = f"{len(names)} shapes of {shapes.n_vertices:,} vertices; strain is relative to {first}"
    return Results(into.folder, into.written, record, [told])


def _labels(path: Path, mesh: Mesh) -> list[str]:
    """Read the name of the region of each vertex, "" for none."""
    found = read_attributes(path, Asset.of_mesh(mesh)) if holds_values(path) else read_asset(path).attributes
    labels = [at for at in found if at.domain == "point" and at.name != MEASURED and at.seems_labels]
    if len(labels) != 1 or len(labels[0]) != mesh.n_vertices:
        raise InputError(f"{path}: give one label for each of the {mesh.n_vertices} vertices, and no others")
    codes = np.nan_to_num(labels[0].plain, nan=-1).astype(int).tolist()
    return ["" if code < 0 else labels[0].coded.names.get(code, str(code)) for code in codes]
