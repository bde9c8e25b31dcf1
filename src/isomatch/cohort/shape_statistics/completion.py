"""Shape completion: what is known of a shape of a model, which is the likeliest, and how uncertain it is."""

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

Pose = Literal["fitted", "given"]
LEAST_NOISE = 1e-6  # of the size of the mean: less would leave nothing of double precision
TOLERANCE = 1e-9  # largest movement of the shape in the last step, over its size
MOST_STEPS = 200
MOST_ROUNDS = 30  # of nearest points; about 10 suffice
SETTLED = 1e-3  # of the size: movement in the last round
STRAIGHT = 1e-3  # width over length of points that are taken for a line, around which any turn is possible
PATCH = 0.2  # √area: errors of points nearer than this are about the same; docs/statistics.md, completion
ALONG = 0.1  # how much is known of where on the surface a nearest point is, over how far it is from it
FACING = 0.5  # least cosine of the normals of points that are taken for one


@dataclass(frozen=True, eq=False, repr=False)
class Completion:
    """The shape of a model that some points of it tell of."""

    mesh: Mesh  #: the likeliest shape, with the n vertices of the model, where the given points are
    #: (n,) how uncertain each vertex is, as far as the modes describe shapes: the root of the sum of the variances of its
    #: three coordinates, in the units of the points
    standard_deviation: FloatArray
    residual: float  #: what the modes do not describe, see `model_noise`, in the units of the points
    scores: FloatArray  #: (k,) coordinates along the modes, in the units of the model, with their standard deviations
    score_deviations: FloatArray
    #: root mean square distance of the given points from where the shape has them, each weighted by one over the square
    #: of its noise; nan without points
    error: float
    scale: float  #: the motion from the model: x ↦ scale · rotation @ x + translation
    rotation: FloatArray  #: (3, 3)
    translation: FloatArray  #: (3,)
    n_points: int  #: on which the shape rests
    notes: tuple[str, ...] = ()  #: what is in doubt

    def __repr__(self) -> str:
        return f"Completion({self.mesh!r}, error {self.error:.3g})"

    @property
    def expected_error(self) -> FloatArray:
        """(n,) distance of each vertex from its true place, a root mean square, in the units of the points."""
        return np.hypot(self.standard_deviation, self.residual)


def complete(model: ShapeModel, observations: Observations, *, pose: Pose = "fitted") -> Completion:
    """Find the likeliest shape of a model given some of its points, and how uncertain every vertex is.

    Parameters
    ----------
    model : ShapeModel
        Scores along its k modes are independent and normally distributed.
    observations : Observations
        Where some points of the surface are, and how precisely that is known. With none, and in the given pose, the
        result is the mean with the deviations of the model.
    pose : {"fitted", "given"}
        Whether the points may be anywhere and turned in any way, and of any size if the model was made without sizes;
        or are where the model is. A pose is fitted to three points or more, which are not on a line.

    Notes
    -----
    Albrecht, Lüthi, Gerig & Vetter, *Posterior shape models*, Medical Image Analysis 2013. Nearest points on a surface
    that was matched are renewed until the shape moves by less than 0.001 of its size, 30 times at most, after which a
    note says so. O(q k²) time a step for q points; a few suffice.

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
        fit, observations, notes = _settled(model, observations.surface, fit, is_free=pose == "fitted")
    motion, shape = fit.motion, fit.shape(model)
    columns = model.modes * model.deviations[:, None, None]  # (k, n, 3)
    if pose == "fitted":
        columns = np.concatenate([columns, _motions(shape, fit.centre, fit.size, model.size is not None)])
    apart = observations.positions - motion.done(observations.points.interpolated(shape))
    precision = 1 / np.maximum(observations.noise, LEAST_NOISE * fit.size * motion.scale) ** 2
    error = float(np.sqrt(precision @ (apart**2).sum(axis=1) / precision.sum())) if len(apart) else np.nan
    mesh, residual = model.mesh().moved(motion.done(shape)), motion.scale * model_noise(model)
    deviations, scores = motion.scale * _deviations(columns, fit.root), fit.scores * model.deviations
    score_deviations = np.linalg.norm(fit.root[: model.n_modes], axis=1) * model.deviations
    placed = motion.scale, motion.rotation, motion.translation
    known = mesh, deviations, residual, scores, score_deviations, error
    return Completion(*known, *placed, len(observations), notes)


@dataclass(frozen=True, eq=False)
class _Fit:
    """Scores (k,) in standard deviations, and the motion to the points."""

    scores: FloatArray  # (k,)
    motion: _Motion
    root: FloatArray  # of the covariance of the scores, and of small motions about the centre in units of the size
    centre: FloatArray
    size: float

    def shape(self, model: ShapeModel) -> FloatArray:
        """(n, 3) the shape where the model is."""
        return model.vertices(self.scores * model.deviations)

    @classmethod
    def of(cls, model: ShapeModel, observations: Observations, is_free: bool, most: int = MOST_STEPS) -> _Fit:
        """Fit the scores, and also the motion if it is free."""
        size = float(np.sqrt(model.weights @ ((model.mean - model.weights @ model.mean) ** 2).sum(axis=1)))
        mean = observations.points.interpolated(model.mean)
        modes = [observations.points.interpolated(mode) for mode in model.modes]
        spread = np.array(modes).reshape(model.n_modes, len(mean), 3) * model.deviations[:, None, None]
        motion = _Motion.onto(mean, observations, model.size is not None) if is_free else _Motion()
        # x = m + Φ b + e of the model, with b ~ N(0, I) in standard deviations and e ~ N(0, Σ). The likeliest b, and
        # motion of the model, minimise |Σ^(−½) (x − m − Φ b − T t)|² + |b|², where T are small turns about the centre,
        # shifts and growth, t, without a prior. A turn is not linear: the step t is made part of the motion, and is
        # repeated from there (Gauss–Newton), with b as a whole; uncertainty is that of the last step
        shape, columns = mean, spread
        for _ in range(most):
            centre = shape.mean(axis=0) if len(shape) else np.zeros(3)
            if is_free:
                columns = np.concatenate([spread, _motions(shape, centre, size, model.size is not None)])
            # the noise is of the whole distance; of each coordinate, it is 1/√3 of that
            noise = np.maximum(observations.noise / motion.scale, LEAST_NOISE * size)[:, None] / np.sqrt(3)
            offsets = motion.undone(observations.positions) - mean
            seen = observations.weighed(np.concatenate([columns, offsets[None]]), motion.rotation) / noise
            solution, root = _solved(seen[:-1], seen[-1], model.n_modes)
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

    scale: float = 1.0
    rotation: FloatArray = field(default_factory=lambda: np.eye(3))
    translation: FloatArray = field(default_factory=lambda: np.zeros(3))

    @classmethod
    def onto(cls, mean: FloatArray, observations: Observations, scaled: bool) -> _Motion:
        """Move points of the mean (q, 3) onto those observed, as near as possible."""
        if len(mean) < 3:
            raise LandmarkError(f"{len(mean)} points do not fix a pose; give at least 3, or pose='given'")
        share = 1 / np.maximum(observations.noise, np.finfo(float).tiny ** 0.25) ** 2
        share = share / share.sum()
        here, there = (x - share @ x for x in (mean, observations.positions))
        for points in (here, there):
            lengths = np.linalg.svd(points * np.sqrt(share)[:, None], compute_uv=False)
            if lengths[1] <= STRAIGHT * lengths[0]:
                problem = "all points are on a line, around which any turn is possible"
                raise LandmarkError(f"{problem}; give others")
        rotation = nearest_rotation(here.T @ (share[:, None] * there)).T
        along = share @ ((here @ rotation.T) * there).sum(axis=1)
        scale = float(along / (share @ (here**2).sum(axis=1))) if scaled else 1.0
        return cls(scale, rotation, share @ observations.positions - scale * rotation @ (share @ mean))

    def done(self, points: FloatArray) -> FloatArray:
        """Move points (m, 3) of the model."""
        return np.asarray(self.scale * points @ self.rotation.T + self.translation)

    def undone(self, points: FloatArray) -> FloatArray:
        """Move points (m, 3) back to the model."""
        return np.asarray((points - self.translation) @ self.rotation / self.scale)

    def after(self, step: FloatArray, centre: FloatArray, size: float) -> _Motion:
        """Put a small motion of the model before this one, as `_motions` has them."""
        grown = float(np.exp(step[6])) if len(step) > 6 else 1.0
        rotation = self.rotation @ Rotation.from_rotvec(step[:3]).as_matrix()
        scale = self.scale * grown
        shifted = self.done((centre + size * step[3:6])[None])[0]
        return _Motion(scale, rotation, shifted - scale * rotation @ centre)


def _settled(
    model: ShapeModel, surface: SeenSurface, fit: _Fit, is_free: bool
) -> tuple[_Fit, Observations, tuple[str, ...]]:
    """Let nearest points on the shape take the place of the images of a map, until it does not move; and notes."""
    before = fit.motion.done(fit.shape(model))
    for _ in range(MOST_ROUNDS):
        observations = surface.nearest(model.mesh().moved(before))
        fit = _Fit.of(model, observations, is_free)
        after = fit.motion.done(fit.shape(model))
        moved = float(np.sqrt(model.weights @ ((after - before) ** 2).sum(axis=1)))
        before = after
        if moved <= SETTLED * fit.size * fit.motion.scale:
            return fit, observations, ()
    note = f"nearest points still move after {MOST_ROUNDS} rounds, in the last one by {moved:.3g}: the shape is in doubt"
    return fit, observations, (note,)


def _motions(points: FloatArray, centre: FloatArray, size: float, scaled: bool) -> FloatArray:
    """Displacements (6 or 7, m, 3) of points by small turns about a centre, shifts, and growth."""
    arms = points - centre
    turns = [np.cross(axis, arms) for axis in np.eye(3)]
    shifts = [np.broadcast_to(size * axis, points.shape) for axis in np.eye(3)]
    return np.array([*turns, *shifts, *([arms] if scaled else [])])


def _solved(matrix: FloatArray, offset: FloatArray, n_modes: int) -> tuple[FloatArray, FloatArray]:
    """Fit columns (c, q, 3), the first with a standard normal prior, to offsets (q, 3): coefficients (c,), and a root."""
    # with rows A = [M; I of the prior] = Q R, the minimum is at R⁻¹ Qᵀ (d; 0), and the posterior covariance
    # (Mᵀ M + prior)⁻¹ = (Rᵀ R)⁻¹ = R⁻¹ R⁻ᵀ: with M = Σ^(−½) Φ it is C = (Φᵀ Σ⁻¹ Φ + I)⁻¹ of Albrecht et al. 2013
    n_columns = len(matrix)
    rows = np.concatenate([matrix.reshape(n_columns, -1).T, np.eye(n_columns)[:n_modes]])
    with serial_blas():
        q, r = np.linalg.qr(rows)
        inverse = solve_triangular(r, np.eye(n_columns))
        return inverse @ (q[: offset.size].T @ offset.ravel()), inverse


def _deviations(columns: FloatArray, root: FloatArray) -> FloatArray:
    """Find the deviation (n,) of the sum of columns (c, n, 3) whose coefficients have the covariance root · rootᵀ."""
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
    #: of all, or (q,): root mean square distance between where a point was seen and where the modes of the model can have
    #: it, in the units of the positions. Errors are taken as independent: points that err together need more noise.
    noise: FloatArray
    #: (q, 3) unit normals, where only the distance across the surface is known: along it, noise is ten times as large
    normals: FloatArray | None = None
    #: what the points are of: where the shape is about known, its nearest points take their place
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

    def weighed(self, columns: FloatArray, rotation: FloatArray) -> FloatArray:
        """Weigh displacements (c, q, 3) by what is known of them; a rotation carries their coordinates to those seen."""
        if self.normals is None:
            return columns
        normals = self.normals @ rotation
        across = np.einsum("cqd,qd->cq", columns, normals)[:, :, None] * normals
        return np.asarray(across + ALONG * (columns - across))

    def check_fits(self, n_vertices: int) -> None:
        """Raise an `InputError` if the points are not on a surface with so many vertices."""
        corners = self.points.corners
        if corners.size and not 0 <= corners.min() <= corners.max() < n_vertices:
            given = f"points at vertices {corners.min()}…{corners.max()}"
            raise InputError(f"{given}; the model has 0…{n_vertices - 1}")


@dataclass(frozen=True, eq=False)
class SeenSurface:
    """A surface that was seen, without names for its n points; noise (n,) as for `Observations`."""

    mesh: Mesh
    noise: FloatArray  # (n,)

    def nearest(self, shape: Mesh) -> Observations:
        """Find the points of a shape of the model near it that are nearest to the vertices, and face as they do."""
        points = nearest_on_surface(shape, self.mesh.vertices)
        normals = points.interpolated(shape.vertex_normals)
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(float).tiny)
        cosines = (normals * self.mesh.vertex_normals).sum(axis=1)
        if np.median(cosines) < 0:  # the surface is wound inside out
            cosines = -cosines
        rows = np.flatnonzero((cosines > FACING) & np.isfinite(self.noise))
        if not len(rows):
            raise InputError(
                "no vertex of the part faces as the shape does where it is nearest; check the pose, and the part itself"
            )
        there = PrecisePoints(points.corners[rows], points.barycentric[rows])
        return Observations(there, self.mesh.vertices[rows], self.noise[rows], normals[rows])


def model_noise(model: ShapeModel) -> float:
    """Estimate how far points of further shapes are from what the modes describe: the error of a shape left out."""
    return float(generalisation(model).mean[-1]) if len(model.names) > 1 else 0.0


def observed_vertices(
    model: ShapeModel, mesh: Mesh, known: BoolArray | None = None, noise: float | None = None
) -> Observations:
    """Take the vertices that a mesh in the topology of a model has, without those that have no finite position.

    Of the others, all (n,) were measured by default. The noise is the root mean square distance of a vertex from what
    the modes describe, by default `model_noise`. As errors of neighbours are alike, all vertices within a square of 0.2
    √area count as one.
    """
    if not np.array_equal(mesh.faces, model.faces) or mesh.n_vertices != len(model.mean):
        problem = f"{mesh!r} has other faces than the model ({len(model.mean)} vertices)"
        raise MeshError(f"{problem}; match it: `observed_part`")
    seen, mean = np.isfinite(mesh.vertices).all(axis=1), model.mesh()
    if known is not None:
        seen &= known
    rows = np.flatnonzero(seen & (mean.vertex_areas > 0))
    points, positions = PrecisePoints.at_vertices(rows), mesh.vertices[rows]
    noise = _noise(noise, model, points, positions)
    notes = (f"{len(rows)} of {len(mesh.vertices)} vertices have a position",)
    return Observations(points, positions, noise / _counted(mean.vertex_areas[rows] / mean.area), notes=notes)


def observed_landmarks(
    model: ShapeModel, own: Landmarks, found: Landmarks, noise: float | None = None
) -> Observations:
    """Take landmarks of a shape, joined by name with the model's own, which are in the coordinates of its mean.

    Their expected errors add to the noise, which is that of `observed_vertices`.
    """
    # of the mean, and of the shape
    names = [[name for name, is_there in zip(x.names, x.placed) if is_there and name] for x in (own, found)]
    shared = [name for name in names[0] if name in set(names[1])]
    if not shared:
        of_both = f"{', '.join(names[1])[:80]} and {', '.join(names[0])[:80]}"
        raise LandmarkError(f"no landmark of the shape is named like one of the mean: {of_both}")
    twice = [name for name in shared if names[0].count(name) + names[1].count(name) > 2]
    if twice:
        raise LandmarkError(f"several landmarks are named {', '.join(twice)}; give each a name of its own")
    row_of = [{x.names[i]: i for i in np.flatnonzero(x.placed)} for x in (own, found)]
    rows, rows_found = ([of[name] for name in shared] for of in row_of)
    points = nearest_on_surface(model.mesh(), own.positions[rows])
    positions, errors = found.positions[rows_found], np.nan_to_num(found.expected_error[rows_found])
    unknown = [name for name in names[1] if name not in shared]
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
    """Take the m vertices of a surface, all of a shape or a part, of which a map to the mean of a model was found.

    That is such as of ``match(part, model.mesh())``. Expected errors (m,) of its images, in √area, as a `MatchResult`
    has them, add to the noise, which is that of `observed_vertices`, until nearest points take their place.
    """
    part, mean = mesh_from(part), model.mesh()
    found.check_fits(part, mean)
    rows = np.flatnonzero(found.matched & (part.vertex_areas > 0))
    points = PrecisePoints(found.faces[rows], np.array(found.barycentric[rows]))
    positions = part.vertices[rows]
    area = _scale(model, points, positions) ** 2 * mean.area
    with np.errstate(divide="ignore"):
        alone = _noise(noise, model, points, positions) / _counted(part.vertex_areas / area)
    errors = np.broadcast_to(np.asarray(expected_error, dtype=np.float64), part.n_vertices)[rows]
    finite = errors[np.isfinite(errors)]
    errors = np.where(np.isfinite(errors), errors, np.median(finite) if len(finite) else 0.0)
    mapped = np.sqrt(area) * errors / _counted(part.vertex_areas[rows] / area)
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
    """Read what is known of a shape: a mesh in the topology of a model without some vertices, any mesh, or landmarks.

    A mesh with the faces of the model has its vertices, without those with ``measured`` = 0; others are matched to the
    mean, as by `match`. Landmarks, see `Landmarks.read`, need those of the mean, in another file. A folder of such
    meshes, named like structures of the model, is in the coordinates of one subject. Noise is that of
    `observed_vertices`.
    """
    path = Path(path)
    if path.is_dir():
        return _of_structures(path, model, noise, config=config, seed=seed, progress=progress)
    if path.suffix.lower() not in FORMATS:
        if landmarks is None:
            raise LandmarkError(f"{path}: give the landmarks of the mean too, with the same names")
        own = Landmarks.read(landmarks, model.mesh())
        return observed_landmarks(model, own, Landmarks.read(path), noise)
    if landmarks is not None:
        use = "landmarks of the mean are for a file of landmarks"
        raise SettingError(f"{landmarks}: {use}; {path} is a mesh")
    mesh, measured = read_corresponding(path, model.faces)
    if np.array_equal(mesh.faces, model.faces) and mesh.n_vertices == len(model.mean):
        return observed_vertices(model, mesh, measured, noise)
    result = match(mesh, model.mesh(), config=config, seed=seed, progress=progress)
    seen = observed_part(model, mesh, result.map, result.expected_error, noise)
    if result.outcome in (Outcome.CONVERGED, Outcome.PARTIAL):
        return seen
    doubt = f"the match is in doubt: {result.outcome.value}; {result.outcome.advice}"
    return replace(seen, notes=(*seen.notes, doubt))


def _of_structures(folder: Path, model: ShapeModel, noise: float | None, **how: Any) -> Observations:
    """Take the structures of a subject that are in a folder; one in another topology is brought into that of the mean."""
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


def _counted(shares: FloatArray) -> FloatArray:
    """Root of the number of independent observations that a vertex with a share of the area stands for, at most 1."""
    return np.minimum(np.sqrt(shares) / PATCH, 1.0)


def _noise(noise: float | None, model: ShapeModel, points: PrecisePoints, positions: FloatArray) -> float:
    """Noise of one point, in the units of the positions."""
    if noise is None:
        return model_noise(model) * _scale(model, points, positions)
    if not 0 <= noise < np.inf:
        raise SettingError(f"noise = {noise!r} is not a distance; give 0 or more, in the units of the shape")
    return noise


def _scale(model: ShapeModel, points: PrecisePoints, positions: FloatArray) -> float:
    """About how many times as large as the model a shape is, if sizes were removed."""
    if model.size is None:
        return 1.0
    there, here = (x - x.mean(axis=0) for x in (positions, points.interpolated(model.mean)))
    return float(np.linalg.norm(there) / max(np.linalg.norm(here), np.finfo(float).tiny)) or 1.0
