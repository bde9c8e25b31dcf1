"""The map from the vertices of one surface to another, as an operator on values at vertices."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, Unpack

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import csc_array, csr_array

from isomatch._core.arrays import AnyArray, FloatArray, IntArray, array_of
from isomatch._core.errors import DescriptorError, FormatError, MapError
from isomatch._core.first_use import PlotOptions, Shown, visualization
from isomatch.correspondence.functional_maps import FunctionalMap, fit_functional_map
from isomatch.correspondence.map_arrays import (
    UNMATCHED,
    check_map,
    compose_arrays,
    invert_arrays,
    pull_back_rows,
    push_forward_rows,
)
from isomatch.correspondence.map_files import map_parts, write_map
from isomatch.io import SurfaceLike, mesh_from, surface_from
from isomatch.spectral import LaplaceBasis, laplace_basis
from isomatch.surfaces import PrecisePoints, Surface, surface_in_use

if TYPE_CHECKING:
    from matplotlib.figure import Figure

logger = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False, repr=False)
class Correspondence(Shown):
    """A map from a source to a target, source → target.

    Parameters
    ----------
    vertices : (n_source,) array of int
        Target vertex of each source vertex; −1 if unmatched.
    n_target : int
        Number of target vertices.
    faces : (n_source, 3) array of int, optional
        Corners of the target triangle that contains the precise image; −1 if unmatched. By default
        the target vertex three times.
    barycentric : (n_source, 3) array of float, optional
        Barycentric coordinates of the precise image in that triangle: not negative, with sum 1. By
        default (1, 0, 0).
    source_hash, target_hash : str
        ``content_hash`` of the two surfaces; maps refuse surfaces with another one. Empty if not
        known.

    Examples
    --------
    >>> f = Correspondence([2, 0, -1], n_target=3)
    >>> f
    Correspondence(source 3 → target 3, 1 unmatched)
    >>> f.pull_back([10.0, 20.0, 30.0])
    array([30., 10., nan])
    >>> f.pull_back(["arm", "leg", "head"]).tolist()
    ['head', 'arm', '']
    >>> f.reversed().vertices
    array([ 1, -1,  0])
    """

    vertices: IntArray
    n_target: int
    faces: IntArray
    barycentric: FloatArray
    source_hash: str
    target_hash: str

    def __init__(
        self,
        vertices: ArrayLike,
        n_target: int,
        faces: ArrayLike | None = None,
        barycentric: ArrayLike | None = None,
        source_hash: str = "",
        target_hash: str = "",
    ) -> None:
        image, points = check_map(vertices, n_target, faces, barycentric)
        for array in (image, *points):
            array.flags.writeable = False
        arrays = {"vertices": image, "faces": points.corners, "barycentric": points.barycentric}
        hashes = {"source_hash": source_hash, "target_hash": target_hash}
        for field, value in {**arrays, "n_target": int(n_target), **hashes}.items():
            object.__setattr__(self, field, value)

    def __repr__(self) -> str:
        n_unmatched = int((~self.matched).sum())
        tail = f", {n_unmatched} unmatched" if n_unmatched else ""
        return f"Correspondence(source {len(self.vertices)} → target {self.n_target}{tail})"

    def plot(
        self,
        source: SurfaceLike = None,
        target: SurfaceLike = None,
        *,
        values: ArrayLike | None = None,
        **options: Unpack[PlotOptions],
    ) -> Figure:
        """Draw both surfaces, corresponding points in the same colour, by `visualization.draw_map`.

        Parameters
        ----------
        source, target : Mesh, PointCloud, or what `surface_from` takes, optional
            The surfaces; by default those of `surfaces`.
        values : (n_source,) array_like of float, optional
            Numbers, such as an expected error, that colour another picture of the source; ``nan``
            is grey.
        **options
            ``label`` of the values, ``colour_map``, ``title``, ``width``, ``view``, as for
            `plot_surface`.

        Raises
        ------
        MapError, DescriptorError, MeshError, SettingError
            If the surfaces are others or no longer held, the values do not fit, a surface has no
            area, or there is no such colour map.
        """
        draw, surfaces = visualization(), self.surfaces(source, target)
        label, colour_map = options.pop("label", ""), options.pop("colour_map", None)
        panel = None if values is None else draw.ValuePanel(values, label, colour_map=colour_map)
        figure: Figure = draw.draw_map(*map(draw.drawable, surfaces), self, values=panel, **options)
        return figure

    def surfaces(self, source: SurfaceLike = None, target: SurfaceLike = None) -> tuple[Surface, Surface]:
        """Return the surfaces given, or the map's own; `MapError` for others, or if no variable holds its own."""
        self.check_fits(source, target)

        def held(name: str, surface: SurfaceLike, own_hash: str) -> Surface:
            found = surface_in_use(own_hash) if surface is None else surface_from(surface)
            if not isinstance(found, Surface):
                raise MapError(
                    f"the {name} of this map is no longer held by any variable; give source and target"
                )
            return found

        return held("source", source, self.source_hash), held("target", target, self.target_hash)

    @property
    def shape(self) -> tuple[int, int]:
        """(n_source, n_target): the shape of the map as a matrix."""
        return len(self.vertices), self.n_target

    @property
    def matched(self) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        """(n_source,) whether each source vertex has an image."""
        return self.vertices >= 0

    def check_fits(self, source: SurfaceLike = None, target: SurfaceLike = None) -> None:
        """Raise `MapError` if numbers of vertices or hashes of surfaces differ from the map."""
        for name, surface, n, own_hash, other_hash in (
            ("source", source, len(self.vertices), self.source_hash, self.target_hash),
            ("target", target, self.n_target, self.target_hash, self.source_hash),
        ):
            if surface is None:
                continue
            surface = surface_from(surface)
            if surface.n_vertices != n:
                raise MapError(
                    f"{self!r} is not a map of this {name}, which has {surface.n_vertices} vertices; give the {name} "
                    "that the map was made for"
                )
            if own_hash and own_hash != surface.content_hash:
                remedy = (
                    "source and target are exchanged"
                    if other_hash == surface.content_hash
                    else f"give the {name} that the map was made for, or match again"
                )
                raise MapError(
                    f"{self!r} is a map of another {name}: {surface!r} has as many vertices, but their positions or the "
                    f"faces differ; {remedy}"
                )

    def pull_back(self, values: ArrayLike, fill: object = None) -> AnyArray:
        """Pull values back from the target to the source.

        Real and complex floats are interpolated at the precise images. Integers, booleans and texts
        are labels, and never averaged: each source vertex takes the label of its target vertex,
        ``vertices``. Region numbers that are stored as floats are interpolated unless made
        integers; `carry_attributes` recognises them.

        Parameters
        ----------
        values : (n_target, ...) array_like
            One row for each target vertex.
        fill : scalar, optional
            Value of unmatched vertices. By default ``nan``, −1 for signed integers, False, or an
            empty text; values of other types have no default.

        Returns
        -------
        (n_source, ...) array
            float64 or complex128, or labels of the given type; a text may be longer if ``fill`` is.

        Raises
        ------
        DescriptorError
            If there is not one row for each target vertex, the type cannot hold ``fill``, or
            ``fill`` is needed and not given.
        """
        rows = array_of(values, "values", DescriptorError)
        if rows.shape[:1] != (self.n_target,):
            raise DescriptorError(
                f"values have shape {rows.shape}, expected one row for each of the {self.n_target} target vertices; "
                "pull_back goes from the target to the source, use reversed() for the other way"
            )
        return pull_back_rows(rows, self.vertices, self.faces, self.barycentric, fill)

    def __matmul__(self, values: ArrayLike) -> AnyArray:
        """Pull back, as `pull_back`."""
        return self.pull_back(values)

    def to_sparse(self) -> csr_array:
        """Return the barycentric weights as a matrix (n_source, n_target), with empty rows if unmatched.

        It multiplies floats as `pull_back` does, except that unmatched vertices get 0 instead of
        ``nan``.
        """
        matched = np.flatnonzero(self.matched)
        entries = self.barycentric[matched].ravel(), (np.repeat(matched, 3), self.faces[matched].ravel())
        matrix = csr_array(entries, shape=self.shape)
        matrix.eliminate_zeros()
        return matrix

    @property
    def T(self) -> csc_array:
        """The transposed matrix (n_target, n_source): ⟨f.to_sparse() @ x, y⟩ = ⟨x, f.T @ y⟩."""
        return self.to_sparse().T

    def to_functional(
        self, source: LaplaceBasis | SurfaceLike, target: LaplaceBasis | SurfaceLike, k: int = 50
    ) -> FunctionalMap:
        """Express the map as a (k, k) matrix from target to source Laplace–Beltrami functions.

        Parameters
        ----------
        source, target : LaplaceBasis, or what `surface_from` takes
            Bases of the surfaces of the map, with one row for each vertex, or the surfaces
            themselves.
        k : int
            Number of functions.

        Returns
        -------
        FunctionalMap
            Least squares over the matched vertices, weighted by their areas. O(n k²).

        Raises
        ------
        MapError, MeshError
            If a basis has fewer functions, or a surface is not one of this map or has no basis.
        """
        bases = []
        for name, basis, n in (("source", source, self.shape[0]), ("target", target, self.shape[1])):
            if not isinstance(basis, LaplaceBasis):
                surface = surface_from(basis)
                self.check_fits(**{name: surface})
                basis = laplace_basis(surface, k)
            if len(basis.vectors) != n or len(basis.values) < k:
                raise MapError(
                    f"{basis!r} is no basis of {k} functions at the {n} vertices of the {name}; compute "
                    f"laplace_basis({name}, {k})"
                )
            bases.append(LaplaceBasis(basis.vectors[:, :k], basis.values[:k], basis.weights, basis.notes))
        matched = self.matched
        weights = np.sqrt(bases[0].weights[matched, None])
        pulled = self.pull_back(np.asarray(bases[1].vectors, dtype=np.float64))[matched]
        return FunctionalMap(
            fit_functional_map(weights * bases[0].vectors[matched], weights * pulled), *bases
        )

    def push_forward(
        self, values: ArrayLike, source_areas: ArrayLike, target_areas: ArrayLike | None = None
    ) -> FloatArray:
        """Push values forward from the source to the target, weighted by areas.

        With P = ``to_sparse()`` and the areas A_s, A_t of the vertices, this is A_t⁻¹ Pᵀ A_s g for
        densities, which preserves the integral over the matched vertices: Σ A_t (push g) = Σ A_s g.
        It is the adjoint of P with respect to areas, and 0 at vertices without an image. Without
        ``target_areas`` it is the mean (Pᵀ A_s g) / (Pᵀ A_s 1) of the values that arrive, which
        preserves constants, and ``nan`` if none arrives. ``reversed(source, target)`` pulls values
        to every target vertex instead.

        Parameters
        ----------
        values : (n_source,) or (n_source, q) array_like of float
            One row for each source vertex.
        source_areas : (n_source,) array_like of float
            Areas of the vertices, such as ``source.vertex_areas``.
        target_areas : (n_target,) array_like of float, optional
            Areas of the vertices, to preserve integrals.

        Returns
        -------
        (n_target,) or (n_target, q) array of float

        Raises
        ------
        DescriptorError
            If values or areas have another number of rows, or the values are not floats: labels
            have no mean.

        Examples
        --------
        >>> f = Correspondence([0, 0, 2], n_target=3)
        >>> f.push_forward([1.0, 2.0, 3.0], source_areas=[1.0, 3.0, 1.0])
        array([1.75,  nan, 3.  ])
        >>> f.push_forward([1.0, 2.0, 3.0], source_areas=[1.0, 3.0, 1.0], target_areas=[2.0, 1.0, 2.0])
        array([3.5, 0. , 1.5])
        """
        return push_forward_rows(self.T, self.matched, values, source_areas, target_areas)

    def then(
        self, other: Correspondence, middle: SurfaceLike = None, target: SurfaceLike = None
    ) -> Correspondence:
        """Compose two maps: the source of this map → the target of the other.

        A precise image inside a triangle of the middle surface is mapped between the images of its
        corners, if they lie in one triangle. Otherwise it gets the image of the nearest corner;
        with the surfaces, it gets the point of the target nearest to the interpolated positions,
        but not across a tear: corners whose images are more than four times as far from the image
        of the nearest corner as usual, relative to the middle surface, are left out. The exact
        product, whose rows may spread over three triangles, is ``self.to_sparse() @
        other.to_sparse()``.

        Parameters
        ----------
        other : Correspondence
            Map from the target of this map, the middle surface.
        middle, target : Mesh, or what `mesh_from` takes; optional
            Source and target of the other map; both or neither.

        Raises
        ------
        MapError
            If the other map does not start from the target of this map, or does not fit these
            meshes.
        """
        if len(other.vertices) != self.n_target:
            raise MapError(
                f"cannot compose {self!r} with {other!r}: the first ends on {self.n_target} vertices, the second "
                f"starts from {len(other.vertices)}"
            )
        if self.target_hash and other.source_hash and self.target_hash != other.source_hash:
            raise MapError(
                f"cannot compose {self!r} with {other!r}: the first ends on another surface than the second starts "
                "from, though with as many vertices; give maps onto and from the same one"
            )
        if (middle is None) != (target is None):
            raise MapError(
                "to compose maps on their surfaces, both are needed; give middle and target, or neither"
            )
        if middle is not None:
            middle, target = mesh_from(middle), mesh_from(target)
            other.check_fits(middle, target)
        points = PrecisePoints(self.faces, self.barycentric)
        images = PrecisePoints(other.faces, other.barycentric)
        image, images = compose_arrays(self.vertices, points, other.vertices, images, middle, target)
        return Correspondence(image, other.n_target, *images, self.source_hash, other.target_hash)

    def reversed(
        self, source: SurfaceLike = None, target: SurfaceLike = None, within: float = 0.05
    ) -> Correspondence:
        """Return the map target → source.

        Without the surfaces, a target vertex gets the first source vertex that is mapped to it.
        Usually a fifth of the vertices or more get none; the repr counts them as unmatched. With
        the surfaces, each target vertex gets the point of the source whose image is nearest, the
        inverse of the piecewise linear map; a vertex of the source if either surface has no
        triangles.

        Parameters
        ----------
        source, target : Mesh, PointCloud, Graph, or what `surface_from` takes; optional
            The surfaces of the map; both or neither.
        within : float
            Target vertices farther from any image, along edges, remain unmatched; in √(target
            area). They lie on parts that the source does not have, such as the rest of the target
            if the source is a part of it.

        Raises
        ------
        MapError
            If only one surface is given, or a surface does not fit the map.
        """
        points: tuple[ArrayLike | None, ArrayLike | None] = None, None
        if source is None and target is None:
            image = np.full(self.n_target, UNMATCHED, dtype=np.int64)
            # the first vertex of each image is written last, and stays
            rows = np.flatnonzero(self.matched)[::-1]
            image[self.vertices[rows]] = rows
        elif source is None or target is None:
            raise MapError("to reverse a map precisely, both surfaces are needed; give source and target")
        else:
            source, target = surface_from(source), surface_from(target)
            self.check_fits(source, target)
            images = PrecisePoints(self.faces, self.barycentric)
            points, reached = invert_arrays(self.vertices, images, source, target, within)
            image = np.where(reached, points[0][:, 0], UNMATCHED)
        return Correspondence(image, len(self.vertices), *points, self.target_hash, self.source_hash)

    def save(self, path: str | Path) -> None:
        """Write everything to an ``.npz`` file, or the vertices alone to a text file (any other suffix).

        Line i of the text, counted from 0 and without the header, is the target vertex of source
        vertex i. An existing file is replaced only by a complete one; `UnwritableFileError` if the
        file cannot be written.
        """
        write_map(Path(path), vars(self))

    @classmethod
    def of_points(cls, points: PrecisePoints, n_target: int) -> Correspondence:
        """Take points of a surface of n vertices as a map onto it.

        Examples
        --------
        >>> Correspondence.of_points(PrecisePoints(np.array([[0, 1, 2]]), np.array([[0.2, 0.5, 0.3]])), 3).vertices
        array([1])
        """
        nearest = points.corners[np.arange(len(points.corners)), points.barycentric.argmax(axis=1)]
        return cls(nearest, n_target, *points)

    @classmethod
    def load(
        cls,
        path: str | Path,
        n_target: int | None = None,
        n_source: int | None = None,
        *,
        counts_from: int | None = None,
        variable: str | None = None,
    ) -> Correspondence:
        """Read a file that `save` wrote, or the map of any other program.

        Parameters
        ----------
        path : path_like
            An ``.npz`` file, an array (``.npy``), variables of MATLAB (``.mat``, before version
            7.3), or text with one vertex on each line (any other suffix). Files of earlier versions
            of isomatch are read too.
        n_target : int, optional
            Number of target vertices. A file that names another number is refused; if a file names
            none, the default is its largest index + 1.
        n_source : int, optional
            Number of source vertices. A map of another number is refused; if a file has several
            arrays, the one of this length is the map.
        counts_from : {0, 1}, optional
            First index. By default 1 if the largest index is ``n_target`` and none is 0, which is
            logged as a warning, and otherwise 0. It is needed if a file of MATLAB could count from
            either. Files of isomatch count from 0. −1 and nan, and 0 if indices count from 1, mean
            unmatched.
        variable : str, optional
            Name of the array, if a file has several of the same length.

        Raises
        ------
        FormatError
            If the file is missing (`MissingFileError`), holds no map, several, or one between other
            shapes, could count from 0 or from 1, or was written by an isomatch that is too new.
        SettingError
            If ``counts_from`` is neither 0 nor 1.
        """
        file = read_map(path, n_target, n_source, counts_from=counts_from, variable=variable)
        if file.note:
            logger.warning("%s", file.note)
        return file.map


class MapFile(NamedTuple):
    """A map read from a file, and how its indices were understood, see `IndexBase`."""

    map: Correspondence
    counts_from: int
    is_certain: bool
    is_likely: bool
    note: str


def read_map(
    path: str | Path,
    n_target: int | None = None,
    n_source: int | None = None,
    *,
    counts_from: int | None = None,
    variable: str | None = None,
    allow_doubt: bool = False,
) -> MapFile:
    """Read a map as `Correspondence.load`, and return how its indices were understood, without warning.

    With ``allow_doubt``, a map of MATLAB that can count from 0 or from 1 is not refused: it counts
    from 0 and is not certain.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "map.txt"
    ...     np.savetxt(file, [3, 1, 2], fmt="%d")
    ...     file_map = read_map(file, n_target=3)
    >>> file_map.map.vertices.tolist(), file_map.counts_from, file_map.note
    ([2, 0, 1], 1, 'map.txt: counts from 1, as its largest index, 3, is the number of target vertices')
    """
    path = Path(path)
    try:
        parts, base = map_parts(path, n_target, n_source, counts_from, variable)
        if path.suffix.lower() == ".mat" and not (base.is_likely or allow_doubt):
            indices = parts["vertices"][parts["vertices"] >= 0]
            raise FormatError(
                f"{path}: can count from 0 or from 1, with indices {indices.min()}…{indices.max()}; say which by "
                "counts_from (--counts-from), or save it as a text that counts from 0"
            )
        return MapFile(Correspondence(**parts), *base)
    except MapError as error:
        raise FormatError(f"{path}: {error}") from None
