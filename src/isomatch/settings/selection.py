"""Settings of the selection among hypotheses."""

from __future__ import annotations

from dataclasses import dataclass

from isomatch.values.settings import Settings, setting


@dataclass(frozen=True)
class SelectionSettings(Settings):
    """Settings of the choice among hypotheses.

    Parameters
    ----------
    sizes : tuple of int
        Functions in the upsampling that precedes the judgement of a hypothesis.
    normal_functions : int
        Functions of the smoothed surfaces whose normals are compared.
    curvature_exponent : float
        Energy = descriptor residual × curvature mismatch to this power.
    orientation_threshold : float
        Mean cosine between normals above which a map counts as orientation-preserving.
    energy_limit : float
        Energy, against the least, up to which a hypothesis is refined and compared again.
    most_contenders : int
        Most hypotheses that are refined.
    landmark_slack : float
        Hypotheses whose landmark error exceeds the smallest by more than this, in √area, are dropped.
    extension_functions : int
        Functions through which a hypothesis is extended to further vertices.
    misfit_limit : float
        Misfit after a stage of the refinement, against the least, from which a map is given up.
    same_map : float
        Mean distance between images, in √area, up to which two refined maps are one: less than one turned limb.
    energy_exponent : float
        Score of a refined map = misfit × energy to this power.
    energy_noise, misfit_noise, score_noise : float
        Energies, misfits and scores below these are equal: two triangulations of one surface differ as much. Otherwise
        one of the symmetric maps between two copies of a mesh would seem better than the others.
    rival_distance : float
        Mean distance between images, in √area, from which a refined map is a rival and not a variant of the winner.
    elsewhere_share : float
        A refined map that is nearer on average is a rival, too, if it sends at least this share of the vertices far away
        from where the winner sends them, and scores as well. So two limbs that are exchanged are told.
    clearly_better : float
        Score of the winner, over that of another map, from which that map counts as a rival whatever the hints say.
    most_alternatives : int
        Most alternatives in the result.
    """

    sizes: tuple[int, ...] = setting(
        tuple(range(20, 51, 5)), "Melzi et al. 2019: grow in steps of 5", least=4
    )
    normal_functions: int = setting(40, "docs/benchmarks.md, sensitivity", least=4)
    curvature_exponent: float = setting(
        2.0, "measured on 86 pairs: 2 and 1 choose right, 2 by a wider margin", least=0
    )
    orientation_threshold: float = setting(
        0.3, "measured on 50 pairs: right maps above 0.54, mixed or mirrored ones below 0.3", least=0, most=1
    )
    energy_limit: float = setting(3.0, "docs/benchmarks.md, sensitivity", least=1)
    most_contenders: int = setting(6, "ablation: no contest (victoria1–victoria2, cat10–cat3)", least=1)
    landmark_slack: float = setting(0.05, "the spacing of the search vertices", least=0)
    extension_functions: int = setting(50, "docs/benchmarks.md, sensitivity; the last of sizes", least=4)
    misfit_limit: float = setting(1.15, "docs/benchmarks.md, sensitivity; as outcome.tie", least=1)
    same_map: float = setting(
        0.02, "docs/benchmarks.md, sensitivity; half of the displacement by one turned limb", least=0
    )
    energy_exponent: float = setting(0.25, "ablation: contest decided by misfit alone", least=0)
    energy_noise: float = setting(
        0.012, "docs/benchmarks.md, symmetry: 0.002 to 0.06 between triangulations", least=0
    )
    misfit_noise: float = setting(
        0.25, "docs/benchmarks.md, symmetry: 0.26 to 0.35 between triangulations", least=0
    )
    score_noise: float = setting(
        0.04, "docs/benchmarks.md, symmetry: 0.04 to 0.09 between triangulations", least=0
    )
    rival_distance: float = setting(0.15, "more than noise or one limb, less than a turned body", least=0)
    elsewhere_share: float = setting(0.05, "half of two exchanged forelegs (horse7–horse14: 0.08)", least=0)
    clearly_better: float = setting(1.15, "docs/benchmarks.md, confidence", least=1)
    most_alternatives: int = setting(2, "what a report can show beside the map", least=0)
