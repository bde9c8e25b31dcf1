"""Settings of one shape: extremities, signatures, curvature, repairs; levels of large meshes; symmetries."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from isomatch._core.errors import SettingError
from isomatch._core.settings import Settings, setting

DistanceUnit = Literal["average", "user"]


@dataclass(frozen=True)
class PreparationSettings(Settings):
    """Fine settings of `prepare`: extremities, signatures and curvature of one shape.

    Parameters
    ----------
    extremity_spacing : float
        Extremities nearer to each other than this, in √area, count as one: a hand, not its fingers.
    n_extremities : int
        Largest number of extremities.
    signature_step : int
        Of a hundred energies of the wave kernel signature, every ``signature_step``-th is used.
    curvature_functions, energy_curvature_functions : tuple of int, int
        Numbers of Laplace–Beltrami functions that smooth the surfaces whose signed mean curvatures are
        signatures; the same number for the surface whose curvature the energy compares.
    distance_unit : {"average", "user"}
        Distances of two shapes are compared in the average distance of each, or in the units of the
        files.
    block_diagonal : bool
        Whether an alignment never mixes descriptor columns of different sign.
    sheet_distance : float
        Glued or merged sheets, such as limbs that touch in a scan, are separated where their
        distance along the surface is at least this, in √area; ``inf`` leaves them together.
    self_contact_concavity : float
        Fused limbs are cut along loops with at most this ratio of cost and length (`cut_self_contacts`); 0 cuts none.
    most_self_contacts : int
        A shape with more handles is not cut, since its handles are no touching limbs.
    most_components : int
        Largest number of components of a mesh that are matched separately, beside the largest component.
    """

    extremity_spacing: float = setting(0.25, "√area; 0.15 takes thumbs for feet on 4 of 50 pairs", least=0)
    n_extremities: int = setting(8, "extremities at most; 7 to 12 give the same errors", least=0)
    signature_step: int = setting(5, "every 5th of 100 energies, as neighbours overlap", least=1)
    curvature_functions: tuple[int, ...] = setting((50, 100, 150), "functions, coarse to fine", least=4)
    energy_curvature_functions: int = setting(100, "functions; the middle of curvature_functions", least=4)
    distance_unit: DistanceUnit = setting("average", "scale must not matter; errors are equal: lab/paper.md")
    block_diagonal: bool = setting(True, "mixing columns of different sign harms: lab/paper.md")
    sheet_distance: float = setting(0.1, "√area along the surface; decisions.md, separated sheets", least=0)
    self_contact_concavity: float = setting(0.5, "cost / length; true contacts have 0.16…0.36", least=0)
    most_self_contacts: int = setting(24, "handles; bodies have 9: decisions.md, self-contacts", least=0)
    most_components: int = setting(12, "chosen: each component takes as long as a small match", least=0)


# The source of four sizes: mean errors in % of √area, and seconds of CPU, of eight pairs of 12,500 vertices.
LEVEL_ERRORS = "vertices; SCAPE: all 1.58 % in 4.9 s, auto 1.54 % in 2.8 s, fast 1.54 % in 1.9 s"


@dataclass(frozen=True)
class LevelSettings(Settings):
    """Sizes of the levels on which large meshes are matched.

    Parameters
    ----------
    matched, polished, fast_matched, fast_polished : int
        Numbers of vertices on which shapes are matched, and on which the map is then polished; the same
        with ``resolution="fast"``.
    spared : float
        A mesh with up to this many times the vertices of a level is not decimated.
    """

    matched: int = setting(5000, LEVEL_ERRORS, least=200)
    polished: int = setting(16000, LEVEL_ERRORS, least=200)
    fast_matched: int = setting(2500, LEVEL_ERRORS, least=200)
    fast_polished: int = setting(5000, LEVEL_ERRORS, least=200)
    spared: float = setting(1.25, "vertices / `matched`; chosen: less hardly saves time", least=1)

    def __post_init__(self) -> None:
        super().__post_init__()
        for kind in ("", "fast_"):
            matched, polished = getattr(self, f"{kind}matched"), getattr(self, f"{kind}polished")
            if polished < matched:
                raise SettingError(
                    f"{kind}polished = {polished} is below {kind}matched = {matched}; a map is polished on more vertices"
                )


@dataclass(frozen=True)
class SymmetrySettings(Settings):
    """Settings of the search for symmetries of one shape.

    Parameters
    ----------
    n_assignments : int
        Largest number of assignments of anchors that are improved; 0 searches for no symmetries.
    largest_residual : float
        Largest residual of the distance descriptors for a symmetry, in units of √(average distance
        / number of search vertices). The spacing of these vertices alone gives about 2.4.
    """

    n_assignments: int = setting(24, "assignments; a body takes 15 to 60 ms: lab/benchmarks.md", least=0)
    largest_residual: float = setting(3.2, "√(average distance / samples); spacing makes 2.4", least=0)
