"""`verify`: how right any map looks on two shapes as they are, by one cost that knows nothing of who found it."""

from __future__ import annotations

import time
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from isomatch._core.arrays import BodyVertices, Bool, BoolArray, Float, FloatArray, Int, UserVertices
from isomatch._core.cached import cached_method, cached_property
from isomatch._core.errors import MeshError
from isomatch._core.first_use import Shown
from isomatch._core.threads import in_background, parallel_map, serial_blas
from isomatch.correspondence import UNMATCHED, Correspondence, RigidRegistration, read_map
from isomatch.decimation import Prolongation, decimate
from isomatch.descriptors import RADII, BallSignature, ball_signature, deviation_of
from isomatch.geodesics import distance_along_edges_to_nearest
from isomatch.io import SurfaceLike
from isomatch.matching.assessment.quality import mean_known
from isomatch.matching.bending import Surroundings, bent_onto
from isomatch.matching.parameters import TIES
from isomatch.matching.priors import checked_initial_map
from isomatch.matching.problem import Problem, prepare_pair
from isomatch.settings import Config
from isomatch.shapes import N_BALLS, PreparedShape
from isomatch.surfaces import Mesh, label_components

# those without another source: decisions.md, one verification
LENGTHS = (0.3, 0.2, 0.14, 0.09, 0.06)  # in √area, over which a shape resists while it is bent by a map
# vertices of the shape that is bent; with 1000, 14 of 14 pairs of species and ants get the same map, later
N_BENT = 500
DESCRIPTOR_WEIGHT, SUPPORT_EXPONENT = 6.0, 2.0  # 3 to 10 and 1 to 3 choose alike
# of the turning, over a unit in radians: about the median of right maps; decisions.md, turning
TURNING_EXPONENT, TURNING_UNIT = 0.25, 0.1
COVERED = 0.05  # √area from an image, up to which a vertex has a counterpart; outcome.coverage_radius
NEAR, FAR = 0.08, 0.3  # √area of the source: distances that measure the unit of a map
N_MEASURED, FEWEST_MEASURED = 300, 40  # samples whose distances do, and how many distances are enough
LARGEST_UNIT_CHANGE = 1.3  # by which a map may measure another unit than that of the files
# times that one part may be as long as the other in the units of the files; beyond, areas are equal
MOST_UNLIKE = 4.0
FEWEST_BENT = 30  # vertices of a piece that can be bent
LEAST = 1e-9  # of what is divided by


@dataclass(frozen=True, eq=False, repr=False)
class Verification(Shown):
    """What speaks for a map of two surfaces, measured on them as they are; compare maps of one pair only.

    Parameters
    ----------
    support : float
        Share of the area that has a counterpart: of two wholes the smaller share, of a part in a whole that of the part,
        of two parts the larger share.
    descriptor_distance : float
        Mean over the area of how differently the surfaces look around points and their images, both ways, in standard
        deviations; see `BallSignature`. nan if nothing is known.
    bending, bending_back : float
        Mean ``|log|`` of the stretch of edges × mean distance from the other surface, in √area: of what has images, when
        it is bent onto the target as rigidly as the map lets it, and of the target bent back.
    turning : float
        Mean angle, in radians, between the rotations of neighbouring vertices of what was bent, there and back.
    unit : float
        What √area of the source is worth in √area of the target: 1 between wholes.
    seconds : float
        Time of this measurement, without that of the preparation.

    Examples
    --------
    >>> found = Verification(1.0, 0.3, 4e-4, 9e-4, 0.1, 1.0, 0.2)
    >>> print(f"{found.cost:.4f}")
    0.0036
    """

    support: float
    descriptor_distance: float
    bending: float
    bending_back: float
    turning: float
    unit: float
    seconds: float

    def __repr__(self) -> str:
        values = ", ".join(f"{field.name}={getattr(self, field.name):.4g}" for field in fields(self))
        return f"Verification(cost={self.cost:.4g}, {values})"

    @property
    def cost(self) -> float:
        """√(bending × bending back) × (turning / 0.1)^¼ × exp(6 × descriptor distance) / support²: lower is better."""
        bending = np.sqrt(self.bending * self.bending_back)
        if not (self.support and np.isfinite(bending)):
            return np.inf
        unlike = DESCRIPTOR_WEIGHT * np.nan_to_num(self.descriptor_distance, nan=1.0)
        turned = (self.turning / TURNING_UNIT) ** TURNING_EXPONENT
        return float(bending * turned * np.exp(unlike) / self.support**SUPPORT_EXPONENT)


def verify(
    source: SurfaceLike | PreparedShape,
    target: SurfaceLike | PreparedShape,
    map: Correspondence | ArrayLike | str | Path,
    config: Config | None = None,
    seed: int = 0,
) -> Verification:
    """Measure, without a ground truth, what speaks for a map between two meshes that any tool has made.

    The same map costs the same whichever way found it. Numbering, motion and turning both surfaces over change nothing
    but what sampling changes, and neither does swapping the surfaces with the inverse map.

    Parameters
    ----------
    source, target : Mesh, PreparedShape, path_like, tuple or object
        As for `match`.
    map : Correspondence, (n_source,) array_like of int, or path_like
        Target vertex of each source vertex; −1 where there is none. Or a file of such a map, see `read_map`.
    config, seed
        As for `match`; they concern the preparation of shapes not yet prepared.

    Returns
    -------
    Verification
        Costs compare maps of one pair. They do not say by themselves whether a map is right: right maps of two species
        cost what wrong ones of one person do.

    Raises
    ------
    MeshError
        If a shape is no mesh, or cannot be used.
    MapError
        If the map does not fit the shapes.

    Notes
    -----
    Bending is that of Sorkine & Alexa, *As-rigid-as-possible surface modeling*, SGP 2007. About 0.2 s a map after the
    preparation. Only the largest component of a shape is looked at.

    Examples
    --------
    >>> from isomatch.datasets import example_pair, ground_truth
    >>> source, target = example_pair()
    >>> verify(source.mesh, target.mesh, ground_truth(source, target).vertices).support
    1.0
    """

    def verified() -> Verification:
        with serial_blas():
            pair = prepare_meshes(source, target, config, seed)
            return Verifier(pair)(on_bodies(pair, images_of(map, pair)))

    return in_background(verified)


def prepare_meshes(
    source: SurfaceLike | PreparedShape, target: SurfaceLike | PreparedShape, config: Config | None, seed: int
) -> Problem:
    """Prepare two shapes whose maps are to be verified; `MeshError` if one is no mesh."""
    pair = prepare_pair(source, target, config, seed)
    for side, shape in (("source", pair.source), ("target", pair.target)):
        if shape.triangles is None:
            raise MeshError(
                f"{side}: a map is verified by bending surfaces, which needs triangles; give meshes"
            )
    return pair


def images_of(map: Correspondence | ArrayLike | str | Path, pair: Problem) -> Int[UserVertices, "n_source"]:
    """Return the target vertex of each source vertex under a map, an array, or a file; `MapError` if it does not fit."""
    sizes = pair.source.surface.n_vertices, pair.target.surface.n_vertices
    if isinstance(map, (str, Path)):
        map = read_map(map, *sizes[::-1]).map
    if isinstance(map, Correspondence):
        map.check_fits(pair.source.surface, pair.target.surface)
        map = map.vertices
    return checked_initial_map(map, *sizes)


def on_bodies(pair: Problem, vertices: Int[UserVertices, "n_source"]) -> Int[BodyVertices, "n_s"]:
    """Turn a map of the users' vertices into one of the bodies: target vertex of each body vertex, or −1."""
    image = vertices[pair.source.user_vertex]
    return BodyVertices(np.where(image >= 0, pair.target.body_vertex[image], UNMATCHED))


@cached_method
def verifier_of(pair: Problem) -> Verifier:
    """Return what verifies maps of a pair, one for each pair, and kept with it."""
    return Verifier(pair)


def relative_cost(cost: float, reference: float) -> float:
    """Return a cost over another one; costs below the noise of copies of a surface are equal."""
    return max(cost, TIES.cost_noise) / max(reference, TIES.cost_noise)


class Verifier:
    """Verifies maps of the bodies of one pair of meshes; what it needs of the shapes is computed once."""

    def __init__(self, pair: Problem, n_bent: int = N_BENT) -> None:
        self.shapes, self.n_bent = (pair.source, pair.target), n_bent
        self.is_whole = [x.longest_boundary <= pair.config.parts.long_boundary for x in self.shapes]
        self.are_whole = pair.config.scale == "area" or all(self.is_whole)
        ratio = pair.source.scale / pair.target.scale
        told = not self.are_whole and 1 / MOST_UNLIKE <= ratio <= MOST_UNLIKE
        self.unit = ratio if told else 1.0

    def __call__(self, image: Int[BodyVertices, "n_s"]) -> Verification:
        """Verify a map: vertex of the target's body for each of the source's, −1 where it has none."""
        started = time.perf_counter()
        source, target = self.shapes
        matched = image >= 0
        if not matched.any():
            seconds = time.perf_counter() - started
            return Verification(0.0, np.nan, np.nan, np.nan, np.nan, self.unit, seconds)
        back, gap = inverse(target, image)
        covered = gap <= COVERED
        back = BodyVertices(np.where(covered, back, UNMATCHED))
        unit = self.unit_of(image)
        ways = ((0, image, unit), (1, back, 1 / unit))
        (there, turned), (onto_source, turned_back) = parallel_map(lambda way: self._bent(*way), ways)
        areas = source.body.vertex_areas, target.body.vertex_areas
        apart = [mean_known(self._apart(way, to), areas[way]) for way, to, _ in ways]
        support = self._support(_share(source, matched), _share(target, covered))
        distance = float(np.nanmean(apart)) if np.isfinite(apart).any() else np.nan
        turning, seconds = float(np.sqrt(turned * turned_back)), time.perf_counter() - started
        return Verification(support, distance, there, onto_source, turning, unit, seconds)

    def _support(self, *shares: float) -> float:
        """Combine the shares that have a counterpart: of wholes both count, of a part in a whole its own."""
        # A map that sends two limbs to one leaves the other uncovered; its larger share is 1.
        if all(self.is_whole):
            return min(shares)
        return max(shares) if not any(self.is_whole) else shares[self.is_whole.index(False)]

    @cached_property
    def _balls(self) -> tuple[tuple[BallSignature, BallSignature], FloatArray]:
        """The ball signatures of both bodies, in √area of the larger one, and the unit of their differences."""
        lengths = self.unit, 1.0
        source, target = (_balls(shape, length / max(lengths)) for shape, length in zip(self.shapes, lengths))
        return (source, target), deviation_of(source, target)

    def unlikeness(self, image: Int[BodyVertices, "n_s"]) -> Float[FloatArray, "n_s"]:
        """Descriptor distance of the source's vertices and their images; nan where unknown."""
        return self._apart(0, image)

    def _apart(self, way: int, image: Int[BodyVertices, "n"]) -> Float[FloatArray, "n"]:
        """Descriptor distance of the vertices of one shape and their images; nan where unknown."""
        balls, deviation = self._balls
        distance = balls[way].descriptor_distance(balls[1 - way].at(image), deviation)
        return np.where(image >= 0, distance, np.nan)

    def unit_of(self, image: Int[BodyVertices, "n_s"]) -> float:
        """Measure the unit: the median ratio of distances of images and of near samples."""
        source, target = self.shapes
        if self.are_whole:
            return self.unit
        samples = source.sample_vertices[image[source.sample_vertices] >= 0][:N_MEASURED]
        along = source.distances.between(samples, samples)
        near = (along > NEAR) & (along < FAR)
        if near.sum() < FEWEST_MEASURED:
            return self.unit
        there = np.maximum(target.distances.between(image[samples], image[samples]), LEAST)
        measured = float(np.median(there[near] / along[near]))
        return float(np.clip(measured, self.unit / LARGEST_UNIT_CHANGE, self.unit * LARGEST_UNIT_CHANGE))

    @cached_property
    def _meshes(self) -> list[Mesh]:
        return [mesh.moved(mesh.vertices / np.sqrt(mesh.area)) for mesh in (x.mesh_body for x in self.shapes)]

    @cached_method
    def _coarse(self, way: int) -> Prolongation:
        return Prolongation(self._meshes[way], decimate(self._meshes[way], self.n_bent))

    @cached_method
    def _registration(self, way: int) -> RigidRegistration:
        return RigidRegistration(self._coarse(way).coarse.mesh, keeps=True)

    def _bent(self, way: int, image: Int[BodyVertices, "n"], unit: float) -> tuple[float, float]:
        """Bending and turning of the largest piece of one shape that has images; nan if it is too small."""
        coarse, mesh = self._coarse(way), self._coarse(way).coarse.mesh
        onto = Surroundings(self._meshes[1 - way], self.shapes[1 - way].index, unit)
        at = image[coarse.nearest_members]
        if (at >= 0).all():
            registration = self._registration(way)
        else:
            kept = largest_piece(mesh, at >= 0)
            if len(kept) < FEWEST_BENT:
                return np.nan, np.nan
            inside = np.zeros(mesh.n_vertices, dtype=bool)
            inside[kept] = True
            registration, at = RigidRegistration(mesh.submesh(inside)[0]), at[kept]
        bent = bent_onto(registration, onto, onto.mesh.vertices[at], LENGTHS)
        return bent.spectral_residual, bent.turning


def _balls(shape: PreparedShape, length: float) -> BallSignature:
    if length == 1.0 and shape.balls is not None:
        return shape.balls
    samples = shape.sample_vertices[:N_BALLS]
    return ball_signature(shape.mesh_body, RADII, unit=1 / length, samples=samples, weld=False)


def inverse(
    target: PreparedShape, image: Int[BodyVertices, "n_s"]
) -> tuple[Int[BodyVertices, "n_t"], Float[FloatArray, "n_t"]]:
    """Vertex of the source whose image is nearest to each of the target's, and how far that is, in √area."""
    known = np.flatnonzero(image >= 0)[::-1]
    of = np.zeros(target.body.n_vertices, dtype=np.int64)
    of[image[known]] = known
    gap, nearest = distance_along_edges_to_nearest(target.body, np.unique(image[known]))
    return BodyVertices(of[nearest]), gap


def _share(shape: PreparedShape, inside: BoolArray) -> float:
    return float(np.average(inside, weights=shape.body.vertex_areas))


def largest_piece(mesh: Mesh, inside: Bool[BoolArray, "n"]) -> Int[BodyVertices, "q"]:
    """Vertices of the largest connected piece of some of a mesh."""
    faces = mesh.faces[inside[mesh.faces].all(axis=1)]
    used = np.zeros(mesh.n_vertices, dtype=bool)
    used[faces] = True
    _, label = label_components(mesh.n_vertices, (faces[:, 0], faces[:, 1]), (faces[:, 1], faces[:, 2]))
    areas = np.bincount(label, mesh.vertex_areas * used)
    return BodyVertices(np.flatnonzero(used & (label == areas.argmax())))
