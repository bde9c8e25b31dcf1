"""Settings of the outcome: bounds of the measures."""

from __future__ import annotations

from dataclasses import dataclass

from isomatch.values.settings import Settings, setting


@dataclass(frozen=True)
class OutcomeSettings(Settings):
    """Bounds of the measures that make an outcome.

    Parameters
    ----------
    coverage_radius : float
        A target vertex this near to an image along edges, in √area, is covered.
    normal_functions : int
        Functions of the smoothed surfaces whose normals are compared.
    tie : float
        Score of a rival, against the map returned, below which nothing decides between them.
    mirror_tie : float
        The same for a map of the other side where either is allowed; the poses alone may differ as much.
    torn : float
        Squared length of the image of an edge, over its own, above which it counts no more: the edge is torn.
    torn_apart : float
        How much farther apart the images of neighbours are than the neighbours, in √area, where the map tears them.
    poor_misfit, poor_residual, poor_stretch, poor_torn_off : float
        Values above which a map is poor.
    poor_orientation : float
        Value below which a map is poor.
    contradiction : float
        Distance from the images that hints ask for, in √area, from which they are contradicted: the mean of the
        landmarks (of a part the median), or the median of an initial map, which may be wrong in places.
    error_scale, error_radius : float
        Factor of the expected error at a vertex, and radius over which it is spread, in √area.
    rival_exponent : float
        A rival whose score is r times that of the map is right with chance 1 / (1 + r^exponent).
    many_rotations : int
        Rotations that both shapes have from which no automatic map is told from another: balls and discs.
    out_of_pose : float
        Mean distance of the images from the nearest points in space, in √area, from which ``start="pose"`` misleads.
    large_component : float
        Share of the area, or of the vertices in components of at least 50, left out from which the match is partial; and
        such a share of one component from which the match is no surer than it.
    """

    coverage_radius: float = setting(0.05, "the spacing of the search vertices", least=0)
    normal_functions: int = setting(60, "chosen with poor_orientation", least=4)
    tie: float = setting(1.15, "docs/benchmarks.md, confidence", least=1)
    mirror_tie: float = setting(1.5, "docs/benchmarks.md, confidence: either side", least=1)
    torn: float = setting(4.0, "chosen: a few torn faces must not outweigh all others", least=1)
    poor_misfit: float = setting(
        0.66, "set on FAUST and creatures; checked in docs/benchmarks.md, confidence", least=0
    )
    poor_residual: float = setting(
        0.38, "set on FAUST and creatures; checked in docs/benchmarks.md, confidence", least=0
    )
    poor_stretch: float = setting(1.2, "docs/benchmarks.md, confidence", least=1)
    torn_apart: float = setting(0.1, "0.07 to 0.15 do as well: docs/benchmarks.md, confidence", least=0)
    poor_torn_off: float = setting(
        0.005, "half a hand; right maps have at most 0.2 %: docs/benchmarks.md, confidence", least=0
    )
    poor_orientation: float = setting(0.65, "chosen, not measured", least=-1, most=1)
    contradiction: float = setting(0.1, "docs/benchmarks.md, contradicted hints", least=0)
    error_scale: float = setting(
        0.32, "mean error of faust_r and creatures: benchmarks/vertex_confidence.py", least=0
    )
    error_radius: float = setting(0.08, "0.05 to 0.14 tried: benchmarks/vertex_confidence.py", least=0)
    rival_exponent: float = setting(16.0, "one in ten at the bound of a tie", least=0)
    many_rotations: int = setting(11, "discs and balls have 11 to 40, bodies 0 to 6 at any setting", least=1)
    out_of_pose: float = setting(0.25, "docs/hints.md: up to 0.22 turned by 40°, from 0.29 by 90°", least=0)
    large_component: float = setting(0.05, "a hand is 1 %, a head 8 % of a body", least=0, most=1)
