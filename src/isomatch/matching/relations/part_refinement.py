"""Refinement of a map of a part: functions of the whole are pulled back to the part, and images sought among them."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from isomatch.correspondence import Embedding, SampledBasis
from isomatch.matching.coordinates import iterated
from isomatch.matching.relations.landmark_distances import LandmarkDistances
from isomatch.matching.relations.part_pair import FEWEST_KNOWN, TRUSTED, PartPair
from isomatch.matching.relations.part_signatures import PartSignatures, WholeSignatures
from isomatch.settings import Config
from isomatch.shapes import PreparedShape
from isomatch.surfaces import vertex_normals
from isomatch.values.arrays import BoolArray, FloatArray, IntArray
from isomatch.values.cached import cached_method, cached_property

# a boundary needs more functions than the share of the area says; chosen on cuts and holes, not one by one
FUNCTION_RATIO = 1.75

# distances from landmarks, in √area, up to which they are coordinates of the refinement; docs/lab/robustness.md: parts
LANDMARK_REACH = 0.3

# distances along the part, in its √area, whose ratios to those of the images measure the unit;
# chosen on cuts and holes, not one by one
LEAST_NEAR, MOST_NEAR = 0.08, 0.3

EXTRA_FUNCTIONS = 3
N_ROUGH_VERTICES = 500  # of the part in the short refinement; chosen on cuts and holes, not one by one


class _Smooth(NamedTuple):
    """The whole through its first functions: vertices (n, 3) and normals (n, 3)."""

    vertices: FloatArray
    normals: FloatArray


class WholeCoordinates:
    """Coordinates of a whole in which images are sought.

    They are functions, signatures, distances from landmarks, smoothed vertices and their normals.

    Parameters
    ----------
    whole : PreparedShape
        A mesh.
    config : Config
        Of the match; the whole may have been prepared with another.
    landmarks : (l,) array of int
        Vertices of the body of the whole whose counterparts on the part are known.
    functions : (n_whole, q) array of float
        Known functions.
    """

    def __init__(
        self, whole: PreparedShape, config: Config, landmarks: IntArray, functions: FloatArray
    ) -> None:
        self._whole, self._settings = whole, config.refining
        self.signatures = WholeSignatures(whole, functions)
        self._distances = LandmarkDistances(whole, landmarks, LANDMARK_REACH)

    @cached_property
    def known(self) -> FloatArray:
        """Signatures, and distances from the landmarks: (n, 23 + q + l)."""
        return np.hstack([self.signatures.values, self._distances.values / self._settings.position_unit])

    @cached_method
    def known_of_part(self, pair: PartPair) -> PartSignatures:
        """Return the same of a part in the unit of a pair."""
        signatures, distances = self.signatures.of_part(pair), self._distances.of_part(pair)
        return PartSignatures(
            np.hstack([signatures.values, distances.values / self._settings.position_unit]),
            np.hstack([signatures.weights, distances.weights]),
        )

    @cached_method
    def smooth(self, k: int) -> _Smooth:
        """Give the whole through its first k functions."""
        mesh = self._whole.mesh_body
        vertices = self._whole.laplace.low_passed(mesh.vertices, k)
        return _Smooth(vertices, vertex_normals(vertices, mesh.faces))

    @cached_method
    def at(self, k: int, with_positions: bool) -> FloatArray:
        """Give the coordinates (n, m) with k functions."""
        settings = self._settings
        columns = [self._whole.laplace.vectors[:, :k] / np.sqrt(k), self.known]
        if with_positions:
            smooth = self.smooth(k)
            columns += [smooth.vertices / settings.position_unit, settings.normal_weight * smooth.normals]
        return np.hstack(columns)


class PartSamples:
    """The sample vertices of a part, in any unit.

    Parameters
    ----------
    pair : PartPair
        The part, and the distances on it.
    """

    def __init__(self, pair: PartPair) -> None:
        self._pair = pair

    def basis(self, n_rows: int) -> SampledBasis:
        """Functions of the part, to be fitted to values at its first sample vertices."""
        return self._pair.part.sampled_basis(n_rows)

    @cached_property
    def near(self) -> tuple[BoolArray, BoolArray, FloatArray]:
        """Near pairs of the first q vertices (q, q), which of them have a known distance on the whole, and those along.

        They are the search vertices that a rough refinement maps, too.
        """
        pair, config = self._pair, self._pair.config
        vertices = pair.part.sample_vertices[: min(config.n_search, config.n_refine, N_ROUGH_VERTICES)]
        along = np.maximum(pair.part.distances.between(vertices, vertices), 0.0)
        near = (along > LEAST_NEAR) & (along < MOST_NEAR)
        known = pair.missing.lower_bound(vertices, vertices, along)[near] >= TRUSTED * along[near]
        return near, known, along[near]


class PartRefinement:
    """Refines maps of some vertices of the part.

    The coordinates of the whole never change: Φ_whole, signatures, its smoothed vertices and their normals. Those of the
    part are the same functions pulled back by the map, Φ_part F, and fitted by functions of the part.

    Parameters
    ----------
    pair : PartPair
        The shapes.
    coordinates : WholeCoordinates
    samples : PartSamples
        Of the part.
    n_rows : int
        Vertices of the part that are mapped.
    """

    def __init__(
        self, pair: PartPair, coordinates: WholeCoordinates, samples: PartSamples, n_rows: int
    ) -> None:
        self._pair, self._whole, self._samples = pair, coordinates, samples
        self._known = coordinates.known_of_part(pair)
        self.vertices = pair.part.sample_vertices[:n_rows]
        self._basis = samples.basis(n_rows)

    def n_functions(self, k: int) -> int:
        """Count the functions of the part with eigenvalues up to those of the first k of the whole, and somewhat more."""
        part, whole = self._pair.part.laplace, self._pair.whole.laplace
        top = FUNCTION_RATIO * whole.values[min(k, len(whole.values)) - 1]
        most = min(len(part.values), len(self.vertices) // 3)
        return int(np.clip(np.searchsorted(part.values / self._pair.share, top) + EXTRA_FUNCTIONS, 6, most))

    def refined(
        self, image: IntArray, sizes: Iterable[int], with_positions: bool = True
    ) -> tuple[IntArray, float]:
        """Refine the images (r,) of the vertices; returns them, and their mean distance in the last coordinates."""

        def nearest(embedding: Embedding, _: int) -> tuple[IntArray, IntArray]:
            row = self._pair.whole.index.vertices(embedding.target, embedding.source)
            return row, row

        return iterated(
            image,
            sizes,
            lambda image, size: self.embedding(image, size, self.vertices, with_positions),
            nearest,
        )

    def extended(self, image: IntArray, k: int) -> IntArray:
        """Map the vertices of this refinement by a map (q,) of another number of sample vertices, through k functions."""
        return self._drawn(self._samples.basis(len(image)), image, k, self.vertices)

    def at(self, image: IntArray, k: int, vertices: IntArray) -> IntArray:
        """Map other vertices (q,) of the part by a map (r,) of those of this refinement, through k functions."""
        return self._drawn(self._basis, image, k, vertices)

    def _drawn(self, basis: SampledBasis, image: IntArray, k: int, vertices: IntArray) -> IntArray:
        functions = self._pair.whole.laplace.vectors[:, :k]
        k_part = min(self.n_functions(k), len(basis.vertices) // 3)
        drawn = basis.functions[vertices, :k_part] @ basis.fit(functions[image], k_part)
        return self._pair.whole.index.vertices(functions, drawn)

    def local_unit(self, image: IntArray) -> float:
        """Measure the unit by images (r,): the median ratio of known distances between near ones and along the part."""
        known = self._samples.near[1]
        if known.sum() < FEWEST_KNOWN:
            return self._pair.unit
        return self._pair.restricted(float(np.median(self._ratios(image)[known])))

    def _ratios(self, image: IntArray) -> FloatArray:
        """Ratios of distances between images and along the part, over pairs of near vertices."""
        near, _, along = self._samples.near
        image = image[: len(near)]
        there: FloatArray = self._pair.whole.distances.between(image, image)[near]
        return np.maximum(there, 1e-3) / along

    def orientation(self, image: IntArray, k: int) -> float:
        """Mean cosine of the normals of the whole and of its copy drawn on the part."""
        smooth = self._whole.smooth(k)
        normals = self._drawn_normals(smooth.vertices[image], self.n_functions(k))[1]
        return float(np.einsum("ij,ij->i", normals[self.vertices], smooth.normals[image]).mean())

    def embedding(
        self, image: IntArray, size: int, vertices: IntArray, with_positions: bool = True
    ) -> Embedding:
        """Coordinates of some vertices of the part, and of all of the whole, under a map (r,)."""
        pair, settings = self._pair, self._pair.config.refining
        k = min(size, len(pair.whole.laplace.values))
        k_part = self.n_functions(k)
        functions = pair.whole.laplace.vectors[:, :k]
        drawn = pair.part.laplace.vectors[vertices, :k_part] @ self._basis.fit(functions[image], k_part)
        nearest = image if vertices is self.vertices else pair.whole.index.vertices(functions, drawn)
        trusted = self._known.weights[vertices]
        there = self._whole.known[nearest]
        columns = [drawn / np.sqrt(k), trusted * self._known.values[vertices] + (1 - trusted) * there]
        if with_positions:
            smooth = self._whole.smooth(k)
            positions, normals = self._drawn_normals(smooth.vertices[image], k_part)
            columns += [
                positions[vertices] / settings.position_unit,
                settings.normal_weight * normals[vertices],
            ]
        return Embedding(np.hstack(columns), self._whole.at(k, with_positions))

    def _drawn_normals(self, positions: FloatArray, k_part: int) -> tuple[FloatArray, FloatArray]:
        """Draw the whole on the part by the positions of the images (r, 3): vertices and normals."""
        mesh = self._pair.meshes[0]
        drawn = self._basis.functions[:, :k_part] @ self._basis.fit(positions, k_part)
        return drawn, vertex_normals(drawn, mesh.faces)
