"""The pair of creatures shipped with the package, and the truth between two creatures."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.resources import as_file, files

import numpy as np

from isomatch._core.arrays import FloatArray
from isomatch._core.cached import cached_property
from isomatch._core.errors import InputError, SettingError
from isomatch.datasets.truth import Truth, closest_points
from isomatch.surfaces import Mesh


@dataclass(frozen=True, eq=False)
class Creature:
    """A posed animal with its rest shape.

    Parameters
    ----------
    mesh : Mesh
        The posed surface, n vertices: closed, manifold, oriented outward, connected, of genus 0.
    rest : (n, 3) array
        Position of each vertex on the rest surface, which all creatures of one kind, style and symmetry share.
    kind : str
        Body plan.
    style : int
        Seed of the proportions.
    symmetric : bool
        Whether the rest surface is its own mirror image under x → −x.
    """

    mesh: Mesh
    rest: FloatArray
    kind: str
    style: int
    symmetric: bool

    @cached_property
    def rest_mesh(self) -> Mesh:
        """The same triangles in the rest pose."""
        return Mesh(self.rest, self.mesh.faces)

    def __repr__(self) -> str:
        symmetric = ", symmetric" if self.symmetric else ""
        return f"Creature({self.kind}, style {self.style}{symmetric}, {self.mesh.n_vertices} vertices)"


FILE = files("isomatch.datasets") / "shipped" / "creature_pair.npz"


def example_pair() -> tuple[Creature, Creature]:
    """Load two poses of one asymmetric animal with different triangulations; only numpy is needed.

    The source stands, and the target runs with its head turned; `ground_truth` gives their correspondence.

    Examples
    --------
    >>> source, target = example_pair()
    >>> source, target
    (Creature(quadruped, style 0, 2968 vertices), Creature(quadruped, style 0, 3242 vertices))
    """
    with as_file(FILE) as path, np.load(path) as stored:
        source, target = (
            Creature(
                mesh=Mesh(stored[f"{name}_vertices"], stored[f"{name}_faces"]),
                rest=stored[f"{name}_rest"].astype(np.float64),
                kind="quadruped",
                style=0,
                symmetric=False,
            )
            for name in ("source", "target")
        )
    return source, target


def ground_truth(source: Creature, target: Creature, *, mirrored: bool = False) -> Truth:
    """Find the true correspondence of two creatures through their common rest surface.

    They are of the same kind, style and symmetry; pose, resolution and triangulation may differ. For each vertex of the
    source, it is the closest point of the target's rest mesh, which differs from the rest surface by O(h²), h being the
    edge length. The mirrored one is the other true correspondence of symmetric creatures, from left to right.
    """
    for what in ("kind", "style", "symmetric"):
        ours, theirs = getattr(source, what), getattr(target, what)
        if ours != theirs:
            raise InputError(
                f"source has {what}={ours!r} and target {what}={theirs!r}, so they share no rest "
                "surface and have no ground truth; make both with the same one"
            )
    if mirrored and not source.symmetric:
        raise SettingError("an asymmetric creature has no mirrored truth; make both with symmetric=True")
    points = source.rest * [-1.0, 1.0, 1.0] if mirrored else source.rest
    return closest_points(points, target.rest_mesh)
