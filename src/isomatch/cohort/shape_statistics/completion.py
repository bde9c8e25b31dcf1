"""Shape completion: the shape of a model, and how uncertain it is, given some of its points."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from scipy.linalg import solve_triangular
from scipy.spatial.transform import Rotation

from isomatch._core.arrays import FloatArray
from isomatch._core.errors import LandmarkError, NotConvergedError
from isomatch._core.memory import require_memory
from isomatch._core.settings import require_one_of
from isomatch._core.threads import serial_blas
from isomatch.cohort.shape_statistics.observations import Observations, SeenSurface, model_noise
from isomatch.cohort.shape_statistics.shape_model import ShapeModel
from isomatch.correspondence import nearest_rotation
from isomatch.surfaces import Mesh

Pose = Literal["fitted", "given"]

LEAST_NOISE = 1e-6  # of the size of the mean: less would leave nothing of double precision
TOLERANCE = 1e-9  # largest movement of the shape in the last step, over its size
MOST_STEPS = 200
MOST_ROUNDS = 30  # of nearest points; about 10 suffice
SETTLED = 1e-3  # of the size: movement in the last round
STRAIGHT = 1e-3  # width over length of points that are taken for a line, around which any turn is possible


@dataclass(frozen=True, eq=False, repr=False)
class Completion:
    """The shape of a model that some points of it tell of.

    Parameters
    ----------
    mesh : Mesh
        The likeliest shape, with the n vertices of the model, where the given points are.
    standard_deviation : (n,) array of float
        How uncertain each vertex is: the root of the sum of the variances of its three coordinates, in the units of the
        points, as far as the modes describe shapes.
    residual : float
        What they do not describe, see `model_noise`, in the units of the points.
    scores, score_deviations : (k,) array of float
        Coordinates of the shape along the modes, in the units of the model, and their standard deviations.
    error : float
        Root mean square distance of the given points from where the shape has them, each weighted by one over the square
        of its noise; nan without points.
    scale : float
    rotation : (3, 3) array of float
    translation : (3,) array of float
        The motion from the model: ``x ↦ scale · rotation @ x + translation``.
    n_points : int
        How many points the shape rests on.
    notes : tuple of str
        What is in doubt.
    """

    mesh: Mesh
    standard_deviation: FloatArray
    residual: float
    scores: FloatArray
    score_deviations: FloatArray
    error: float
    scale: float
    rotation: FloatArray
    translation: FloatArray
    n_points: int
    notes: tuple[str, ...] = ()

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
        or are where the model is.

    Raises
    ------
    LandmarkError
        If a pose is to be fitted to fewer than three points, or to points on a line.
    NotConvergedError
        If pose and shape still move after many steps.

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
        raise NotConvergedError(
            f"shape completion: shape and pose still move after {most} steps; the points may be wrong, or "
            "their noise too small"
        )


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
                raise LandmarkError(
                    "all points are on a line, around which any turn is possible; give others"
                )
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
