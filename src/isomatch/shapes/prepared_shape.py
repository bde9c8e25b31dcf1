"""`PreparedShape`: all that is computed from one shape alone, for any number of matches; its file."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from hashlib import blake2b
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, Unpack

import numpy as np
from numpy.typing import ArrayLike

from isomatch._core.array_file import Archive, ArrayFormat, Stored, save_arrays
from isomatch._core.arrays import AnyArray, BoolArray, Float32Array, FloatArray, IntArray
from isomatch._core.cached import cached_property
from isomatch._core.errors import FormatError, InputError, SettingError
from isomatch._core.first_use import PlotOptions, Shown, visualization
from isomatch.correspondence import Correspondence, PrecisePoints, SignedPoints
from isomatch.decimation import Decimated, Prolongation
from isomatch.descriptors import (
    BallSignature,
    ball_signature,
    geodesic_distance_descriptor,
    mean_curvature,
    standardised,
)
from isomatch.geodesics import Sampling, distance_along_edges_to_nearest
from isomatch.repair import count_handles, seems_inside_out
from isomatch.settings import Config
from isomatch.shapes.body import Body, Detail, Level
from isomatch.shapes.smooth_shape import SmoothShape, orientation_of
from isomatch.shapes.symmetries import Symmetry, SymmetrySearch
from isomatch.spectral import DistanceBasis, LaplaceBasis, refined_laplace_basis
from isomatch.surfaces import Graph, Mesh, PointCloud

if TYPE_CHECKING:
    from matplotlib.figure import Figure

N_BALLS = 500  # vertices whose balls are computed; other vertices get means of nearby balls; chosen


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class PreparedShape(SmoothShape, Shown):
    """One shape, ready to be matched.

    Vertices below are vertices of the *body*, except in ``body_vertex`` and ``user_vertex``.

    Parameters
    ----------
    surface, body, body_vertex, user_vertex, laplace, sample_vertices, config, detail
        As for ``SmoothShape``.
    scale : float
        Length in the user's units of a length of 1 in the body: √area of the body, or for a graph
        the average distance divided by the average distance in the body.
    distances : DistanceBasis
        Geodesic distance basis of the body, rank k.
    column_vertices : (p,) array of int
        Farthest point samples from which distances were computed.
    columns : (p, n_body) array of float32
        Geodesic distances from each of them.
    extremities : (q,) array of int
        Extremal points of the body.
    extremity_columns : (q, n_body) array of float
        Geodesic distances from each of them.
    requested : Config
        The settings asked for.
    seed : int
        The seed used.
    left_out : float
        Share of the area in components other than the body, or share of the vertices in such
        components of at least 50 vertices, if larger.
    notes : tuple of str
        Sentences on repairs and on left-out components.
    timings : dict of str to float
        Seconds of each stage of the preparation.
    share : float
        Area of the body, divided by the area of the shape.
    others : tuple of Body
        Further components of a mesh that can be matched by themselves, largest first; not prepared.
    finer : Level, optional
        A finer level, on which maps of complete shapes are polished.
    refining : Prolongation, optional
        Between the finer level and the body.
    original : PreparedShape, optional
        For a variant, such as a shape with capped holes: the shape from which the variant was made.
        Maps of the variant are carried back to the original; points on a cap have no image.
    origin : (n_body,) array of int, optional
        For a variant: vertex of the original's body for each vertex of the body; −1 on caps, whose
        vertices come last.
    """

    scale: float
    distances: DistanceBasis
    column_vertices: IntArray
    columns: Float32Array
    extremities: IntArray
    extremity_columns: FloatArray
    requested: Config
    seed: int
    left_out: float
    notes: tuple[str, ...]
    timings: dict[str, float]
    share: float = 1.0
    others: tuple[Body, ...] = ()
    finer: Level | None = None
    refining: Prolongation | None = None
    original: PreparedShape | None = None
    origin: IntArray | None = None

    def save(self, path: str | Path) -> None:
        """Write the shape to an ``.npz`` file, so that it need not be prepared again.

        Raises
        ------
        UnwritableFileError
            If the file cannot be written.
        """
        write_prepared(Path(path), self)

    @classmethod
    def load(cls, path: str | Path, config: Config | None = None) -> PreparedShape:
        """Read a shape that `save` wrote; its matches are the same to the last bit.

        Parameters
        ----------
        path : path_like
            The file.
        config : Config, optional
            Settings of the matches to come: a shape prepared with other settings is refused.

        Raises
        ------
        FormatError
            If the file is missing (`MissingFileError`), damaged, holds something else, or was
            written by a version of isomatch that prepared shapes in another way.
        SettingError
            If the shape was prepared with other settings than ``config``.
        """
        shape: PreparedShape = read_prepared(Path(path), cls)
        if config:
            shape.require_prepared_for(config, str(path))
        return shape

    def require_prepared_for(self, config: Config, what: str) -> None:
        """Raise `SettingError`, about ``what``, if the shape was prepared with other settings."""
        same_in_full = config.resolution == "full" and self.detail is None and not self.others
        used_config = replace(self.requested, resolution="full") if same_in_full else self.requested
        if name := used_config.differs_in_preparation(config):
            used, asked = getattr(self.requested, name), getattr(config, name)
            raise SettingError(
                f"{what} was prepared with {name} = {used!r}, the match asks for {asked!r}; prepare both shapes "
                "with the settings of the match"
            )

    def plot(self, values: ArrayLike | None = None, **options: Unpack[PlotOptions]) -> Figure:
        """Draw the user's shape, coloured by values at vertices; see `isomatch.visualization.plot_surface`.

        By default the values are the average distance from each vertex to the whole body, in √area
        of the body; vertices off the body are grey. `TypeError` if the shape is a graph, which has
        no positions.
        """
        if values is None:
            values = self.lift(self.average_distance)
            options = {**options, "label": options.get("label") or "average distance / √area"}
        figure: Figure = visualization().plot_surface(self.surface, values, **options)
        return figure

    @property
    def seconds(self) -> float:
        """Time the preparation took, in seconds."""
        return self.timings["total"]

    def __repr__(self) -> str:
        return f"PreparedShape({self.surface!r}, {self.distances!r}, {self.laplace!r})"

    def correspondence(
        self, target: SmoothShape, image: IntArray | PrecisePoints, matched: BoolArray | None = None
    ) -> Correspondence:
        """See `SmoothShape.correspondence`; maps of variants are carried back to their originals."""
        source = self.original or self
        if self.original is None and getattr(target, "original", None) is None:
            return super().correspondence(target, image, matched)
        points = image if isinstance(image, PrecisePoints) else PrecisePoints.at_vertices(image)
        n = source.body.n_vertices
        points = PrecisePoints(points.corners[:n], points.barycentric[:n])
        matched = None if matched is None else matched[:n]
        if isinstance(target, PreparedShape) and target.original:
            points, off_caps = target.on_original(points)
            matched = off_caps if matched is None else matched & off_caps
            target = target.original
        return source.correspondence(target, points, matched)

    def on_original(self, points: PrecisePoints) -> tuple[PrecisePoints, BoolArray]:
        """Carry points back to the original's body, and flag those on no cap, or near its rim."""
        vertices = points.corners[:, 0]
        off_caps = self.to_original[vertices] <= self.config.parts.boundary_tolerance
        carried = PrecisePoints.at_vertices(self.original_vertex[vertices])
        inside = (self.to_original[points.corners] == 0).all(axis=1)
        carried.corners[inside] = self.original_vertex[points.corners[inside]]
        carried.barycentric[inside] = points.barycentric[inside]
        return carried, off_caps

    @cached_property
    def original_vertex(self) -> IntArray:
        """(n_body,) vertex of the original's body nearest to each vertex of a variant."""
        return self._nearest_of_original[1]

    @cached_property
    def to_original(self) -> FloatArray:
        """(n_body,) distance of each vertex of a variant from `original_vertex`, in √area of the original."""
        return self._nearest_of_original[0]

    @cached_property
    def _nearest_of_original(self) -> tuple[FloatArray, IntArray]:
        assert self.origin is not None
        assert self.original is not None
        off_caps = np.flatnonzero(self.origin >= 0)
        if len(off_caps) == len(self.origin):
            return np.zeros(len(off_caps)), self.origin
        distance, nearest = distance_along_edges_to_nearest(self.body, off_caps)
        return distance * self.scale / self.original.scale, self.origin[nearest]

    @cached_property
    def average_distance(self) -> FloatArray:
        """(n_body,) average geodesic distance from each vertex to the whole body."""
        return self.distances @ self.body.vertex_areas

    @cached_property
    def intrinsic_scale(self) -> float:
        """The unit in which distances of two shapes are compared: by default the average distance."""
        if self.config.preparation.distance_unit == "user":
            return 1.0 / self.scale
        return float(self.body.vertex_areas @ self.average_distance)

    def distance(self, a: IntArray, b: IntArray) -> FloatArray:
        """Low-rank geodesic distances between vertices of two lists (q,), in √area; O(k) for each pair."""
        return np.where(a == b, 0.0, np.maximum(self.distances.distance(a, b), 0.0))

    def mean_distance(self, a: IntArray, b: IntArray) -> float:
        """Mean low-rank distance between vertices of two lists (q,)."""
        return float(self.distance(a, b).mean())

    def mean_distances(self, a: IntArray, others: Sequence[IntArray]) -> FloatArray:
        """Mean low-rank distances (q,) between the vertices of one list (r,) and of each of q other lists."""
        if not others:
            return np.zeros(0)
        distances = self.distance(np.tile(a, len(others)), np.concatenate(others))
        return np.asarray(distances.reshape(-1, len(a)).mean(axis=1))

    def distances_between(self, vertices: IntArray) -> FloatArray:
        """Low-rank geodesic distances (m, m) between m vertices, in √area."""
        distances: FloatArray = np.maximum(self.distances.between(vertices, vertices), 0.0)
        distances /= np.sqrt(self.body.area)
        np.fill_diagonal(distances, 0.0)
        return distances

    @property
    def boundary_length(self) -> float:
        """Length of the boundary of the body, in √area; 0 for points and graphs."""
        return float(self.triangles.boundary_lengths.sum()) if self.triangles is not None else 0.0

    @property
    def longest_boundary(self) -> float:
        """Length of the longest boundary loop of the body, in √area; 0 without a boundary."""
        return float(self.triangles.boundary_lengths.max(initial=0.0)) if self.triangles is not None else 0.0

    @cached_property
    def handles(self) -> int:
        """Number of handles of the body, see `repair.count_handles`; 0 for points and graphs."""
        return 0 if self.triangles is None else count_handles(self.triangles)

    @cached_property
    def one_sided(self) -> bool:
        """Whether the body has no inside, like a Möbius strip: two faces of an edge are wound inconsistently."""
        return self.triangles is not None and bool(self.triangles.edge_table.clash.any())

    @cached_property
    def seems_inside_out(self) -> bool:
        """Whether the body, which is open, seems to face inward; see `repair.seems_inside_out`."""
        return self.triangles is not None and self.boundary_length > 0 and seems_inside_out(self.triangles)

    @cached_property
    def polishable(self) -> SmoothShape:
        """The shape on which maps are polished: the finer level, or this shape if it has none."""
        if self.finer is None or self.refining is None:
            return self
        body = self.finer.surface
        interpolation = self.refining.on_coarse.interpolation(self.body.n_vertices)
        laplace = refined_laplace_basis(body, self.laplace, interpolation)
        return SmoothShape(
            surface=self.surface,
            body=body,
            body_vertex=self.finer.body_vertex,
            user_vertex=self.finer.user_vertex,
            laplace=laplace,
            sample_vertices=self.refining.nearest_members[self.sample_vertices],
            config=self.config,
            detail=self.finer.detail,
        )

    @cached_property
    def points(self) -> SignedPoints:
        """Geodesic distance descriptors of the body, in the intrinsic unit, as a signed point cloud."""
        # The point of vertex x is the row p(x) of the descriptor, with s_c = ±1 and d(x, y) = Σ_c s_c p_c(x)
        # p_c(y). Rows are divided by √(average distance), so that these sums are distances over the average
        # distance.
        descriptor = geodesic_distance_descriptor(self.distances)
        signed = self.config.preparation.block_diagonal
        signs = descriptor.signature if signed else np.ones_like(descriptor.signature)
        return SignedPoints(descriptor.coordinates / np.sqrt(self.intrinsic_scale), signs)

    @cached_property
    def curvature(self) -> FloatArray:
        """(n_body,) signed mean curvature of the smoothed body, standardised by area; 0 without triangles."""
        if self.triangles is None:
            return np.zeros(self.body.n_vertices)
        k = self.config.preparation.energy_curvature_functions
        curvature = mean_curvature(self.triangles, self.laplace, k, weld=False)
        return standardised(curvature[:, None], self.triangles.vertex_areas)[:, 0]

    @cached_property
    def balls(self) -> BallSignature | None:
        """Ball signatures of the vertices of the body, which end at caps; None without triangles."""
        if self.triangles is None:
            return None
        balls = ball_signature(self.triangles, unit=1.0, samples=self.sample_vertices[:N_BALLS], weld=False)
        if self.origin is not None and (self.origin < 0).any():
            # a ball that reaches a cap is unknown, like a ball that reaches the boundary
            to_caps, _ = distance_along_edges_to_nearest(self.triangles, np.flatnonzero(self.origin < 0))
            balls = replace(balls, to_boundary=np.minimum(balls.to_boundary, to_caps))
        return balls

    @cached_property
    def symmetries(self) -> tuple[Symmetry, ...]:
        """Maps of the shape onto itself, as rows of its search vertices."""
        return self.symmetry_search.symmetries(self._orientation_of)

    def near_symmetries(self, most: float) -> tuple[Symmetry, ...]:
        """Find self-maps with residuals as between individuals, but at most ``most``."""
        return self.symmetry_search.near_symmetries(self._orientation_of, most)

    @cached_property
    def symmetry_search(self) -> SymmetrySearch:
        """Self-maps of the search vertices that agree with their distances."""
        vertices = self.sample_vertices[: self.config.n_search]
        points = self.points.at(vertices, self.config.search.start_columns)
        return SymmetrySearch(points, self.distances_between(vertices), self.config.symmetry)

    def _orientation_of(self, image_row: IntArray) -> float:
        """Orientation of a map of the search vertices, given by rows."""
        vertices = self.sample_vertices[: self.config.n_search]
        basis = self.sampled_basis(self.config.n_search)
        k = min(self.config.selection.normal_functions, len(self.laplace.values))
        return orientation_of(self, basis, self, vertices[image_row], k)


FORMAT = ArrayFormat(  # contents of the file of a prepared shape
    what="a prepared shape",
    writer="PreparedShape.save",
    version=3,  # to be raised when shapes are prepared in another way: files of other versions are refused
    arrays={"about": Stored("text"), "digest": Stored("text")},
)
_ARRAY = re.compile(r"array_[0-9]{1,9}")  # matches the names of the arrays in a file
# classes of the objects that a file may hold, except graphs
_SURFACES, _BASES = (Mesh, PointCloud), (DistanceBasis, LaplaceBasis, Sampling)
_STORED = *_SURFACES, *_BASES, Body, Detail, Level, Decimated, Prolongation
KINDS: dict[str, Any] = {kind.__name__: kind for kind in _STORED}  # makes an object, by the name of its class
KINDS["Graph"] = lambda **parts: Graph(*parts.values())  # its parameters have other names than its fields

# for each field that holds vertices: the lowest number allowed, and how many vertices there are
NUMBERED: dict[str, tuple[int, Callable[[Any], int]]] = {
    "body_vertex": (-1, lambda part: len(part.user_vertex)),
    "user_vertex": (0, lambda part: len(part.body_vertex)),
    "sample_vertices": (0, lambda part: part.body.n_vertices),
    "column_vertices": (0, lambda part: part.body.n_vertices),
    "extremities": (0, lambda part: part.body.n_vertices),
    "owner": (0, lambda part: part.mesh.n_vertices),
}


def write_prepared(path: Path, shape: Any) -> None:
    """Write a prepared shape; an object that occurs several times is written once."""
    arrays: list[AnyArray] = []
    numbers: dict[int, int] = {}  # number of each object written, by its id

    def to_plain(value: Any) -> Any:
        if value is None or isinstance(value, str | int | float):
            return value
        if isinstance(value, np.generic):
            return value.item()
        if isinstance(value, tuple):
            return ["tuple", *map(to_plain, value)]
        if isinstance(value, dict | Config):
            values = value if isinstance(value, dict) else value.to_dict()
            return {"values": values, "is": type(value).__name__}
        if id(value) in numbers:
            return {"again": numbers[id(value)]}
        if isinstance(value, np.ndarray):
            arrays.append(value)
            entry: dict[str, Any] = {"array": len(arrays) - 1}
        else:
            parts = {field.name: to_plain(getattr(value, field.name)) for field in fields(value)}
            entry = {"parts": parts, "is": type(value).__name__}
        numbers[id(value)] = len(numbers)
        return entry

    about = json.dumps(to_plain(shape))
    array_of_name = {f"array_{i}": array for i, array in enumerate(arrays)}
    save_arrays(path, FORMAT.version, {"about": about, "digest": _digest(about, arrays), **array_of_name})


def read_prepared(path: Path, kind: type[Any]) -> Any:
    """Read a shape of class ``kind``; `FormatError` if the file was changed or is of another format."""

    def refuse(problem: str) -> NoReturn:
        raise FormatError(f"{path}: not {FORMAT.what} ({problem}); prepare the shape and save it again")

    head = FORMAT.read(path)
    with Archive.opened(path, refuse) as stored:
        if "format_version" not in stored or int(stored.read("format_version")) != FORMAT.version:
            refuse("shapes were prepared in another way then")
        names = sorted(filter(_ARRAY.fullmatch, stored.names), key=lambda name: int(name[6:]))
        arrays = list(stored.read_all(names).values())
    if head["digest"] != _digest(head["about"], arrays):
        refuse("it was changed after it was written")
    kinds = {**KINDS, kind.__name__: kind}
    objects: list[Any] = []

    def build(plain: Any) -> Any:
        if isinstance(plain, list):
            return tuple(map(build, plain[1:]))
        if not isinstance(plain, dict):
            return plain
        if "again" in plain:
            return objects[plain["again"]]
        if "values" in plain:
            return Config.from_dict(plain["values"]) if plain["is"] == "Config" else plain["values"]
        if "array" in plain:
            part = arrays[plain["array"]]
        else:
            part = kinds[plain["is"]](**{name: build(value) for name, value in plain["parts"].items()})
            _require_vertices(part)
        objects.append(part)
        return part

    try:
        shape = build(json.loads(head["about"]))
        if not isinstance(shape, kind):
            raise ValueError("it holds something else")
        for surface, numbers in ((shape.surface, shape.body_vertex), (shape.body, shape.user_vertex)):
            if len(numbers) != surface.n_vertices:
                raise ValueError(f"{len(numbers)} numbers of vertices for {surface.n_vertices} vertices")
    except (InputError, AttributeError, KeyError, IndexError, TypeError, ValueError, RecursionError) as error:
        refuse(str(error))
    return shape


def _require_vertices(part: Any) -> None:
    """Raise `ValueError` if a field of a part that should hold vertices holds other values."""
    for name, (lowest, count) in NUMBERED.items():
        numbers = getattr(part, name, None)
        if numbers is None:
            continue
        if numbers.ndim != 1 or numbers.dtype.kind != "i":
            raise ValueError(f"{name} are not numbers of vertices")
        if len(numbers) and not lowest <= numbers.min() <= numbers.max() < count(part):
            raise ValueError(f"{name} {numbers.min()}…{numbers.max()} are outside {lowest}…{count(part) - 1}")


def _digest(about: str, arrays: list[AnyArray]) -> str:
    digest = blake2b(about.encode(), digest_size=16)
    for array in arrays:
        digest.update(f"{array.dtype.str} {array.shape}".encode())
        digest.update(np.ascontiguousarray(array).data)
    return digest.hexdigest()
