"""Parts that are missing: a plane cut, holes, a limb, and parts hidden from a camera. No vertex moves."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from isomatch._core.arrays import BoolArray, FloatArray
from isomatch._core.errors import MeshError, SettingError
from isomatch.geodesics import distance_engine, farthest_point_sampling, peripheral_vertex
from isomatch.surfaces import Mesh, rasterise
from isomatch_lab.damage.damaged import SHARE_RANGE, Damaged, require_usable, with_faces

N_TIPS = 5  # number of extremities among which a limb is drawn: the ends of four limbs and a head
VIEW_COUNT_RANGE = (0, 7)  # allowed numbers of views; at most one from each direction of three axes
FINE_EDGE_QUANTILE = 0.05  # quantile of the edge lengths that the depth buffer resolves; chosen
PIXELS_PER_EDGE = 8  # pixels of the depth buffer along an edge of this quantile; chosen
MAX_PIXELS = 3000  # pixels along each side of the depth buffer; chosen


def cut(mesh: Mesh, share: float = 0.3, *, seed: int = 0) -> Damaged:
    """Cut off the part beyond a plane in a random direction.

    Parameters
    ----------
    mesh : Mesh
        The whole.
    share : float
        Share of the area to remove, between 0 and 1. The largest component of the rest is kept, and what falls off with
        the other components counts as removed; so no less is removed, and more only where a piece falls off at once.
    seed : int
        Draws the direction.

    Returns
    -------
    Damaged
        Faces that the plane crosses are removed as a whole; no vertex is new.

    Raises
    ------
    SettingError
        If the share is not between 0 and 1.
    MeshError
        If nothing would be left, or the mesh is no surface.

    Examples
    --------
    >>> strip = Mesh([[x, y, 0] for x in range(9) for y in (0, 1)], [[2 * i, 2 * i + 2, 2 * i + 1] for i in range(8)])
    >>> cut(strip, 0.5).mesh
    Mesh(9 vertices, 4 faces)
    """
    require_usable(mesh, "share", share, SHARE_RANGE)
    direction = np.random.default_rng(seed).standard_normal(3)
    return _remove_share(mesh, mesh.vertices @ direction, share)


def holes(mesh: Mesh, share: float = 0.25, *, count: int = 8, seed: int = 0) -> Damaged:
    """Remove geodesic discs of equal radius, with centres drawn at random from the area.

    Parameters
    ----------
    mesh : Mesh
        The whole.
    share : float
        Share of the area to remove, between 0 and 1, as in `cut`. It determines the radius.
    count : int
        Number of discs; they may overlap.
    seed : int
        Draws the centres.

    Returns
    -------
    Damaged
        No vertex is new. Costs ``count`` distance columns.

    Raises
    ------
    SettingError
        If the share is not between 0 and 1, or the count is not in 1…n.
    MeshError
        If nothing would be left, or the mesh is no surface.
    """
    require_usable(mesh, "share", share, SHARE_RANGE)
    weights = mesh.vertex_areas / mesh.area
    if not 1 <= count <= np.count_nonzero(weights):
        raise SettingError(
            f"count = {count} must lie in 1…{np.count_nonzero(weights)}, the number of vertices with an area"
        )
    centres = np.random.default_rng(seed).choice(mesh.n_vertices, count, replace=False, p=weights)
    return _remove_share(mesh, distance_engine(mesh).distances_from(centres).min(axis=0), share)


def limb_removed(mesh: Mesh, share: float = 0.09, *, seed: int = 0) -> Damaged:
    """Cut off a limb: the geodesic disc around one of five extremities.

    Parameters
    ----------
    mesh : Mesh
        The whole. Its largest component is damaged; the others are removed first.
    share : float
        Share of the area to remove, between 0 and 1, as in `cut`. Of a human, 0.09 is an arm or the head, and 0.18 a leg
        (the rule of nines of burn surgery: Wallace, *The exposure treatment of burns*, The Lancet 1951).
    seed : int
        Draws the extremity.

    Returns
    -------
    Damaged
        No vertex is new. Extremities are farthest points, the first of them most remote.

    Raises
    ------
    SettingError
        If the share is not between 0 and 1.
    MeshError
        If nothing would be left, or the mesh is no surface of at least five vertices.
    """
    require_usable(mesh, "share", share, SHARE_RANGE)
    body, index = mesh.submesh(mesh.components == _largest(mesh))
    engine = distance_engine(body)
    samples = farthest_point_sampling(engine, N_TIPS, peripheral_vertex(body, engine))
    distance = np.zeros(mesh.n_vertices)  # distance 0: other components are removed first
    distance[index] = samples.columns[np.random.default_rng(seed).integers(N_TIPS)]
    return _remove_share(mesh, distance, share)


def view(mesh: Mesh, views: int = 1, *, seed: int = 0) -> Damaged:
    """Keep the faces that are seen by a camera, as a scanner sees them, or by several.

    Parameters
    ----------
    mesh : Mesh
        The whole.
    views : int
        Number of cameras, 1 to 6. The second looks from behind, the next two from both sides, the last two from above
        and below.
    seed : int
        Draws the rotation of the cameras.

    Returns
    -------
    Damaged
        The largest component of all faces that show in at least one pixel of a depth buffer. No vertex is new.

    Raises
    ------
    SettingError
        If the number of views is not 1 to 6.
    MeshError
        If no face is seen, or the mesh is no surface.

    Notes
    -----
    The cameras are orthographic. A pixel is an eighth of all but the shortest twentieth of the edges, with at most 3000
    pixels along an axis. Faces that are seen so obliquely that no pixel shows them are missed, as at the rims of a scan.
    """
    require_usable(mesh, "views", views, VIEW_COUNT_RANGE)
    if views != int(views):
        raise SettingError(f"views = {views} is not a whole number of cameras")
    axes = Rotation.random(rng=np.random.default_rng(seed)).as_matrix()
    finest, widest = np.quantile(mesh.edge_lengths, FINE_EDGE_QUANTILE), np.ptp(mesh.vertices, axis=0).max()
    pixel = max(finest / PIXELS_PER_EDGE, widest / MAX_PIXELS)
    seen = np.zeros(mesh.n_faces, dtype=bool)
    for i in range(int(views)):
        camera = np.roll(axes, i // 2, axis=0) * [[1], [1], [(-1) ** i]]
        points = mesh.vertices @ camera.T / pixel
        points -= points.min(axis=0)
        width, height = np.ceil(np.ptp(points, axis=0)[:2]).astype(int)
        raster = rasterise(points, mesh.sound_faces, int(width), int(height))
        seen[raster.face[raster.covered]] = True
    return _keep_faces(mesh, _largest_part(mesh, seen))


def _remove_share(mesh: Mesh, order: FloatArray, share: float) -> Damaged:
    """Remove faces in the order of the smallest of their corners' values, until a share of the area is gone."""
    ranked = order[mesh.sound_faces].min(axis=1).argsort(kind="stable")

    def left(count: int) -> BoolArray:
        keep = np.ones(mesh.n_faces, dtype=bool)
        keep[ranked[:count]] = False
        return _largest_part(mesh, keep)

    # only the largest component is kept, so the area lost grows with the number of faces removed: bisect that number
    too_few, enough = 0, mesh.n_faces
    while enough - too_few > 1:
        middle = (too_few + enough) // 2
        if mesh.face_areas[left(middle)].sum() > (1 - share) * mesh.area:
            too_few = middle
        else:
            enough = middle
    return _keep_faces(mesh, left(enough))


def _largest(mesh: Mesh) -> int:
    """Label of the component of largest area."""
    return int(np.bincount(mesh.components, mesh.vertex_areas).argmax())


def _largest_part(mesh: Mesh, faces: BoolArray) -> BoolArray:
    """Restrict some faces of a mesh to their component of largest area."""
    part = Mesh(mesh.vertices, mesh.sound_faces[faces])
    kept = faces.copy()
    kept[faces] = part.components[part.faces[:, 0]] == _largest(part)
    return kept


def _keep_faces(mesh: Mesh, faces: BoolArray) -> Damaged:
    """Keep some faces of a mesh, and the vertices that they use."""
    if not faces.any():
        raise MeshError(f"nothing would be left of {mesh!r}; remove less of it, or give a finer mesh")
    return with_faces(mesh, mesh.faces[faces])
