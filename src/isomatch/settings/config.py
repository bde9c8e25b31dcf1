"""All settings of a match: the everyday ones, and the settings of each stage, which are passed down."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, Protocol, Self

from isomatch._core.errors import SettingError
from isomatch._core.first_use import Shown
from isomatch._core.settings import Settings, require_one_of, setting
from isomatch._core.texts import read_toml
from isomatch.geodesics import engine_names
from isomatch.settings import (
    ElasticSettings,
    LevelSettings,
    OutcomeSettings,
    PartSettings,
    PreparationSettings,
    RefinementSettings,
    SearchSettings,
    SelectionSettings,
    SymmetrySettings,
)
from isomatch.spectral import Weighting

Orientation = Literal["preserve", "reverse", "any"]
RefinementName = Literal["none", "laplace_icp", "joint", "smooth"]
Hypotheses = Literal["all", "given"]
Start = Literal["auto", "pose"]
Resolution = Literal["auto", "full", "fast"]
PartRole = Literal["auto", "source", "target", "both", "none"]
"""Which shape is a part: the source of the target, the target of the source, or both of an unseen whole."""
Scale = Literal["auto", "same", "area", "free"]


class MatchSettings(Protocol):
    """The common part of the settings of every method, `match` or a baseline."""

    @property
    def orientation(self) -> Orientation:
        """Whether the map should preserve the orientation of the faces."""

    def to_dict(self) -> dict[str, Any]:
        """Return the settings as plain values."""

    def changed(self) -> dict[str, Any]:
        """Return the settings that differ from their defaults."""


# largest size of a file of settings, in bytes; chosen: a file with all settings has a fifth of this size
MAX_FILE_BYTES = 2**14


@dataclass(frozen=True)
class Config(Settings, Shown):
    """Settings of `prepare` and `match`; the defaults are those that the benchmarks recommend.

    Parameters
    ----------
    n_columns, rank, n_functions : int
        Number p of distance columns of each shape; rank k of the distance basis, which is the
        length of the descriptors; number of Laplace–Beltrami eigenfunctions of each shape.
    weights : {"area", "uniform"}
        Inner product of the distance basis; the paper uses "uniform".
    engine : str, optional
        How geodesic distances are computed, by a name of `engine_names`; by default fast marching
        on meshes, Dijkstra on point clouds and graphs.
    n_search, n_refine : int
        Number of vertices of each shape on which hypotheses are tried and compared; number of vertices
        of the source on which the refinement iterates before its last step on all vertices.
    hypotheses : {"all", "given"}
        Choose among automatic and given hypotheses, or only among given ones and flips of the map
        from landmarks. With "all", an automatic hypothesis wins if it fits better than the priors;
        if maps tie, the one nearest to the priors wins, even if it is a mirror image.
    search_runners_up : bool, optional
        With ``hypotheses="given"``: whether automatic hypotheses are searched as alternatives, so
        that the quality tells if one of them fits better. This takes as long as an automatic match.
        By default for "joint" and "smooth".
    refinement : {"none", "laplace_icp", "joint", "smooth"}
        After the alignment of distance descriptors: nothing (the paper's plain method); its
        post-processing; or spectral upsampling joint with signatures, positions and normals.
        "smooth" has more steps, for a map that is smooth and nearly one to one.
    orientation : {"preserve", "reverse", "any"}
        Whether the map preserves the orientation of the faces, reverses it (a mirror image), or
        does what fits better.
    start : {"auto", "pose"}
        Whether shapes are roughly aligned in space, so that maps to nearest points are hypotheses
        too: for the shapes as they are, and for both centred and scaled to equal area. Among maps
        that fit equally well, the one nearest to these wins. With ``hypotheses="given"``, only
        these and those from priors may win.
    pin : float, optional
        Landmarks hold: a landmark farther from its target than this, in √area, is moved there, and
        the map around it follows smoothly. 0 holds all exactly. By default they only guide the map.
    part : {"auto", "source", "target", "both", "none"}
        Which shape is a part of the other, or whether both are parts; "auto" takes shapes with a
        long boundary for parts. Parts need a refinement that searches further ("joint", "smooth" or
        a custom one), the orientation "preserve", and no descriptors.
    scale : {"auto", "same", "area", "free"}
        Units of a part and a whole: near the units of the files, exactly these, scaled to the same
        area, or free. Complete shapes are always scaled to the same area.
    resolution : {"auto", "full", "fast"}
        "auto" matches large meshes on fewer vertices, polishes the map on more and carries it to
        all; "full" uses all vertices throughout; "fast" uses still fewer. Maps always name the
        user's vertices.
    preparation, levels, symmetry, search, selection, refining, parts, elastic, outcome
        Fine settings of each stage.

    Examples
    --------
    >>> Config(rank=30, n_columns=60).search.n_hypotheses
    14
    >>> Config.from_dict({"rank": 30, "search": {"n_hypotheses": 20}}).search.n_hypotheses
    20
    """

    n_columns: int = setting(100, "columns of distances, p = 2 k in Shamai & Kimmel 2017", least=8)
    rank: int = setting(50, "columns of descriptors, k = 50 in Shamai & Kimmel 2017", least=4)
    n_functions: int = setting(150, "200 functions gain nothing: decisions.md, refinement cost", least=20)
    weights: Weighting = setting("area", "chosen: vertices then count by the area around them")
    engine: str | None = setting(None, "fast marching is the most exact of the fast: lab/benchmarks.md")
    n_search: int = setting(400, "600 vertices are no better on 17 pairs; with 300, 2 of 50 fail", least=100)
    n_refine: int = setting(1000, "error on 50 pairs 1.63 % of √area, with all vertices 1.59", least=100)
    hypotheses: Hypotheses = setting("all", "a prior can be wrong, so automatic hypotheses compete")
    search_runners_up: bool | None = setting(None, "by the refinement: the paper's methods need no search")
    refinement: RefinementName = setting("joint", "error in % of √area: none 2.9, laplace_icp 2.5, joint 1.5")
    orientation: Orientation = setting("preserve", "with 'any', 3 of 14 pairs fail")
    start: Start = setting("auto", "shapes need not be aligned in space")
    pin: float | None = setting(None, "√area; by default no landmark holds, as clicks are inexact", least=0)
    part: PartRole = setting("auto", "a long boundary tells a part: lab/robustness.md, parts")
    scale: Scale = setting("auto", "in FAUST, sizes of one person differ by factors up to 1.2")
    resolution: Resolution = setting("auto", "fewer vertices are faster and as exact: `LevelSettings`")
    preparation: PreparationSettings = setting(PreparationSettings())
    levels: LevelSettings = setting(LevelSettings())
    symmetry: SymmetrySettings = setting(SymmetrySettings())
    search: SearchSettings = setting(SearchSettings())
    selection: SelectionSettings = setting(SelectionSettings())
    refining: RefinementSettings = setting(RefinementSettings())
    parts: PartSettings = setting(PartSettings())
    elastic: ElasticSettings = setting(ElasticSettings())
    outcome: OutcomeSettings = setting(OutcomeSettings())

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.engine is not None:
            require_one_of("engine", self.engine, engine_names())
        if self.n_refine < 2 * self.n_functions:
            raise SettingError(
                f"n_refine = {self.n_refine} is below 2 n_functions = {2 * self.n_functions}: too few for the fit"
            )
        if self.rank > self.n_columns:
            raise SettingError(f"rank = {self.rank} exceeds n_columns = {self.n_columns}")
        n_fitted = max(self.selection.extension_functions, self.search.flipped_functions)
        if n_fitted > self.n_search // 2:
            raise SettingError(
                f"n_search = {self.n_search} is below 2 × {n_fitted}, the functions fitted on the search vertices; "
                "ask for more vertices, or fewer functions in search.flipped_functions or selection.extension_functions"
            )

    @classmethod
    def from_file(cls, path: str | Path) -> Self:
        """Read settings from a TOML file, stages as tables.

        Raises
        ------
        FormatError
            If the file is missing (`MissingFileError`) or is not TOML.
        SettingError
            If a setting is unknown, or its value is not allowed.
        """
        values = read_toml(Path(path), MAX_FILE_BYTES)
        try:
            return cls.from_dict(values)
        except SettingError as error:
            raise SettingError(f"{path}: {error}") from None

    def differs_in_preparation(self, other: Config) -> str | None:
        """Name the first setting of `prepare` in which two configurations differ; None if there is none."""
        names = "n_columns rank n_functions weights engine n_search n_refine resolution preparation levels symmetry"
        return next((name for name in names.split() if getattr(self, name) != getattr(other, name)), None)

    def for_size(self, n: int) -> Self:
        """Reduce what a shape of n vertices cannot provide."""
        columns = min(self.n_columns, n // 2)
        rank = min(self.rank, columns // 2 if columns < self.n_columns else self.rank)
        return replace(self, n_columns=columns, rank=rank, n_functions=max(20, min(self.n_functions, n // 4)))
