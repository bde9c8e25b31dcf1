"""Shapes in correspondence: the same vertices in every shape, some of them not measured."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from hashlib import blake2b
from itertools import accumulate, pairwise
from pathlib import Path
from typing import TypeVar

import numpy as np

from isomatch._core.arrays import BoolArray, FloatArray, IntArray, numbers_of
from isomatch._core.cached import cached_property
from isomatch._core.errors import (
    FormatError,
    LandmarkError,
    MeshError,
    MissingFileError,
    NotConvergedError,
    some,
)
from isomatch._core.files import legible
from isomatch._core.skipped import tell_skipped
from isomatch._core.tables import read_table
from isomatch._core.texts import natural_order
from isomatch.cohort.shape_statistics.procrustes import Scale, aligned_to, generalised_procrustes
from isomatch.correspondence import Correspondence
from isomatch.io import FORMATS, Asset, Polygons, meshes_among, read_as_far_as_possible
from isomatch.landmarks import Landmarks
from isomatch.surfaces import Mesh

MIRRORED = "_mirrored"  # ending of the names of shapes that are mirror images

T = TypeVar("T")
MEASURED = "measured"  # attribute of points: 1 where a surface was measured, 0 where it is interpolated
MIN_MEASURED = 0.5  # a shape is left out if the share of its measured vertices is below this; chosen
CORRESPONDED = "corresponded"  # folder, inside the folder of a collection, of its shapes in one topology
STRUCTURES = "structures.csv"  # name of the table of the number of vertices of each structure of subjects
# missing vertices are in place once none moves by more than this share of the mean's size; chosen
TOLERANCE = 1e-6
MAX_ROUNDS = 500  # largest number of rounds that place missing vertices; chosen: enough if 97 % are missing


def slices_of(structures: Mapping[str, int]) -> dict[str, slice]:
    """Return the slice of the vertices of each structure: numbers 5 and 2 give 0:5 and 5:7."""
    ends = accumulate(structures.values())
    return {name: slice(end - n, end) for (name, n), end in zip(structures.items(), ends)}


def structure_of(mesh: Mesh, part: slice) -> Mesh:
    """Return the mesh of the vertices of one structure."""
    inside = (mesh.faces[:, 0] >= part.start) & (mesh.faces[:, 0] < part.stop)
    return Mesh(mesh.vertices[part], mesh.faces[inside] - part.start)


@dataclass(frozen=True, eq=False, repr=False)
class CorrespondedShapes:
    """Shapes in one topology, or landmarks: vertex i of one corresponds to vertex i of every other.

    Examples
    --------
    >>> triangle = Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    >>> CorrespondedShapes.of_meshes({"small": triangle, "large": triangle.moved(2 * triangle.vertices)})
    CorrespondedShapes(2 shapes of 3 vertices)
    """

    names: tuple[str, ...]  #: names of the m shapes, all different
    #: (m, n, 3) positions of their vertices, in one unit, all finite; landmarks also (m, n, 2)
    vertices: FloatArray
    #: (f, 3) 0-based vertex indices of the triangles that they share; landmarks have none
    faces: IntArray = field(default_factory=lambda: np.zeros((0, 3), dtype=np.int64))
    left_out: tuple[str, ...] = ()  #: the shapes that were left out, each with the reason
    #: (m, n) which vertices have a counterpart on the shape, and are not interpolated; by default all
    measured: BoolArray | None = None
    #: for subjects of several surfaces, see `stacked`: number of vertices of each structure
    structures: Mapping[str, int] = field(default_factory=dict)
    landmarks: Landmarks | None = None  #: landmarks of one shape, with their names and curves

    def __post_init__(self) -> None:
        vertices = numbers_of(self.vertices, "vertices", MeshError)
        dims = (3,) if len(self.faces) else (2, 3)
        if vertices.ndim != 3 or vertices.shape[2] not in dims or len(vertices) != len(self.names):
            expected = f"({len(self.names)}, n, 3): a row x, y, z for each vertex of each named shape"
            raise MeshError(f"vertices have shape {vertices.shape}, expected {expected}")
        if not len(vertices):
            raise MeshError("no shapes; give at least one")
        if repeated := [name for name, count in Counter(self.names).items() if count > 1]:
            raise MeshError(f"several shapes are named {', '.join(repeated)}; give each its own name")
        bad = np.flatnonzero(~np.isfinite(vertices).all(axis=(1, 2)))
        if len(bad):
            problem = f"shape {self.names[bad[0]]} has vertices without a position ({len(bad)} such shapes)"
            raise MeshError(f"{problem}; leave it out, as CorrespondedShapes.of_meshes does")
        no_faces = np.zeros((0, 3), dtype=np.int64)
        faces = Mesh(vertices[0], self.faces).sound_faces if len(self.faces) else no_faces
        vertices.flags.writeable = False
        measured = None if self.measured is None else np.asarray(self.measured, dtype=bool)
        if measured is not None and measured.shape != vertices.shape[:2]:
            expected = f"expected {vertices.shape[:2]}: a row for each shape"
            raise MeshError(f"measured has shape {measured.shape}, {expected}")
        measured = None if measured is None or measured.all() else measured
        if self.structures and sum(self.structures.values()) != vertices.shape[1]:
            problem = f"{self.structures} are not {vertices.shape[1]} vertices"
            raise MeshError(f"{problem}; give those of each structure")
        names, left_out = tuple(self.names), tuple(self.left_out)
        vars(self).update(names=names, left_out=left_out, vertices=vertices, faces=faces, measured=measured)

    def __repr__(self) -> str:
        return f"CorrespondedShapes({len(self)} shapes of {self.n_vertices} {self.points})"

    def __len__(self) -> int:
        return len(self.names)

    @classmethod
    def of_meshes(
        cls,
        meshes: Mapping[str, Mesh],
        measured: Mapping[str, BoolArray] | None = None,
        polygons: Mapping[str, Polygons] | None = None,
        structures: Mapping[str, int] | None = None,
    ) -> CorrespondedShapes:
        """Collect meshes in natural order of names, without those that are not in correspondence.

        A mesh is left out if its faces, or the ``polygons`` they were cut from, differ from those
        of most meshes by more than the order of faces and corners; if it has a vertex without a
        finite position, as unmatched vertices are written; or if less than half of its vertices
        were ``measured``, an array (n,) for each mesh with some that were not, and there are no
        ``structures``. Polygons are cut as in the first mesh. ``left_out`` tells which and why.
        `MeshError` if none remains.
        """
        ordered = {name: meshes[name] for name in sorted(meshes, key=natural_order)}
        if not ordered:
            raise MeshError("no shapes; give at least one")
        outlines = dict(polygons or {n: Polygons.of_triangles(mesh.faces) for n, mesh in ordered.items()})
        forms = {n: (mesh.n_vertices, _form(outlines[n]), len(outlines[n])) for n, mesh in ordered.items()}
        common = _most_common(forms.values())
        masks = dict(measured or {})
        kept, left_out = {}, []
        for name, mesh in ordered.items():
            unplaced = np.flatnonzero(~np.isfinite(mesh.vertices).all(axis=1))
            if forms[name] != common:
                left_out.append(f"{name}: other faces than most shapes ({mesh!r})")
            elif len(unplaced):
                left_out.append(f"{name}: vertices without a position, {some(unplaced)}")
            elif name in masks and not structures and masks[name].mean() < MIN_MEASURED:
                left_out.append(f"{name}: only {masks[name].mean():.0%} of its vertices were measured")
            else:
                kept[name] = mesh
        if not kept:
            raise MeshError("; ".join(["no shapes", *left_out, "give at least one"]))
        if not common[2]:
            raise MeshError("the shapes have no faces; give meshes, or read points as landmarks")
        positions = np.array([mesh.vertices for mesh in kept.values()])
        windings = {name: _digest(outlines[name].corners) for name in kept}
        usual = _most_common(windings.values())
        faces = next(mesh.faces for name, mesh in kept.items() if windings[name] == usual)
        all_vertices = np.ones(positions.shape[1], dtype=bool)
        seen = np.array([masks.get(name, all_vertices) for name in kept])
        return cls(tuple(kept), positions, faces, tuple(left_out), seen, dict(structures or {}))

    @classmethod
    def of_landmarks(cls, specimens: Mapping[str, Landmarks]) -> CorrespondedShapes:
        """Make shapes of landmarks, see `read_specimens`; those without a place are not measured.

        `LandmarkError` if specimens have different landmarks, or one has a place in none of them.

        Examples
        --------
        >>> CorrespondedShapes.of_landmarks({"a": Landmarks([[0, 0], [1, 0]]), "b": Landmarks([[0, 0], [2, 0]])})
        CorrespondedShapes(2 shapes of 2 landmarks)
        """
        if not specimens:
            raise LandmarkError("no specimens; give the landmarks of at least one")
        names, first = tuple(specimens), next(iter(specimens.values()))
        if other := [n for n in names if specimens[n].positions.shape != first.positions.shape]:
            raise LandmarkError(f"{other[0]} has other landmarks than {names[0]}; give the same of each")
        positions = np.array([marks.positions for marks in specimens.values()])
        placed = np.isfinite(positions).all(axis=2)
        if len(missing := np.flatnonzero(~placed.any(axis=0))):
            named = first.names[missing[0]] or missing[0] + 1
            raise LandmarkError(f"the landmark {named} has a place in no specimen; leave it out")
        if len(few := np.flatnonzero(placed.mean(axis=1) < MIN_MEASURED)):
            problem = f"{names[few[0]]} lacks {(~placed[few[0]]).sum()} of {len(first)} landmarks"
            raise LandmarkError(f"{problem}, more than half; leave it out")
        centroids = np.nanmean(positions, axis=1, keepdims=True)
        positions = np.where(placed[:, :, None], positions, centroids)
        return cls(names, positions, measured=placed, landmarks=first)

    @property
    def points(self) -> str:
        """What corresponds: vertices, or landmarks."""
        return "vertices" if len(self.faces) else "landmarks"

    @property
    def marks(self) -> tuple[str, ...]:
        """Names of landmarks, or their numbers from 1 without names; numbers of vertices from 0."""
        if self.landmarks is None:
            return tuple(map(str, range(self.n_vertices)))
        return tuple(name or str(i) for i, name in enumerate(self.landmarks.names, start=1))

    @property
    def links(self) -> IntArray:
        """(l, 2) landmarks that follow each other on the curves, as the lines of a wireframe."""
        curves = self.landmarks.curves if self.landmarks else ()
        ways = [(*curve.rows, *(curve.rows[:1] if curve.closed else ())) for curve in curves]
        return np.array([pair for way in ways for pair in pairwise(way)], dtype=np.int64).reshape(-1, 2)

    @property
    def seen(self) -> BoolArray:
        """(m, n) which vertices were measured, also if all were."""
        return np.ones(self.vertices.shape[:2], dtype=bool) if self.measured is None else self.measured

    @property
    def n_vertices(self) -> int:
        """Number of vertices of each shape."""
        return int(self.vertices.shape[1])

    @cached_property
    def area_weights(self) -> FloatArray:
        """(n,) share of each vertex in the area, averaged over the shapes; the sum is 1.

        All structures have the same sum, so that large ones do not drown small ones. All landmarks
        have the same share.
        """
        if not len(self.faces):
            return np.full(self.n_vertices, 1 / self.n_vertices)
        shares = np.zeros(self.n_vertices)
        parts = slices_of(self.structures or {"": self.n_vertices}).values()
        for i, name in enumerate(self.names):
            areas = self.mesh(i).vertex_areas
            for part in parts:
                area = areas[part].sum()
                if not 0 < area < np.inf:
                    raise MeshError(f"shape {name} has area {area}; leave it out, or use weights='uniform'")
                shares[part] += areas[part] / area
        return np.asarray(shares / shares.sum())

    def mesh(self, i: int) -> Mesh:
        """Return one of the shapes."""
        return self._topology.moved(self.vertices[i])

    @cached_property
    def _topology(self) -> Mesh:
        return Mesh(self.vertices[0], self.faces)

    def moved(self, vertices: FloatArray) -> CorrespondedShapes:
        """Return the same shapes at other positions, (m, n, 3)."""
        return replace(self, vertices=vertices)

    def mirrored(self, left_right: Sequence[Correspondence]) -> CorrespondedShapes:
        """Return the shapes followed by their mirror images, moved onto them.

        The left–right map of each shape, see `left_right_map`, gives the point on the other side
        for each vertex. A vertex without one stays in its place in the mirror image, and is not
        measured there.
        """
        m, n = self.vertices.shape[:2]
        fits = all(sides.shape == (n, n) and sides.matched.any() for sides in left_right)
        if len(left_right) != m or not fits:
            raise MeshError(f"{left_right!r} are no maps of {m} shapes of {n} vertices onto themselves")
        images, seen = self.vertices.copy(), self.seen.copy()
        for shape, image, own_seen, sides in zip(self.vertices, images, seen, left_right):
            matched = sides.matched
            other = sides.pull_back(shape, fill=0.0) * [-1.0, *np.ones(shape.shape[1] - 1)]
            image[matched] = aligned_to(shape, other, matched / matched.sum())[matched]
            own_seen[:] = own_seen[sides.vertices] & matched
        names = (*self.names, *(name + MIRRORED for name in self.names))
        vertices, measured = np.concatenate([self.vertices, images]), np.concatenate([self.seen, seen])
        return replace(self, names=names, vertices=vertices, measured=measured)


def _digest(faces: IntArray) -> bytes:
    return blake2b(np.ascontiguousarray(faces).tobytes()).digest()


def _form(polygons: Polygons) -> bytes:
    """Digest which points each polygon joins, in any order."""
    starts = np.cumsum(polygons.sizes) - polygons.sizes
    rows = []
    for size in np.unique(polygons.sizes).tolist():
        of_size = np.sort(polygons.corners[starts[polygons.sizes == size, None] + np.arange(size)], axis=1)
        rows.append(of_size[np.lexsort(of_size.T)].ravel())
    return _digest(np.concatenate([np.sort(polygons.sizes), *rows]))


def _most_common(values: Iterable[T]) -> T:
    """Return the most frequent value, the first on a tie."""
    return Counter(values).most_common(1)[0][0]


def read_shapes(source: str | Path | Iterable[str | Path]) -> CorrespondedShapes:
    """Read meshes in one topology from a folder, an ``isomatch collect`` folder, or given files.

    A shape has the name of its file without the suffix; ``left_out`` names files that are not in
    correspondence with the others. The attribute ``measured`` of PLY files tells which vertices
    were measured; a table ``structures.csv`` beside them, which surfaces subjects are made of.
    """
    paths = _files_of(Path(source)) if isinstance(source, str | Path) else [Path(path) for path in source]
    files = {legible(path.stem): path for path in paths}
    if len(files) < len(paths):
        counts = Counter(legible(path.stem) for path in paths)
        repeated = [name for name, count in counts.items() if count > 1]
        raise FormatError(f"{source}: several files are named {', '.join(repeated)}; keep one of each")
    assets = {name: read_as_far_as_possible(path) for name, path in files.items()}
    meshes = {name: Mesh(asset.placed_points, asset.polygons.triangles) for name, asset in assets.items()}
    if any(mesh.n_faces for mesh in meshes.values()):
        for name in [name for name, mesh in meshes.items() if not mesh.n_faces]:
            tell_skipped(f"{name}: left out, as it has no faces")
            del meshes[name]
    polygons = {name: assets[name].polygons for name in meshes}
    masks = ((name, _read_measured(files[name], assets[name])) for name in meshes)
    measured = {name: mask for name, mask in masks if mask is not None}
    table = paths[0].parent / STRUCTURES if paths else Path(STRUCTURES)
    structures = _structures_in(table) if paths and table.exists() else {}
    return CorrespondedShapes.of_meshes(meshes, measured, polygons, structures)


def _structures_in(table: Path) -> dict[str, int]:
    try:
        return {line["structure"]: int(line["vertices"]) for line in read_table(table).records()}
    except (KeyError, ValueError):
        problem = "not the structures of subjects; its columns are structure, vertices"
        raise FormatError(f"{table}: {problem}") from None


def read_corresponding(path: str | Path, faces: IntArray) -> tuple[Mesh, BoolArray | None]:
    """Read a mesh, cut like triangles (f, 3) if they fit, and its ``measured``, if any."""
    asset = read_as_far_as_possible(path)
    triangles = faces if _is_cut_as(asset.polygons, faces) else asset.polygons.triangles
    return Mesh(asset.placed_points, triangles), _read_measured(path, asset)


def _is_cut_as(polygons: Polygons, triangles: IntArray) -> bool:
    if len(triangles) != (polygons.sizes - 2).sum():
        return False
    of = np.repeat(np.arange(len(polygons)), polygons.sizes - 2)  # number of the polygon of each triangle
    first = (np.cumsum(polygons.sizes) - polygons.sizes)[of, None]
    whole = polygons.sizes[of] == 3
    n = max(int(polygons.corners.max(initial=0)), int(triangles.max(initial=0))) + 1
    polygon_corners = np.repeat(np.arange(len(polygons)), polygons.sizes) * n + polygons.corners
    is_equal = np.array_equal(triangles[whole], polygons.corners[first[whole] + np.arange(3)])
    return is_equal and bool(np.isin(of[:, None] * n + triangles, polygon_corners).all())


def _read_measured(file: str | Path, asset: Asset) -> BoolArray | None:
    if Path(file).suffix.lower() != ".ply":
        return None
    masks = [x.values for x in asset.attributes if (x.name, x.domain) == (MEASURED, "point")]
    return np.asarray(masks[0] != 0) if masks and masks[0].ndim == 1 else None


def _files_of(folder: Path) -> list[Path]:
    corresponded = folder / CORRESPONDED
    folder = corresponded if corresponded.is_dir() else folder
    if not folder.is_dir():
        raise MissingFileError(f"{folder}: no such folder; give a folder of meshes in one topology")
    files = meshes_among(folder.iterdir())
    if not files:
        raise FormatError(f"{folder}: no meshes; give a folder of {', '.join(FORMATS)} files in one topology")
    return files


def filled(
    shapes: CorrespondedShapes, weights: FloatArray | None = None, scale: Scale = "keep"
) -> CorrespondedShapes:
    """Move vertices that were not measured onto the mean of those that were.

    After `generalised_procrustes` with these weights, a missing vertex lies on the mean: it adds no
    variance, and does not turn or shift its shape. One that no shape measured stays where it is.

    Notes
    -----
    Alignment and means alternate until nothing moves, which is expectation maximisation for one
    mean and equal deviations everywhere. A round takes the time of `generalised_procrustes`.
    """
    measured = shapes.measured
    if measured is None:
        return shapes
    stays = measured | ~measured.any(axis=0)
    count = stays.sum(axis=0)[:, None]
    vertices = shapes.vertices.copy()
    for _ in range(MAX_ROUNDS):
        now = generalised_procrustes(vertices, weights, scale)
        mean = np.einsum("sn,sni->ni", stays, now.aligned) / count
        placed = (mean - now.translations[:, None]) @ now.rotations / now.scales[:, None, None]
        moved = np.abs(np.where(stays[:, :, None], 0.0, placed - vertices)).max(axis=(1, 2)) * now.scales
        vertices = np.where(stays[:, :, None], vertices, placed)
        if moved.max() <= TOLERANCE * np.sqrt(((mean - mean.mean(axis=0)) ** 2).sum(axis=1).mean()):
            return replace(shapes, vertices=vertices)
    problem = f"the mean of shapes of which parts are missing still moves after {MAX_ROUNDS} rounds"
    raise NotConvergedError(f"{problem}; leave out those of which little was measured")


def measured_variances(aligned: FloatArray, shapes: CorrespondedShapes) -> FloatArray:
    """(n,) variance of each vertex of shapes (m, n, 3) that measured it; nan for fewer than two."""
    measured = shapes.measured
    if measured is None:
        return np.asarray(((aligned - aligned.mean(axis=0)) ** 2).sum(axis=(0, 2)) / max(len(aligned) - 1, 1))
    count = measured.sum(axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.einsum("sn,sni->ni", measured, aligned) / count[:, None]
        squares = np.where(measured, ((aligned - mean) ** 2).sum(axis=2), 0.0).sum(axis=0)
        return np.asarray(np.where(count > 1, squares / (count - 1), np.nan))
