"""Subjects of several surfaces: a collection for each structure, and their contacts."""

from __future__ import annotations

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
from isomatch.cohort.plan import OTHER_SHAPES, Entry
from isomatch.cohort.shape_statistics import MEASURED, STRUCTURES, CorrespondedShapes, Doubt
from isomatch.cohort.snapshot import Snapshot
from isomatch.io import Asset, Attribute, mesh_from, meshes_among, write_asset
from isomatch.spectral import factorise_for_threads
from isomatch.surfaces import Mesh, PrecisePoints, nearest_on_surface, reflected

Structures = Mapping[str, Mapping[str, Path]]  # the file of each subject, by structure
# √area of the smaller of two structures: a vertex of the smaller structure touches the larger structure if it is less
# than this away from it; chosen.
CONTACT_DISTANCE = 0.1
# Gaps between two structures are measured if at least this share of the area of the smaller touches the larger; chosen.
MIN_CONTACT_SHARE = 0.2
# A structure is a sheet on a larger structure, and is moved along with it (cartilage on bone, but not the bones of a
# joint), if at least this share of the sheet's area touches the larger structure; chosen.
MIN_SHEET_SHARE = 0.6
# √area of a sheet: outside the contact, its movement falls to 1/e over this length; chosen
MOVEMENT_REACH = 0.1
N_ROUNDS = 4  # times that a sheet is moved; chosen: more times hardly reduce the slip of knee cartilage
# √(mean area of a vertex): a touching vertex of a moved sheet has no counterpart if its nearest point on the larger
# structure is farther than this from the point that it should touch; chosen
MAX_SLIP = 0.5
# A sheet is left where its own matching put it if more than this share of the vertices with which it touches the larger
# structure would have no counterpart there after the move; chosen.
MAX_UNPAIRED_SHARE = 0.5


def structures_of(source: str | Path) -> dict[str, dict[str, Path]]:
    """List the files of subjects by structure, see `run`; empty for shapes of one surface."""
    path = Path(source)
    listed = list[tuple[str, str, Path]]()
    columns = ("subject", "structure", "file")
    if path.suffix.lower() == ".csv" and path.is_file():
        table = read_table(path)
        if {*columns} <= {title.lower() for title in table.titled(always=True).titles}:
            rows = table.records(columns, (), "give these columns")
            listed = [(row["subject"], row["structure"], path.parent / row["file"]) for row in rows]
    elif path.is_dir() and not meshes_among(path.iterdir()):
        folders = [folder for folder in path.iterdir() if folder.is_dir() and folder.name[0] != "."]
        found_in = {folder.name: meshes_among(folder.iterdir()) for folder in folders}
        listed = [(subject, file.stem, file) for subject, files in found_in.items() for file in files]
        if empty := sorted(subject for subject, files in found_in.items() if listed and not files):
            tell_skipped(f"{path}: {', '.join(empty)} left out, with no surface that can be read")
    found: dict[str, dict[str, Path]] = {}
    for subject, structure, file in sorted(listed, key=lambda row: [*map(natural_order, row[1::-1])]):
        files = found.setdefault(legible(structure), {})
        if legible(subject) in files:
            raise InputError(f"{source}: {subject} has {structure} twice; keep one")
        files[legible(subject)] = file.resolve()
    subjects = dict.fromkeys(subject for files in found.values() for subject in files)
    for what, names in {"structure": [*found], "subject": [*subjects]}.items():
        require_names(names, what, source, "name it otherwise")
    for names in ([*found], [*subjects]):
        folded = [normalize("NFC", name).casefold() for name in names]
        if alike := [name for name, fold in zip(names, folded) if folded.count(fold) > 1]:
            remedy = "name them alike, or otherwise"
            raise InputError(f"{source}: {', '.join(alike)} differ in case or accents alone; {remedy}")
    # If a few subjects have a structure and lack a usual one, it might be the usual one under another name.
    usual = [structure for structure, files in found.items() if 2 * len(files) > len(subjects)]
    for structure, files in found.items():
        lacked = [other for other in usual if found[other].keys().isdisjoint(files)]
        who = f"{source}: nothing is matched; {structure} of {', '.join(files)}"
        if structure in ("corresponded", "statistics"):  # folders of results
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
    """Make or continue a collection for each structure; one that lies on a larger one is led by it."""
    names = {name for files in found.values() for name in files}
    named = [] if reflect in (None, "auto") else list(reflect or ())
    if strangers := {*named, *(units or ()), template} - names - {OTHER_SHAPES, None}:
        raise InputError(f"{', '.join(map(str, strangers))}: no subjects; give names such as {min(names)}")
    in_order = sorted(names, key=natural_order)
    # The subject with most structures shows which structure lies on which.
    whole = template or max(in_order, key=lambda name: sum(name in files for files in found.values()))
    meshes = dict[str, Mesh]()
    for structure, files in found.items():
        with suppress(IsomatchError, KeyError):  # the collection tells what is wrong with a file
            meshes[structure] = mesh_from(files[whole])
    leaders = leaders_of(meshes)  # larger structures first
    made = dict[str, Collection]()
    free = sorted((name for name in found if name not in leaders), key=lambda name: -len(found[name]))
    for structure in (*free, *leaders):
        files = found[structure]
        made[structure] = Collection.create(
            Path(folder) / structure,
            [Entry(name, file) for name, file in files.items()],
            template=template if template in files else None,
            reflect=reflect if reflect in (None, "auto") else [name for name in named if name in files],
            units=units and {name: unit for name, unit in units.items() if name in {OTHER_SHAPES, *files}},
            leader=made.get(leaders.get(structure, "")),
            beside=made.get(free[0]),
            **options,
        )
    return made


def sides_of(
    found: Mapping[str, Snapshot], mirrored: Names[str] = ()
) -> tuple[set[str], list[tuple[str, str]]]:
    """Decide which subjects are reflected, given ``mirrored`` layouts; also list what disagrees."""
    # The majority decides: the layout and each structure whose map is sure have a vote. A
    # structure, or a layout, that reflects no subject does not tell sides, and has no vote. Sides
    # are relative to a template, so those of a structure with another template may be opposite.
    templates = {name: known.template or "" for name, known in found.items()}
    turned = {name: set(known.reflected) for name, known in found.items()}
    first, *others = found
    for structure in others:
        names = set(found[structure].names)
        shared = names & set(found[first].names)
        n_opposite = len((turned[structure] ^ turned[first]) & shared)
        if templates[structure] != templates[first] and 2 * n_opposite > len(shared):
            turned[structure] = names - turned[structure]
    subjects = dict.fromkeys(name for known in found.values() for name in known.names)
    by_layout = set(subjects) - set(mirrored) if templates[first] in mirrored else set(mirrored)
    reflected, against = set[str](), list[tuple[str, str]]()
    for subject in subjects:
        asked = {}
        for structure, known in found.items():
            pair, rows = (templates[structure], subject), known.rows
            sides = rows.pairs[pair].sides if rows.is_current(pair) else ()
            is_sure = bool(sides) and all(side.outcome.is_called_right for side in sides)
            if turned[structure] and (is_sure or subject == templates[structure]):
                asked[structure] = subject in turned[structure]
        votes = [*asked.values(), *([subject in by_layout] if by_layout else [])]
        is_reflected = sum(votes) * 2 >= len(votes) > 0
        reflected |= {subject} if is_reflected else set()
        against += [(structure, subject) for structure, vote in asked.items() if vote != is_reflected]
    return reflected, against


def finish_subjects(
    folder: str | Path, collections: Mapping[str, Collection], *, keep_contacts: bool = True
) -> list[Gap]:
    """Write each subject as one surface to ``corresponded``, and the gaps to ``contacts.csv``."""
    parts = {}
    for name, collection in collections.items():
        if written := surfaces_written(collection):
            parts[name] = shape_statistics.read_shapes(map(collection.layout.corresponded, written))
    if not parts:
        raise InputError(f"{folder}: no structure is in one topology; see their pages")
    templates = [collection.chosen_template(collection.rows()) for collection in collections.values()]
    shapes = shape_statistics.stacked(parts)
    shapes, gaps = measure_contacts(shapes, max(templates, key=templates.count), move=keep_contacts)
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
    """Find subjects whose layout is unlike the others', by points that move with each structure."""
    sides = () if reflect in (None, "auto") else tuple(reflect or ())
    marks, faces = dict[str, CorrespondedShapes](), np.array([[0, 1, 2]])  # any one face: it is not used
    for structure, files in found.items():
        points = {}
        for name, file in files.items():
            with suppress(IsomatchError):  # the collection tells what is wrong with a file
                mesh = mesh_from(file)
                if 0 < mesh.area < np.inf:
                    points[name] = _moment_points(reflected(mesh) if name in sides else mesh)
        if points:
            marks[structure] = CorrespondedShapes(tuple(points), np.array([*points.values()]), faces)
    if not marks:
        return []
    shapes = shape_statistics.stacked(marks)
    doubts = shape_statistics.doubtful_positions(shapes.names, shapes.vertices)
    known = {"units": units, "twice": (), "mirrored": ()}
    return [doubt for doubt in doubts if doubt.names[0] not in known.get(doubt.kind, doubt.names)]


def _moment_points(mesh: Mesh) -> FloatArray:
    """Four points (4, 3) that move, turn and reflect with a surface, from its moments."""
    share = mesh.vertex_areas / mesh.area
    centre = share @ mesh.vertices
    y = mesh.vertices - centre
    covariance = (share * y.T) @ y
    size = np.trace(covariance)
    skewness = (share * (y**2).sum(axis=1)) @ y / size
    once = covariance @ skewness / size
    return np.asarray(centre + np.array([0 * skewness, skewness, once, covariance @ once / size]))


class Gap(NamedTuple):
    """How two structures of a subject lie on each other; lengths are nan if not measured."""

    subject: str
    structure: str
    other: str
    gap_before: float  # largest distance of a touching point outside the other structure from that structure
    overlap_before: float  # the same for touching points inside the other structure
    # mean distance, on the other structure, between the nearest point and the counterpart of a touching point
    slip_before: float
    gap_after: float  # the same three after points were moved
    overlap_after: float
    slip_after: float
    without: float  # share of the touching points without a counterpart on the other structure
    note: str  # why the structure was not moved


class _Contact(NamedTuple):
    other: str
    points: PrecisePoints  # points of the other structure nearest to each vertex
    distances: FloatArray  # (n,) distances to these points over the contact distance: vertices below 1 touch
    area: float  # area of the vertices that touch

    @classmethod
    def of(cls, mesh: Mesh, other: str, larger: Mesh) -> _Contact:
        points = nearest_on_surface(larger, mesh.vertices)
        lengths = np.linalg.norm(points.interpolated(larger.vertices) - mesh.vertices, axis=1)
        distances = lengths / (CONTACT_DISTANCE * np.sqrt(mesh.area))
        return cls(other, points, distances, float(mesh.vertex_areas[distances < 1].sum()))

    @property
    def touches(self) -> BoolArray:
        return self.distances < 1


def leaders_of(meshes: Mapping[str, Mesh]) -> dict[str, str]:
    """Find the larger structure on which each lies by 0.6 of its area, as cartilage on bone."""
    found = [(name, contacts) for name, contacts in _contacts_of(meshes, MIN_SHEET_SHARE).items() if contacts]
    return {name: max(contacts, key=lambda contact: contact.area).other for name, contacts in found}


def measure_contacts(
    shapes: CorrespondedShapes, of: str | None = None, *, move: bool = True
) -> tuple[CorrespondedShapes, list[Gap]]:
    """Measure gaps where structures touch in a subject; ``move`` points to keep them together."""
    # Contacts are those in the subject ``of``, by default the first with most structures. A structure,
    # such as cartilage, that touches a larger structure there with 0.6 of its area or more is moved along
    # with the larger structure. Its touching points that then lie beyond the edge of the larger structure
    # have no counterpart: they continue that surface, and are not measured. Let p be the point of the
    # larger structure that is nearest to a vertex in this subject. In another subject, where q is nearest
    # to the vertex, the vertex moves by p − q, and then back to its surface, four times. Movements u are
    # smooth: they minimise
    #     Σ w ‖u − (p − q)‖² + Σ ‖u_i − u_j‖² + μ Σ ‖u‖²
    # with weights w that fall to 0 at twice the contact distance, and μ so that u falls off within
    # 0.1 √area. Gaps are measured where a fifth of the area of the smaller structure, or more, touches the
    # larger one. They are the largest distances of the touching points, outside and inside the larger
    # structure, and the mean distance of q from p.
    parts = shape_statistics.slices_of(shapes.structures)
    vertices, measured = shapes.vertices.copy(), shapes.seen.copy()
    has = {name: np.asarray(measured[:, part].any(axis=1)) for name, part in parts.items()}
    at = int(np.sum([*has.values()], axis=0).argmax()) if of not in shapes.names else shapes.names.index(of)
    whole, own_parts = shapes.mesh(at), {name: part for name, part in parts.items() if has[name][at]}
    meshes = {name: shape_statistics.structure_of(whole, part) for name, part in own_parts.items()}
    gaps = list[Gap]()

    def mesh_of(places: FloatArray, i: int, name: str) -> Mesh:
        return meshes[name].moved(places[i, parts[name]])

    for name, contacts in _contacts_of(meshes, MIN_CONTACT_SHARE).items():
        sheets = [contact for contact in contacts if contact.area >= MIN_SHEET_SHARE * meshes[name].area]
        sheet = max(sheets, key=lambda contact: contact.area, default=None)
        smooth = _smoothing(meshes[name], sheet) if sheet else None
        for i in np.flatnonzero(has[name]).tolist():
            surface, note = mesh_of(shapes.vertices, i, name), ""
            if move and sheet and smooth and has[sheet.other][i] and i != at:
                moved, kept = _follow(surface, mesh_of(vertices, i, sheet.other), sheet, smooth)
                if (without := 1 - kept[sheet.touches].mean()) > MAX_UNPAIRED_SHARE:
                    note = f"left as matched: {without:.0%} of what touches would have no counterpart"
                else:
                    vertices[i, parts[name]] = moved
                    measured[i, parts[name]] &= kept
            for contact in contacts:
                if has[contact.other][i]:
                    counted = contact.touches & measured[i, parts[name]]
                    before, after = (
                        _gap_of(contact, mesh_of(places, i, name), mesh_of(places, i, contact.other), rows)
                        for places, rows in ((shapes.vertices, contact.touches), (vertices, counted))
                    )
                    without = float(1 - counted.sum() / contact.touches.sum())
                    gaps.append(Gap(shapes.names[i], name, contact.other, *before, *after, without, note))
    return replace(shapes, vertices=vertices, measured=measured), gaps


def _contacts_of(meshes: Mapping[str, Mesh], least: float) -> dict[str, list[_Contact]]:
    """Find where each structure touches a larger one with at least a share of its own area; largest first."""
    ordered = sorted(meshes, key=lambda name: -meshes[name].area)
    found = dict[str, list[_Contact]]()
    for i, name in enumerate(ordered):
        contacts = (_Contact.of(meshes[name], other, meshes[other]) for other in ordered[:i])
        found[name] = [contact for contact in contacts if contact.area >= least * meshes[name].area]
    return found


def _smoothing(mesh: Mesh, contact: _Contact) -> Callable[[FloatArray], FloatArray]:
    """Return the function that extends movements (n, 3) of touching points to all points."""
    # The minimum of Σ w |u − d|² + Σ |u_i − u_j|² + μ Σ |u|² solves (W + L + μ I) u = W d. Beyond
    # the contact u″ = μ u along a line, in edges, and an edge is about as long as the root of the
    # area of a vertex: μ = (edge / reach)²
    ones, n = np.ones(len(mesh.edges)), mesh.n_vertices
    links = coo_array((ones, mesh.edges.T), shape=(n, n)).tocsr()
    fading = np.clip(2 - contact.distances, 0, 1)
    weights = fading**2 * (3 - 2 * fading)
    stiffness = 1 / (mesh.n_vertices * MOVEMENT_REACH**2)
    solve = factorise_for_threads(csc_array(laplacian(links + links.T)), weights + stiffness)
    return lambda pulls: np.asarray(solve(weights[:, None] * pulls))


def _follow(
    surface: Mesh, other: Mesh, contact: _Contact, smooth: Callable[[FloatArray], FloatArray]
) -> tuple[FloatArray, BoolArray]:
    """Move the points of a structure along with the other; tell which have counterparts."""
    goals, places = contact.points.interpolated(other.vertices), surface.vertices
    for _ in range(N_ROUNDS):
        places = _nearest(surface, places + smooth(goals - _nearest(other, places)))
    left, longest = goals - _nearest(other, places), MAX_SLIP * np.sqrt(surface.area / len(places))
    is_beyond = contact.touches & (np.linalg.norm(left, axis=1) > longest)
    return np.where(is_beyond[:, None], places + left, places), ~is_beyond


def _nearest(mesh: Mesh, positions: FloatArray) -> FloatArray:
    return nearest_on_surface(mesh, positions).interpolated(mesh.vertices)


def _gap_of(contact: _Contact, surface: Mesh, other: Mesh, rows: BoolArray) -> tuple[float, float, float]:
    """Measure the largest gap and overlap, and mean slip, of some points of a contact."""
    if not rows.any():
        return np.nan, np.nan, np.nan
    points = surface.vertices[rows]
    nearest = nearest_on_surface(other, points)
    away = points - nearest.interpolated(other.vertices)
    outside = np.einsum("ij,ij->i", away, nearest.interpolated(other.vertex_normals)) >= 0
    lengths = np.linalg.norm(away, axis=1)
    slip = np.linalg.norm(contact.points.interpolated(other.vertices)[rows] - (points - away), axis=1)
    gap, overlap = (float(lengths[side].max(initial=0.0)) for side in (outside, ~outside))
    return gap, overlap, float(slip.mean())
