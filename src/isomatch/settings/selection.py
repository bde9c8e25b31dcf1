"""Settings of the selection among hypotheses."""

from __future__ import annotations

from dataclasses import dataclass

from isomatch.values.settings import Settings, setting


@dataclass(frozen=True)
class SelectionSettings(Settings):
    """Settings of the choice among hypotheses.

    Parameters
    ----------
    normal_functions : int
        Functions of the smoothed surfaces whose normals are compared.
    curvature_exponent : float
        Energy = descriptor residual × curvature mismatch to this power.
    orientation_threshold : float
        Mean cosine between normals above which a map counts as orientation-preserving.
    mirrored_energy : float
        Energy of a hypothesis of the orientation that is not allowed, against the least of the others, below which it is
        refined and compared, too.
    energy_limit : float
        Energy, against the least, up to which a hypothesis is refined and compared again.
    most_contenders : int
        Most hypotheses that are refined.
    extension_functions : int
        Functions through which a hypothesis is extended to further vertices.
    misfit_limit : float
        Misfit after a stage of the refinement, against the least, from which a map is given up.
    same_map : float
        Mean distance between images, in √area, up to which two refined maps are one: less than one turned limb.
    energy_exponent : float
        Score of a refined map = misfit × energy to this power.
    rival_distance : float
        Mean distance between images, in √area, from which a refined map is an alternative, not a variant of the winner.
    mismatch_weight : float
        The ratio of the costs of two maps is multiplied by exp(this × the difference of their mean mismatches, see
        `BallSignature`, over the region where they differ).
    most_alternatives : int
        Most alternatives in the result.
    """

    normal_functions: int = setting(40, "docs/lab/benchmarks.md, sensitivity", least=4)
    curvature_exponent: float = setting(
        2.0, "measured on 86 pairs: 2 and 1 choose right, 2 by a wider margin", least=0
    )
    orientation_threshold: float = setting(
        0.3, "measured on 50 pairs: right maps above 0.54, mixed or mirrored ones below 0.3", least=0, most=1
    )
    mirrored_energy: float = setting(
        0.75, "lopsided creatures up to 0.52; bodies with a left and a right side from 0.42", least=0
    )
    energy_limit: float = setting(3.0, "docs/lab/benchmarks.md, sensitivity", least=1)
    most_contenders: int = setting(4, "docs/lab/design_notes.md: no other map than by 6", least=1)
    extension_functions: int = setting(
        50, "docs/lab/benchmarks.md, sensitivity; as many as before the judgement", least=4
    )
    misfit_limit: float = setting(1.15, "docs/lab/benchmarks.md, sensitivity; as outcome.tie", least=1)
    same_map: float = setting(
        0.02, "docs/lab/benchmarks.md, sensitivity; half of the displacement by one turned limb", least=0
    )
    energy_exponent: float = setting(0.25, "ablation: contest decided by misfit alone", least=0)
    rival_distance: float = setting(0.15, "more than noise or one limb, less than a turned body", least=0)
    mismatch_weight: float = setting(1.5, "docs/lab/design_notes.md", least=0)
    most_alternatives: int = setting(2, "what a report can show beside the map", least=0)
