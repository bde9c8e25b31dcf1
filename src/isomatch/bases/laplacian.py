"""The Laplacian of whatever has one: meshes and point clouds."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
import robust_laplacian
from scipy.sparse import csc_array, diags_array
from scipy.sparse.linalg import splu

from isomatch._arrays import FloatArray
from isomatch.errors import MeshError, SettingError
from isomatch.geodesics import MetricSpace
from isomatch.surfaces import Mesh, PointCloud

Surface: TypeAlias = Mesh | PointCloud
"""What has a Laplacian."""


def require_surface(surface: MetricSpace) -> Surface:
    """Return a surface that has a Laplacian as it is; `SettingError` for all others."""
    if isinstance(surface, Mesh | PointCloud):
        return surface
    raise SettingError(
        f"a {type(surface).__name__} has no Laplacian, which this method needs; use method='nystrom'"
    )


def laplacian(surface: Surface) -> tuple[csc_array, FloatArray]:
    """Stiffness L (n, n), which has no scale, and masses (n,) in squared mesh units.

    The tufted intrinsic Delaunay Laplacian of Sharp & Crane, *A Laplacian for Nonmanifold Triangle Meshes*, SGP 2020.
    """
    if isinstance(surface, Mesh):
        stiffness, mass = robust_laplacian.mesh_laplacian(surface.vertices, surface.faces)
    else:
        stiffness, mass = robust_laplacian.point_cloud_laplacian(surface.vertices)
    masses = np.asarray(mass.diagonal(), dtype=np.float64)
    if not (masses > 0).all():
        raise MeshError(
            f"{int((masses <= 0).sum())} vertices have no area, so the Laplacian is undefined there; "
            "call repair(mesh)"
        )
    return csc_array(stiffness), masses


def factorised(stiffness: csc_array, diagonal: FloatArray) -> Callable[[FloatArray], FloatArray]:
    """Factorise H + diag(d), symmetric and definite; return what solves with it."""
    solve: Callable[[FloatArray], FloatArray] = splu(
        csc_array(stiffness + diags_array(diagonal)),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    ).solve
    return solve
