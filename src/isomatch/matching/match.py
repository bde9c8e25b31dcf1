"""`match`: prepare both shapes, and match them; those of several components one by one."""

from __future__ import annotations

from numpy.typing import ArrayLike

from isomatch._threads import serial_blas
from isomatch.matching.components import match_components
from isomatch.matching.config import Config
from isomatch.matching.connected import match_connected
from isomatch.matching.hints import Hints
from isomatch.matching.pair import prepare_pair
from isomatch.matching.prepare import PreparedShape
from isomatch.matching.result import MatchResult
from isomatch.matching.stage_timer import Progress, StageTimer
from isomatch.surfaces import SurfaceLike


def match(
    source: SurfaceLike | PreparedShape,
    target: SurfaceLike | PreparedShape,
    landmarks: ArrayLike | None = None,
    initial_map: ArrayLike | None = None,
    initial_descriptors: tuple[ArrayLike, ArrayLike] | None = None,
    config: Config | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> MatchResult:
    """Match two near-isometric surfaces.

    Parameters
    ----------
    source, target : Mesh, PointCloud, Graph, PreparedShape, path_like, tuple or object
        The shapes; `prepare` one that is matched more than once. Also the path of a mesh file, a tuple (vertices, faces)
        or a mesh of trimesh, PyVista, meshio or Open3D; see `isomatch.surfaces.surface_from`.
    landmarks : (m, 2) array_like of int, optional
        Rows (source vertex, target vertex), m ≥ 3.
    initial_map : (n_source,) array_like of int, optional
        Target vertex of each source vertex from another method; −1 where unknown.
    initial_descriptors : two array_likes, optional
        (n_source, q) and (n_target, q) values of functions that should correspond.
    config : Config, optional
        Settings; by default those of the prepared shapes, else the defaults.
    seed : int
        Seeds sampling and eigensolver of shapes not yet prepared.
    progress : callable, optional
        Called with the name of each stage as it starts.

    Returns
    -------
    MatchResult
        ``.map`` is the `Correspondence` source → target.

    Raises
    ------
    MeshError
        If a surface cannot be used.
    LandmarkError, MapError, DescriptorError
        If landmarks, initial map or descriptors do not fit the shapes.
    SettingError
        If shapes were prepared with other settings, or hints are asked for and none was given.
    NotConvergedError
        If no map of a part keeps the orientation.

    Notes
    -----
    Shamai & Kimmel, *Geodesic Distance Descriptors*, CVPR 2017, with automatic starts and a joint refinement beyond it.
    About 1.5 s for two shapes of 5 000 vertices on two cores, half of it preparation, and 4 s for 28 000. Large meshes
    are matched on fewer vertices, see ``Config.resolution``.

    Examples
    --------
    >>> from isomatch.datasets import example_pair
    >>> source, target = example_pair()
    >>> result = match(source.mesh, target.mesh)
    >>> result.outcome.name
    'CONVERGED'
    """
    timer = StageTimer(progress)
    with serial_blas():
        timer.start("prepare")
        pair = prepare_pair(source, target, config, seed)
        given = landmarks, initial_map, initial_descriptors
        if pair.oriented and (pair.source.others or pair.target.others):
            return match_components(pair, *given, timer, seed)
        return match_connected(pair, Hints.of(pair, *given), timer, seed)
