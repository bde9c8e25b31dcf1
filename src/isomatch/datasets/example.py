"""The pair of creatures shipped with the package, and the exact truth between two triangulations."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.resources import as_file, files

import numpy as np
from scipy.spatial import KDTree

from isomatch._core.arrays import FloatArray, IntArray
from isomatch._core.cached import cached_property
from isomatch._core.errors import InputError, SettingError
from isomatch.surfaces import Mesh, nearest_on_surface


@dataclass(frozen=True, eq=False)
class Creature:
    """A posed animal with its rest shape.

    All creatures of one kind, style and symmetry share the rest surface.
    """

    mesh: Mesh  # the posed surface, n vertices: closed, manifold, oriented outward, of genus 0
    rest: FloatArray  # the position of each vertex on the rest surface, (n, 3)
    kind: str  # the body plan
    style: int  # the seed of the proportions
    symmetric: bool  # whether the rest surface is its own mirror image under x → −x

    @cached_property
    def rest_mesh(self) -> Mesh:
        """The same triangles in the rest pose."""
        return Mesh(self.rest, self.mesh.faces)

    def __repr__(self) -> str:
        symmetric = ", symmetric" if self.symmetric else ""
        return f"Creature({self.kind}, style {self.style}{symmetric}, {self.mesh.n_vertices} vertices)"


# file with the arrays of the two creatures of `example_pair`
PAIR_FILE = files("isomatch.datasets") / "shipped" / "creature_pair.npz"


def example_pair() -> tuple[Creature, Creature]:
    """Load two poses of one asymmetric animal with different triangulations; only numpy is needed.

    The source stands, and the target runs with its head turned; `ground_truth` gives their
    correspondence.

    Examples
    --------
    >>> source, target = example_pair()
    >>> source, target
    (Creature(quadruped, style 0, 2968 vertices), Creature(quadruped, style 0, 3242 vertices))
    """
    with as_file(PAIR_FILE) as path, np.load(path) as arrays:
        source, target = (
            Creature(
                mesh=Mesh(arrays[f"{name}_vertices"], arrays[f"{name}_faces"]),
                rest=arrays[f"{name}_rest"].astype(np.float64),
                kind="quadruped",
                style=0,
                symmetric=False,
            )
            for name in ("source", "target")
        )
    return source, target


@dataclass(frozen=True, eq=False)
class Truth:
    """True image of each of n source vertices on the target."""

    vertices: IntArray  # the nearest target vertex, (n,)
    faces: IntArray  # the target face that contains the closest point, (n,)
    barycentric: FloatArray  # the weights of the three corners of that face, (n, 3)

    def points(self, target: Mesh) -> FloatArray:
        """Compute the precise images, (n, 3), on the target mesh in any pose."""
        corners = target.vertices[target.faces[self.faces]]
        return np.asarray(np.einsum("ij,ijx->ix", self.barycentric, corners))


def ground_truth(source: Creature, target: Creature, *, mirrored: bool = False) -> Truth:
    """Find the true correspondence of two creatures through their common rest surface.

    They have the same kind, style and symmetry; pose, resolution and triangulation may differ. The
    image of a source vertex is the closest point of the target's rest mesh, which differs from the
    rest surface by O(h²) for edges of length h. The mirrored truth is the other true correspondence
    of symmetric creatures, from left to right.
    """
    for name in ("kind", "style", "symmetric"):
        first, second = getattr(source, name), getattr(target, name)
        if first != second:
            raise InputError(
                f"source has {name}={first!r} and target {name}={second!r}, so they share no rest "
                "surface and have no ground truth; make both with the same one"
            )
    if mirrored and not source.symmetric:
        raise SettingError("an asymmetric creature has no mirrored truth; make both with symmetric=True")
    points = source.rest * [-1.0, 1.0, 1.0] if mirrored else source.rest
    return closest_points(points, target.rest_mesh)


def closest_points(points: FloatArray, mesh: Mesh) -> Truth:
    """Find the closest point of a mesh to each of (n, 3) points, exactly."""
    corners, barycentric = nearest_on_surface(mesh, points)
    number = {face: i for i, face in enumerate(map(tuple, mesh.faces.tolist()))}
    faces = np.array([number.get(face, -1) for face in map(tuple, corners.tolist())], dtype=np.int64)
    at_vertex = np.flatnonzero(faces < 0)  # for points at vertices, the first face with that vertex
    used, first_corner = np.unique(mesh.faces, return_index=True)
    corner = first_corner[np.searchsorted(used, corners[at_vertex, 0])]
    faces[at_vertex], barycentric[at_vertex] = corner // 3, np.eye(3)[corner % 3]
    nearest: IntArray = KDTree(mesh.vertices).query(points)[1].astype(np.int64)
    return Truth(nearest, faces, np.maximum(barycentric, 0.0))  # rounding makes some weights negative
