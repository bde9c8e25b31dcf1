"""Adapter to pyFM, the most used Python package for functional maps: the package's own code is run."""

from __future__ import annotations

import numpy as np

from isomatch._core.first_use import package
from isomatch.correspondence import Correspondence
from isomatch.surfaces import Mesh

INITIAL_FUNCTIONS = 50  # number of eigenfunctions in the first functional map; chosen
FINAL_FUNCTIONS = 200  # number of eigenfunctions in the last functional map; chosen
UPSAMPLING_STEP = 5  # number of eigenfunctions that each step of ZoomOut adds; chosen
ORIENTATION_WEIGHT = 1.0  # weight of the orientation term over the other terms together; chosen


def pyfm_zoomout(source: Mesh, target: Mesh) -> Correspondence:
    """Match with pyFM: wave kernel signatures, orientation term, then ZoomOut to 200 functions.

    Parameters
    ----------
    source, target : Mesh
        The surfaces; every vertex must belong to a face.

    Returns
    -------
    Correspondence
        Source → target.

    Raises
    ------
    MissingDependencyError
        If the package ``pyfmaps`` is not installed.

    Notes
    -----
    The package pyfmaps is by R. Magnet. Ovsjanikov et al. 2012, Ren et al. 2018 (orientation term), Melzi et al. 2019
    (ZoomOut). The weights are the package's defaults, with the orientation term switched on.
    """
    functional, mesh_of_pyfm = (
        package(f"pyFM.{name}", "peers", "the method 'pyfm'") for name in ("functional", "mesh")
    )
    FunctionalMapping, TriMesh = functional.FunctionalMapping, mesh_of_pyfm.TriMesh
    # pyFM maps the vertices of its second mesh to its first mesh
    shapes = [
        TriMesh(mesh.vertices, mesh.faces, area_normalize=True, center=True) for mesh in (target, source)
    ]
    model = FunctionalMapping(*shapes)
    model.preprocess(descr_type="WKS", n_descr=100, subsample_step=5, k_process=FINAL_FUNCTIONS)
    model.fit(K=(INITIAL_FUNCTIONS,) * 2, w_orient=ORIENTATION_WEIGHT)
    steps = (FINAL_FUNCTIONS - INITIAL_FUNCTIONS) // UPSAMPLING_STEP
    refined = model.zoomout_refine(nit=steps, step=UPSAMPLING_STEP)
    return Correspondence(np.asarray(model.get_p2p(refined)), target.n_vertices)
