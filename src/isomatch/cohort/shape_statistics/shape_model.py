"""The statistical shape model: mean and principal modes, its quality, and files of other tools."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import chi2

from isomatch._core.array_file import ArrayFormat, Stored, save_arrays
from isomatch._core.arrays import BoolArray, FloatArray, IntArray, numbers_of
from isomatch._core.cached import cached_property
from isomatch._core.errors import FormatError, InputError, MeshError, SettingError
from isomatch._core.files import replaced, write_text
from isomatch._core.first_use import package
from isomatch._core.settings import generator, require_one_of
from isomatch._core.threads import serial_blas
from isomatch.cohort.shape_statistics.procrustes import Scale, aligned_to, generalised_procrustes
from isomatch.cohort.shape_statistics.shapes import (
    MIRRORED,
    CorrespondedShapes,
    filled,
    read_corresponding,
    slices_of,
)
from isomatch.io import write_mesh
from isomatch.surfaces import Mesh

Weighting = Literal["area", "uniform"]  # whether a vertex counts by its area, or all count alike
# a mode is a rounding error if its standard deviation, over the size of the mean, is below this; chosen
MIN_DEVIATION = 1e-10
# largest number of shapes left out, one at a time; of more, some are drawn at random; chosen
MAX_LEFT_OUT = 100
# Number of random shapes that `specificity` draws; chosen: their mean distance is then known to about 1 % (Styner et al.
# 2003 draw 10 000).
N_RANDOM_SHAPES = 1000
FORMAT = ArrayFormat(  # contents of the file of a model
    what="a shape model",
    writer="ShapeModel.save",
    version=1,
    arrays={
        "names": Stored("text"),
        "mean": Stored("float", ("n", "d")),
        "faces": Stored("integer", ("f", 3), index_of="n"),
        "weights": Stored("float", ("n",)),
        "modes": Stored("float", ("k", "n", "d")),
        "variances": Stored("float", ("k",), positive=True),
        "scores": Stored("float", ("m", "k")),
        "size": Stored("float", positive=True, group="size"),
        "structures": Stored("text", group="structures"),
    },
    filled=("n", "m"),
)


@dataclass(frozen=True, eq=False)
class ScoredShape:
    """A shape described by the modes of a model.

    Examples
    --------
    >>> triangle = Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    >>> shapes = CorrespondedShapes.of_meshes({str(s): triangle.moved(s * triangle.vertices) for s in (1, 2, 3)})
    >>> model = ShapeModel.fit(shapes)
    >>> scored = model.score(model.mode_mesh(0, 3.0))
    >>> round(scored.mahalanobis, 6), round(scored.p_value, 4), bool(scored.error < 1e-9)
    (3.0, 0.0027, True)
    """

    scores: FloatArray  #: (k,) coordinates along the modes, in the units of the shapes
    deviations: FloatArray  #: (k,) the scores in standard deviations of the modes
    aligned: FloatArray  #: (n, 3) the shape moved onto the mean
    reconstructed: FloatArray  #: (n, 3) the shape of the model with these scores
    error: float  #: root mean square distance of these two, which no mode describes
    measured: BoolArray | None = None  #: (n,) which vertices were measured; by default all

    @property
    def vertex_errors(self) -> FloatArray:
        """(n,) distance of each aligned vertex from the reconstructed one; nan if not measured."""
        errors = np.linalg.norm(self.aligned - self.reconstructed, axis=1)
        return np.asarray(errors if self.measured is None else np.where(self.measured, errors, np.nan))

    @property
    def mahalanobis(self) -> float:
        """Mahalanobis distance from the mean within the modes, in standard deviations."""
        return float(np.linalg.norm(self.deviations))

    @property
    def p_value(self) -> float:
        """Probability that a shape of the model is as far from the mean, from χ².

        Variances are taken as exact. If a model has nearly as many modes as shapes, almost every
        new shape has a small p-value: compare its distance with those of `leave_one_out`.
        """
        return float(chi2.sf(self.mahalanobis**2, len(self.deviations))) if len(self.deviations) else 1.0


@dataclass(frozen=True, eq=False, repr=False)
class ShapeModel:
    """Mean and principal modes of m corresponding shapes: x = mean + Σ score · mode.

    Examples
    --------
    >>> triangle = Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    >>> shapes = CorrespondedShapes.of_meshes({str(s): triangle.moved(s * triangle.vertices) for s in (1, 2, 3)})
    >>> model = ShapeModel.fit(shapes)
    >>> model
    ShapeModel(1 mode of 3 shapes, 3 vertices)
    >>> (model.scores / model.scores[2]).round(6).ravel() + 0.0
    array([-1.,  0.,  1.])
    """

    names: tuple[str, ...]  #: names of the shapes
    mean: FloatArray  #: (n, 3) mean shape
    faces: IntArray  #: (f, 3) triangles; none for landmarks
    weights: FloatArray  #: (n,) weight of each vertex in all distances; the sum is 1
    #: (k, n, 3) displacements of the vertices, orthonormal in the weighted scalar product, in
    #: decreasing order of variance; as many as describe all shapes, at most m − 1
    modes: FloatArray
    variances: FloatArray  #: (k,) variances of the scores, with m − 1 degrees of freedom
    scores: FloatArray  #: (m, k) coordinates of the shapes along the modes
    #: root mean square distance from the centroid that every shape was given, if sizes were removed
    size: float | None = None
    #: for subjects of several surfaces: number of vertices of each structure, in their order
    structures: Mapping[str, int] = field(default_factory=dict)

    def __repr__(self) -> str:
        modes = f"{self.n_modes} mode{'s' * (self.n_modes != 1)}"
        return f"ShapeModel({modes} of {len(self.names)} shapes, {len(self.mean)} vertices)"

    @classmethod
    def fit(
        cls,
        shapes: CorrespondedShapes,
        scale: Scale = "keep",
        weights: Weighting = "area",
        *,
        tangent: bool = False,
    ) -> ShapeModel:
        """Align shapes and find their modes.

        Vertices that were not measured are where the mean of the others is, see `filled`; for
        ``scale`` and ``tangent``, see `generalised_procrustes`. With ``weights="area"``, a vertex
        counts by its share of the area, so that the model does not depend on how densely the
        surface is sampled; with "uniform" all count alike.

        Notes
        -----
        Cootes et al., *Active shape models*, CVIU 1995. One singular value decomposition of the
        weighted m × 3n matrix: O(m n min(m, n)) time. The sign of a mode is such that it moves the
        outer parts of the mean outward.
        """
        require_one_of("weights", weights, Weighting)
        n = shapes.n_vertices
        share = shapes.area_weights if weights == "area" else np.full(n, 1 / n)
        shapes = filled(shapes, share, scale)
        superimposed = generalised_procrustes(shapes.vertices, share, scale, tangent=tangent)
        mean = superimposed.mean
        about_mean, about_centre = superimposed.aligned - mean, mean - share @ mean
        with serial_blas():
            # With the SVD X √W = U S Vᵀ of displacements X, (m, 3 n), and weights W, modes are S⁻¹ Uᵀ X and scores U S.
            weighted = (about_mean * np.sqrt(share)[:, None]).reshape(len(shapes), -1)
            u, values, _ = np.linalg.svd(weighted, full_matrices=False)
            least = MIN_DEVIATION * np.sqrt(len(shapes) * (share @ about_centre**2).max())
            kept = int((values[: len(shapes) - 1] > least).sum())
            u, values = u[:, :kept], values[:kept]
            # Modes are sums of displacements without weights, so that vertices of weight 0 move, too.
            modes = np.tensordot(u.T / values[:, None], about_mean, 1)
        outward = share[:, None] * (about_centre**2).sum(axis=1, keepdims=True) * about_centre
        signs = np.where(np.einsum("kij,ij->k", modes, outward) < 0, -1.0, 1.0)
        modes, scores = modes * signs[:, None, None], u * values * signs
        variances = values**2 / max(len(shapes) - 1, 1)
        of_mean = shapes.names, mean, shapes.faces, share
        return cls(*of_mean, modes, variances, scores, superimposed.size, shapes.structures)

    @property
    def n_modes(self) -> int:
        """Number of modes k."""
        return len(self.modes)

    @property
    def deviations(self) -> FloatArray:
        """(k,) standard deviation along each mode, in the units of the shapes."""
        return np.asarray(np.sqrt(self.variances))

    @property
    def variance_ratios(self) -> FloatArray:
        """(k,) share of each mode in the total variance."""
        return np.asarray(self.variances / self.variances.sum())

    @cached_property
    def vertex_variances(self) -> FloatArray:
        """(n,) variance of each vertex, summed over coordinates; the weighted mean is the total."""
        return np.asarray(np.einsum("k,kij,kij->i", self.variances, self.modes, self.modes))

    @property
    def structure_shares(self) -> dict[str, FloatArray]:
        """Share of each structure in the variance of each mode, (k,); their sum is 1."""
        shares = np.einsum("i,kij,kij->ki", self.weights, self.modes, self.modes)
        return {name: shares[:, part].sum(axis=1) for name, part in slices_of(self.structures).items()}

    @property
    def aligned(self) -> FloatArray:
        """(m, n, 3) the shapes of the model, moved onto their mean."""
        return np.asarray(self.mean + np.tensordot(self.scores, self.modes, 1))

    def vertices(self, scores: ArrayLike) -> FloatArray:
        """Return the shape (n, 3) with given scores along the first modes; further ones are 0."""
        leading = numbers_of(scores, "scores", SettingError)
        if leading.ndim != 1 or len(leading) > self.n_modes:
            remedy = f"give at most {self.n_modes}, one for each mode"
            raise SettingError(f"scores have shape {leading.shape}; {remedy}")
        return np.asarray(self.mean + np.tensordot(leading, self.modes[: len(leading)], 1))

    def mesh(self, scores: ArrayLike = ()) -> Mesh:
        """Return the shape with given scores as a mesh; by default the mean."""
        return self._topology.moved(self.vertices(scores))

    def mode_mesh(self, mode: int, deviations: float) -> Mesh:
        """Return the mean moved along one mode, counted from 0, by some standard deviations."""
        if not 0 <= mode < self.n_modes:
            raise SettingError(f"mode = {mode} is not one of the {self.n_modes} modes, counted from 0")
        return self._topology.moved(self.mean + deviations * self.deviations[mode] * self.modes[mode])

    @cached_property
    def _topology(self) -> Mesh:
        return Mesh(self.mean, self.faces)

    def score(self, mesh: Mesh, measured: BoolArray | None = None) -> ScoredShape:
        """Describe another shape in the same topology; the model stays as it is.

        Vertices that were not ``measured``, (n,), by default none, are taken to be on the mean, and
        do not count in the error.

        Notes
        -----
        The shape is moved onto the mean, and its difference from it projected on the modes. The
        shapes of the model get their stored scores, also with vertices that were not measured,
        unless sizes were removed: then the measured part is brought to the size of the same part of
        the mean.
        """
        if not np.array_equal(mesh.faces, self.faces) or mesh.n_vertices != len(self.mean):
            remedy = "bring it into correspondence with isomatch collect add"
            raise MeshError(f"{mesh!r} has other faces than the model ({len(self.mean)} vertices); {remedy}")
        if not np.isfinite(mesh.vertices).all():
            remedy = "only a shape that is matched completely can be scored"
            raise MeshError(f"some vertices have no position; {remedy}")
        seen = np.ones(len(self.mean), dtype=bool) if measured is None else np.asarray(measured, dtype=bool)
        if seen.shape != self.weights.shape or not self.weights[seen].any():
            remedy = f"give one for each of the {len(self.mean)} vertices, some of them true"
            raise MeshError(f"measured has shape {seen.shape} and {int(seen.sum())} true values; {remedy}")
        weights = np.where(seen, self.weights, 0.0)
        size = None if self.size is None else self.size * self._spread(weights) / self._spread(self.weights)
        aligned = aligned_to(self.mean, mesh.vertices, weights, size)
        scores = np.einsum("kij,i,ij->k", self.modes, weights, aligned - self.mean)
        reconstructed = self.vertices(scores)
        error = float(np.sqrt(weights @ ((aligned - reconstructed) ** 2).sum(axis=1) / weights.sum()))
        return ScoredShape(scores, scores / self.deviations, aligned, reconstructed, error, measured)

    def score_file(self, path: str | Path) -> ScoredShape:
        """Score the shape in a file, see `score`; a PLY file may have ``measured``.

        Polygons are cut like those of the model. Errors name the file.
        """
        try:
            return self.score(*read_corresponding(path, self.faces))
        except MeshError as error:
            raise MeshError(f"{path}: {error}") from None

    def _spread(self, weights: FloatArray) -> float:
        """Root mean square distance of the mean, or of a part of it, from its centroid."""
        share = weights / weights.sum()
        return float(np.sqrt(share @ ((self.mean - share @ self.mean) ** 2).sum(axis=1)))

    def save(self, path: str | Path) -> None:
        """Write the model to an ``.npz`` file, which `load` reads."""
        arrays = {"names": np.array(json.dumps(self.names))}
        others = [name for name in FORMAT.arrays if name not in ("names", "size", "structures")]
        arrays |= {name: getattr(self, name) for name in others}
        arrays |= {} if self.size is None else {"size": np.array(self.size)}
        if self.structures:
            arrays["structures"] = np.array(json.dumps(list(self.structures.items())))
        save_arrays(path, FORMAT.version, arrays)

    @classmethod
    def load(cls, path: str | Path) -> ShapeModel:
        """Read a model."""
        stored = FORMAT.read(path)
        try:
            names = json.loads(stored.pop("names"))
            structures = {str(name): int(n) for name, n in json.loads(stored.pop("structures", "[]"))}
        except (ValueError, TypeError, RecursionError):
            names, structures = None, {}
        fits = not structures or sum(structures.values()) == len(stored["mean"])
        if not isinstance(names, list) or len(names) != len(stored["scores"]) or not fits:
            remedy = "expected a file written by ShapeModel.save"
            raise FormatError(f"{path}: not a shape model (its names); {remedy}")
        size = float(stored.pop("size")) if "size" in stored else None
        return cls(names=tuple(map(str, names)), size=size, structures=structures, **stored)


@dataclass(frozen=True, eq=False)
class ModelCurve:
    """Means (k,) of a measure, ``mean[j]`` with j modes, and their standard errors."""

    mean: FloatArray
    standard_error: FloatArray

    @classmethod
    def of_rows(cls, rows: FloatArray) -> ModelCurve:
        """Make a curve of the values of all cases, (cases, k)."""
        return cls(rows.mean(axis=0), rows.std(axis=0) / np.sqrt(max(len(rows) - 1, 1)))


def compactness(model: ShapeModel) -> FloatArray:
    """Compute the share of the total variance in the first j modes, (k + 1,) for j = 0…k."""
    return np.concatenate([[0.0], np.cumsum(model.variance_ratios)])


def _without_each(
    model: ShapeModel, seed: int, most: int
) -> Iterator[tuple[FloatArray, FloatArray, FloatArray]]:
    """Yield the difference of each shape from the mean of the others, their axes and variances."""
    # Scores take the place of shapes: they have the same distances, as the modes are orthonormal. The mirror image of a
    # shape is left out with the shape.
    m = len(model.names)
    chosen = np.sort(generator(seed).choice(m, most, replace=False)) if m > most else np.arange(m)
    individuals = np.array([name.removesuffix(MIRRORED) for name in model.names])
    with serial_blas():
        for left_out in chosen if m > 1 else ():
            others = model.scores[individuals != individuals[left_out]]
            mean = others.mean(axis=0)
            _, values, axes = np.linalg.svd(others - mean, full_matrices=False)
            used = values[: m - 2] > 1e-10 * max(values.max(initial=0.0), 1e-300)
            variances = values[: m - 2][used] ** 2 / max(len(others) - 1, 1)
            yield model.scores[left_out] - mean, axes[: m - 2][used], variances


def generalisation(model: ShapeModel, *, seed: int = 0, most: int = MAX_LEFT_OUT) -> ModelCurve:
    """Measure how well the model describes new shapes, leaving out one at a time.

    The curve is the root mean square distance between a shape left out and the nearest one in the
    span of j modes of the others, for j = 0…m − 2; it never increases with j, and is empty for one
    shape. If there are more than ``most`` shapes, the seed draws that many.

    Notes
    -----
    Davies, *Learning shape: optimal models for analysing natural variability*, 2002; Styner et al.,
    IPMI 2003. Alignment is not repeated without the shape left out. Its mirror image
    (`CorrespondedShapes.mirrored`) is left out with it.
    """
    rows = []
    for missed, axes, _ in _without_each(model, seed, most):
        row = np.full(len(model.names) - 1, np.linalg.norm(missed))
        for j, axis in enumerate(axes, start=1):  # ``missed`` loses its parts along the first j axes
            missed = missed - (missed @ axis) * axis
            row[j:] = np.linalg.norm(missed)
        rows.append(row)
    return ModelCurve.of_rows(np.array(rows)) if rows else ModelCurve(np.zeros(0), np.zeros(0))


@dataclass(frozen=True, eq=False)
class LeaveOneOut:
    """How unusual each shape is to a model of the others; see `leave_one_out`."""

    mahalanobis: FloatArray  #: (c,) distance from the mean, in standard deviations
    errors: FloatArray  #: (c,) root mean square distance from the modes


def leave_one_out(model: ShapeModel, *, seed: int = 0, most: int = MAX_LEFT_OUT) -> LeaveOneOut:
    """Measure how unusual each shape of a model is to a model of the others.

    Arguments are those of `generalisation`, whose curve ends with the mean of the errors. O(m⁴)
    time for m ≤ ``most`` shapes.

    Examples
    --------
    >>> triangle = Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    >>> sizes = {str(s): triangle.moved(s * triangle.vertices) for s in (1, 2, 3, 4)}
    >>> model = ShapeModel.fit(CorrespondedShapes.of_meshes(sizes))
    >>> usual = leave_one_out(model)
    >>> usual.mahalanobis.round(3)
    array([2.   , 0.436, 0.436, 2.   ])
    >>> round(model.score(triangle.moved(7 * triangle.vertices)).mahalanobis, 3)
    3.486
    """
    distances, errors = [], []
    for missed, axes, variances in _without_each(model, seed, most):
        along = axes @ missed
        distances.append(np.sqrt((along**2 / variances).sum()))
        errors.append(np.linalg.norm(missed - along @ axes))
    return LeaveOneOut(np.array(distances), np.array(errors))


def specificity(model: ShapeModel, *, n_samples: int = N_RANDOM_SHAPES, seed: int = 0) -> ModelCurve:
    """Measure how much random shapes of the model look like the shapes that it was made from.

    The curve is the root mean square distance of a random shape of j modes from the nearest of the
    m shapes, for j = 0…k. The seed draws ``n_samples`` shapes, with independent normal scores.

    Notes
    -----
    Davies 2002; Styner et al. 2003. O(n_samples m k) time: distances are those of the scores.
    """
    # The squared distance of a random shape from a shape of the model is Σ (z − b)² with the scores z of the random
    # shape, which are 0 after the first j modes, and the scores b of the other.
    draws = generator(seed).standard_normal((n_samples, model.n_modes)) * model.deviations
    squares = np.broadcast_to((model.scores**2).sum(axis=1), (n_samples, len(model.names))).copy()
    rows = [np.sqrt(squares.min(axis=1))]
    for drawn, scores in zip(draws.T, model.scores.T):
        squares += drawn[:, None] * (drawn[:, None] - 2 * scores)  # adds (z − b)² − b² for this mode
        rows.append(np.sqrt(np.maximum(squares.min(axis=1), 0.0)))
    return ModelCurve.of_rows(np.array(rows).T)


def write_shapeworks(folder: str | Path, shapes: CorrespondedShapes, aligned: FloatArray) -> None:
    """Write a project of ShapeWorks to an existing folder, whose particles are the vertices.

    ShapeWorks Studio opens ``project.swproj``. Each shape has a mesh and two ``.particles`` files,
    text with x y z on each line: local as they are, and world as ``aligned``, (m, n, 3).
    """
    folder = Path(folder)
    subjects = []
    for i, name in enumerate(shapes.names):
        files = dict.fromkeys(("shape_1", "groomed_1"), f"{name}.ply")
        files |= {f"{of}_particles_1": f"{name}_{of}.particles" for of in ("local", "world")}
        write_mesh(folder / files["shape_1"], shapes.mesh(i))
        write_text(folder / files["local_particles_1"], _lines(shapes.vertices[i]))
        write_text(folder / files["world_particles_1"], _lines(aligned[i]))
        subjects.append({"name": name, **files})
    write_text(folder / "project.swproj", json.dumps({"data": subjects}, indent=4) + "\n")


def _lines(points: FloatArray) -> str:
    return "".join(f"{x:.9g} {y:.9g} {z:.9g}\n" for x, y, z in points.tolist())


def write_statismo(path: str | Path, model: ShapeModel) -> None:
    """Write an HDF5 file, ``.h5``, for Scalismo and Statismo; needs the extra ``statistics``.

    The model must have a mode. Version 0.9 of the format, in single precision. Its modes are
    orthonormal without weights, so they differ from those of a model with area weights; the
    distribution of shapes is the same.
    """
    if not model.n_modes:
        problem = "the model has no mode of variation, which the format needs"
        raise InputError(f"{problem}; give shapes that differ")
    h5py = package("h5py", "statistics", "writing HDF5 files")
    spread = (model.modes * model.deviations[:, None, None]).reshape(model.n_modes, -1)
    _, values, modes = np.linalg.svd(spread, full_matrices=False)
    points = model.mean.astype(np.float32)
    with replaced(Path(path)) as stream, h5py.File(stream, "w") as file:
        for name, values_of in {
            "model/mean": points.ravel(),
            "model/pcaBasis": modes.T.astype(np.float32),
            "model/pcaVariance": (values**2).astype(np.float32),
            "model/noiseVariance": np.zeros(1, np.float32),
            "representer/points": points.T,
            "representer/cells": model.faces.T.astype(np.int32),
            "version/majorVersion": np.array(0, np.int32),
            "version/minorVersion": np.array(9, np.int32),
        }.items():
            file[name] = values_of
        file.create_group("modelinfo")
        for name, text in {
            "name": "itkStandardMeshRepresenter",
            "datasetType": "POLYGON_MESH",
            "version/majorVersion": "0",
            "version/minorVersion": "9",
        }.items():
            file["representer"].attrs[name] = text
