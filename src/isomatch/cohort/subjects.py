"""Subjects of several surfaces: a collection for each structure, all of them as one shape, and where they touch."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from collections.abc import Collection as Names
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal, NamedTuple
from unicodedata import normalize

import numpy as np
from scipy.sparse import coo_array, csc_array
from scipy.sparse.csgraph import laplacian

from isomatch._core.arrays import BoolArray, FloatArray
from isomatch._core.errors import InputError, IsomatchError
from isomatch._core.files import legible, made_folder, require_names, staged
from isomatch._core.skipped import tell_skipped
from isomatch._core.tables import read_table
from isomatch._core.texts import natural_order, write_csv
from isomatch.cohort import shape_statistics
from isomatch.cohort.collection import Collection
from isomatch.cohort.finish import surfaces_written
from isomatch.cohort.plan import Entry
from isomatch.cohort.shape_statistics import MEASURED, STRUCTURES, CorrespondedShapes, Doubt
from isomatch.cohort.unusual_shapes import OTHERS
from isomatch.io import Asset, Attribute, mesh_from, meshes_among, write_asset
from isomatch.matching import Outcome
from isomatch.spectral import factorise_for_threads
from isomatch.surfaces import Mesh, PrecisePoints, nearest_on_surface, reflected

Structures = Mapping[str, Mapping[str, Path]]  # the file of each subject, by structure
SURE = (Outcome.CONVERGED, Outcome.PARTIAL)  # maps that tell sides
TOUCHING = 0.1  # √area of the smaller of two structures: points nearer to the other touch it
LEAST_TOUCHING = 0.2  # share of the area of the smaller one that has to touch the other
LEAST_HELD = 0.6  # the same, for points to be kept together: sheets have more, joints that slide less
REACH = 0.1  # √area: how far beyond the contact points are still moved
ROUNDS = 4  # the slip of knee cartilage hardly falls in further ones
SLIPPED = 0.5  # √area of a vertex: a point that still slips by more has no counterpart
MOST_WITHOUT = 0.5  # share of the points that touch: with more, a structure stays as it was matched


def structures_of(source: str | Path) -> dict[str, dict[str, Path]]:
    """List the files of subjects by structure, see `run`; none of what is one surface each."""
    path = Path(source)
    listed = list[tuple[str, str, Path]]()
    columns = ("subject", "structure", "file")
    if path.suffix.lower() == ".csv" and path.is_file():
        table = read_table(path)
        if {*columns} <= {title.lower() for title in table.titled(always=True).titles}:
            rows = table.records(columns, (), "give these columns")
            listed = [(row["subject"], row["structure"], path.parent / row["file"]) for row in rows]
    elif path.is_dir() and not meshes_among(path.iterdir()):
        folders = [each for each in path.iterdir() if each.is_dir() and not each.name.startswith(".")]
        found_in = {each: meshes_among(each.iterdir()) for each in folders}
        listed = [(each.name, file.stem, file) for each, files in found_in.items() for file in files]
        if empty := sorted(each.name for each, files in found_in.items() if listed and not files):
            tell_skipped(f"{path}: {', '.join(empty)} left out, with no surface that can be read")
    found: dict[str, dict[str, Path]] = {}
    for subject, structure, file in sorted(listed, key=lambda row: [*map(natural_order, row[1::-1])]):
        own = found.setdefault(legible(structure), {})
        if legible(subject) in own:
            raise InputError(f"{source}: {subject} has {structure} twice; keep one")
        own[legible(subject)] = file.resolve()
    require_names(found, "structure", source, "name it otherwise")
    require_names(
        {name for files in found.values() for name in files}, "subject", source, "name it otherwise"
    )
    for names in (found, {name: None for files in found.values() for name in files}):
        alike = [name for name, n in Counter(map(_folded, names)).items() if n > 1]
        if twice := [name for name in names if _folded(name) in alike]:
            raise InputError(
                f"{source}: {', '.join(twice)} differ in case or accents alone; name them alike, or otherwise"
            )
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


def _folded(name: str) -> str:
    return normalize("NFC", name).casefold()


def subject_collections(
    folder: str | Path,
    found: Structures,
    *,
    template: str | None = None,
    reflect: Literal["auto"] | Iterable[str] | None = None,
    units: Mapping[str, str] | None = None,
    **options: Any,
) -> dict[str, Collection]:
    """Make a collection for each structure, or continue them; one that lies on a larger one is led by that.

    The template of the structure that most subjects have is that of all others, where they have it.
    """
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
    free = sorted((each for each in found if each not in below), key=lambda each: -len(found[each]))
    for structure in (*free, *below):
        files = found[structure]
        made[structure] = Collection.create(
            Path(folder) / structure,
            [Entry(name, file) for name, file in files.items()],
            template=template if template in files else None,
            reflect=reflect if reflect in (None, "auto") else [name for name in named if name in files],
            units=units and {name: unit for name, unit in units.items() if name in {OTHERS, *files}},
            leader=made.get(below.get(structure, "")),
            beside=made.get(free[0]),
            **options,
        )
    return made


def sides_of(
    collections: Mapping[str, Collection], mirrored: Names[str] = ()
) -> tuple[set[str], list[tuple[str, str]]]:
    """Decide which subjects are reflected, each as a whole; also name structures, with subjects, that ask otherwise.

    ``mirrored`` are those whose layout fits the others better as its mirror image, see `subject_doubts`.
    """
    # Most votes decide: of the layout, and of each structure whose map is sure. What reflects no subject tells
    # no sides, and has none. Of another template, or of most, a side may be the opposite one.
    all_rows = {name: own.rows() for name, own in collections.items()}
    templates = {name: own.chosen_template(all_rows[name]) or "" for name, own in collections.items()}
    turned = {name: set(all_rows[name].reflected(own.names)) for name, own in collections.items()}
    first, *others = collections
    for structure in others:
        names = set(collections[structure].names)
        shared = names & set(collections[first].names)
        if templates[structure] != templates[first] and 2 * len(
            (turned[structure] ^ turned[first]) & shared
        ) > len(shared):
            turned[structure] = names - turned[structure]
    subjects = dict.fromkeys(name for own in collections.values() for name in own.names)
    of_layout = set(subjects) - set(mirrored) if templates[first] in mirrored else set(mirrored)
    reflected, against = set[str](), list[tuple[str, str]]()
    for subject in subjects:
        asked = {}
        for structure, rows in all_rows.items():
            pair = templates[structure], subject
            is_sure = rows.is_current(pair) and all(each.outcome in SURE for each in rows.pairs[pair].sides)
            if turned[structure] and (is_sure or subject == pair[0]):
                asked[structure] = subject in turned[structure]
        votes = [*asked.values(), *([subject in of_layout] if of_layout else [])]
        is_turned = sum(votes) * 2 >= len(votes) > 0
        reflected |= {subject} if is_turned else set()
        against += [(structure, subject) for structure, ask in asked.items() if ask != is_turned]
    return reflected, against


def finish_subjects(
    folder: str | Path, collections: Mapping[str, Collection], *, keep_contacts: bool = True
) -> list[Gap]:
    """Write each subject as one surface, see `stacked` and `contacts_kept`, to ``corresponded``, with tables."""
    parts = {}
    for name, own in collections.items():
        if written := surfaces_written(own):
            parts[name] = shape_statistics.read_shapes(map(own.layout.corresponded, written))
    if not parts:
        raise InputError(f"{folder}: no structure is in one topology; see their pages")
    templates = [own.chosen_template(own.rows()) for own in collections.values()]
    shapes, gaps = contacts_kept(
        shape_statistics.stacked(parts), max(templates, key=templates.count), move=keep_contacts
    )
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
    shapes = shape_statistics.stacked(marks)
    doubts = shape_statistics.doubtful_positions(shapes.names, shapes.vertices)
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


class Gap(NamedTuple):
    """How two structures of a subject lie on each other; the lengths are nan where nothing is measured."""

    subject: str
    structure: str
    other: str
    gap_before: float
    overlap_before: float
    slip_before: float
    gap_after: float
    overlap_after: float
    slip_after: float
    without: float  # share of the points that touch which have no counterpart
    note: str  # why nothing was moved


class _Contact(NamedTuple):
    other: str
    points: PrecisePoints  # of the other, nearest to each vertex of a structure
    distances: FloatArray  # (n,) over those of points that touch
    area: float  # of what touches

    @classmethod
    def of(cls, mesh: Mesh, other: str, larger: Mesh) -> _Contact:
        points = nearest_on_surface(larger, mesh.vertices)
        apart = np.linalg.norm(points.interpolated(larger.vertices) - mesh.vertices, axis=1)
        distances = apart / (TOUCHING * np.sqrt(mesh.area))
        return cls(other, points, distances, float(mesh.vertex_areas[distances < 1].sum()))

    @property
    def touches(self) -> BoolArray:
        return self.distances < 1


def beneath(meshes: Mapping[str, Mesh]) -> dict[str, str]:
    """Find the larger structure on which each lies by 0.6 of its area, as cartilage on its bone; largest first."""
    contacts = _contacts_of(meshes, LEAST_HELD)
    return {name: max(own, key=lambda each: each.area).other for name, own in contacts.items() if own}


def contacts_kept(
    shapes: CorrespondedShapes, of: str | None = None, *, move: bool = True
) -> tuple[CorrespondedShapes, list[Gap]]:
    """Keep points of structures together that lie on each other in a subject, and measure gap and overlap in all."""
    # that subject is ``of``, by default the first of those with most structures. A structure, such as cartilage, that
    # touches a larger one by 0.6 of its area or more follows that; points beyond its edge have no counterpart: they
    # continue it, and are not measured. A vertex b was nearest to the point p of the larger structure; in each subject
    # it moves by p − q, where q is now nearest to it, then back to its surface, four times. Movements u are smooth: they
    # minimise Σ w ‖u − (p − q)‖² + Σ ‖u_i − u_j‖² + μ Σ ‖u‖², with weights w that fall to 0 at twice the distance that
    # counts as touching, and μ so that u falls off within 0.1 √area. Gaps are of two structures that touch by a fifth of
    # the area of the smaller one: of its points that touch in the template, the largest distances outside and inside the
    # larger one, and the mean distance of its nearest point from the corresponding one.
    parts = shape_statistics.slices_of(shapes.structures)
    vertices, measured = shapes.vertices.copy(), shapes.seen.copy()
    has = {name: np.asarray(measured[:, part].any(axis=1)) for name, part in parts.items()}
    at = int(np.sum([*has.values()], axis=0).argmax()) if of not in shapes.names else shapes.names.index(of)
    whole, own_parts = shapes.mesh(at), {name: part for name, part in parts.items() if has[name][at]}
    meshes = {name: shape_statistics.structure_of(whole, part) for name, part in own_parts.items()}
    gaps = list[Gap]()

    def mesh_of(places: FloatArray, i: int, name: str) -> Mesh:
        return meshes[name].moved(places[i, parts[name]])

    for name, touching in _contacts_of(meshes, LEAST_TOUCHING).items():
        sheets = [each for each in touching if each.area >= LEAST_HELD * meshes[name].area]
        held = max(sheets, key=lambda each: each.area, default=None)
        smooth = _smoothing(meshes[name], held) if held else None
        for i in np.flatnonzero(has[name]).tolist():
            own, note = mesh_of(shapes.vertices, i, name), ""
            if move and held and smooth and has[held.other][i] and i != at:
                new, kept = _followed(own, mesh_of(vertices, i, held.other), held, smooth)
                if (without := 1 - kept[held.touches].mean()) > MOST_WITHOUT:
                    note = f"left as matched: {without:.0%} of what touches would have no counterpart"
                else:
                    vertices[i, parts[name]] = new
                    measured[i, parts[name]] &= kept
            for each in touching:
                if has[each.other][i]:
                    counted = each.touches & measured[i, parts[name]]
                    before, after = (
                        _lies(each, mesh_of(places, i, name), mesh_of(places, i, each.other), rows)
                        for places, rows in ((shapes.vertices, each.touches), (vertices, counted))
                    )
                    without = float(1 - counted.sum() / each.touches.sum())
                    gaps.append(Gap(shapes.names[i], name, each.other, *before, *after, without, note))
    return replace(shapes, vertices=vertices, measured=measured), gaps


def _contacts_of(meshes: Mapping[str, Mesh], least: float) -> dict[str, list[_Contact]]:
    """Find where each structure touches a larger one, by a share of its area; largest structures first."""
    ordered = sorted(meshes, key=lambda name: -meshes[name].area)
    found = {a: [_Contact.of(meshes[a], b, meshes[b]) for b in ordered[:i]] for i, a in enumerate(ordered)}
    return {a: [each for each in own if each.area >= least * meshes[a].area] for a, own in found.items()}


def _smoothing(mesh: Mesh, contact: _Contact) -> Callable[[FloatArray], FloatArray]:
    """Return what makes movements (n, 3) of all points of a structure of those of the points that touch."""
    # the minimum of Σ w |u − d|² + Σ |u_i − u_j|² + μ Σ |u|² solves (W + L + μ I) u = W d; along a line u″ = μ u beyond
    # the contact, in edges, and an edge is about as long as the root of the area of a vertex: μ = (edge / reach)²
    ones, n = np.ones(len(mesh.edges)), mesh.n_vertices
    links = coo_array((ones, mesh.edges.T), shape=(n, n)).tocsr()
    fading = np.clip(2 - contact.distances, 0, 1)
    weights = fading**2 * (3 - 2 * fading)
    stiffness = 1 / (mesh.n_vertices * REACH**2)
    solve = factorise_for_threads(csc_array(laplacian(links + links.T)), weights + stiffness)
    return lambda pulls: np.asarray(solve(weights[:, None] * pulls))


def _followed(
    own: Mesh, other: Mesh, contact: _Contact, smooth: Callable[[FloatArray], FloatArray]
) -> tuple[FloatArray, BoolArray]:
    """Move the points of a structure of a subject along it; and tell which have a counterpart on it."""
    goals, here = contact.points.interpolated(other.vertices), own.vertices
    for _ in range(ROUNDS):
        here = _nearest(own, here + smooth(goals - _nearest(other, here)))
    left = goals - _nearest(other, here)
    is_beyond = contact.touches & (np.linalg.norm(left, axis=1) > SLIPPED * np.sqrt(own.area / len(here)))
    return np.where(is_beyond[:, None], here + left, here), ~is_beyond


def _nearest(mesh: Mesh, positions: FloatArray) -> FloatArray:
    return nearest_on_surface(mesh, positions).interpolated(mesh.vertices)


def _lies(contact: _Contact, own: Mesh, other: Mesh, rows: BoolArray) -> tuple[float, float, float]:
    """Largest gap and overlap, and mean slip, of some points of a contact; nan of none."""
    if not rows.any():
        return np.nan, np.nan, np.nan
    here = own.vertices[rows]
    nearest = nearest_on_surface(other, here)
    away = here - nearest.interpolated(other.vertices)
    outside = np.einsum("ij,ij->i", away, nearest.interpolated(other.vertex_normals)) >= 0
    apart = np.linalg.norm(away, axis=1)
    slip = np.linalg.norm(contact.points.interpolated(other.vertices)[rows] - (here - away), axis=1)
    gap, overlap = (float(apart[side].max(initial=0.0)) for side in (outside, ~outside))
    return gap, overlap, float(slip.mean())
