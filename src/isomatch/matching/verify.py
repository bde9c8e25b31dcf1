"""`verify`: one cost of any map between two shapes, whichever method found the map."""

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
from isomatch.descriptors import RADII, BallSignature, ball_signature, deviation_of
from isomatch.geodesics import distance_along_edges_to_nearest
from isomatch.io import SurfaceLike
from isomatch.matching.assessment.quality import mean_known
from isomatch.matching.bending import Surroundings, bend_onto, coarse_shapes
from isomatch.matching.parameters import TIES
from isomatch.matching.priors import checked_initial_map
from isomatch.matching.problem import Problem, prepare_pair
from isomatch.settings import Config
from isomatch.shapes import N_BALLS, PreparedShape
from isomatch.surfaces import Mesh, label_components

# √area, one length for each step of bending: shorter pieces of the shape move almost rigidly; decisions.md, one
# verification
BENDING_LENGTHS = (0.3, 0.2, 0.14, 0.09, 0.06)
N_BENT_VERTICES = 1000  # vertices of a bent shape; chosen: with 500, costs are 1.1 to 1.5 times as high
# Weight of the descriptor distance, and exponent of the support, in `Verification.cost`. Weights from 3 to
# 10, and exponents from 1 to 3, choose the same maps.
DESCRIPTOR_WEIGHT, SUPPORT_EXPONENT = 6.0, 2.0
# Exponent of the turning in the cost, and the turning in radians that neither raises nor lowers the cost; it
# is the median of right maps: decisions.md, turning.
TURNING_EXPONENT, TURNING_UNIT = 0.25, 0.1
COVERAGE_DISTANCE = 0.05  # √area of the target; a vertex farther from all images has no counterpart; chosen
MIN_DISTANCE, MAX_DISTANCE = 0.08, 0.3  # √area of the source; distances in between measure the unit; chosen
# The unit is measured on the distances between N_SAMPLES samples at most, if at least MIN_MEASURED of these lie
# between MIN_DISTANCE and MAX_DISTANCE; both chosen.
N_SAMPLES, MIN_MEASURED = 300, 40
MAX_UNIT_RATIO = 1.3  # largest ratio of the measured unit to the files' unit, in either direction; chosen
# If the √area of the source in the files' units, over the √area of the target, or the reverse, exceeds this, the units
# of the files are not trusted, and both shapes are taken to have one area; chosen.
MAX_LENGTH_RATIO = 4.0
MIN_PIECE = 30  # vertices; smaller pieces of a shape are not bent; chosen
MIN_DIVISOR = 1e-9  # √area of the target; shorter distances are raised to this, so that no ratio is 0; chosen


@dataclass(frozen=True, eq=False, repr=False)
class Verification(Shown):
    """Measures and cost of a map between two surfaces; costs compare maps of one pair only.

    Parameters
    ----------
    support : float
        Share of the area that has a counterpart: the smaller share of two wholes, the share of the part in a whole, the
        larger share of two parts.
    descriptor_distance : float
        How differently the surfaces look around points and their images, in standard deviations: mean over the area,
        both ways; see `BallSignature`. nan if nothing is known.
    bending, bending_back : float
        Mean ``|log|`` of the stretch of edges × mean distance from the other surface, in √area: of the source, bent onto
        the target as rigidly as the map allows, and of the target bent onto the source.
    turning : float
        Mean angle, in radians, between the rotations of neighbouring vertices of the bent shapes.
    unit : float
        What √area of the source is worth in √area of the target: 1 between wholes.
    seconds : float
        Time of this measurement, without the preparation.

    Examples
    --------
    >>> found = Verification(1.0, 0.3, 4e-4, 9e-4, 0.1, 1.0, seconds=0.2)
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
        """√(bending × back) × (turning / 0.1)^¼ × exp(6 × descriptor distance) / support²."""
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
    """Measure the cost of a map between two meshes, made by any tool, without a ground truth.

    The cost depends on the map alone, not on the method. Up to effects of sampling, it does not change when vertices
    are renumbered, surfaces are moved, both are turned inside out, or source and target are swapped.

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
        Costs compare maps of one pair. A single cost does not say whether a map is right: a right map between two
        species may cost as much as a wrong one between two poses of a person.

    Raises
    ------
    MeshError
        If a shape is no mesh, or cannot be used.
    MapError
        If the map does not fit the shapes.

    Notes
    -----
    Shapes are bent as by Sorkine & Alexa, *As-rigid-as-possible surface modeling*, SGP 2007. A map takes about 0.2 s
    after the preparation. Only the largest component of each shape counts.

    Examples
    --------
    >>> from isomatch.datasets import example_pair, ground_truth
    >>> source, target = example_pair()
    >>> verify(source.mesh, target.mesh, ground_truth(source, target).vertices).support
    1.0
    """

    def run() -> Verification:
        with serial_blas():
            pair = prepare_meshes(source, target, config, seed)
            return Verifier(pair)(on_bodies(pair, images_of(map, pair)))

    return in_background(run)


def prepare_meshes(
    source: SurfaceLike | PreparedShape, target: SurfaceLike | PreparedShape, config: Config | None, seed: int
) -> Problem:
    """Prepare two shapes to verify their maps; `MeshError` if one is no mesh."""
    pair = prepare_pair(source, target, config, seed)
    for side, shape in (("source", pair.source), ("target", pair.target)):
        if shape.triangles is None:
            raise MeshError(
                f"{side}: a map is verified by bending surfaces, which needs triangles; give meshes"
            )
    return pair


def images_of(map: Correspondence | ArrayLike | str | Path, pair: Problem) -> Int[UserVertices, "n_source"]:
    """Read target vertices from a map, an array or a file; `MapError` if they do not fit."""
    sizes = pair.source.surface.n_vertices, pair.target.surface.n_vertices
    if isinstance(map, (str, Path)):
        map = read_map(map, *sizes[::-1]).map
    if isinstance(map, Correspondence):
        map.check_fits(pair.source.surface, pair.target.surface)
        map = map.vertices
    return checked_initial_map(map, *sizes)


def on_bodies(pair: Problem, vertices: Int[UserVertices, "n_source"]) -> Int[BodyVertices, "n_s"]:
    """Turn a map of the users' vertices into one of the bodies; −1 without an image."""
    image = vertices[pair.source.user_vertex]
    return BodyVertices(np.where(image >= 0, pair.target.body_vertex[image], UNMATCHED))


@cached_method
def verifier_of(pair: Problem) -> Verifier:
    """Return the verifier of a pair, which is kept with the pair."""
    return Verifier(pair)


def relative_cost(cost: float, reference: float) -> float:
    """Divide a cost by another one; costs below the noise between copies of a surface are equal."""
    return max(cost, TIES.cost_noise) / max(reference, TIES.cost_noise)


class Verifier:
    """Verifies maps between the bodies of two meshes, and keeps what it computes of the shapes."""

    def __init__(self, pair: Problem, n_bent: int = N_BENT_VERTICES) -> None:
        self.shapes, self.coarse, self.n_bent = (pair.source, pair.target), coarse_shapes(pair), n_bent
        self.is_whole = [x.longest_boundary <= pair.config.parts.long_boundary for x in self.shapes]
        self.are_whole = pair.config.scale == "area" or all(self.is_whole)
        ratio = pair.source.scale / pair.target.scale
        is_trusted = not self.are_whole and 1 / MAX_LENGTH_RATIO <= ratio <= MAX_LENGTH_RATIO
        self.unit = ratio if is_trusted else 1.0

    def __call__(self, image: Int[BodyVertices, "n_s"]) -> Verification:
        """Verify a map: target vertex for each source vertex, or −1."""
        started = time.perf_counter()
        source, target = self.shapes
        matched = image >= 0
        if not matched.any():
            seconds = time.perf_counter() - started
            return Verification(0.0, np.nan, np.nan, np.nan, np.nan, self.unit, seconds)
        back, gap = invert_map(target, image)
        covered = gap <= COVERAGE_DISTANCE
        back = BodyVertices(np.where(covered, back, UNMATCHED))
        unit = self.unit_of(image)
        ways = ((image, unit, 0), (back, 1 / unit, 1))
        (bending, turning), (bending_back, turning_back) = parallel_map(lambda way: self._bend(*way), ways)
        areas = source.body.vertex_areas, target.body.vertex_areas
        distances = [mean_known(self.descriptor_distances(to, way), areas[way]) for to, _, way in ways]
        return Verification(
            support=self._support(_area_share(source, matched), _area_share(target, covered)),
            descriptor_distance=float(np.nanmean(distances)) if np.isfinite(distances).any() else np.nan,
            bending=bending,
            bending_back=bending_back,
            turning=float(np.sqrt(turning * turning_back)),
            unit=unit,
            seconds=time.perf_counter() - started,
        )

    def _support(self, *shares: float) -> float:
        """Combine the shares that have a counterpart, see `Verification.support`."""
        # Of two wholes, the smaller share is taken: a map of two limbs to one limb leaves a limb uncovered.
        if all(self.is_whole):
            return min(shares)
        return max(shares) if not any(self.is_whole) else shares[self.is_whole.index(False)]

    @cached_property
    def _balls(self) -> tuple[tuple[BallSignature, BallSignature], FloatArray]:
        """The ball signatures of both bodies, in √area of the larger one, and their deviations."""
        lengths = self.unit, 1.0
        units = [length / max(lengths) for length in lengths]
        source, target = (_ball_signature(shape, unit) for shape, unit in zip(self.shapes, units))
        return (source, target), deviation_of(source, target)

    def descriptor_distances(self, image: Int[BodyVertices, "n"], way: int = 0) -> Float[FloatArray, "n"]:
        """Descriptor distance of each vertex of one shape and its image; nan where unknown."""
        balls, deviation = self._balls
        distance = balls[way].descriptor_distance(balls[1 - way].at(image), deviation)
        return np.where(image >= 0, distance, np.nan)

    def unit_of(self, image: Int[BodyVertices, "n_s"]) -> float:
        """Measure the unit: median ratio of the distance between images to the distance between near samples."""
        source, target = self.shapes
        if self.are_whole:
            return self.unit
        samples = source.sample_vertices[image[source.sample_vertices] >= 0][:N_SAMPLES]
        on_source = source.distances.between(samples, samples)
        near = (on_source > MIN_DISTANCE) & (on_source < MAX_DISTANCE)
        if near.sum() < MIN_MEASURED:
            return self.unit
        on_target = np.maximum(target.distances.between(image[samples], image[samples]), MIN_DIVISOR)
        measured = float(np.median(on_target[near] / on_source[near]))
        return float(np.clip(measured, self.unit / MAX_UNIT_RATIO, self.unit * MAX_UNIT_RATIO))

    def _bend(self, image: Int[BodyVertices, "n"], unit: float, way: int) -> tuple[float, float]:
        """Bend the largest mapped piece of one shape; return bending and turning, nan if the piece is too small."""
        coarse = self.coarse.at(way, self.n_bent)
        mesh = coarse.prolongation.coarse.mesh
        onto = Surroundings(self.coarse.meshes[1 - way], self.shapes[1 - way].index, unit)
        images = image[coarse.prolongation.nearest_members]
        if (images >= 0).all():
            registration = coarse.registration
        else:
            kept = largest_piece(mesh, images >= 0)
            if len(kept) < MIN_PIECE:
                return np.nan, np.nan
            inside = np.zeros(mesh.n_vertices, dtype=bool)
            inside[kept] = True
            registration, images = RigidRegistration(mesh.submesh(inside)[0]), images[kept]
        bent = bend_onto(registration, onto, onto.mesh.vertices[images], BENDING_LENGTHS)
        return bent.bending_cost, bent.turning


def _ball_signature(shape: PreparedShape, length: float) -> BallSignature:
    if length == 1.0 and shape.balls is not None:
        return shape.balls
    samples = shape.sample_vertices[:N_BALLS]
    return ball_signature(shape.mesh_body, RADII, unit=1 / length, samples=samples, weld=False)


def invert_map(
    target: PreparedShape, image: Int[BodyVertices, "n_s"]
) -> tuple[Int[BodyVertices, "n_t"], Float[FloatArray, "n_t"]]:
    """Find the source vertex whose image is nearest to each target vertex, and the distance of that image."""
    known = np.flatnonzero(image >= 0)[::-1]
    source_vertex = np.zeros(target.body.n_vertices, dtype=np.int64)
    source_vertex[image[known]] = known
    gap, nearest = distance_along_edges_to_nearest(target.body, np.unique(image[known]))
    return BodyVertices(source_vertex[nearest]), gap


def _area_share(shape: PreparedShape, inside: BoolArray) -> float:
    return float(np.average(inside, weights=shape.body.vertex_areas))


def largest_piece(mesh: Mesh, inside: Bool[BoolArray, "n"]) -> Int[BodyVertices, "q"]:
    """Find the largest connected piece of the vertices inside a mask."""
    faces = mesh.faces[inside[mesh.faces].all(axis=1)]
    used = np.zeros(mesh.n_vertices, dtype=bool)
    used[faces] = True
    _, label = label_components(mesh.n_vertices, (faces[:, 0], faces[:, 1]), (faces[:, 1], faces[:, 2]))
    areas = np.bincount(label, mesh.vertex_areas * used)
    return BodyVertices(np.flatnonzero(used & (label == areas.argmax())))
