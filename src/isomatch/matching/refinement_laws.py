"""Laws that every refinement of maps must keep, tried on a small shape made here."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from isomatch.errors import SettingError
from isomatch.matching.fit import Fit
from isomatch.matching.hints import Hints
from isomatch.matching.pair import prepare_pair
from isomatch.matching.relations.isometry import Isometry
from isomatch.matching.stages import Refinement, Stages
from isomatch.runtime.threads import serial_blas
from isomatch.settings import Config
from isomatch.shapes import PreparedShape, prepare
from isomatch.surfaces import Mesh
from isomatch.values.arrays import FloatArray, IntArray

N_VERTICES = 500
MOST_ERROR = 0.02  # mean, in √area; half an edge of the shape is 0.025
MOST_CHANGED = 0.01  # share of images, where two points are equally near
MOVED = 0.1  # in √area: how far images of a rough map may be from the true ones


def check_refinement(refinement: Refinement, seed: int = 0) -> None:
    """Check that a refinement keeps the laws of one, as a dot test checks an adjoint.

    A bumpy ball is matched to a copy that is turned and whose vertices are drawn in another order:

    - repeatable: the same maps are refined to the same ones, to the last bit, when it is called again, and by several
      threads;
    - relabelling: when the target's vertices are numbered in another way, so are the images;
    - truth: the true map stays the true map, where it is refined and everywhere.

    Parameters
    ----------
    refinement : Refinement
        What would be handed to `match`.
    seed : int
        Seeds the turn, the orders of the vertices and the rough map.

    Raises
    ------
    SettingError
        If a law is broken: which one, by how much, and what to look at.

    Notes
    -----
    About a second. The laws are necessary, not sufficient: match shapes whose true map is known, too.

    Examples
    --------
    >>> from isomatch.matching import REFINEMENTS, Refinement
    >>> check_refinement(REFINEMENTS["joint"])
    >>> class Shuffled(Refinement):
    ...     def __call__(self, relation, fit):
    ...         return relation.measured(fit, fit.image[::-1])
    >>> check_refinement(Shuffled())
    Traceback (most recent call last):
    isomatch.errors.SettingError: Shuffled breaks the law "truth": ...
    """
    random = np.random.default_rng(seed)
    config = Config(hypotheses="given", search_rivals=False)
    ball = bumpy_ball(N_VERTICES)
    source = prepare(ball, config)
    turn = Rotation.random(random_state=random).as_matrix()
    trial, renumbered = (
        _Trial(refinement, source, ball.vertices @ turn.T, random.permutation(N_VERTICES)) for _ in range(2)
    )
    rough = trial.moved(random)
    with serial_blas():
        _check_repeatable(trial, rough)
        _check_relabelling(trial, renumbered, rough)
        _check_truth(trial)


def bumpy_ball(n_vertices: int) -> Mesh:
    """Make a ball with bumps and without symmetries, of vertices that are spread evenly.

    Examples
    --------
    >>> bumpy_ball(200)
    Mesh(200 vertices, 396 faces)
    """
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
    """A refinement, a shape and a copy of it whose vertices have other numbers."""

    def __init__(
        self, refinement: Refinement, source: PreparedShape, positions: FloatArray, number: IntArray
    ) -> None:
        original = np.argsort(number)
        mesh = Mesh(positions[original], number[source.mesh_body.faces])
        pair = prepare_pair(source, mesh, source.requested)
        hints = Hints.of(pair, None, number, None)
        self.refinement, self.number, self.target = refinement, number, pair.target
        self.relation = Isometry().on(pair, hints, Stages(refinement))
        candidates, _ = self.relation.candidates(*self.relation.hypotheses())
        self._fit = self.relation.begun(candidates)[0]

    @property
    def truth(self) -> IntArray:
        """(r,) true images."""
        return self.number[self.relation.vertices]

    def moved(self, random: np.random.Generator) -> IntArray:
        """Draw vertices of the source near those that are mapped, as images (r,) of a rough map."""
        source = self.relation.source
        everywhere = np.arange(source.body.n_vertices)
        apart = source.distances.between(self.relation.vertices, everywhere)
        return np.array([random.choice(np.flatnonzero(row <= MOVED)) for row in apart])

    def refined(self, images: Sequence[IntArray]) -> list[Fit]:
        """Refine maps (r,) onto vertices of the source, with their own numbers in the copy."""
        fits = [replace(self._fit, image=self.number[image]) for image in images]
        return self.relation.contest(fits)


def _check_repeatable(trial: _Trial, rough: IntArray) -> None:
    def refined(threads: int) -> list[IntArray]:
        with _threads(threads):
            return [fit.image for fit in trial.refined([trial.relation.vertices, rough])]

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
        raise _broken(trial, "repeatable", f"{what}, it gives {how}", remedy)


def _check_relabelling(trial: _Trial, renumbered: _Trial, rough: IntArray) -> None:
    first, second = trial.refined([rough])[0], renumbered.refined([rough])[0]
    other = renumbered.number[np.argsort(trial.number)][first.image]
    changed = float((other != second.image).mean())
    if changed > MOST_CHANGED:
        apart = renumbered.target.mean_distance(other, second.image)
        raise _broken(
            trial,
            "relabelling",
            f"{changed:.0%} of the images are other points, {apart:.3f} √area apart on average, when the vertices of the "
            f"target have other numbers (at most {MOST_CHANGED:.0%})",
            "what uses the number of a vertex, or the order of the vertices",
        )


def _check_truth(trial: _Trial) -> None:
    fit = trial.refined([trial.relation.vertices])[0]
    embedding = trial.relation.everywhere(fit)
    everywhere = trial.target.index.vertices(embedding.target, embedding.source)
    for image, truth, where in (
        (fit.image, trial.truth, "__call__ and contest"),
        (everywhere, trial.number, "everywhere"),
    ):
        error = trial.target.mean_distance(image, truth)
        if not error <= MOST_ERROR:
            raise _broken(
                trial,
                "truth",
                f"of the true map of a turned copy it makes one with a mean error of {error:.3f} √area (at most "
                f"{MOST_ERROR})",
                f"{where}: whether rows are those of relation.vertices and images are vertices of the target",
            )


def _broken(trial: _Trial, law: str, how: str, look_at: str) -> SettingError:
    return SettingError(f'{type(trial.refinement).__name__} breaks the law "{law}": {how}; look at {look_at}')


@contextmanager
def _threads(number: int) -> Iterator[None]:
    """Let `parallel_map` use so many threads."""
    name = "ISOMATCH_NUM_THREADS"
    before = os.environ.get(name)
    os.environ[name] = str(number)
    try:
        yield
    finally:
        if before is None:
            del os.environ[name]
        else:
            os.environ[name] = before
