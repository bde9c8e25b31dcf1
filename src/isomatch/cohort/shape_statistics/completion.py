"""Shape completion: the likeliest shape of a model given some points, and its uncertainty."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import solve_triangular
from scipy.spatial.transform import Rotation

from isomatch._core.arrays import BoolArray, FloatArray, IntArray, array_of, numbers_of
from isomatch._core.errors import InputError, LandmarkError, MeshError, NotConvergedError, SettingError
from isomatch._core.files import legible
from isomatch._core.memory import require_memory
from isomatch._core.settings import require_one_of
from isomatch._core.stage_timer import Progress
from isomatch._core.threads import serial_blas
from isomatch.cohort.shape_statistics.shape_model import ShapeModel, generalisation
from isomatch.cohort.shape_statistics.shapes import read_corresponding, slices_of, structure_of
from isomatch.correspondence import Correspondence, nearest_rotation, wrap
from isomatch.io import FORMATS, SurfaceLike, mesh_from, meshes_among
from isomatch.landmarks import Landmarks
from isomatch.matching import Outcome, match
from isomatch.settings import Config
from isomatch.surfaces import Mesh, PrecisePoints, nearest_on_surface

Pose = Literal["fitted", "given"]  # whether the points may be moved to the model, or lie where it is
# Share of the size of the model's mean: lower noise of points is raised to this, so that double precision suffices;
# chosen.
MIN_NOISE = 1e-6
TOLERANCE = 1e-9  # a fit ends once a step moves the shape by at most this share of the mean's size; chosen
MAX_STEPS = 200  # number of steps after which a fit fails if the shape still moves; chosen
MAX_ROUNDS = 30  # largest number of times that nearest points are found anew; chosen: about 10 are enough
# Nearest points are final once finding them anew moves the shape by at most this share of its size; chosen.
MAX_MOVEMENT = 1e-3
# Points are on a line, and any turn around the line fits them equally, if the second singular value of their weighted
# offsets from their mean, over the first, is at most this; chosen.
MAX_WIDTH = 1e-3
# √area: all vertices in a square of this width count as one observation, as their errors are alike: docs/statistics.md
PATCH_LENGTH = 0.2
# weight of offsets of points along the surface; offsets across it have the weight 1; chosen
ALONG_WEIGHT = 0.1
# A vertex is paired with the nearest point of the shape if the cosine of the angle between their normals exceeds this
# (60°); chosen.
MIN_COSINE = 0.5


@dataclass(frozen=True, eq=False, repr=False)
class Completion:
    """The likeliest shape of a model given some points, in the units of the points."""

    mesh: Mesh  #: the likeliest shape, with the n vertices of the model, where the points are
    #: (n,) standard deviation of each vertex within the modes: the root of the sum of the variances
    #: of its three coordinates
    standard_deviation: FloatArray
    residual: float  #: distance of shapes from what modes describe, see `model_noise`
    scores: FloatArray  #: (k,) coordinates along the modes, in the units of the model
    score_deviations: FloatArray  #: (k,) their standard deviations
    #: root mean square distance of the given points from the shape, each weighted by one over the
    #: square of its noise; nan without points
    error: float
    scale: float  #: factor of the motion from the model, x ↦ scale · rotation @ x + translation
    rotation: FloatArray  #: (3, 3) rotation of this motion
    translation: FloatArray  #: (3,) translation of this motion
    n_points: int  #: number of points used
    notes: tuple[str, ...] = ()  #: what is in doubt

    def __repr__(self) -> str:
        return f"Completion({self.mesh!r}, error {self.error:.3g})"

    @property
    def expected_error(self) -> FloatArray:
        """(n,) root mean square distance of each vertex from its true place."""
        return np.hypot(self.standard_deviation, self.residual)


def complete(model: ShapeModel, observations: Observations, *, pose: Pose = "fitted") -> Completion:
    """Find the likeliest shape of a model given some of its points, and its uncertainty.

    Parameters
    ----------
    model : ShapeModel
        Scores along its k modes are independent and normally distributed.
    observations : Observations
        Positions of some points of the surface, with their noise. Without any, and in the given
        pose, the result is the mean with the deviations of the model.
    pose : {"fitted", "given"}
        Whether the points may be anywhere and turned in any way, and of any size if the model was
        made without sizes; or are where the model is. A pose is fitted to three points or more,
        which are not on a line.

    Notes
    -----
    Albrecht, Lüthi, Gerig & Vetter, *Posterior shape models*, Medical Image Analysis 2013. Nearest
    points on a matched surface are renewed until the shape moves by less than 0.001 of its size, at
    most 30 times, after which a note says so. O(q k²) time a step for q points; a few suffice.

    Examples
    --------
    >>> from isomatch.cohort.shape_statistics import CorrespondedShapes
    >>> square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    >>> shapes = CorrespondedShapes("abc", [square * [1, height, 1] for height in (1, 2, 3)], [[0, 1, 2], [0, 2, 3]])
    >>> model = ShapeModel.fit(shapes)
    >>> corner = Observations.at_vertices([1, 2, 0], [[6.0, 5, 5], [6, 7.5, 5], [5, 5, 5]], noise=1e-3)
    >>> completed = complete(model, corner)
    >>> completed.mesh.vertices[3].round(2).tolist(), (completed.standard_deviation < 0.01).all().tolist()
    ([5.0, 7.5, 5.0], True)
    """
    require_one_of("pose", pose, Pose)
    observations.check_fits(len(model.mean))
    n_values = 3.0 * (model.n_modes + 7) * (len(observations) + len(model.mean))
    require_memory(8 * 3 * n_values, "shape completion", "use a model of fewer vertices, or fewer points")
    fit = _Fit.of(model, observations, is_free=pose == "fitted")
    notes: tuple[str, ...] = ()
    if observations.surface:
        fit, observations, notes = _fit_nearest(model, observations.surface, fit, is_free=pose == "fitted")
    motion, shape = fit.motion, fit.shape(model)
    columns = model.modes * model.deviations[:, None, None]  # (k, n, 3), for one deviation along each mode
    if pose == "fitted":
        columns = np.concatenate([columns, _motions(shape, fit.centre, fit.size, model.size is not None)])
    offsets = observations.positions - motion.apply(observations.points.interpolated(shape))
    precision = 1 / np.maximum(observations.noise, MIN_NOISE * fit.size * motion.scale) ** 2
    error = float(np.sqrt(precision @ (offsets**2).sum(axis=1) / precision.sum())) if len(offsets) else np.nan
    mesh, residual = model.mesh().moved(motion.apply(shape)), motion.scale * model_noise(model)
    deviations, scores = motion.scale * _deviations(columns, fit.root), fit.scores * model.deviations
    score_deviations = np.linalg.norm(fit.root[: model.n_modes], axis=1) * model.deviations
    placed = motion.scale, motion.rotation, motion.translation
    known = mesh, deviations, residual, scores, score_deviations, error
    return Completion(*known, *placed, len(observations), notes)


@dataclass(frozen=True, eq=False)
class _Fit:
    """Scores (k,) in standard deviations, and the motion to the points."""

    scores: FloatArray  # (k,) scores in standard deviations
    motion: _Motion
    # (c, c) matrix whose product with its transpose is the covariance of the k scores and of the small motions, see
    # `_motions`: turns in radians, shifts in sizes, growth
    root: FloatArray
    centre: FloatArray  # (3,) centroid of the points on the shape, in the coordinates of the model
    size: float  # root mean square distance of the model's mean from its centroid

    def shape(self, model: ShapeModel) -> FloatArray:
        """(n, 3) the shape in the coordinates of the model."""
        return model.vertices(self.scores * model.deviations)

    @classmethod
    def of(cls, model: ShapeModel, observations: Observations, is_free: bool, most: int = MAX_STEPS) -> _Fit:
        """Fit the scores, and also the motion if it is free."""
        size = float(np.sqrt(model.weights @ ((model.mean - model.weights @ model.mean) ** 2).sum(axis=1)))
        mean = observations.points.interpolated(model.mean)
        modes = [observations.points.interpolated(mode) for mode in model.modes]
        spread = np.array(modes).reshape(model.n_modes, len(mean), 3) * model.deviations[:, None, None]
        motion = _Motion.onto(mean, observations, model.size is not None) if is_free else _Motion()
        # The points are x = m + Φ b + e, with the mean m, modes Φ, scores b ~ N(0, I) in standard deviations and noise
        # e ~ N(0, Σ). The likeliest b and motion minimise |Σ^(−½) (x − m − Φ b − T t)|² + |b|², where the columns of T
        # are displacements by small turns about the centre, shifts and growth, whose amounts t have no prior. A turn is
        # not linear: the step t becomes part of the motion, and another step is made from there (Gauss–Newton), which
        # finds b as a whole; the last step gives the uncertainty.
        shape, columns = mean, spread
        for _ in range(most):
            centre = shape.mean(axis=0) if len(shape) else np.zeros(3)
            if is_free:
                columns = np.concatenate([spread, _motions(shape, centre, size, model.size is not None)])
            # The noise of each coordinate is the noise of the distance over √3.
            noise = np.maximum(observations.noise / motion.scale, MIN_NOISE * size)[:, None] / np.sqrt(3)
            offsets = motion.undo(observations.positions) - mean
            seen = observations.weigh(np.concatenate([columns, offsets[None]]), motion.rotation) / noise
            solution, root = _solve(seen[:-1], seen[-1], model.n_modes)
            scores, step = solution[: model.n_modes], solution[model.n_modes :]
            before, shape = shape, mean + np.tensordot(scores, spread, 1)
            if is_free:
                motion = motion.after(step, centre, size)
            moved = max(np.abs(shape - before).max(initial=0.0), size * np.abs(step).max(initial=0.0))
            if not is_free or moved <= TOLERANCE * size:
                return cls(scores, motion, root, centre, size)
        why = "the points may be wrong, or their noise too small"
        raise NotConvergedError(f"shape completion: shape and pose still move after {most} steps; {why}")


@dataclass(frozen=True, eq=False)
class _Motion:
    """From the model to the points: x ↦ scale · rotation @ x + translation."""

    scale: float = 1.0  # factor of the motion x ↦ scale · rotation @ x + translation
    rotation: FloatArray = field(default_factory=lambda: np.eye(3))
    translation: FloatArray = field(default_factory=lambda: np.zeros(3))

    @classmethod
    def onto(cls, mean: FloatArray, observations: Observations, scaled: bool) -> _Motion:
        """Move points of the mean (q, 3) as near as possible to those observed."""
        if len(mean) < 3:
            raise LandmarkError(f"{len(mean)} points do not fix a pose; give at least 3, or pose='given'")
        share = 1 / np.maximum(observations.noise, np.finfo(float).tiny ** 0.25) ** 2
        share = share / share.sum()
        source, target = (x - share @ x for x in (mean, observations.positions))
        for points in (source, target):
            lengths = np.linalg.svd(points * np.sqrt(share)[:, None], compute_uv=False)
            if lengths[1] <= MAX_WIDTH * lengths[0]:
                problem = "all points are on a line, around which any turn is possible"
                raise LandmarkError(f"{problem}; give others")
        rotation = nearest_rotation(source.T @ (share[:, None] * target)).T
        along = share @ ((source @ rotation.T) * target).sum(axis=1)
        scale = float(along / (share @ (source**2).sum(axis=1))) if scaled else 1.0
        return cls(scale, rotation, share @ observations.positions - scale * rotation @ (share @ mean))

    def apply(self, points: FloatArray) -> FloatArray:
        """Move points (m, 3) of the model."""
        return np.asarray(self.scale * points @ self.rotation.T + self.translation)

    def undo(self, points: FloatArray) -> FloatArray:
        """Move points (m, 3) back to the model."""
        return np.asarray((points - self.translation) @ self.rotation / self.scale)

    def after(self, step: FloatArray, centre: FloatArray, size: float) -> _Motion:
        """Compose this motion with a small one before it, as `_motions` has them."""
        growth = float(np.exp(step[6])) if len(step) > 6 else 1.0
        rotation = self.rotation @ Rotation.from_rotvec(step[:3]).as_matrix()
        scale = self.scale * growth
        shifted = self.apply((centre + size * step[3:6])[None])[0]
        return _Motion(scale, rotation, shifted - scale * rotation @ centre)


def _fit_nearest(
    model: ShapeModel, surface: SeenSurface, fit: _Fit, is_free: bool
) -> tuple[_Fit, Observations, tuple[str, ...]]:
    """Fit the shape to a surface by nearest points until it does not move; also return notes."""
    before = fit.motion.apply(fit.shape(model))
    for _ in range(MAX_ROUNDS):
        observations = surface.nearest(model.mesh().moved(before))
        fit = _Fit.of(model, observations, is_free)
        after = fit.motion.apply(fit.shape(model))
        moved = float(np.sqrt(model.weights @ ((after - before) ** 2).sum(axis=1)))
        before = after
        if moved <= MAX_MOVEMENT * fit.size * fit.motion.scale:
            return fit, observations, ()
    note = f"nearest points still move after {MAX_ROUNDS} rounds, in the last one by {moved:.3g}"
    return fit, observations, (f"{note}: the shape is in doubt",)


def _motions(points: FloatArray, centre: FloatArray, size: float, scaled: bool) -> FloatArray:
    """Displacements (6 or 7, m, 3) of points by small turns about a centre, shifts, and growth."""
    arms = points - centre
    turns = [np.cross(axis, arms) for axis in np.eye(3)]
    shifts = [np.broadcast_to(size * axis, points.shape) for axis in np.eye(3)]
    return np.array([*turns, *shifts, *([arms] if scaled else [])])


def _solve(matrix: FloatArray, offset: FloatArray, n_modes: int) -> tuple[FloatArray, FloatArray]:
    """Fit columns (c, q, 3) to offsets (q, 3): coefficients (c,) and a root of their covariance."""
    # The first n_modes coefficients have a standard normal prior. For the columns M and the offset d, let A = Q R be M
    # with n_modes rows of the identity below it. The minimum is at R⁻¹ Qᵀ (d; 0), and the posterior covariance is
    # (AᵀA)⁻¹ = R⁻¹ R⁻ᵀ: with M = Σ^(−½) Φ, it is C = (Φᵀ Σ⁻¹ Φ + I)⁻¹ of Albrecht et al. 2013.
    n_columns = len(matrix)
    rows = np.concatenate([matrix.reshape(n_columns, -1).T, np.eye(n_columns)[:n_modes]])
    with serial_blas():
        q, r = np.linalg.qr(rows)
        inverse = solve_triangular(r, np.eye(n_columns))
        return inverse @ (q[: offset.size].T @ offset.ravel()), inverse


def _deviations(columns: FloatArray, root: FloatArray) -> FloatArray:
    """Deviations (n,) of Σ of columns (c, n, 3) with coefficients of covariance root · rootᵀ."""
    with serial_blas():
        spread = root.T @ columns.reshape(len(columns), -1)
    return np.asarray(np.sqrt((spread**2).reshape(len(columns), -1, 3).sum(axis=(0, 2))))


@dataclass(frozen=True, eq=False, repr=False)
class Observations:
    """Points of a surface that were seen, in any coordinates.

    Examples
    --------
    >>> Observations.at_vertices([3, 5], [[0, 0, 0], [1, 0, 0]], noise=0.1)
    Observations(2 points)
    """

    points: PrecisePoints  #: q points, on the triangles of the model
    positions: FloatArray  #: (q, 3) where they were seen
    #: root mean square distance of seen points from what the modes describe, in the units of the
    #: positions, for all points or each (q,). Points with dependent errors need more noise.
    noise: FloatArray
    #: (q, 3) unit normals, if noise along the surface is ten times as large as across it
    normals: FloatArray | None = None
    #: the surface that the points are on; nearest points on it replace them once the shape is known
    surface: SeenSurface | None = None
    notes: tuple[str, ...] = ()  #: what was left out, or is in doubt

    def __post_init__(self) -> None:
        positions = numbers_of(self.positions, "positions", InputError).reshape(-1, 3)
        noise = numbers_of(self.noise, "noise", InputError)
        if len(self.points.corners) != len(positions) or noise.shape not in ((), (len(positions),)):
            given = f"{len(self.points.corners)} points with {len(positions)} positions"
            raise InputError(f"{given} and noise of shape {noise.shape}; give one of each for each point")
        if not np.isfinite(positions).all() or not np.isfinite(noise).all() or (noise < 0).any():
            need = "positions and noise must be finite, and noise not negative"
            raise InputError(f"{need}; leave out other points")
        vars(self).update(positions=positions, noise=np.broadcast_to(noise, len(positions)).copy())

    def __repr__(self) -> str:
        return f"Observations({len(self)} points)"

    def __len__(self) -> int:
        return len(self.positions)

    @classmethod
    def at_vertices(cls, vertices: ArrayLike, positions: ArrayLike, noise: ArrayLike) -> Observations:
        """Make observations of vertices (q,) of the model."""
        rows: IntArray = array_of(vertices, "vertices", InputError).astype(np.int64)
        return cls(PrecisePoints.at_vertices(rows), np.asarray(positions), np.asarray(noise))

    def weigh(self, columns: FloatArray, rotation: FloatArray) -> FloatArray:
        """Weigh displacements (c, q, 3) of the model across and along the surface, once rotated."""
        if self.normals is None:
            return columns
        normals = self.normals @ rotation
        across = np.einsum("cqd,qd->cq", columns, normals)[:, :, None] * normals
        return np.asarray(across + ALONG_WEIGHT * (columns - across))

    def check_fits(self, n_vertices: int) -> None:
        """Raise an `InputError` if the points are not on a surface with ``n_vertices`` vertices."""
        corners = self.points.corners
        if corners.size and not 0 <= corners.min() <= corners.max() < n_vertices:
            given = f"points at vertices {corners.min()}…{corners.max()}"
            raise InputError(f"{given}; the model has 0…{n_vertices - 1}")


@dataclass(frozen=True, eq=False)
class SeenSurface:
    """A surface that was seen, without names for its n points; noise (n,) as for `Observations`."""

    mesh: Mesh
    noise: FloatArray  # (n,) noise of each vertex

    def nearest(self, shape: Mesh) -> Observations:
        """Find the points of a shape that are nearest to the vertices, and face as they do."""
        points = nearest_on_surface(shape, self.mesh.vertices)
        normals = points.interpolated(shape.vertex_normals)
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(float).tiny)
        cosines = (normals * self.mesh.vertex_normals).sum(axis=1)
        if np.median(cosines) < 0:  # the surface is inside out: its normals point inward
            cosines = -cosines
        rows = np.flatnonzero((cosines > MIN_COSINE) & np.isfinite(self.noise))
        if not len(rows):
            problem = "no vertex of the part faces as the shape does where it is nearest"
            raise InputError(f"{problem}; check the pose, and the part itself")
        nearest = PrecisePoints(points.corners[rows], points.barycentric[rows])
        return Observations(nearest, self.mesh.vertices[rows], self.noise[rows], normals[rows])


def model_noise(model: ShapeModel) -> float:
    """Estimate how far other shapes are from the modes: the error of a shape left out."""
    return float(generalisation(model).mean[-1]) if len(model.names) > 1 else 0.0


def observed_vertices(
    model: ShapeModel, mesh: Mesh, known: BoolArray | None = None, noise: float | None = None
) -> Observations:
    """Observe the vertices of a mesh in the topology of a model that have a finite position.

    ``known`` (n,) tells which of these were measured, by default all. The noise is the root mean
    square distance of a vertex from the modes, by default `model_noise`. As errors of neighbours
    are alike, all vertices within a square of 0.2 √area count as one.
    """
    if not np.array_equal(mesh.faces, model.faces) or mesh.n_vertices != len(model.mean):
        problem = f"{mesh!r} has other faces than the model ({len(model.mean)} vertices)"
        raise MeshError(f"{problem}; match it: `observed_part`")
    seen, mean = np.isfinite(mesh.vertices).all(axis=1), model.mesh()
    if known is not None:
        seen &= known
    rows = np.flatnonzero(seen & (mean.vertex_areas > 0))
    points, positions = PrecisePoints.at_vertices(rows), mesh.vertices[rows]
    shares = mean.vertex_areas[rows] / mean.area
    alone = _noise(noise, model, points, positions) / _root_of_observations(shares)
    notes = (f"{len(rows)} of {len(mesh.vertices)} vertices have a position",)
    return Observations(points, positions, alone, notes=notes)


def observed_landmarks(
    model: ShapeModel, mean_landmarks: Landmarks, found: Landmarks, noise: float | None = None
) -> Observations:
    """Observe landmarks of a shape, joined by name with landmarks of the model's mean.

    Their expected errors add to the noise, see `observed_vertices`.
    """
    both = mean_landmarks, found
    known, given = ([n for n, is_placed in zip(x.names, x.placed) if is_placed and n] for x in both)
    shared = [name for name in known if name in set(given)]
    if not shared:
        of_both = f"{', '.join(given)[:80]} and {', '.join(known)[:80]}"
        raise LandmarkError(f"no landmark of the shape is named like one of the mean: {of_both}")
    if twice := [name for name in shared if known.count(name) + given.count(name) > 2]:
        raise LandmarkError(f"several landmarks are named {', '.join(twice)}; give each a name of its own")
    row_of = [{x.names[i]: i for i in np.flatnonzero(x.placed)} for x in both]
    rows, rows_found = ([of[name] for name in shared] for of in row_of)
    points = nearest_on_surface(model.mesh(), mean_landmarks.positions[rows])
    positions, errors = found.positions[rows_found], np.nan_to_num(found.expected_error[rows_found])
    unknown = [name for name in given if name not in shared]
    notes = (f"landmarks that the mean does not have: {', '.join(unknown)}",) if unknown else ()
    total = np.hypot(_noise(noise, model, points, positions), errors)
    return Observations(points, positions, total, notes=notes)


def observed_part(
    model: ShapeModel,
    part: SurfaceLike,
    found: Correspondence,
    expected_error: ArrayLike = 0.0,
    noise: float | None = None,
) -> Observations:
    """Observe the m vertices of a shape, or a part, given its map to the mean of a model.

    The map may be from ``match(part, model.mesh())``. Expected errors (m,) of its images, in √area,
    as a `MatchResult` has them, add to the noise, see `observed_vertices`, until nearest points
    replace the images.
    """
    part, mean = mesh_from(part), model.mesh()
    found.check_fits(part, mean)
    rows = np.flatnonzero(found.matched & (part.vertex_areas > 0))
    points = PrecisePoints(found.faces[rows], np.array(found.barycentric[rows]))
    positions = part.vertices[rows]
    area = _scale(model, points, positions) ** 2 * mean.area
    with np.errstate(divide="ignore"):
        alone = _noise(noise, model, points, positions) / _root_of_observations(part.vertex_areas / area)
    errors = np.broadcast_to(np.asarray(expected_error, dtype=np.float64), part.n_vertices)[rows]
    finite = errors[np.isfinite(errors)]
    errors = np.where(np.isfinite(errors), errors, np.median(finite) if len(finite) else 0.0)
    mapped = np.sqrt(area) * errors / _root_of_observations(part.vertex_areas[rows] / area)
    notes = (f"{len(rows)} of {part.n_vertices} vertices were matched to the mean",)
    surface = SeenSurface(part, alone)
    return Observations(points, positions, np.hypot(alone[rows], mapped), surface=surface, notes=notes)


def read_observations(
    path: str | Path,
    model: ShapeModel,
    landmarks: str | Path | None = None,
    *,
    noise: float | None = None,
    config: Config | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> Observations:
    """Read observations of a shape: a mesh, in the topology of a model or not, or landmarks.

    A mesh with the faces of the model gives its vertices, without those with ``measured`` = 0;
    others are matched to the mean by `match`. Landmarks, see `Landmarks.read`, need those of the
    mean, in another file. A folder of meshes, named like structures of the model, is in the
    coordinates of one subject. For the noise, see `observed_vertices`.
    """
    path = Path(path)
    if path.is_dir():
        return _of_structures(path, model, noise, config=config, seed=seed, progress=progress)
    if path.suffix.lower() not in FORMATS:
        if landmarks is None:
            raise LandmarkError(f"{path}: give the landmarks of the mean too, with the same names")
        mean_landmarks = Landmarks.read(landmarks, model.mesh())
        return observed_landmarks(model, mean_landmarks, Landmarks.read(path), noise)
    if landmarks is not None:
        use = "landmarks of the mean are for a file of landmarks"
        raise SettingError(f"{landmarks}: {use}; {path} is a mesh")
    mesh, measured = read_corresponding(path, model.faces)
    if np.array_equal(mesh.faces, model.faces) and mesh.n_vertices == len(model.mean):
        return observed_vertices(model, mesh, measured, noise)
    result = match(mesh, model.mesh(), config=config, seed=seed, progress=progress)
    seen = observed_part(model, mesh, result.map, result.expected_error, noise)
    if result.outcome.is_called_right:
        return seen
    doubt = f"the match is in doubt: {result.outcome.value}; {result.outcome.advice}"
    return replace(seen, notes=(*seen.notes, doubt))


def _of_structures(folder: Path, model: ShapeModel, noise: float | None, **how: Any) -> Observations:
    """Observe the structures of a subject in a folder, matched to the mean if needed."""
    files = {legible(file.stem): file for file in meshes_among(folder.iterdir())}
    if not files or not set(files) <= set(model.structures):
        remedy = f"give some of the structures of the model, {[*model.structures]}"
        raise InputError(f"{folder}: has {[*files]}; {remedy}")
    whole, known, notes = model.mean.copy(), np.zeros(len(model.mean), dtype=bool), list[str]()
    for name, file in files.items():
        part = slices_of(model.structures)[name]
        mean = structure_of(model.mesh(), part)
        mesh, measured = read_corresponding(file, mean.faces)
        if not np.array_equal(mesh.faces, mean.faces) or mesh.n_vertices != mean.n_vertices:
            result = match(mean, mesh, **how)
            notes += [f"{name}: {result.outcome.value}"] * (result.outcome is not Outcome.CONVERGED)
            wrapped = wrap(result.map, mean, mesh)
            mesh, measured = wrapped.mesh, ~wrapped.extended
        known[part] = True if measured is None else measured
        whole[part] = mesh.vertices
    seen = observed_vertices(model, Mesh(whole, model.faces), known, noise)
    return replace(seen, notes=(*seen.notes, *notes))


def _root_of_observations(shares: FloatArray) -> FloatArray:
    """Root of the number of independent observations that a vertex stands for, at most 1."""
    return np.minimum(np.sqrt(shares) / PATCH_LENGTH, 1.0)


def _noise(noise: float | None, model: ShapeModel, points: PrecisePoints, positions: FloatArray) -> float:
    """Noise of one point, in the units of the positions."""
    if noise is None:
        return model_noise(model) * _scale(model, points, positions)
    if not 0 <= noise < np.inf:
        raise SettingError(f"noise = {noise!r} is not a distance; give 0 or more, in the units of the shape")
    return noise


def _scale(model: ShapeModel, points: PrecisePoints, positions: FloatArray) -> float:
    """Estimate the size of a shape divided by the size of the model, if sizes were removed."""
    if model.size is None:
        return 1.0
    sizes = [np.linalg.norm(x - x.mean(axis=0)) for x in (positions, points.interpolated(model.mean))]
    return float(sizes[0] / max(sizes[1], np.finfo(float).tiny)) or 1.0
