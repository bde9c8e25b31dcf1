"""`match`: prepare both shapes, and match them; those of several components one by one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from numpy.typing import ArrayLike

from isomatch.assets import SurfaceLike
from isomatch.correspondence import Correspondence
from isomatch.errors import SettingError
from isomatch.matching.components import match_components
from isomatch.matching.hints import Hints, checked_landmarks
from isomatch.matching.judge import Solution, judged
from isomatch.matching.known_functions import with_functions
from isomatch.matching.pair import ShapePair, prepare_pair
from isomatch.matching.pins import pinned
from isomatch.matching.refinements import REFINEMENTS
from isomatch.matching.result import MatchResult
from isomatch.matching.stages import Refinement, Relation, Stages, Start, name_of
from isomatch.matching.windings import solve_either_winding
from isomatch.runtime.interruption import in_background
from isomatch.runtime.stage_timer import Progress, StageTimer
from isomatch.runtime.threads import serial_blas
from isomatch.settings import Config
from isomatch.shapes import PreparedShape


def match(
    source: SurfaceLike | PreparedShape,
    target: SurfaceLike | PreparedShape,
    landmarks: ArrayLike | None = None,
    initial_map: ArrayLike | None = None,
    initial_descriptors: tuple[ArrayLike, ArrayLike] | None = None,
    config: Config | None = None,
    seed: int = 0,
    progress: Progress | None = None,
    *,
    refinement: Refinement | None = None,
    starts: Sequence[Start] | None = None,
    relation: Relation | None = None,
    functions: tuple[ArrayLike, ArrayLike] | None = None,
) -> MatchResult:
    """Match two near-isometric surfaces.

    Parameters
    ----------
    source, target : Mesh, PointCloud, Graph, PreparedShape, path_like, tuple or object
        The shapes; `prepare` one that is matched more than once. Also the path of a mesh file, a tuple (vertices, faces)
        or a mesh of trimesh, PyVista, meshio or Open3D; see `isomatch.assets.files`.
    landmarks : (m, 2) array_like of int, optional
        Rows (source vertex, target vertex), m ≥ 3; see `read_landmarks`. With ``Config.pin`` they hold.
    initial_map : (n_source,) array_like of int, optional
        Target vertex of each source vertex from another method; −1 where unknown. It wins where no other map fits better.
    initial_descriptors : two array_likes, optional
        (n_source, q) and (n_target, q) values of functions that should correspond.
    config : Config, optional
        Settings; by default those of the prepared shapes, else the defaults.
    seed : int
        Seeds sampling and eigensolver of shapes not yet prepared.
    progress : callable, optional
        Called as ``progress(stage, share)`` when a stage starts, on the thread that called `match`: its name, and the
        share of the work that is done, which rises from 0 to 1 and is an estimate. A function of the stage alone is
        called with that. What it raises ends the match and reaches the caller as it is. `show_progress` is such a
        function.
    refinement : Refinement, optional
        Takes the place of ``config.refinement``: your own subclass of `Refinement`.
    starts : sequence of callable, optional
        Where first maps come from, beside hints: functions of the pair that return arrays (q, 2) of vertices of both
        bodies; with ``[yours, *default_starts]`` they are added to those of isomatch. In every relation, landmarks and an
        initial map contend with them, whichever they are; with ``Config(hypotheses="given")`` no start may win.
    relation : Relation, optional
        What is claimed of the shapes, such as `Isometry`, `Part` or `Elastic`; by default each one that fits them. Of
        shapes of several components it is claimed of each two partners. `Part` and `Elastic` want meshes and the
        orientation "preserve", and `Part` no descriptors.
    functions : two array_likes, optional
        (n_source, q) and (n_target, q), or (n_source,) and (n_target,), values that mean the same on both shapes, such as
        thickness, sulcal depth or colour; nan where unknown. Unlike ``initial_descriptors``, which only start the search,
        they are coordinates of every stage, with the weight ``Config.refining.function_weight``.

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
        If shapes were prepared with other settings, hints are asked for and none was given, a refinement, start or
        relation handed in gives something else than it should, or a relation does not suit the shapes or the settings.
    NotConvergedError
        If no map of a part keeps the orientation.

    Notes
    -----
    Shamai & Kimmel, *Geodesic Distance Descriptors*, CVPR 2017, with automatic starts and a joint refinement beyond it.
    About 2 s for two shapes of 5 000 vertices on two cores, and 4 s for 28 000. Large meshes
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

    def matched() -> MatchResult:
        with serial_blas():
            timer.start("prepare")
            pair = with_functions(prepare_pair(source, target, config, seed, timer), functions)
            stages = stages_of(pair, refinement, starts, relation)
            require_landmarks_for_pins(pair, landmarks)
            solution = solve_prepared(pair, (landmarks, initial_map, initial_descriptors), stages, timer)
            handed = _handed_in(refinement, starts, relation)
            result = judged(replace(solution, notes=(*solution.notes, *handed)), timer, seed)
        timer.reach("done", 1.0)
        return result

    return in_background(matched)


def stages_of(
    pair: ShapePair,
    refinement: Refinement | None = None,
    starts: Sequence[Start] | None = None,
    relation: Relation | None = None,
) -> Stages:
    """Return the stages handed in, and where there is none, those of the settings of a pair."""
    return Stages(REFINEMENTS[pair.config.refinement] if refinement is None else refinement, starts, relation)


def require_landmarks_for_pins(pair: ShapePair, landmarks: ArrayLike | None) -> None:
    """Raise `SettingError` if landmarks are to be held and none were given."""
    if pair.config.pin is not None and landmarks is None:
        raise SettingError(f"pin = {pair.config.pin}, but no landmarks were given that could be held")


def solve_prepared(
    pair: ShapePair,
    user_hints: tuple[ArrayLike | None, ArrayLike | None, tuple[ArrayLike, ArrayLike] | None],
    stages: Stages,
    timer: StageTimer,
) -> Solution:
    """Match two prepared shapes, given landmarks, an initial map and descriptors."""
    landmarks, initial_map, _ = user_hints
    tolerance = pair.config.pin
    if isinstance(initial_map, Correspondence):
        initial_map.check_fits(pair.source.surface, pair.target.surface)
    if pair.oriented and (pair.source.others or pair.target.others):
        solution = match_components(pair, *user_hints, stages, timer)
    else:
        solution = solve_either_winding(pair, Hints.of(pair, *user_hints), stages, timer)
    if tolerance is None or landmarks is None:
        return solution
    timer.start("pins")
    sizes = pair.source.surface.n_vertices, pair.target.surface.n_vertices
    return pinned(pair, solution, checked_landmarks(landmarks, *sizes), tolerance)


def _handed_in(
    refinement: Refinement | None, starts: Sequence[Start] | None, relation: Relation | None
) -> list[str]:
    """Record which stages are not those of the settings."""
    stages = []
    if refinement:
        stages.append(f"refinement = {type(refinement).__name__}")
    if starts is not None:
        stages.append(f"starts = {', '.join(map(name_of, starts)) or 'none'}")
    if relation:
        stages.append(f"relation = {type(relation).__name__}")
    return [f"stages handed in: {'; '.join(stages)}"] if stages else []
