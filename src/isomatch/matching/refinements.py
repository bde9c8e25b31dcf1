"""The refinements of isomatch, and the laws that every refinement must keep."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from operator import itemgetter
from typing import ClassVar

import numpy as np
from scipy.linalg import polar
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from isomatch._core.arrays import BodyVertices, FloatArray, Int, IntArray, SearchRows
from isomatch._core.errors import SettingError
from isomatch._core.threads import parallel_map, serial_blas
from isomatch.correspondence import Embedding, signed_procrustes
from isomatch.matching.isometric.candidates import energy_of
from isomatch.matching.isometric.isometry import Isometry
from isomatch.matching.maps import Fit
from isomatch.matching.parameters import SPECTRAL
from isomatch.matching.priors import Priors
from isomatch.matching.problem import Joint, Problem, Refinement, prepare_pair
from isomatch.settings import Config, RefinementName
from isomatch.shapes import PreparedShape, orientation_of, prepare
from isomatch.surfaces import Mesh


class Smooth(Joint):
    """The joint refinement with more registration: its maps are smooth, nearly one to one."""

    smooth: ClassVar[bool] = True


class Descriptors(Joint):
    """The plain method of the paper: align distance descriptors, and refine no further."""

    searches_further: ClassVar[bool] = False
    polishes: ClassVar[bool] = False

    def everywhere(self, problem: Problem, fit: Fit, coordinates: Callable[[], Embedding]) -> Embedding:
        """Align distance descriptors, starting from the first map of the fit."""
        if fit.candidate is None:
            return coordinates()
        return descriptor_embedding(problem, SearchRows(fit.candidate.alignment.target_row))


class LaplaceIcp(Descriptors):
    """Post-processing as in the paper: iterative closest points in the Laplace–Beltrami basis."""

    def everywhere(self, problem: Problem, fit: Fit, coordinates: Callable[[], Embedding]) -> Embedding:
        """Post-process the alignment of distance descriptors."""
        return laplace_icp_embedding(problem, super().everywhere(problem, fit, coordinates))


def descriptor_embedding(pair: Problem, target_row: Int[SearchRows, "m_s"]) -> Embedding:
    """Align distance descriptors by iterative closest points, from a map of the search vertices."""
    # Shamai & Kimmel 2017: min over P, C of ‖X_s − P X_t C‖, where X are descriptors, P maps vertices to
    # vertices, and C is orthogonal within blocks of equal sign; first on the refinement vertices, then twice
    # on all vertices
    source, target = pair.source.points, pair.target.points

    def align(source_vertex: BodyVertices, target_vertex: BodyVertices) -> FloatArray:
        return target.coordinates @ signed_procrustes(source.at(source_vertex), target.at(target_vertex))

    points = align(pair.source_vertices, BodyVertices(pair.target_vertices[target_row]))
    all_vertices = BodyVertices(np.arange(len(source.coordinates)))
    for vertices in (*[pair.refinement_vertices] * SPECTRAL.n_distance_steps, all_vertices, all_vertices):
        images = pair.target.index.vertices(points, source.coordinates[vertices])
        points = align(vertices, BodyVertices(images))
    return Embedding(source.coordinates, points)


def laplace_icp_embedding(pair: Problem, start: Embedding) -> Embedding:
    """Post-process a map by iterative closest points in the Laplace–Beltrami basis."""
    # In the post-processing of Shamai & Kimmel 2017, the functional map F is orthogonal and has its final
    # size from the start. Here F is fitted by least squares, because it is not orthogonal where shapes
    # stretch, and grows as in Melzi et al. 2019. Small first sizes repair large errors of the given map, larger
    # first sizes keep limbs separate. Maps from several first sizes grow to a middle size; of the maps that keep
    # the orientation of the given map, the map of least energy grows on.
    settings, spectra, vertices = pair.config.refining, pair.spectra, pair.refinement_vertices
    weights = pair.source.laplace.weights
    rows = spectra.nearest(start.target, start.source[vertices])
    most = pair.n_functions
    if settings.laplace_steps_at_once:
        first = polar(spectra.functional_map(rows, most))[0]
        return spectra.embedding(spectra.orthogonal_icp(first, most, settings.laplace_steps_at_once, weights))
    middle = min(SPECTRAL.choice_size, most)

    def side(target_vertex: BodyVertices) -> float:
        return float(np.sign(orientation_of(pair.source, spectra.source, pair.target, target_vertex, middle)))

    def sizes(first: int, last: int) -> tuple[int, ...]:
        return (*range(first + SPECTRAL.size_step, last, SPECTRAL.size_step), last) if last > first else ()

    def grow(first: int) -> tuple[bool, float, FloatArray]:
        functional_map = spectra.upsample(spectra.functional_map(rows, first), sizes(first, middle))
        image = BodyVertices(spectra.image(functional_map))
        return side(image) != start_side, energy_of(pair, vertices, image), functional_map

    start_side = side(BodyVertices(rows))
    trials = parallel_map(grow, sorted({min(first, middle) for first in SPECTRAL.first_sizes}))
    *_, functional_map = min(trials, key=itemgetter(0, 1))
    functional_map = spectra.upsample(functional_map, sizes(middle, most))
    of_source, of_target = spectra.embedding(functional_map)
    images = spectra.nearest(of_target, of_source)
    on_target = pair.target.laplace.vectors[images, :most]
    return spectra.embedding(pair.source.laplace.coefficients(on_target, most))


REFINEMENTS: dict[RefinementName, Refinement] = {
    "joint": Joint(),
    "smooth": Smooth(),
    "laplace_icp": LaplaceIcp(),
    "none": Descriptors(),
}
"""The refinements that settings can name."""


N_VERTICES = 500  # vertices of the ball on which a refinement is tried; chosen: the three laws take a second
MAX_ERROR = 0.02  # √area, mean; a refinement is allowed to move the true map this far; half an edge is 0.025
MAX_CHANGED_SHARE = 0.01  # share of images that renumbering is allowed to change, as points might tie; chosen
MAX_ROUGH_ERROR = 0.1  # √area; images under the rough map are at most this far from the true ones; chosen


def check_refinement(refinement: Refinement, seed: int = 0) -> None:
    """Check that a refinement keeps three laws, as a dot test checks an adjoint.

    A bumpy ball is matched to a copy that is turned and whose vertices are permuted:

    - repeatable: called again, and by several threads, it gives the same maps to the last bit;
    - relabelling: if the target's vertices are renumbered, so are the images;
    - truth: the true map remains the true map, at the refinement vertices and everywhere.

    Parameters
    ----------
    refinement : Refinement
        A refinement for `match`.
    seed : int
        Seeds the turn, the orders of the vertices and the rough map.

    Raises
    ------
    SettingError
        If a law is broken: which one, by how much, and where to look.

    Notes
    -----
    Takes about a second. The laws are necessary, not sufficient: also match shapes whose true map is known.

    Examples
    --------
    >>> from isomatch.matching import REFINEMENTS, Refinement
    >>> check_refinement(REFINEMENTS["joint"])
    >>> class Shuffled(Refinement):
    ...     def __call__(self, problem, fit):
    ...         return fit.image[::-1]
    >>> check_refinement(Shuffled())
    Traceback (most recent call last):
    isomatch.SettingError: Shuffled breaks the law "truth": ...
    """
    random = np.random.default_rng(seed)
    config = Config(hypotheses="given", search_runners_up=False)
    ball = bumpy_ball(N_VERTICES)
    source = prepare(ball, config)
    turn = Rotation.random(random_state=random).as_matrix()
    copy = ball.vertices @ turn.T
    trial, renumbered = (_Trial(refinement, source, copy, random.permutation(N_VERTICES)) for _ in range(2))
    rough = trial.draw_rough_map(random)
    with serial_blas():
        _check_repeatable(trial, rough)
        _check_relabelling(trial, renumbered, rough)
        _check_truth(trial)


def bumpy_ball(n_vertices: int) -> Mesh:
    """Make a ball with bumps and without symmetries, with evenly spread vertices."""
    number = np.arange(n_vertices)
    height, angle = 1 - (2 * number + 1) / n_vertices, np.pi * (1 + 5**0.5) * number
    ring = np.sqrt(1 - height**2)
    points = np.column_stack([ring * np.cos(angle), ring * np.sin(angle), height])
    faces = ConvexHull(points).simplices
    a, b, c = (points[faces[:, i]] for i in range(3))
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), a) < 0
    faces[inward] = faces[inward, ::-1]
    x, y, z = points.T
    radius = 1 + 0.3 * np.sin(3 * x + 1) * np.cos(2 * y) + 0.25 * np.sin(4 * z + 2 * x) + 0.2 * y
    return Mesh(points * radius[:, None] * [1.6, 1.0, 0.7], faces)


class _Trial:
    """A refinement, a shape, and a copy of it with renumbered vertices."""

    def __init__(
        self, refinement: Refinement, source: PreparedShape, positions: FloatArray, number: IntArray
    ) -> None:
        mesh = Mesh(positions[np.argsort(number)], number[source.mesh_body.faces])
        pair = prepare_pair(source, mesh, source.requested)
        priors = Priors.of(pair.source, pair.target, None, number)
        self.refinement, self.number, self.target = refinement, number, pair.target
        self.model = Isometry(replace(pair, priors=priors, refinement=refinement))
        candidates, _ = self.model.candidates(*self.model.hypotheses())
        self._fit = self.model.begin(candidates)[0]

    def draw_rough_map(self, random: np.random.Generator) -> Int[BodyVertices, "r"]:
        """Draw random images near the true ones, as vertices of the source."""
        distances = self.model.source.distances.row(self.model.vertices)
        near = (np.flatnonzero(row <= MAX_ROUGH_ERROR) for row in distances)
        return BodyVertices(np.array([random.choice(vertices) for vertices in near]))

    def refine(self, images: Sequence[Int[BodyVertices, "r"]]) -> list[Fit]:
        """Refine maps whose images are given as vertices of the source."""
        fits = [replace(self._fit, image=BodyVertices(self.number[image])) for image in images]
        return self.model.refine(fits)


def _check_repeatable(trial: _Trial, rough: Int[BodyVertices, "r"]) -> None:
    def refined(threads: int) -> list[BodyVertices]:
        with _threads(threads):
            return [fit.image for fit in trial.refine([trial.model.vertices, rough])]

    first = refined(1)
    for what, threads, remedy in (
        ("called again", 1, "random numbers without a seed, or something kept between calls"),
        ("called with three threads", 3, "something that several maps write to"),
    ):
        again = refined(threads)
        if len(again) != len(first):
            how = f"{len(again)} maps instead of {len(first)}"
        elif changed := sum(int((a != b).sum()) for a, b in zip(first, again)):
            how = f"{changed} other images of {sum(map(len, first))}"
        else:
            continue
        raise _law_error(trial, "repeatable", f"{what}, it gives {how}", remedy)


def _check_relabelling(trial: _Trial, renumbered: _Trial, rough: Int[BodyVertices, "r"]) -> None:
    first, second = trial.refine([rough])[0], renumbered.refine([rough])[0]
    other = renumbered.number[np.argsort(trial.number)][first.image]
    changed = float((other != second.image).mean())
    if changed > MAX_CHANGED_SHARE:
        distance = renumbered.target.mean_distance(other, second.image)
        how = (
            f"{changed:.0%} of the images are other points, {distance:.3f} √area apart on average, when the vertices of "
            f"the target have other numbers (at most {MAX_CHANGED_SHARE:.0%})"
        )
        look_at = "what uses the number of a vertex, or the order of the vertices"
        raise _law_error(trial, "relabelling", how, look_at)


def _check_truth(trial: _Trial) -> None:
    fit = trial.refine([trial.model.vertices])[0]
    embedding = trial.model.everywhere(fit)
    everywhere = trial.target.index.vertices(embedding.target, embedding.source)
    for image, truth, where in (
        (fit.image, trial.number[trial.model.vertices], "__call__"),
        (everywhere, trial.number, "everywhere"),
    ):
        error = trial.target.mean_distance(image, truth)
        if not error <= MAX_ERROR:
            how = f"of the true map of a turned copy it makes one with a mean error of {error:.3f} √area"
            look_at = "rows are those of problem.refinement_vertices and images are vertices of the target"
            raise _law_error(trial, "truth", f"{how} (at most {MAX_ERROR})", f"{where}: whether {look_at}")


def _law_error(trial: _Trial, law: str, how: str, look_at: str) -> SettingError:
    return SettingError(f'{type(trial.refinement).__name__} breaks the law "{law}": {how}; look at {look_at}')


@contextmanager
def _threads(number: int) -> Iterator[None]:
    """Let `parallel_map` use a given number of threads."""
    name = "ISOMATCH_NUM_THREADS"
    before = os.environ.get(name)
    os.environ[name] = str(number)
    try:
        yield
    finally:
        os.environ.pop(name)
        if before is not None:
            os.environ[name] = before
