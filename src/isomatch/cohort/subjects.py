"""Subjects of several surfaces: a collection for each structure, and all of them as one shape a subject."""

from __future__ import annotations

from collections.abc import Collection as Names
from collections.abc import Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, Literal

import numpy as np

from isomatch._core.arrays import FloatArray
from isomatch._core.errors import InputError, IsomatchError
from isomatch._core.files import legible, made_folder, staged
from isomatch._core.texts import natural_order, read_csv, write_csv
from isomatch.cohort.collection import Collection
from isomatch.cohort.contacts import Gap, beneath, contacts_kept
from isomatch.cohort.entries import Entry
from isomatch.cohort.finish import surfaces_written
from isomatch.cohort.outliers import OTHERS
from isomatch.cohort.shape_statistics import (
    MEASURED,
    STRUCTURES,
    CorrespondedShapes,
    Doubt,
    doubtful_positions,
    read_shapes,
    stacked,
)
from isomatch.io import Asset, Attribute, mesh_from, meshes_among, write_asset
from isomatch.surfaces import Mesh, reflected

Structures = Mapping[str, Mapping[str, Path]]  # the file of each subject, by structure


def structures_of(source: str | Path) -> dict[str, dict[str, Path]]:
    """List the files of subjects by structure, see `run`; none of what is one surface each."""
    path = Path(source)
    listed = list[tuple[str, str, Path]]()
    if path.suffix.lower() == ".csv" and path.is_file():
        rows = [row for row in read_csv(path) if {"subject", "structure", "file"} <= set(row)]
        listed = [(row["subject"], row["structure"], path.parent / row["file"]) for row in rows]
    elif path.is_dir() and not meshes_among(path.iterdir()):
        folders = [each for each in path.iterdir() if each.is_dir() and not each.name.startswith(".")]
        listed = [(each.name, file.stem, file) for each in folders for file in meshes_among(each.iterdir())]
    found: dict[str, dict[str, Path]] = {}
    for subject, structure, file in sorted(listed, key=lambda row: [*map(natural_order, row[1::-1])]):
        own = found.setdefault(legible(structure), {})
        if legible(subject) in own:
            raise InputError(f"{source}: {subject} has {structure} twice; keep one")
        own[legible(subject)] = file.resolve()
    # structures that few subjects have which lack one that most have: perhaps it is the same
    usual = [each for each, files in found.items() if 2 * len(files) > len({row[0] for row in listed})]
    for structure, files in found.items():
        lacked = [other for other in usual if not set(found[other]) & set(files)]
        who = f"{source}: nothing is matched; {structure} of {', '.join(files)}"
        if structure in ("corresponded", "statistics"):  # folders beside those of structures
            raise InputError(f"{who} cannot have this name; rename it")
        if structure not in usual and (lacked or len(files) == 1):
            same = f"may be the same as {' or '.join(lacked)}" if lacked else "is in no other subject"
            raise InputError(f"{who} {same}; name structures alike, or take it out")
    return found


def subject_collections(
    folder: str | Path,
    found: Structures,
    *,
    template: str | None = None,
    reflect: Literal["auto"] | Iterable[str] | None = None,
    units: Mapping[str, str] | None = None,
    **options: Any,
) -> dict[str, Collection]:
    """Make a collection for each structure, or continue them; one that lies on a larger one is led by that."""
    names = {name for files in found.values() for name in files}
    named = [] if reflect in (None, "auto") else list(reflect or ())
    if strangers := {*named, *(units or ()), template} - names - {OTHERS, None}:
        raise InputError(f"{', '.join(map(str, strangers))}: no subjects; give names such as {min(names)}")
    in_order = sorted(names, key=natural_order)
    whole = template or max(in_order, key=lambda name: sum(name in files for files in found.values()))
    meshes = dict[str, Mesh]()
    for structure, files in found.items():
        with suppress(IsomatchError, KeyError):  # its collection tells what is wrong with a file
            meshes[structure] = mesh_from(files[whole])
    below = beneath(meshes)  # larger ones first
    made = dict[str, Collection]()
    for structure in (*(each for each in found if each not in below), *below):
        files = found[structure]
        made[structure] = Collection.create(
            Path(folder) / structure,
            [Entry(name, file) for name, file in files.items()],
            template=template if template in files else None,
            reflect=reflect if reflect in (None, "auto") else [name for name in named if name in files],
            units=units and {name: unit for name, unit in units.items() if name in {OTHERS, *files}},
            leader=made.get(below.get(structure, "")),
            **options,
        )
    return made


def finish_subjects(
    folder: str | Path, collections: Mapping[str, Collection], *, keep_contacts: bool = True
) -> list[Gap]:
    """Write each subject as one surface, in the topology of all templates, to ``corresponded`` in a folder.

    Its structures are stacked, see `stacked`, and their contacts kept, see `contacts_kept`, which
    ``contacts.csv`` tells. ``structures.csv`` has the structures. `InputError` if none is in one topology.
    """
    parts = {
        name: read_shapes(map(own.layout.corresponded, written))
        for name, own in collections.items()
        if (written := surfaces_written(own))
    }
    if not parts:
        raise InputError(f"{folder}: no structure is in one topology; see their pages")
    templates = [own.chosen_template(own.rows()) for own in collections.values()]
    shapes, gaps = contacts_kept(stacked(parts), max(templates, key=templates.count), move=keep_contacts)
    to = Path(folder) / "corresponded"
    gone = {file.name for file in to.glob("*.ply")} - {f"{name}.ply" for name in shapes.names}
    with made_folder(to), staged(to, STRUCTURES, gone) as new:
        for i, name in enumerate(shapes.names):
            mark = Attribute(MEASURED, "point", "label", shapes.seen[i].astype(np.uint8))
            write_asset(new / f"{name}.ply", Asset.of_mesh(shapes.mesh(i), [mark]))
        rows = [{"structure": name, "vertices": n} for name, n in shapes.structures.items()]
        write_csv(new / STRUCTURES, rows, ("structure", "vertices"))
    columns = Gap._fields if gaps else Gap._fields[:1]
    write_csv(Path(folder) / "contacts.csv", (gap._asdict() for gap in gaps), columns)
    return gaps


def subject_doubts(
    found: Structures, reflect: Names[str] | None = None, units: Names[str] = ()
) -> list[Doubt]:
    """Find subjects whose layout hardly belongs to the others, by points that move with each structure."""
    turned = () if reflect in (None, "auto") else tuple(reflect or ())
    marks, faces = dict[str, CorrespondedShapes](), np.array([[0, 1, 2]])  # of no surface
    for structure, files in found.items():
        own = {}
        for name, file in files.items():
            with suppress(IsomatchError):  # its collection tells
                mesh = mesh_from(file)
                if 0 < mesh.area < np.inf:
                    own[name] = _marks(reflected(mesh) if name in turned else mesh)
        if own:
            marks[structure] = CorrespondedShapes(tuple(own), np.array([*own.values()]), faces)
    if not marks:
        return []
    shapes = stacked(marks)
    doubts = doubtful_positions(shapes.names, shapes.vertices)
    known = {"units": units, "twice": (), "mirrored": ()}
    return [each for each in doubts if each.names[0] not in known.get(each.kind, each.names)]


def _marks(mesh: Mesh) -> FloatArray:
    """Points (4, 3) that move, turn and reflect with a surface: its centroid, and skewness, times the covariance."""
    share = mesh.vertex_areas / mesh.area
    centre = share @ mesh.vertices
    y = mesh.vertices - centre
    covariance = (share * y.T) @ y
    size = np.trace(covariance)
    skewness = (share * (y**2).sum(axis=1)) @ y / size
    once = covariance @ skewness / size
    return np.asarray(centre + np.array([0 * skewness, skewness, once, covariance @ once / size]))
