"""Procedural articulated animals, at any resolution and in any pose, with exact ground truth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from isomatch.datasets.anatomy import body
from isomatch.datasets.implicit import Skin
from isomatch.datasets.posing import Pose, natural_pose, posed
from isomatch.datasets.tessellation import tessellate
from isomatch.datasets.truth import Truth, closest_points
from isomatch.errors import InputError, SettingError
from isomatch.surfaces import Mesh
from isomatch.values.arrays import FloatArray
from isomatch.values.cached import cached_property

FEWEST_VERTICES = 1500


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


def creature(
    n_vertices: int = 5000,
    *,
    pose: int | Pose = 0,
    kind: str = "quadruped",
    style: int = 0,
    symmetric: bool = False,
    triangulation: int = 0,
) -> Creature:
    """Make an animal.

    Parameters
    ----------
    n_vertices : int
        Number of vertices, at least 1500; that of the mesh differs by up to 5 %.
    pose : int or mapping of str to (3,) array_like
        Seed of a random natural pose, 0 being the rest pose; or, for each joint that turns, its angles in
        degrees about x (to the right), y (forward) and z (up). `joint_names` lists the joints.
    kind : {"quadruped", "biped"}
        Body plan.
    style : int
        Seed of the proportions; 0 is the plain design.
    symmetric : bool
        Whether the rest shape is its own mirror image. If not, an ear is longer, a leg thicker, the tail bent, and so on.
    triangulation : int
        Seed of the triangulation. With two seeds, the same surface has no vertex and no connectivity in common.

    Returns
    -------
    Creature
        About 1.2 units long (quadruped) or 1.6 tall (biped). The same arguments give the same creature.

    Raises
    ------
    MissingDependencyError
        Without scikit-image: ``pip install 'isomatch[creatures]'``.
    SettingError
        If an argument is out of range, or a joint is unknown.

    Notes
    -----
    Poses are near-isometric: 90 % of the edges change their length by less than 18 %, typically by less than 11 %; the
    others lie at joints bent almost to their limits. Time is linear in ``n_vertices``.

    Examples
    --------
    >>> source = creature(2000, pose=1)
    >>> target = creature(2000, pose={"head": [0, 0, 30]}, triangulation=1)
    >>> truth = ground_truth(source, target)
    >>> len(truth.vertices) == source.mesh.n_vertices
    True
    """
    if n_vertices < FEWEST_VERTICES:
        raise SettingError(
            f"n_vertices = {n_vertices} is too coarse for a creature's thin limbs; ask for at least {FEWEST_VERTICES}"
        )
    limbs = body(kind, style, symmetric)
    skin = Skin.of(limbs)
    angles = natural_pose(limbs, pose) if isinstance(pose, int | np.integer) else pose
    rest = tessellate(skin, n_vertices, triangulation)
    mesh = Mesh(posed(rest.vertices, limbs, skin, angles), rest.faces)
    return Creature(mesh, rest.vertices, kind, style, symmetric)


def joint_names(kind: str = "quadruped") -> tuple[str, ...]:
    """Names of the joints of a body plan, for ``creature(pose=...)``.

    Examples
    --------
    >>> joint_names()[:3]
    ('waist', 'neck', 'head')
    """
    return tuple(joint.name for limb in body(kind) for joint in limb.joints)


def ground_truth(source: Creature, target: Creature, *, mirrored: bool = False) -> Truth:
    """Find the true correspondence of two creatures through their common rest surface.

    Parameters
    ----------
    source, target : Creature
        Of the same kind, style and symmetry; pose, resolution and triangulation may differ.
    mirrored : bool
        Find the other true correspondence of symmetric creatures, which maps left to right.

    Returns
    -------
    Truth
        For each vertex of the source, the closest point of the target's rest mesh, and its nearest vertex.

    Raises
    ------
    InputError
        If the creatures differ in kind, style or symmetry.
    SettingError
        If the mirrored truth of an asymmetric creature is asked for.

    Notes
    -----
    The closest point is exact; the two meshes differ from the rest surface by O(h²), h being the edge length.
    Time O(n log m) for n source vertices and m target faces.
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
