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
    extremity_spacing, n_extremities : float, int
        Extremities nearer to each other than this, in √area, count as one, as fingers must not
        displace hands; largest number of extremities.
    signature_step : int
        Of a hundred energies of the wave kernel signature, every ``signature_step``-th is used.
    curvature_functions, energy_curvature_functions : tuple of int, int
        Numbers of Laplace–Beltrami functions of the smoothed surfaces whose signed mean curvatures
        are signatures; the number for the surface whose curvature the energy compares.
    distance_unit : {"average", "user"}
        Distances of two shapes are compared in the average distance of each, or in the units of the
        files.
    block_diagonal : bool
        Whether an alignment never mixes descriptor columns of different sign.
    sheet_distance : float
        Glued or merged sheets, such as limbs that touch in a scan, are separated where their
        distance along the surface is at least this, in √area; ``inf`` leaves them together.
    self_contact_concavity, most_self_contacts : float, int
        Fused limbs are cut along loops whose mean cost (`cut_self_contacts`) is at most the first;
        0 cuts none. A shape with more handles than the second is not cut: they are no limbs.
    most_components : int
        Components of a mesh, beside the largest one, that are matched separately, at most.
    """

    extremity_spacing: float = setting(0.25, "0.15: thumbs displaced heads or feet on 4 of 50 pairs", least=0)
    n_extremities: int = setting(8, "lab/benchmarks.md, sensitivity: 7 to 12 the same map", least=0)
    signature_step: int = setting(5, "lab/benchmarks.md, sensitivity; the filters overlap", least=1)
    curvature_functions: tuple[int, ...] = setting((50, 100, 150), "sensitivity; coarse to fine", least=4)
    energy_curvature_functions: int = setting(100, "the middle of curvature_functions", least=4)
    distance_unit: DistanceUnit = setting("average", "lab/paper.md, deviations: distances in mesh units")
    block_diagonal: bool = setting(True, "lab/paper.md, deviations: C not block-diagonal")
    sheet_distance: float = setting(0.1, "decisions.md, separated sheets", least=0)
    self_contact_concavity: float = setting(0.5, "decisions.md, self-contacts: 0.16…0.36", least=0)
    most_self_contacts: int = setting(24, "decisions.md, self-contacts: limbs 9, skulls 157", least=0)
    most_components: int = setting(12, "chosen: each takes as long as a small match", least=0)


# Mean errors × 100 / √area and seconds of CPU on eight pairs of SCAPE, with 12 500 vertices each
MEASURED = "SCAPE: on all vertices 1.58 in 4.9 s, auto 1.54 in 2.8 s, fast 1.54 in 1.9 s"


@dataclass(frozen=True)
class LevelSettings(Settings):
    """Sizes of the levels on which large meshes are matched.

    Parameters
    ----------
    matched, polished, fast_matched, fast_polished : int
        Vertices on which shapes are matched, and on which the map is then polished; the same with
        ``resolution="fast"``.
    spared : float
        A mesh up to this factor larger is not decimated.
    """

    matched: int = setting(5000, MEASURED, least=200)
    polished: int = setting(16000, MEASURED, least=200)
    fast_matched: int = setting(2500, MEASURED, least=200)
    fast_polished: int = setting(5000, MEASURED, least=200)
    spared: float = setting(1.25, "chosen: less is hardly faster", least=1)

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
    most : int
        Largest number of assignments that are followed up; 0 searches for no symmetries.
    largest_residual : float
        Largest residual of the distance descriptors for a symmetry, in units of √(average distance
        / number of search vertices). The spacing of these vertices alone gives about 2.4.
    """

    most: int = setting(24, "lab/benchmarks.md, symmetry", least=0)
    largest_residual: float = setting(3.2, "lab/benchmarks.md, symmetry", least=0)
