"""The geodesic distance basis: a low-rank form of the matrix of all distances of a surface."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike
from scipy.linalg import qr

from isomatch._core.array_file import ArrayFormat, Stored, save_arrays
from isomatch._core.arrays import AnyArray, FloatArray, IntArray
from isomatch._core.compiled import compiled
from isomatch._core.errors import MeshError, SettingError, some
from isomatch._core.threads import n_threads, parallel_map
from isomatch.geodesics import Sampling, points_of
from isomatch.spectral.basis import PlottedBasis, fix_signs
from isomatch.surfaces import PrecisePoints

FORMAT = ArrayFormat(  # contents of the file of a distance basis
    what="a distance basis",
    writer="DistanceBasis.save",
    version=1,  # raise it with a change after which earlier versions of isomatch cannot read the file
    arrays={
        "vectors": Stored("float", ("n", "k")),
        "values": Stored("float", ("k",)),
        "weights": Stored("float", ("n",), positive=True),
        "method": Stored("text"),
        "engine": Stored("text"),
        "samples": Stored("integer", ("p",), index_of="n"),
        "welded": Stored("text", group="welded"),
        "held_out_vertices": Stored("integer", ("q",), index_of="n", group="held out"),
        "held_out_columns": Stored("float", ("q", "n"), group="held out"),
    },
    filled=("n", "k"),
)
MIN_EIGENVALUE_RATIO = 1e-12  # eigenvalues below this share of the largest are rounding and left out; chosen
MIN_PAIRS_FOR_THREADS = 50_000  # number of pairs below which threads cost more time than they save; chosen


@dataclass(frozen=True, eq=False, repr=False)
class DistanceBasis(PlottedBasis):
    """A low-rank form D ≈ Q Λ Qᵀ of the matrix of all geodesic distances, n × k numbers instead of n × n.

    Parameters
    ----------
    vectors : (n, k) array of float
        Q, orthonormal in the weights: QᵀAQ = I.
    values : (k,) array of float
        The diagonal of Λ, decreasing in magnitude, of either sign, in mesh units times the unit of
        ``weights``.
    weights : (n,) array of float
        The diagonal of A: vertex areas in squared mesh units, or ones.
    method, engine : str
        How the basis and the distances were computed.
    samples : (p,) array of int
        Vertices whose distance columns were used; empty for the exact basis.
    held_out : Sampling, optional
        Columns that were not used, drawn with probability ∝ weight; `error_estimate` measures on
        them.
    notes : tuple of str
        Number of vertices that were welded.

    Notes
    -----
    Shamai & Kimmel, *Geodesic Distance Descriptors*, CVPR 2017. 8 n k bytes.

    Examples
    --------
    The distances of four points on a line have full rank, so that four vectors are exact, and fewer
    are not.

    >>> from isomatch import distance_basis
    >>> line = np.abs(np.subtract.outer(np.arange(4.0), np.arange(4.0)))
    >>> basis = distance_basis(line, k=4, p=4, method="exact")
    >>> basis
    DistanceBasis(4 points, rank 4, exact, 0 columns, matrix)
    >>> basis.row(1).round(6) + 0.0
    array([1., 0., 1., 2.])
    >>> (basis @ np.ones(4)).round(6)
    array([6., 4., 4., 6.])
    >>> basis.truncated(2).distance([0, 0], [0, 3]).round(2)
    array([0.24, 3.16])
    """

    vectors: FloatArray
    values: FloatArray
    weights: FloatArray
    method: str
    engine: str
    samples: IntArray
    held_out: Sampling | None = None
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        n, k = self.vectors.shape
        if not (n and k) or self.values.shape != (k,) or self.weights.shape != (n,):
            raise MeshError(
                f"vectors of shape {self.vectors.shape}, values of shape {self.values.shape} and weights of shape "
                f"{self.weights.shape} do not make a basis; expected (n, k), (k,) and (n,), neither of them 0"
            )

    def __repr__(self) -> str:
        n, k = self.vectors.shape
        p = len(self.samples)
        return f"DistanceBasis({n} points, rank {k}, {self.method}, {p} columns, {self.engine})"

    @property
    def rank(self) -> int:
        """Number of basis vectors."""
        return len(self.values)

    def distance(self, i: ArrayLike, j: ArrayLike) -> FloatArray:
        """Approximate distances of pairs of vertices, in mesh units; ``i`` and ``j`` broadcast.

        O(k) time per pair, on all threads; millions of pairs per second. They are not corrected:
        near 0 they may be slightly negative, and the distance of a vertex to itself is not exactly
        0.
        """
        first, second = np.broadcast_arrays(self._indices(i), self._indices(j))
        pairs = low_rank_distances(self.vectors, self.values, first.ravel(), second.ravel())
        return pairs.reshape(first.shape)[()]

    def between(self, rows: ArrayLike, columns: ArrayLike) -> FloatArray:
        """Approximate distances from r vertices to c vertices, (r, c), in mesh units. O(r c k)."""
        return np.asarray(
            (self.vectors[self._indices(rows)] * self.values) @ self.vectors[self._indices(columns)].T
        )

    def row(self, i: ArrayLike) -> FloatArray:
        """Approximate distances from one or more vertices to all, (..., n), in mesh units. O(n k) each."""
        return np.asarray((self.vectors[self._indices(i)] * self.values) @ self.vectors.T)

    def nearest(self, i: int, r: float) -> tuple[IntArray, FloatArray]:
        """Vertices within distance r of vertex i, nearest first, and their distances, at least 0. O(n k)."""
        distances = np.maximum(self.row(self._indices(i)), 0.0)
        distances[i] = 0.0
        within = np.flatnonzero(distances <= r)
        within = within[np.argsort(distances[within], kind="stable")]
        return within, distances[within]

    def __matmul__(self, values: ArrayLike) -> FloatArray:
        """Product of the approximate distance matrix with an (n,) or (n, q) array. O(n k q)."""
        x = np.asarray(values, dtype=np.float64)
        return np.asarray(self.vectors @ ((self.values * (self.vectors.T @ x).T).T))

    def truncated(self, k: int) -> DistanceBasis:
        """Keep the first k vectors, at least one: the best approximation of rank k of this basis."""
        return replace(self, vectors=self.vectors[:, :k], values=self.values[:k])

    def astype(self, dtype: DTypeLike) -> DistanceBasis:
        """Convert the vectors to another precision; float32 halves the memory, with an error of 1e-6."""
        vectors: Any = np.ascontiguousarray(self.vectors, dtype=dtype)
        return replace(self, vectors=vectors, values=self.values.astype(dtype))

    def error_estimate(self) -> float:
        """Relative error in the Frobenius norm with weights A, measured on the held-out columns.

        Returns
        -------
        float
            Error with respect to the distances of the engine, which have errors of their own.

        Raises
        ------
        SettingError
            If there are no held-out columns.

        Notes
        -----
        √(Σ_y ‖D̂_y − D_y‖²_A / Σ_y ‖D_y‖²_A), summed over the columns y that were not used for the
        fit. They are drawn with probability ∝ weight, so that numerator and denominator are
        unbiased except that the samples are left out. Ten columns give the error within a factor of
        about 1.3.
        """
        return float(self.error_estimates()[-1])

    def error_estimates(self) -> FloatArray:
        """Estimate the errors of the truncations to 1…k vectors, (k,). O(n k) per held-out column."""
        if self.held_out is None:
            raise SettingError(
                "this basis was built without held-out columns, so its error cannot be estimated; "
                "use distance_basis(surface, held_out=10)"
            )
        residual = self.held_out.columns.astype(np.float64)
        total = (self.weights * residual**2).sum()
        errors = np.zeros(self.rank)
        for c, (value, vector) in enumerate(zip(self.values, self.vectors.T)):
            residual -= np.outer(value * vector[self.held_out.vertices], vector)
            errors[c] = (self.weights * residual**2).sum()
        return np.asarray(np.sqrt(errors / total))

    def with_points(self, points: PrecisePoints) -> DistanceBasis:
        """Add m points of faces as points n … n + m − 1, with interpolated distances and weight 0.

        Raises
        ------
        MeshError
            If they are no points between the n vertices.
        """
        added = points_of(points, len(self.vectors)).interpolated(self.vectors)
        weights = np.append(self.weights, np.zeros(len(added)))
        return replace(self, vectors=np.concatenate([self.vectors, added]), weights=weights, held_out=None)

    def save(self, path: str | Path) -> None:
        """Write the basis to an ``.npz`` file; an existing file is replaced only by a complete one.

        Raises
        ------
        UnwritableFileError
            If the file cannot be written.
        """
        held_out = {} if self.held_out is None else vars(self.held_out)
        arrays = {name: value for name, value in vars(self).items() if name not in ("held_out", "notes")}
        arrays |= {f"held_out_{name}": array for name, array in held_out.items()}
        if self.notes:
            arrays["welded"] = "; ".join(self.notes)
        save_arrays(path, FORMAT.version, arrays)

    @classmethod
    def load(cls, path: str | Path) -> DistanceBasis:
        """Read a file written by `save`, of this version of isomatch or an earlier one.

        Raises
        ------
        FormatError
            If the file is missing (`MissingFileError`), holds something else, or was written by an
            isomatch that is too new.
        """
        arrays = FORMAT.read(path)
        held_out = {name: arrays.pop(f"held_out_{name}", None) for name in ("vertices", "columns")}
        notes = tuple(filter(None, arrays.pop("welded", "").split("; ")))
        sampling = None if held_out["vertices"] is None else Sampling(**held_out)
        return cls(**arrays, notes=notes, held_out=sampling)

    def _indices(self, i: ArrayLike) -> IntArray:
        """Check that vertex indices are integers within bounds, which compiled loops do not."""
        indices = np.asarray(i)
        if indices.size and indices.dtype.kind not in "iu":
            raise MeshError(f"vertex indices must be integers, not {indices.dtype}")
        indices = indices.astype(np.int64)
        n = len(self.vectors)
        bad = indices[(indices < -n) | (indices >= n)]
        if bad.size:
            raise MeshError(f"vertices {some(bad)} are outside 0…{n - 1}, the points of the basis")
        return indices


def orthonormalise(
    outer: FloatArray, middle: FloatArray, weights: FloatArray, method: str, engine: str, samples: IntArray
) -> DistanceBasis:
    """Bring D ≈ S T Sᵀ to the form Q Λ Qᵀ with QᵀAQ = I, without null eigenvalues. O(n q²)."""
    # Shamai & Kimmel 2017, section "Computing the basis": with the QR decomposition A^½ S = P R,
    # PᵀP = I, and the eigenpairs R T Rᵀ = V Λ Vᵀ of a q × q matrix,
    #   D ≈ S T Sᵀ = A^(−½) P (R T Rᵀ) Pᵀ A^(−½) = Q Λ Qᵀ,  Q = A^(−½) P V,
    # and QᵀAQ = Vᵀ PᵀP V = I. So Λ holds the eigenvalues of the operator f ↦ D A f of the approximation.
    root = np.sqrt(weights)[:, None]
    q, r = qr(root * outer, mode="economic", check_finite=True)
    inner = r @ middle @ r.T
    values, vectors = np.linalg.eigh((inner + inner.T) / 2)
    order = np.argsort(-np.abs(values), kind="stable")
    order = order[np.abs(values[order]) > MIN_EIGENVALUE_RATIO * np.abs(values).max()]
    basis = fix_signs(q @ vectors[:, order] / root, weights)
    return DistanceBasis(basis, values[order], weights, method, engine, samples)


def low_rank_distances(vectors: AnyArray, values: AnyArray, i: IntArray, j: IntArray) -> FloatArray:
    """Σ_c Λ_c Q_ic Q_jc (m,) for unchecked pairs of rows of Q (n, k); negative indices count from the end."""
    # Sums are in the precision of Q. The rows of the pairs are not copied, so that only the result needs
    # memory.
    out = np.zeros(len(i))
    parts = n_threads() if len(i) >= MIN_PAIRS_FOR_THREADS else 1
    ends = np.linspace(0, len(i), parts + 1).astype(np.int64)

    def sum_part(a: int) -> None:
        part = slice(ends[a], ends[a + 1])
        _sum_pairs(vectors, values, i[part], j[part], out[part])

    parallel_map(sum_part, range(parts))
    return out


@compiled(fastmath=True)
def _sum_pairs(vectors: AnyArray, values: AnyArray, i: IntArray, j: IntArray, out: FloatArray) -> None:
    for a in range(len(i)):
        x, y = vectors[i[a]], vectors[j[a]]
        total = values[0] * x[0] * y[0]
        for c in range(1, len(values)):
            total += values[c] * x[c] * y[c]
        out[a] = total
