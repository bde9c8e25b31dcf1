"""Shapes with known correspondence on disk, each read when it is asked for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from isomatch._core.arrays import IntArray
from isomatch._core.errors import FormatError, MissingFileError
from isomatch._core.settings import generator
from isomatch.evaluation import read_indices
from isomatch.surfaces import Mesh, PrecisePoints
from isomatch_lab.sets.shape_files import arrays, read_landmarks, read_shape, stored_indices


@dataclass(frozen=True, eq=False)
class KnownShape:
    """A shape and its vertices whose correspondence to other shapes is known.

    Parameters
    ----------
    mesh : Mesh
        The shape, in its file's units.
    marks : (q,) array of int
        Vertices in an order common to all shapes of a class: mark k of one corresponds to mark k of the other.
    mirrored : (q,) array of int, optional
        The left–right mirror image of each mark.
    """

    mesh: Mesh
    marks: IntArray
    mirrored: IntArray | None = None


@dataclass(frozen=True, eq=False)
class BenchmarkPair:
    """Two shapes and the true images of some source vertices.

    Parameters
    ----------
    name : str
        "source-target".
    source, target : Mesh
        The surfaces.
    truth : (q, 2) array of int
        Rows (source vertex, target vertex).
    mirrored : (q, 2) array of int, optional
        The symmetric truth, where it is known.
    symmetric : bool
        The shapes are truly symmetric, so that the mirrored truth is as good as the direct one. Otherwise errors against
        the mirrored truth are only reported in addition.
    alone : (m,) array of int, optional
        Source vertices that have no counterpart, where the truth tells of every vertex which has one.
    points : PrecisePoints, optional
        The q true images as points in target triangles, where they are known so precisely; ``truth`` then has the nearest
        corner.
    unit : float, optional
        By what errors are divided, in mesh units: by default √(target area). For a part, √area of the whole.
    moved : (n_target,) array of int, optional
        Where the target was relabelled, the vertex that each vertex of its file became.
    group : str
        Name of the group of pairs in its set.
    notes : tuple of str
        What was decided when the truth was read.
    """

    name: str
    source: Mesh
    target: Mesh
    truth: IntArray
    mirrored: IntArray | None = None
    symmetric: bool = True
    alone: IntArray | None = None
    points: PrecisePoints | None = None
    unit: float | None = None
    moved: IntArray | None = None
    group: str = ""
    notes: tuple[str, ...] = ()

    def relabelled(self, seed: int) -> BenchmarkPair:
        """Shuffle and rotate the target, see `relabelled`, so that equal indices and a common pose do not help."""
        target, new = relabelled(self.target, seed)

        def moved(rows: IntArray) -> IntArray:
            return np.column_stack([rows[:, 0], new[rows[:, 1]]])

        return replace(
            self,
            target=target,
            truth=moved(self.truth),
            mirrored=None if self.mirrored is None else moved(self.mirrored),
            points=None if self.points is None else self.points._replace(corners=new[self.points.corners]),
            moved=new,
        )


def relabelled(mesh: Mesh, seed: int) -> tuple[Mesh, IntArray]:
    """Shuffle vertices and faces and rotate at random; also return the new index of each old vertex."""
    rng = generator(seed)
    new = rng.permutation(mesh.n_vertices)
    vertices = np.empty_like(mesh.vertices)
    vertices[new] = mesh.vertices @ Rotation.random(rng=rng).as_matrix().T
    return Mesh(vertices, new[mesh.faces][rng.permutation(mesh.n_faces)]), new


@dataclass(frozen=True, eq=False)
class ShapeSet:
    """Shapes on disk and the truth between them.

    Parameters
    ----------
    name : str
        Name of the set.
    shapes : mapping of str to Path
        File of each shape.
    truths : mapping of str to Path
        Files of truth by name: marks by ``<shape>`` or ``<class>``, their mirror images by the same name with ``.sym``, a
        dense map by ``<source>_<target>``.
    shared : bool
        Shapes of a class share their triangulation, so that equal vertices correspond.
    listed : tuple of (str, str)
        The pairs that the set comes with, if any.
    landmarks : Path, optional
        Folder of landmarks, see `with_landmarks`.

    Examples
    --------
    >>> from isomatch_lab.sets import tosca
    >>> cats = tosca("data/TOSCA")  # doctest: +SKIP
    >>> cats["cat0"].mesh, cats.pair("cat0", "cat1").truth  # doctest: +SKIP
    """

    name: str
    shapes: Mapping[str, Path] = field(repr=False)
    truths: Mapping[str, Path] = field(repr=False)
    shared: bool
    listed: tuple[tuple[str, str], ...] = field(default=(), repr=False)
    landmarks: Path | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """All shapes, in natural order."""
        return tuple(self.shapes)

    @property
    def pairs(self) -> tuple[tuple[str, str], ...]:
        """The pairs that the set lists; otherwise those with a dense map, or else all ordered pairs within a class."""
        within = [(a, b) for a in self.names for b in self.names if a != b and _group(a) == _group(b)]
        return self.listed or tuple(pair for pair in within if self._map(*pair)) or tuple(within)

    def mesh(self, name: str) -> Mesh:
        """Read a shape; `MissingFileError` if there is none of that name."""
        if name not in self.shapes:
            raise MissingFileError(f"{self.name} has no shape {name!r}; choose from {', '.join(self.names)}")
        return read_shape(self.shapes[name], name)

    def __getitem__(self, name: str) -> KnownShape:
        """Read a shape with its marks; `MissingFileError` if there is no such shape, or no truth about it."""
        mesh = self.mesh(name)
        marks, mirrored = self._marks(name, mesh) if self.landmarks is None else self._landmarks(name)
        for vertices in (marks, mirrored):
            if vertices is not None and vertices.max(initial=-1) >= mesh.n_vertices:
                raise FormatError(
                    f"{self.shapes[name]}: known vertices reach {vertices.max()}, but its vertices are "
                    f"0…{mesh.n_vertices - 1}; truth and shape are of different versions, so obtain both from one source"
                )
        if mirrored is not None and len(mirrored) != len(marks):
            raise FormatError(
                f"{self.shapes[name]}: {len(marks)} known vertices but {len(mirrored)} mirror images; give one for each"
            )
        return KnownShape(mesh, marks, mirrored)

    def pair(self, source: str, target: str) -> BenchmarkPair:
        """Read two shapes and the truth between them.

        Parameters
        ----------
        source, target : str
            Names of shapes.

        Returns
        -------
        BenchmarkPair
            With the vertices in the order of the files. Where the triangulation is shared, equal vertices correspond, so
            relabel the target before matching, as `benchmark_set` does. With mirrored truth if the target's symmetry is
            known.

        Raises
        ------
        MissingFileError
            If either shape or its truth is missing.
        FormatError
            If a file cannot be read, or the two shapes have no common truth.
        """
        name = f"{source}-{target}"
        dense = self._map(source, target)
        if dense is not None and self.landmarks is None:
            mesh, onto, image = self.mesh(source), self.mesh(target), read_indices(dense)
            if len(image) != mesh.n_vertices or image.max() >= onto.n_vertices:
                raise FormatError(
                    f"{dense}: {len(image)} entries up to {image.max() + 1} do not map the {mesh.n_vertices} vertices of "
                    f"{source} to the {onto.n_vertices} of {target}"
                )
            return BenchmarkPair(name, mesh, onto, np.column_stack([np.arange(len(image)), image]))
        a, b = self[source], self[target]
        if len(a.marks) != len(b.marks) or (self.shared and _group(source) != _group(target)):
            raise FormatError(
                f"{self.name}: {len(a.marks)} known vertices of {source} and {len(b.marks)} of {target} do not "
                "correspond; choose shapes of one class and version"
            )
        truth = np.column_stack([a.marks, b.marks])
        mirrored = None if b.mirrored is None else np.column_stack([a.marks, b.mirrored])
        return BenchmarkPair(name, a.mesh, b.mesh, truth, mirrored, symmetric=False)

    def with_landmarks(self, folder: str | Path) -> ShapeSet:
        """Take hand-picked landmarks as the only marks.

        Parameters
        ----------
        folder : path_like
            Holds a file for each shape, or for each class where poses share a triangulation: ``cat0``, ``cat``,
            ``tosca_cat`` or ``tosca``, for example, with the suffix ``.txt`` or ``.npz``. Text has one landmark a line:
            its vertex and, where a symmetry is known, the number of the landmark that is its mirror image; ``#`` starts
            a comment. An archive has the same in arrays ``landmark_vertices`` and ``symmetry_perm``. All count from 0.

        Returns
        -------
        ShapeSet
            The same shapes, with landmarks as marks. A missing file is a `MissingFileError` when a shape is read.
        """
        return replace(self, landmarks=Path(folder))

    def _map(self, source: str, target: str) -> Path | None:
        return self.truths.get(f"{source}_{target}") or self.truths.get(f"{source}-{target}")

    def _marks(self, name: str, mesh: Mesh) -> tuple[IntArray, IntArray | None]:
        """Vertices in common order and their mirror images, from the archive or from text."""
        path = self.shapes[name]
        archive = arrays(path) if path.suffix == ".npz" else {}
        sides: list[IntArray | None] = []
        for key, suffix in (("vts", ""), ("vts_sym", ".sym")):
            file = self.truths.get(name + suffix) or self.truths.get(_group(name) + suffix)
            sides.append(
                read_indices(file) if file else stored_indices(path, key) if key in archive else None
            )
        marks, mirrored = sides
        if marks is None and self.shared:
            marks = np.arange(mesh.n_vertices)
        if marks is None:
            raise MissingFileError(
                f"{path}: there is no truth for {name}; expected {name}.vts, one vertex a line counted from 1, in the "
                "folder of the set"
            )
        return marks, mirrored

    def _landmarks(self, name: str) -> tuple[IntArray, IntArray | None]:
        """Landmarks of a shape, and their mirror images."""
        folder = self.landmarks or Path()
        keys = (name, _group(name), f"{self.name}_{_group(name)}", self.name)
        for path in (folder / f"{key}{suffix}" for key in keys for suffix in (".txt", ".npz")):
            if path.exists():
                return read_landmarks(path)
        raise MissingFileError(
            f"{folder}: no landmarks of {name}; expected {', '.join(keys[:-1])} or {keys[-1]}, with .txt or .npz"
        )


def _group(name: str) -> str:
    """Class of a shape: its name without the number of the pose."""
    return name.rstrip("0123456789")
