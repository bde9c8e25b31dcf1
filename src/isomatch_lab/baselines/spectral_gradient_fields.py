"""Spectral gradient fields: functional maps that also keep scalar products of gradients."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import polar
from scipy.sparse import csr_array

from isomatch._core.arrays import FloatArray, IntArray
from isomatch._core.settings import Settings, require_least, setting
from isomatch._core.threads import serial_blas
from isomatch.correspondence import Embedding
from isomatch.matching import MatchResult, Problem
from isomatch.settings import Orientation
from isomatch.shapes import PreparedShape
from isomatch.surfaces import Mesh, Surface
from isomatch_lab.baselines.eigenfunction_matching import MAX_MATCHED, ORIENTATION_SIGN, signed_permutation
from isomatch_lab.baselines.laplace_nearest_neighbours import first_functional_map
from isomatch_lab.baselines.task import Task

N_FROM_PRIORS = 20  # eigenfunctions in the first functional map, which a few priors determine; chosen


@dataclass(frozen=True)
class GradientFieldsConfig(Settings):
    """Settings of `spectral_gradient_fields`.

    Parameters
    ----------
    n_matched : int
        Eigenfunctions other than the constant that are matched to one another if there are no priors, from 2 to 14:
        2^n_matched combinations of signs are tried.
    n_functions : int
        Number of Laplace–Beltrami functions at the end.
    n_gradients : int
        First functions other than the constant whose gradients help to match points; 0 leaves gradients out.
    gradient_weight : float
        Weight of the gradients against the functions themselves.
    step : int
        Number of functions added in each iteration.
    steps : int
        Number of iterations with all functions.
    orientation : {"preserve", "reverse", "any"}
        Sign of the pseudo-scalars, which "any" leaves out.
    """

    n_matched: int = setting(12, least=2, most=MAX_MATCHED)
    n_functions: int = 50
    n_gradients: int = setting(12, least=0)
    gradient_weight: float = setting(0.3, least=0)
    step: int = setting(3, least=1)
    steps: int = setting(10, least=1)
    orientation: Orientation = "preserve"

    def __post_init__(self) -> None:
        super().__post_init__()
        require_least(self, n_functions=self.n_matched + 1)


def spectral_gradient_fields(
    source: Surface | PreparedShape,
    target: Surface | PreparedShape,
    landmarks: ArrayLike | None = None,
    initial_map: ArrayLike | None = None,
    initial_descriptors: tuple[ArrayLike, ArrayLike] | None = None,
    config: GradientFieldsConfig | None = None,
    seed: int = 0,
) -> MatchResult:
    """Match eigenfunctions by their moments, then points by spectral kernel maps and gradients of eigenfunctions.

    Parameters
    ----------
    source, target, landmarks, initial_map, initial_descriptors, seed
        As for `match`. The start comes from the initial map, else the landmarks, else the descriptors; eigenfunctions are
        matched only if there are no priors.
    config : GradientFieldsConfig, optional
        Settings.

    The result and the errors are the same as for `functional_maps`.

    Notes
    -----
    After Shtern & Kimmel, *Matching the LBO Eigenspace of Non-Rigid Shapes via High Order Statistics*, Axioms 2014
    (signs and order); *Iterative Closest Spectral Kernel Maps*, 3DV 2014 (nearest neighbours in
    φ_i √h(λ_i), alternating with the alignment of the kernels); *Spectral Gradient Fields Embedding for Nonrigid Surface
    Matching*, CVIU 2015 (gradients in addition to the functions).
    Reconstructed from these papers' own summaries, so this is a method in their spirit rather than theirs. Ours are the
    kernel h = 1 / λ of commute times; the orthogonal alignment; the growth by a few functions at a time; the gradients of
    successive functions, as scalars and pseudo-scalars ; their number and weight, chosen by trial
    on nine pairs of creatures; and that a map transfers gradients only by its block for those functions. Points and
    graphs have no gradients. Without priors, the signs of the leading eigenfunctions decide everything: on four pairs of
    FAUST two maps were completely wrong (errors of 0.46 and 0.50 √area). Give landmarks where that matters.
    """
    config = config or GradientFieldsConfig()
    with serial_blas():
        task = Task.of(source, target, landmarks, initial_map, initial_descriptors, seed)
        task.timer.start("eigenfunctions")
        functional_map, origin = _start(task, config)
        task.timer.start("refinement")
        last = task.functions_at_most(config.n_functions)
        kernels, laplace = KernelMaps.of(task.pair, config), task.pair.source.laplace
        functions = task.pair.target.laplace.vectors
        for k in (*range(len(functional_map), last, config.step), *[last] * config.steps):
            image = kernels.image(functional_map, task.pair.refinement_vertices)
            functional_map = polar(task.spectra.functional_map(image, k))[0]
        everywhere = kernels.image(functional_map, np.arange(len(laplace.weights)))
        functional_map = polar(laplace.coefficients(functions[everywhere, :last], last))[0]
        return task.result(kernels.embedding(functional_map), config, origin)


def _start(task: Task, config: GradientFieldsConfig) -> tuple[FloatArray, str]:
    """First functional map, and where it comes from."""
    if task.priors.any:
        return first_functional_map(task, task.functions_at_most(min(N_FROM_PRIORS, config.n_functions)))
    m = task.functions_at_most(config.n_matched + 1) - 1
    return signed_permutation(task.pair, m, ORIENTATION_SIGN[config.orientation]), "eigenfunctions"


@dataclass(frozen=True, eq=False)
class KernelMaps:
    """Two shapes in the coordinates in which nearest neighbours are sought."""

    pair: Problem
    of_source: ComplexArray  # (n, q) gradients of eigenfunctions from the second on; none without triangles
    of_target: ComplexArray
    weights: FloatArray  # (2,) weights of scalars and pseudo-scalars; the sign says if these agree or oppose

    @classmethod
    def of(cls, pair: Problem, config: GradientFieldsConfig) -> KernelMaps:
        """Compute the gradients."""
        with_gradients = pair.oriented and config.n_gradients > 0
        fields = [
            gradient_fields(shape.triangles, shape.laplace.vectors[:, 1 : 1 + config.n_gradients])
            if shape.triangles and with_gradients
            else np.zeros((shape.body.n_vertices, 0), dtype=np.complex128)
            for shape in (pair.source, pair.target)
        ]
        weights = config.gradient_weight * np.array([1.0, ORIENTATION_SIGN[config.orientation]])
        return cls(pair, fields[0], fields[1], weights)

    def embedding(self, functional_map: FloatArray) -> Embedding:
        """φ_i / √λ_i and products of gradients; the map (k, k) carries the target's to the source's functions."""
        k = len(functional_map)
        values = self.pair.source.laplace.values[1:k]
        kernel = np.append(0.0, 1 / np.sqrt(values))
        kernel /= np.linalg.norm(kernel)
        of_source, of_target = (x * kernel for x in self.pair.spectra.embedding(functional_map))
        m = min(self.of_source.shape[1], k - 1)
        if m < 2:
            return Embedding(of_source, of_target)
        carried = self.of_target[:, :m] @ functional_map[1 : m + 1, 1 : m + 1].T
        turn = np.repeat(self.weights / np.sqrt(2 * (m - 1)), m - 1)
        products = turn * invariants(carried, values[:m])
        own_products = np.abs(turn) * invariants(self.of_source[:, :m], values[:m])
        return Embedding(np.hstack([of_source, own_products]), np.hstack([of_target, products]))

    def image(self, functional_map: FloatArray, rows: IntArray) -> IntArray:
        """Nearest target vertex of each of some source vertices."""
        of_source, of_target = self.embedding(functional_map)
        return self.pair.target.index.vertices(of_target, of_source[rows])


ComplexArray: TypeAlias = np.ndarray[tuple[int, int], np.dtype[np.complex128]]


def gradient_fields(mesh: Mesh, functions: FloatArray) -> ComplexArray:
    """Gradients of q functions (n, q) at the vertices, as complex numbers in a frame of each tangent plane: (n, q)."""
    # on a triangle of area A and normal N, A ∇f = ½ Σ_c f_c N × e_c, where e_c is the edge opposite to corner c. The
    # gradient at a vertex is the mean over its triangles, weighted by area. It is linear in f, and z̄_f z_g = ⟨∇f, ∇g⟩
    # + i ⟨∇f × ∇g, N⟩ does not depend on the frame. Every isometry preserves its real part; its imaginary part changes
    # sign with orientation
    normals = mesh.vertex_normals
    along = np.cross(normals, np.eye(3)[np.abs(normals).argmin(axis=1)])
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-300)
    across = np.cross(normals, along)
    corner = mesh.vertices[mesh.faces]  # (m, 3, 3)
    opposite = np.roll(corner, 1, axis=1) - np.roll(corner, -1, axis=1)
    doubled = np.cross(opposite[:, 0], opposite[:, 1])
    length = np.linalg.norm(doubled, axis=1, keepdims=True)
    unit = np.divide(doubled, length, out=np.zeros_like(doubled), where=length > 0)
    integrals = 0.5 * np.einsum("mcx,mcq->mxq", np.cross(unit[:, None], opposite), functions[mesh.faces])
    corners = mesh.faces.ravel(), np.repeat(np.arange(mesh.n_faces), 3)
    around = csr_array((np.ones(len(corners[0])), corners), shape=(mesh.n_vertices, mesh.n_faces))
    areas = np.maximum(around @ length / 2, 1e-300)
    gradients = (around @ integrals.reshape(mesh.n_faces, -1) / areas).reshape(mesh.n_vertices, 3, -1)
    turned: ComplexArray = np.einsum("nx,nxq->nq", along + 1j * across, gradients)
    return turned


def invariants(fields: ComplexArray, values: FloatArray) -> FloatArray:
    """Products of the gradients of successive functions, divided by the roots of their eigenvalues: (n, 2 (q − 1))."""
    scaled = fields / np.sqrt(values)
    # first the scalars ⟨∇φ_a, ∇φ_a+1⟩ / √(λ_a λ_a+1), then the pseudo-scalars ⟨∇φ_a × ∇φ_a+1, N⟩ / √(λ_a λ_a+1)
    products = scaled[:, :-1].conj() * scaled[:, 1:]
    return np.hstack([products.real, products.imag])
