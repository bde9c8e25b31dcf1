"""Coordinates in the range that single precision and other packages can handle."""

from __future__ import annotations

import numpy as np

from isomatch.errors import MeshError, some
from isomatch.surfaces import Mesh, PointCloud


def ordinary_unit(surface: Mesh | PointCloud) -> float:
    """Length to divide coordinates by so that their squares neither overflow nor vanish; 1 at ordinary sizes."""
    extent = float(np.abs(surface.vertices).max(initial=0.0))
    return 1.0 if extent == 0.0 or 1e-10 < extent < 1e10 else extent


def require_finite(mesh: Mesh) -> None:
    """Raise `MeshError` if a coordinate is not finite."""
    bad = np.flatnonzero(~np.isfinite(mesh.vertices).all(axis=1))
    if len(bad):
        raise MeshError(
            f"vertices {some(bad)} have coordinates that are not finite, so no distance is defined; "
            "correct the file or call repair(mesh)"
        )
