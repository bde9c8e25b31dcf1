"""`Subjects`: subjects of several surfaces, a collection for each structure, and all of them as one shape a subject."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from isomatch.assets import Asset, Attribute, Polygons, mesh_from, meshes_among, write_asset
from isomatch.collections.cohort import OTHERS, alike_shapes, likeness_of
from isomatch.collections.collection import Collection
from isomatch.collections.finish import surfaces_written
from isomatch.collections.plan import Layout
from isomatch.collections.shapes import Entry
from isomatch.errors import FormatError, InputError, IsomatchError
from isomatch.statistics import (
    MEASURED,
    STRUCTURES,
    CorrespondedShapes,
    Doubt,
    doubtful_positions,
    likely_units,
    read_shapes,
    size_factors,
    stacked,
    told_factor,
)
from isomatch.storage.files import legible, made_folder, staged, write_text
from isomatch.storage.texts import natural_order, read_csv, write_csv
from isomatch.surfaces import Mesh, reflected
from isomatch.values.arrays import FloatArray

SUBJECTS = "subjects.json"  # in the folder of subjects: their structures
COLUMNS = ("subject", "structure", "file")
RESERVED = {"corresponded", "landmarks", "statistics"}  # folders beside those of the structures
STRUCTURE = "structure"  # attribute of the points of a subject: the number of their structure
FEWEST = (
    8  # subjects that tell where structures usually lie; of five made ones, one was named that belongs there
)
UNLIKE = 2.0  # factor between principal radii of one kind, over that between sizes

Structures = Mapping[str, Mapping[str, Path]]
"""The file of each subject, by structure."""


def are_subjects(source: str | Path) -> bool:
    """Whether a folder holds a folder of surfaces for each subject, or a table has columns subject, structure, file."""
    path = Path(source)
    if path.suffix.lower() == ".csv":
        rows = read_csv(path) if path.is_file() else []
        return bool(rows) and set(COLUMNS) <= set(rows[0])
    if not path.is_dir() or Layout(path).plan.exists() or meshes_among(path.iterdir()):
        return False
    return any(each.is_dir() and meshes_among(each.iterdir()) for each in path.iterdir())


def structures_of(source: str | Path) -> dict[str, dict[str, Path]]:
    """List the files of subjects by structure, see `Subjects.create`; `InputError` if names do not tell what is what."""
    path = Path(source)
    if path.is_dir():
        folders = sorted(
            (each for each in path.iterdir() if each.is_dir()), key=lambda each: natural_order(each.name)
        )
        listed = [
            (legible(folder.name), legible(file.stem), file)
            for folder in folders
            if not folder.name.startswith(".")
            for file in meshes_among(folder.iterdir())
        ]
    else:
        listed = [(row["subject"], row["structure"], path.parent / row["file"]) for row in read_csv(path)]
    counted = Counter((subject, structure) for subject, structure, _ in listed)
    problems = [
        f"{subject} has {structure} {count} times; keep one"
        for (subject, structure), count in counted.items()
        if count > 1
    ]
    found: dict[str, dict[str, Path]] = {}
    for subject, structure, file in listed:
        found.setdefault(structure, {})[subject] = file.resolve()
    problems += _named_differently(found)
    if reserved := sorted(set(found) & RESERVED):
        problems.append(
            f"{', '.join(reserved)} cannot be names of structures, but of folders beside them; name them differently"
        )
    if problems:
        raise InputError(f"{source}: nothing is matched; {'; '.join(problems)}")
    return dict(sorted(found.items(), key=lambda item: natural_order(item[0])))


def _named_differently(found: Structures) -> Iterator[str]:
    """Name structures that few subjects have which lack a structure that most have: perhaps it is the same."""
    subjects = {name for files in found.values() for name in files}
    usual = [structure for structure, files in found.items() if 2 * len(files) > len(subjects)]
    for structure, files in found.items():
        lacked = [other for other in usual if not set(found[other]) & set(files)]
        if structure in usual:
            continue
        who = f"{', '.join(sorted(files, key=natural_order))} {'has' if len(files) == 1 else 'have'} {structure}"
        if lacked:
            yield f"{who}, but not {' or '.join(lacked)}; is it the same? Name structures alike in all subjects"
        elif len(files) == 1:
            yield f"{who}, and no other subject has it, so it corresponds to nothing; take it out or rename it"


@dataclass(frozen=True)
class Subjects:
    """Subjects of several surfaces: a `Collection` for each structure, whose shapes are named like the subjects.

    Parameters
    ----------
    folder : Path
        The folder; that of a structure, in it, is named like it.
    collections : mapping of str to Collection
        The collection of each structure.
    doubts : tuple of Doubt
        What hardly belongs together, seen before anything was matched; see `subject_doubts`.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> from isomatch import write_mesh
    >>> triangle = Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    >>> with TemporaryDirectory() as folder:
    ...     for subject in ("s1", "s2"):
    ...         Path(folder, "in", subject).mkdir(parents=True)
    ...         write_mesh(f"{folder}/in/{subject}/femur.ply", triangle)
    ...     write_mesh(f"{folder}/in/s2/patella.ply", triangle)
    ...     try:
    ...         Subjects.create(f"{folder}/out", f"{folder}/in")
    ...     except InputError as error:
    ...         print(str(error).partition("; ")[2])
    s2 has patella, and no other subject has it, so it corresponds to nothing; take it out or rename it
    """

    folder: Path
    collections: Mapping[str, Collection]
    doubts: tuple[Doubt, ...] = ()

    @classmethod
    def create(
        cls,
        folder: str | Path,
        source: str | Path,
        *,
        template: str | None = None,
        reflect: str | Iterable[str] | None = None,
        units: Mapping[str, str] | None = None,
        **options: Any,
    ) -> Subjects:
        """Make a collection of each structure, or continue them.

        Parameters
        ----------
        folder : path_like
            Where they are kept.
        source : path_like
            A folder with a folder for each subject, whose files are named like the structures; or a CSV file with columns
            ``subject``, ``structure`` and ``file``, relative to its folder. A subject may lack structures.
        template : str, optional
            Name of a subject, whose structures are the templates. By default, and of a structure that it lacks, that in
            the middle of all.
        reflect : "auto", str or iterable of str, optional
            Subjects that are matched as their mirror images, with all their structures. "auto": those that are laid out
            mirror-wise, see `subject_doubts`.
        units : mapping of str to str, optional
            Units of subjects, by name, as in `Collection.create`.
        **options : Any
            Others of `Collection.create`.

        Raises
        ------
        InputError
            If a subject has a structure twice, structures are named differently, or what `Collection.create` refuses.
        """
        found, folder = structures_of(source), Path(folder).absolute()
        names = {name for files in found.values() for name in files}
        named = [reflect] if isinstance(reflect, str) and reflect != "auto" else reflect
        if (
            strangers := {
                *(named if named and named != "auto" else ()),
                *(units or {}),
                *filter(None, [template]),
            }
            - names
            - {OTHERS}
        ):
            raise InputError(
                f"{', '.join(sorted(strangers))}: no subjects; give their names, such as {min(names)}"
            )
        doubts = subject_doubts(found, () if reflect == "auto" else tuple(named or ()), units or {})
        if named == "auto":
            named = [name for doubt in doubts if doubt.kind == "mirrored" for name in doubt.names]
            doubts = [doubt for doubt in doubts if doubt.kind != "mirrored"]
        made = {}
        for structure, files in found.items():
            own = (
                None
                if units is None
                else {name: unit for name, unit in units.items() if name in {OTHERS, *files}}
            )
            made[structure] = Collection.create(
                folder / structure,
                [Entry(name, file) for name, file in files.items()],
                template=template if template in files else None,
                reflect=None if named is None else [name for name in named if name in files],
                units=own,
                **options,
            )
        write_text(folder / SUBJECTS, json.dumps({"structures": list(made)}, indent=2) + "\n")
        return cls(folder, made, tuple(doubts))

    @classmethod
    def open(cls, folder: str | Path) -> Subjects:
        """Open the subjects in a folder; `FormatError` if it holds none, or its plan is damaged."""
        path = Path(folder).absolute() / SUBJECTS
        try:
            structures = json.loads(path.read_text(encoding="utf-8"))["structures"]
            return cls(path.parent, {name: Collection.open(path.parent / name) for name in structures})
        except FileNotFoundError:
            raise FormatError(f"{folder}: holds no subjects; make them with isomatch collect") from None
        except (ValueError, KeyError, TypeError) as error:
            raise FormatError(f"{path}: not the plan of subjects ({error}); make it again") from None

    def finish(self) -> CorrespondedShapes:
        """Write each subject as one surface, in the topology of all templates, to the folder ``corresponded``.

        Its structures are stacked, see `isomatch.statistics.stacked`; ``measured`` is 0 at vertices that a subject lacks,
        ``structure`` the number of the structure, and ``structures.csv`` has their names. `InputError` if no structure of
        two subjects is in one topology.
        """
        shapes = self.stacked()
        numbers = np.repeat(np.arange(len(shapes.structures)), [*shapes.structures.values()]).astype(np.int32)
        label = Attribute(STRUCTURE, "point", "label", numbers, names=dict(enumerate(shapes.structures)))
        to = self.folder / "corresponded"
        files = {f"{name}.ply": i for i, name in enumerate(shapes.names)}
        with (
            made_folder(to),
            staged(to, STRUCTURES, {file.name for file in to.glob("*.ply")} - set(files)) as new,
        ):
            for file, i in files.items():
                own = [label]
                if shapes.measured is not None:
                    own.append(Attribute(MEASURED, "point", "label", shapes.measured[i].astype(np.uint8)))
                polygons = Polygons.of_triangles(shapes.faces)
                write_asset(new / file, Asset(shapes.vertices[i], polygons, tuple(own)))
            rows = [{"structure": name, "vertices": n} for name, n in shapes.structures.items()]
            write_csv(new / STRUCTURES, rows, ("structure", "vertices"))
        return shapes

    def stacked(self) -> CorrespondedShapes:
        """Read the surfaces of all structures in the topology of their templates, as one shape for each subject."""
        parts = {}
        for structure, collection in self.collections.items():
            if names := surfaces_written(collection):
                parts[structure] = read_shapes(collection.layout.corresponded(name) for name in names)
        if not parts:
            raise InputError(f"{self.folder}: nothing is in one topology; see the pages of the structures")
        return stacked(parts)


def subject_doubts(
    found: Structures, reflected_ones: Iterable[str] = (), units: Iterable[str] = ()
) -> list[Doubt]:
    """Find what hardly belongs together among subjects, from their files alone.

    Parameters
    ----------
    found : mapping of str to mapping of str to Path
        The file of each subject, by structure.
    reflected_ones : iterable of str
        Subjects that are mirror images, which is taken into account.
    units : iterable of str
        Subjects whose units are known, so that their sizes are not questioned.

    Returns
    -------
    list of Doubt
        - *units*: the size of a subject, or of one of its structures, suggests others, see `size_factors`.
        - *twice*: all structures of two subjects are the same, but for a motion, their size, and the order of vertices.
        - *mirrored*: the structures are laid out as in a mirror.
        - *unlike*: a structure is another thing than in most subjects: shorter or longer, wider or thinner, or like
          another structure; or it lies elsewhere among the others. *far* is not told, as subjects may be anywhere.

    Notes
    -----
    Each file is read once. Of a structure are compared its centroid, the principal radii of its surface, and vectors that
    turn and reflect with it: its skewness, alone and times the covariance. These points of all structures, labelled, are
    looked at by `doubtful_positions`.
    """
    turned = set(reflected_ones)
    subjects = sorted({name for files in found.values() for name in files}, key=natural_order)
    points = np.full((len(subjects), len(found), 4, 3), np.nan)
    radii = np.full((len(subjects), len(found), 3), np.nan)
    rows: dict[str, dict[str, dict[str, Any]]] = {structure: {} for structure in found}
    for k, (structure, files) in enumerate(found.items()):
        for name, file in files.items():
            try:
                mesh = mesh_from(file)
            except IsomatchError:
                continue  # its collection tells
            mesh = reflected(mesh) if name in turned else mesh
            if 0 < mesh.area < np.inf:
                i = subjects.index(name)
                points[i, k], radii[i, k] = _marks(mesh)
                rows[structure][name] = {"hash": mesh.content_hash, **likeness_of(mesh)}
    doubts = [
        Doubt("twice", (name, other), "are the same subject, in all structures")
        for name, other in _twice(rows)
    ]
    there = np.isfinite(radii[:, :, 0])
    doubts += _units_and_kinds(subjects, list(found), radii, there, set(units))
    told = {name for doubt in doubts for name in doubt.names if doubt.kind in ("units", "unlike")}
    # all of one size, and what a subject lacks where it is in another one
    sizes = np.linalg.norm(radii, axis=2)
    kept = [i for i, name in enumerate(subjects) if name not in told and there[i].any()]
    marks = {}
    for k, structure in enumerate(found):
        if own := [i for i in kept if there[i, k]]:
            scales = [np.nanmedian(sizes[i] / np.nanmedian(sizes, axis=0)) for i in own]
            at = points[own, k] / np.array(scales)[:, None, None]
            names = tuple(subjects[i] for i in own)
            marks[structure] = CorrespondedShapes(names, at, np.array([[0, 1, 2]]))
    if len(kept) > 1:
        laid = stacked(marks)
        reasons = {
            "mirrored": "is laid out as in a mirror: left and right exchanged? (--reflect NAME or auto)"
        }
        reasons["unlike"] = "has its structures elsewhere among each other than most subjects, or another one"
        doubts += [
            doubt._replace(reason=reasons[doubt.kind])
            for doubt in doubtful_positions(laid.names, laid.vertices)
            if doubt.kind == "mirrored" or (doubt.kind == "unlike" and len(kept) >= FEWEST)
        ]
    return doubts


def _marks(mesh: Mesh) -> tuple[FloatArray, FloatArray]:
    """Points (4, 3) that move, turn and reflect with a surface, and its principal radii (3,)."""
    corners = mesh.vertices[mesh.sound_faces]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    share, at = areas / areas.sum(), corners.mean(axis=1)
    centre = share @ at
    y = at - centre
    covariance = np.einsum("i,ij,ik->jk", share, y, y)
    skewness = np.einsum("i,ij,ik,ik->j", share, y, y, y) / np.trace(covariance)
    size = np.trace(covariance)
    once = covariance @ skewness / size
    arms = np.array([0 * skewness, skewness, once, covariance @ once / size])
    return centre + arms, np.sqrt(np.maximum(np.linalg.eigvalsh(covariance), 1e-12 * size))


def _twice(rows: Mapping[str, Mapping[str, dict[str, Any]]]) -> Iterator[tuple[str, str]]:
    """Find subjects all of whose structures are those of another one, with that."""
    alike: Counter[tuple[str, str]] = Counter()
    for own in rows.values():
        alike.update((each.other, each.name) for each in alike_shapes(dict(own)) if each.kind == "copy")
    for (name, other), count in alike.items():
        if count == sum(name in own and other in own for own in rows.values()):
            yield name, other


def _units_and_kinds(
    subjects: list[str],
    structures: list[str],
    radii: FloatArray,
    there: np.ndarray[Any, Any],
    known: set[str],
) -> Iterator[Doubt]:
    """Find subjects and structures of other sizes than most, and structures that are other things."""
    sizes = np.linalg.norm(radii, axis=2)  # (m, s)
    factors = np.ones_like(sizes)
    for k in range(len(structures)):
        factors[there[:, k], k] = size_factors(sizes[there[:, k], k])
    for i, name in enumerate(subjects):
        odd = np.flatnonzero(there[i] & (factors[i] != 1))
        if len(odd) and name not in known:
            factor = float(np.exp(np.log(factors[i, odd]).mean()))
            units = likely_units(factor)
            if len(odd) == there[i].sum():
                yield Doubt(
                    "units",
                    (name,),
                    f"{told_factor(factor)} (--units {name}={units[0] if units else 'UNIT'})",
                )
            else:
                which = ", ".join(structures[k] for k in odd)
                yield Doubt("units", (name,), f"mixes units or structures: its {which} {told_factor(factor)}")
    forms = np.log(radii / sizes[:, :, None])
    with np.errstate(invalid="ignore"):
        middle = np.array([np.median(forms[there[:, k], k], axis=0) for k in range(len(structures))])
        scale = np.array([np.median(sizes[there[:, k], k]) for k in range(len(structures))])
    away = np.abs(forms - middle).max(axis=2)  # from the usual form, as a factor
    for i, name in enumerate(subjects):
        for k in np.flatnonzero(there[i] & (factors[i] == 1)).tolist():
            spread = np.median(away[there[:, k], k])
            if away[i, k] > max(np.log(UNLIKE), 6 * 1.4826 * spread):
                others = np.abs(forms[i, k] - middle).max(axis=1) + np.abs(np.log(sizes[i, k] / scale))
                like = structures[int(others.argmin())]
                hint = f", and is most like a {like}" if like != structures[k] else ""
                factor = np.exp(away[i, k])
                reason = f"has another thing as its {structures[k]}: its proportions differ by a factor of {factor:.3g}"
                yield Doubt("unlike", (name,), reason + hint)
