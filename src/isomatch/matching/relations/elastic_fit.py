"""The fit of two shapes to each other: smooth maps both ways that become inverse to one another."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.linalg import LinAlgError
from scipy.linalg.lapack import dposv

from isomatch.correspondence import Embedding
from isomatch.matching.relations.elastic_shape import ElasticShape, Samples
from isomatch.surfaces import vertex_normals
from isomatch.values.arrays import Float32Array, FloatArray, IntArray, single
from isomatch.values.cached import cached_property

# factor of the Dirichlet energy in these steps; its root is a length in √area; chosen with coarse_functions
COARSE_SMOOTHNESS = (0.01, 0.01, 0.007)

COARSE_FUNCTIONS = (20, 20, 30)  # in the steps of the coarse fit; chosen: limbs, but no details

COARSE_ITERATIONS = (2, 2, 4)  # in each step; docs/lab/design_notes.md

SIGNATURE_WEIGHT = 0.05  # beside canonical coordinates; chosen on pairs of animals, not one by one

NORMAL_WEIGHT = 0.05  # in the coarse fit; chosen on pairs of animals, not one by one

LANDMARK_WEIGHT = 30.0  # of a landmark, in samples; chosen, not measured

RIDGE = 1e-9


class Coefficients(NamedTuple):
    """Each shape drawn on the other by its first functions: (k_s, d_t + 3) and (k_t, d_s + 3)."""

    source: FloatArray
    target: FloatArray


class Step(NamedTuple):
    """A step of the fit: functions, smoothness, iterations, and whether maps are made to respect the symmetries."""

    n_functions: int
    smoothness: float
    iterations: int
    symmetric: bool


def coarse_steps() -> tuple[Step, ...]:
    """Return the steps with few functions; after each, only the best fits go on."""
    return tuple(
        Step(k, smoothness, iterations, True)
        for k, smoothness, iterations in zip(COARSE_FUNCTIONS, COARSE_SMOOTHNESS, COARSE_ITERATIONS)
    )


class Images(NamedTuple):
    """Images of the samples both ways, as rows of the vertices sought.

    Parameters
    ----------
    forth, back : (m_s,) and (m_t,) array of int
    misfit : float
        Their mean distance.
    orientation : float
        Mean cosine between the normals of either shape and of its copy drawn on the other, of the wanted side.
    """

    forth: IntArray
    back: IntArray
    misfit: float
    orientation: float


class _Drawn(NamedTuple):
    """A shape drawn on the vertices sought of another: canonical coordinates (c, d), and normals (c, 3)."""

    canonical: FloatArray
    normals: FloatArray


@dataclass(frozen=True, eq=False)
class ElasticFit:
    """Alternates images both ways and the smooth functions that fit them.

    Parameters
    ----------
    source, target : Samples
    signatures : Embedding
        Signatures of all vertices of both.
    landmarks : (l, 2) array of int
        Vertices of source and target that correspond.
    side : float
        1 for maps that preserve the orientation of the faces, −1 for those that reverse it.
    normal_weight : float
        Of normals, beside canonical coordinates.

    Notes
    -----
    The energy is that of Ezuz, Solomon & Ben-Chen, *Reversible harmonic maps between discrete surfaces*, 2019: Dirichlet
    energy of both maps into canonical coordinates, and their distance from being inverse to each other. Here each map is
    a combination of few Laplace–Beltrami functions, for which the Dirichlet energy is diagonal, and signatures, normals
    and symmetries take part.
    """

    source: Samples
    target: Samples
    signatures: Embedding
    landmarks: IntArray
    side: float = 1.0
    normal_weight: float = NORMAL_WEIGHT

    def from_pairs(self, pairs: IntArray, step: Step) -> Coefficients:
        """Fit smooth maps to pairs (q, 2) of vertices alone."""

        def fitted(onto: Samples, other: Samples, here: IntArray, there: IntArray) -> FloatArray:
            return _smooth(
                onto.shape,
                here,
                other.shape.drawn[there],
                np.ones(len(here)),
                step.n_functions,
                step.smoothness,
            )

        return Coefficients(
            fitted(self.source, self.target, pairs[:, 0], pairs[:, 1]),
            fitted(self.target, self.source, pairs[:, 1], pairs[:, 0]),
        )

    def run(
        self, start: Coefficients, steps: tuple[Step, ...], images: Images | None = None
    ) -> tuple[Coefficients, Images]:
        """Take some steps from a start, whose images may be known."""
        found, images = start, images or self.images(start)
        for step in steps:
            for _ in range(step.iterations):
                found = self._fitted(images, step)
                images = self.images(found)
        return found, images

    def _fitted(self, images: Images, step: Step) -> Coefficients:
        source, target = self.source, self.target
        symmetric = step.symmetric and source.mirror_row is not None and target.mirror_row is not None

        def one(
            onto: Samples, other: Samples, forth: IntArray, back: IntArray, sides: IntArray
        ) -> FloatArray:
            here = [onto.vertices, onto.targets[back], sides[:, 0]]
            there = [other.targets[forth], other.vertices, sides[:, 1]]
            drawn = [other.shape.drawn[v] for v in there]
            if symmetric:  # the mirror image of where the mirror image goes
                mirrored = other.shape.mirrored
                assert mirrored is not None
                here += [onto.vertices]
                drawn += [mirrored[other.targets[forth[onto.mirror_row]]]]
            weights = np.concatenate([np.ones(len(v)) for v in here])
            first = len(here[0]) + len(here[1])
            weights[first : first + len(sides)] = LANDMARK_WEIGHT
            return _smooth(
                onto.shape, np.concatenate(here), np.vstack(drawn), weights, step.n_functions, step.smoothness
            )

        return Coefficients(
            one(source, target, images.forth, images.back, self.landmarks),
            one(target, source, images.back, images.forth, self.landmarks[:, ::-1]),
        )

    def images(self, found: Coefficients) -> Images:
        """Nearest images both ways, in the coordinates of `embedding`."""
        source, target, drawn = self.source, self.target, self._drawn(found)
        nearest = self._nearest_anywhere if source.everywhere else self._nearest_samples
        forth, back, misfit = nearest(drawn)
        cosines = [
            np.einsum("ij,ij->i", shape.normals[onto.row], other.normals[image]).mean()
            for shape, onto, other, image in zip(drawn, (source, target), (target, source), (forth, back))
        ]
        return Images(forth, back, misfit, self.side * float(np.mean(cosines)))

    def embedding(self, found: Coefficients) -> Embedding:
        """Coordinates of the vertices sought of both shapes, in which images are nearest."""
        return self._embedding(self._drawn(found))

    def _embedding(self, drawn: tuple[_Drawn, _Drawn]) -> Embedding:
        return Embedding(
            *(
                np.hstack([moving, SIGNATURE_WEIGHT * signatures[onto.targets]])
                for moving, signatures, onto in zip(
                    self._moving(drawn), self.signatures, (self.source, self.target)
                )
            )
        )

    def _drawn(self, found: Coefficients) -> tuple[_Drawn, _Drawn]:
        """Draw the target on the source, and the source on the target."""
        return _drawn(self.source, found.source), _drawn(self.target, found.target)

    def _moving(self, drawn: tuple[_Drawn, _Drawn]) -> Embedding:
        """Leave the signatures out, which are the same under all maps."""
        source, target, (target_here, source_there) = self.source, self.target, drawn
        weight = self.normal_weight
        return Embedding(
            np.hstack(
                [
                    target_here.canonical,
                    source.canonical,
                    self.side * weight * target_here.normals,
                    weight * source.normals,
                ]
            ),
            np.hstack(
                [
                    target.canonical,
                    source_there.canonical,
                    weight * target.normals,
                    self.side * weight * source_there.normals,
                ]
            ),
        )

    @cached_property
    def _unlike(self) -> Float32Array:
        """(m_s, m_t) squared distances of the weighted signatures of the samples of both."""
        a, b = (
            SIGNATURE_WEIGHT * values[samples.vertices]
            for values, samples in zip(self.signatures, (self.source, self.target))
        )
        return single(np.stack([((row - b) ** 2).sum(axis=1) for row in a]))

    def _nearest_anywhere(self, drawn: tuple[_Drawn, _Drawn]) -> tuple[IntArray, IntArray, float]:
        """Find the images (m_s,) and (m_t,) of the samples both ways, and the sum of both mean distances."""
        source, target, (a, b) = self.source, self.target, self._embedding(drawn)
        from_source, from_target = a[source.row], b[target.row]
        forth = target.shape.prepared.index.vertices(b, from_source)
        back = source.shape.prepared.index.vertices(a, from_target)
        misfit = np.linalg.norm(from_source - b[forth], axis=1).mean()
        return forth, back, float(misfit + np.linalg.norm(from_target - a[back], axis=1).mean())

    def _nearest_samples(self, drawn: tuple[_Drawn, _Drawn]) -> tuple[IntArray, IntArray, float]:
        """Do the same among the samples, by one product for both ways."""
        a, b = self._moving(drawn)
        squared = single(a) @ single(-2 * b).T
        squared += self._unlike
        squared += single(np.einsum("ij,ij->i", b, b))
        squared += single(np.einsum("ij,ij->i", a, a))[:, None]
        forth, back = squared.argmin(axis=1), squared.argmin(axis=0)
        nearest = squared[np.arange(len(a)), forth], squared[back, np.arange(len(b))]
        misfit = sum(np.sqrt(np.maximum(each, 0.0)).mean(dtype=np.float64) for each in nearest)
        return forth, back, float(misfit)

    def asymmetry(self, images: Images) -> float:
        """How far the maps are from exchanging mirror images: a mean distance; 0 unless both are nearly symmetric."""
        apart = []
        for onto, other, image in (
            (self.source, self.target, images.forth),
            (self.target, self.source, images.back),
        ):
            if onto.mirror_row is None or other.shape.mirrored is None:
                return 0.0
            d = other.shape.canonical.shape[1]
            mirrored = other.shape.mirrored[other.targets[image], :d]
            there = other.shape.canonical[other.targets[image[onto.mirror_row]]]
            apart.append(np.linalg.norm(mirrored - there, axis=1).mean())
        return float(np.mean(apart))


def _drawn(onto: Samples, coefficients: FloatArray) -> _Drawn:
    """Draw the other shape on the vertices sought."""
    k = len(coefficients)
    canonical = onto.functions_sought[:, :k] @ coefficients[:, :-3]
    normals = vertex_normals(onto.functions[:, :k] @ coefficients[:, -3:], onto.faces)
    return _Drawn(canonical, normals[onto.sought])


def _smooth(
    shape: ElasticShape,
    vertices: IntArray,
    values: FloatArray,
    weights: FloatArray,
    k: int,
    smoothness: float,
) -> FloatArray:
    """Coefficients that minimise the mean weighted squared error + smoothness × Dirichlet energy."""
    laplace = shape.prepared.laplace
    functions = laplace.vectors[vertices, :k]
    weighted = functions * (weights / weights.sum())[:, None]
    gram = weighted.T @ functions
    gram[np.diag_indices_from(gram)] += smoothness * laplace.values[:k] + RIDGE
    _, coefficients, failed = dposv(gram, weighted.T @ values)
    if failed or not np.isfinite(coefficients).all():
        raise LinAlgError(f"{k} functions of a shape cannot be fitted to {len(vertices)} vertices")
    return np.asarray(coefficients)
