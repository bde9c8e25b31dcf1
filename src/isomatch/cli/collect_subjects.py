"""What ``isomatch collect`` writes of subjects of several surfaces: where structures touch, landmarks over all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import isomatch
import isomatch.landmarks as shape_landmarks
from isomatch import collections
from isomatch.assets import mesh_from
from isomatch.cli.collect_landmarks import SUFFIXES, write_all
from isomatch.cli.terminal import Tell
from isomatch.errors import InputError
from isomatch.statistics import CorrespondedShapes
from isomatch.storage.files import made_folder
from isomatch.storage.texts import write_csv
from isomatch.surfaces import reflected

MEASURED = {
    "before": ("mean", "gap", "overlap"),
    "after": ("mean", "gap", "overlap"),
    "apart": ("mean", "largest"),
}
NUMBERS = [f"{what}_{when}" for when, kinds in MEASURED.items() for what in kinds]


def write_contacts(
    subjects: collections.Subjects, shapes: CorrespondedShapes
) -> list[collections.ContactGap]:
    """Write gaps and overlaps of the structures that touch, in each subject, to ``contacts.csv``, and return them."""
    files: dict[str, dict[str, isomatch.Mesh]] = {}
    templates = []
    for structure, collection in subjects.collections.items():
        rows = collection.rows()
        templates.append(collection.chosen_template(rows) or "")
        scales, turned = collections.scales_of(collection.units, rows), rows.reflected(collection.names)
        files[structure] = {}
        for name in {*collection.names} & {*shapes.names}:
            if rows.shapes.get(name, {}).get("state") == "done":
                mesh = mesh_from(collection.paths[name])
                mesh = reflected(mesh) if name in turned else mesh
                files[structure][name] = mesh.moved(mesh.vertices * scales.get(name, 1.0))
    template = max(templates, key=templates.count)
    gaps = list(collections.contact_gaps(shapes, files, template))
    rows_of = [gap._asdict() for gap in gaps]
    write_csv(subjects.folder / "contacts.csv", rows_of, collections.ContactGap._fields)
    return gaps


def summed_gaps(gaps: Sequence[collections.ContactGap]) -> dict[str, dict[str, dict[str, float]]]:
    """Sum up what was measured of each contact: means over the subjects, and the largest gap and overlap of all."""
    summed = {}
    for pair in dict.fromkeys((gap.structure, gap.other) for gap in gaps):
        own = [gap for gap in gaps if (gap.structure, gap.other) == pair]
        columns = {name: np.array([getattr(gap, name) for gap in own]) for name in NUMBERS}
        summed[" and ".join(pair)] = {
            when: {
                what: float(
                    columns[f"{what}_{when}"].mean() if what == "mean" else columns[f"{what}_{when}"].max()
                )
                for what in kinds
            }
            for when, kinds in MEASURED.items()
        }
    return summed


def write_subject_landmarks(
    subjects: collections.Subjects, marks: Path, tell: Tell, curve_points: int | None
) -> dict[str, Any]:
    """Carry landmarks over all structures of some subjects to the others: each by the structure that it is nearest to.

    A file of each subject, and tables of those that have all landmarks, are in the folder ``landmarks``.
    """
    to = subjects.folder / "landmarks"
    points: dict[str, list[isomatch.Landmarks]] = {}
    records = {}
    with TemporaryDirectory() as folder, made_folder(to):
        for structure, files in _divided(subjects, marks, Path(folder)).items():
            collection = subjects.collections[structure]
            inner = collection.layout.landmarks
            records[structure] = write_all(collection, files, inner, tell, curve_points=curve_points)
            for name in records[structure]["shapes"]:
                points.setdefault(name, []).append(isomatch.Landmarks.read(inner / f"{name}.mrk.json"))
        whole = {name: _together(several) for name, several in points.items()}
        for name, each in whole.items():
            isomatch.write_landmarks(to / f"{name}.mrk.json", each)
        most = max(len(each) for each in whole.values())
        complete = {name: each for name, each in whole.items() if len(each) == most}
        for table in ("landmarks.csv", "landmarks.tps"):
            shape_landmarks.write_specimens(to / table, complete)
    lack = [name for name in whole if name not in complete]
    return {"folder": str(to), "shapes": list(whole), "incomplete": lack, "structures": records}


def _divided(subjects: collections.Subjects, marks: Path, into: Path) -> Mapping[str, dict[str, Path]]:
    """Divide the landmarks of subjects by the structures that they lie on; return their files by structure."""
    paths = sorted(marks.iterdir()) if marks.is_dir() else [marks]
    names = {name for each in subjects.collections.values() for name in each.names}
    of = {
        path: path.name[: -len(suffix)]
        for path in paths
        for suffix in SUFFIXES[::-1]
        if path.name.endswith(suffix)
    }
    own = {name: path for path, name in of.items() if name in names}
    if not own:
        raise InputError(
            f"{marks}: no landmarks of a subject; name the file like one, such as {min(names)}.mrk.json"
        )
    divided: dict[str, dict[str, Path]] = {}
    for name, path in own.items():
        landmarks = isomatch.Landmarks.read(path)
        having = [structure for structure, each in subjects.collections.items() if name in each.paths]
        distances = []
        for structure in having:
            mesh = mesh_from(subjects.collections[structure].paths[name])
            nearest = shape_landmarks.nearest_on_surface(mesh, landmarks.positions).interpolated(
                mesh.vertices
            )
            distances.append(np.linalg.norm(nearest - landmarks.positions, axis=1))
        nearest_structure = np.argmin(distances, axis=0)
        for k, structure in enumerate(having):
            rows = np.flatnonzero(nearest_structure == k)
            if len(rows):
                file = into / structure / f"{name}.mrk.json"
                file.parent.mkdir(exist_ok=True)
                isomatch.write_landmarks(file, _some(landmarks, rows))
                divided.setdefault(structure, {})[name] = file
    return divided


def _some(landmarks: isomatch.Landmarks, rows: np.ndarray[Any, Any]) -> isomatch.Landmarks:
    """Return some of the landmarks, as single points."""
    names = [landmarks.names[i] for i in rows.tolist()]
    return isomatch.Landmarks(landmarks.positions[rows], names, axes=landmarks.axes, unit=landmarks.unit)


def _together(several: Sequence[isomatch.Landmarks]) -> isomatch.Landmarks:
    """Join landmarks of one subject."""
    positions, errors, spread = (
        np.concatenate([getattr(each, column) for each in several])
        for column in ("positions", "expected_error", "spread")
    )
    names = [name for each in several for name in each.names]
    first = several[0]
    return isomatch.Landmarks(positions, names, (), errors, spread, first.axes, first.unit)
