"""Settings of one shape: extremities, signatures, curvature, what is mended."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from isomatch.values.settings import Settings, setting

DistanceUnit = Literal["average", "user"]


@dataclass(frozen=True)
class PreparationSettings(Settings):
    """Fine settings of `prepare`: extremities, signatures and curvature of one shape.

    Parameters
    ----------
    extremity_spacing : float
        Extremities nearer to each other than this, in √area, count as one: fingers must not displace hands.
    n_extremities : int
        Most extremities of a shape.
    signature_step : int
        Which of the hundred energies of the wave kernel signature are kept: every fifth.
    curvature_functions : tuple of int
        Functions of the smoothed surfaces whose signed mean curvatures are part of the signatures.
    energy_curvature_functions : int
        Functions of the smoothed surface whose curvature the energy of a map compares.
    distance_unit : {"average", "user"}
        Unit in which distances of two shapes are compared: the average distance of each, or that of the user.
    block_diagonal : bool
        Whether descriptor columns of different sign are never mixed by an alignment.
    sheet_distance : float
        Sheets that are glued together, such as limbs that touch in a scan, are separated where they are at least so far
        apart along the surface, in √area; ``inf`` leaves them together.
    contact_concavity : float
        Limbs that are fused are cut from what they touch along loops whose mean cost, see `cut_contacts`, is at most
        this; 0 cuts none.
    most_contacts : int
        Shapes of which one has more handles than this are not cut: they are no limbs that touch.
    most_components : int
        Most components of a mesh, beside the largest, that are matched by themselves.
    """

    extremity_spacing: float = setting(
        0.25, "changed with others: at 0.15, thumbs displaced heads or feet on 4 of 50 pairs", least=0
    )
    n_extremities: int = setting(8, "docs/lab/benchmarks.md, sensitivity: 7 to 12 the same map", least=0)
    signature_step: int = setting(
        5,
        "docs/lab/benchmarks.md, sensitivity; the filters are seven energies wide, so neighbours repeat each other",
        least=1,
    )
    curvature_functions: tuple[int, ...] = setting(
        (50, 100, 150), "docs/lab/benchmarks.md, sensitivity; coarse to fine", least=4
    )
    energy_curvature_functions: int = setting(
        100, "docs/lab/benchmarks.md, sensitivity; the middle of curvature_functions", least=4
    )
    distance_unit: DistanceUnit = setting("average", "docs/lab/paper.md, deviations: distances in mesh units")
    block_diagonal: bool = setting(True, "docs/lab/paper.md, deviations: C not block-diagonal")
    sheet_distance: float = setting(0.1, "docs/lab/robustness.md, touching limbs", least=0)
    contact_concavity: float = setting(
        0.5, "docs/lab/robustness.md, touching limbs: seams have 0.16 to 0.36", least=0
    )
    most_contacts: int = setting(
        24,
        "docs/lab/design_notes.md: limbs that touch make up to 9 handles, skulls have 157 and more",
        least=0,
    )
    most_components: int = setting(12, "chosen: each takes as long as a small match", least=0)
