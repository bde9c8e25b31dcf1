"""Other triangulations with fewer vertices: decimated, or of a density that varies along the body.

Vertices are merged in place, so that every vertex that remains is one of the original.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from isomatch import resolution
from isomatch.geodesics import distance_engine, peripheral_vertex
from isomatch.surfaces import Mesh
from isomatch.values.arrays import FloatArray
from isomatch_lab.damage.damaged import SHARES, Damaged, require_usable, with_faces

RATIOS = (1.0, 1000.0)  # of densities


def decimate(mesh: Mesh, share: float = 0.25, *, seed: int = 0) -> Damaged:
    """Decimate by quadric errors.

    Parameters
    ----------
    mesh : Mesh
        The whole.
    share : float
        Share of the vertices to keep, between 0 and 1.
    seed : int
        Without effect, because nothing is drawn.

    Returns
    -------
    Damaged
        The topology and all vertices of boundaries are preserved, and no vertex moves. More vertices remain if no further
        edge can be collapsed. With a ``stand_in`` for each removed vertex: the one it was collapsed onto.

    Raises
    ------
    SettingError
        If the share is not between 0 and 1.
    MeshError
        If the mesh is no surface.

    Notes
    -----
    `isomatch.resolution.decimate` in place. O(n).
    """
    require_usable(mesh, "share", share, SHARES)
    return _thinned(mesh, share)


def resample(mesh: Mesh, ratio: float = 16.0, *, seed: int = 0) -> Damaged:
    """Thin out the vertices more and more from one end of the body to the other.

    Parameters
    ----------
    mesh : Mesh
        The whole; if it is evenly sampled, the result has the density that is asked for.
    ratio : float
        Density at the dense end, where all vertices are kept, over that at the other end; above 1, at most 1000.
    seed : int
        Draws the vertex from which the dense end is searched.

    Returns
    -------
    Damaged
        The density decreases exponentially with the geodesic distance from the dense end. The topology and all
        vertices of boundaries are preserved, and no vertex moves. With a ``stand_in`` for each removed vertex.

    Raises
    ------
    SettingError
        If the ratio is out of range.
    MeshError
        If the mesh is no surface.

    Notes
    -----
    `isomatch.resolution.decimate` in place, with the square of the density as weights. O(n), and one distance map.
    """
    require_usable(mesh, "ratio", ratio, RATIOS)
    engine = distance_engine(mesh)
    distance = engine.distances_from(np.array([peripheral_vertex(mesh, engine, seed)]))[0]
    farthest = distance[np.isfinite(distance)].max()
    density = ratio ** -np.minimum(distance / farthest, 1.0)
    return _thinned(mesh, float(density.mean()), density**2)


def _thinned(mesh: Mesh, share: float, weights: FloatArray | None = None) -> Damaged:
    """Merge vertices in place until a share of those in use is left."""
    n_unused = mesh.n_vertices - len(np.unique(mesh.sound_faces))
    wanted = max(round(share * (mesh.n_vertices - n_unused)), 4) + n_unused
    coarse = resolution.decimate(mesh, wanted, in_place=True, weights=weights)
    moved = np.linalg.norm(mesh.vertices - coarse.mesh.vertices[coarse.owner], axis=1)
    order = np.lexsort((moved, coarse.owner))  # by owners, the vertex that has not moved first
    kept = order[np.unique(coarse.owner[order], return_index=True)[1]]
    damaged = with_faces(mesh, kept[coarse.mesh.faces])
    return replace(damaged, stand_in=damaged.damaged_vertex[kept[coarse.owner]])
