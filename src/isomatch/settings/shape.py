"""Settings of one shape: extremities, signatures, curvature, repairs; levels of large meshes; symmetries."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from isomatch._core.errors import SettingError
from isomatch._core.settings import Settings, setting

DistanceUnit = Literal["average", "user"]


@dataclass(frozen=True)
class PreparationSettings(Settings):
    """Fine settings of `prepare`: extremities, signatures and curvature of one shape."""

    extremity_spacing: float = setting(0.25, "with 0.15, thumbs displaced feet on 4 of 50 pairs", least=0)
    """Least distance between two extremities, in √area: a hand has one extremity, and not one for each finger."""
    n_extremities: int = setting(8, "7 to 12 give the same errors: lab/benchmarks.md", least=0)
    """Largest number of extremities of a shape."""
    signature_step: int = setting(5, "chosen: filters at neighbouring energies overlap", least=1)
    """Step n: only every n-th of the hundred energies of the wave kernel signature is used."""
    curvature_functions: tuple[int, ...] = setting((50, 100, 150), "chosen: coarse to fine", least=4)
    """Numbers of Laplace–Beltrami eigenfunctions that smooth the surfaces whose mean curvatures are signatures."""
    energy_curvature_functions: int = setting(100, "chosen: the middle of curvature_functions", least=4)
    """Number of eigenfunctions that smooth the surface whose mean curvature is compared in the energy of a map."""
    distance_unit: DistanceUnit = setting("average", "scale must not matter; errors are equal: lab/paper.md")
    """Unit in which distances of two shapes are compared: the average of each, or the units of the files."""
    block_diagonal: bool = setting(True, "mixing columns of different sign harms: lab/paper.md")
    """Whether an alignment never mixes descriptor columns of different sign."""
    sheet_distance: float = setting(0.1, "decisions.md, separated sheets", least=0)
    """Least distance along the surface, in √area, between glued or merged sheets that are separated; ``inf``: none."""
    self_contact_concavity: float = setting(0.5, "true contacts have 0.16 to 0.36", least=0)
    """Largest cost of a loop over its length, along which fused limbs are cut apart (`cut_self_contacts`); 0: none."""
    most_self_contacts: int = setting(24, "bodies have up to 9: decisions.md, self-contacts", least=0)
    """Largest number of handles of a shape whose self-contacts are cut; more handles cannot all be touching limbs."""
    most_components: int = setting(12, "chosen: each component takes as long as a small match", least=0)
    """Largest number of components of a mesh that are matched separately, besides the largest component."""


# Reason for the four sizes below: mean error in % of √area, and CPU time, of 8 pairs of SCAPE with 12,500
# vertices, matched on all vertices, or with the sizes of resolution = "auto" or "fast".
LEVEL_ERRORS = "SCAPE: all 1.58 % in 4.9 s, auto 1.54 % in 2.8 s, fast 1.54 % in 1.9 s"


@dataclass(frozen=True)
class LevelSettings(Settings):
    """Levels of a large mesh: on fewer vertices the mesh is matched, and on more the map is then polished."""

    matched: int = setting(5000, LEVEL_ERRORS, least=200)
    """Number of vertices to which large meshes are decimated to be matched, with ``resolution="auto"``."""
    polished: int = setting(16000, LEVEL_ERRORS, least=200)
    """Number of vertices on which the map of a large mesh is polished after the match, with ``resolution="auto"``."""
    fast_matched: int = setting(2500, LEVEL_ERRORS, least=200)
    """Number of vertices to which large meshes are decimated to be matched, with ``resolution="fast"``."""
    fast_polished: int = setting(5000, LEVEL_ERRORS, least=200)
    """Number of vertices on which the map is polished after the match with ``resolution="fast"``."""
    spared: float = setting(1.25, "chosen: a smaller decimation hardly saves time", least=1)
    """Largest number of vertices of a mesh over the number of a level, up to which the mesh is not decimated to it."""

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
    """Settings of the search for symmetries: maps of a shape onto itself that keep distances."""

    n_assignments: int = setting(24, "chosen: all 24 take 15 to 60 ms: lab/benchmarks.md, symmetry", least=0)
    """Largest number of first self-maps, from images of a few vertices, that are improved; 0: no symmetries."""
    largest_residual: float = setting(3.2, "the spacing of vertices alone gives 2.4", least=0)
    """Largest descriptor residual of a symmetry, in √(average distance / number of search vertices)."""
