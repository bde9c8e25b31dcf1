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
    tie : float
        Score of an alternative, against the map returned, below which nothing decides between them.
    look_tie : float
        The same between shapes far from isometric, whose misfits are nearly equal.
    mirror_tie : float
        The same for a map of the other side where either is allowed; the poses alone may differ as much.
    mirror_image : float
        Score of a map of the orientation that is not allowed, against the map returned, below which it fits clearly
        better.
    torn : float
        Squared length of the image of an edge, over its own, above which it counts no more: the edge is torn.
    torn_apart : float
        How much farther apart the images of neighbours are than the neighbours, in √area, where the map tears them.
    poor_misfit, poor_residual, poor_stretch, poor_torn_off : float
        Values above which a map is poor.
    poor_bending, poor_far_residual : float
        Values of `Quality.bend_misfit` and of the residual above which a map between shapes far from isometric is poor.
    poor_mismatch : float
        Mean mismatch, see `Quality`, of which a map is sure only if it is well below.
    doubtful_mismatch : float
        Mean mismatch of the neighbourhood of a vertex, above the median of the map, from which its image is doubtful.
    doubtful_area : float
        Share of the surface from which a region of doubtful images lowers the outcome.
    poor_orientation : float
        Value below which a map is poor.
    contradiction : float
        Distance from the images that hints ask for, in √area, from which they are contradicted: the mean of the
        landmarks (of a part the median), or the median of an initial map, which may be wrong in places.
    out_of_pose : float
        Mean distance of the images from the nearest points in space, in √area, from which ``start="pose"`` misleads.
    large_component : float
        A component is large from this share of the area, or of the vertices. If a large one has no partner, the match is
        partial, and it is no surer than its least sure large component.
    """

    coverage_radius: float = setting(0.05, "the spacing of the search vertices", least=0)
    tie: float = setting(1.25, "docs/lab/design_notes.md", least=1)
    look_tie: float = setting(1.15, "docs/lab/design_notes.md", least=1)
    mirror_tie: float = setting(1.5, "docs/lab/benchmarks.md, confidence: either side", least=1)
    mirror_image: float = setting(
        0.6, "lopsided creatures up to 0.52; bodies with a left and a right side from 0.67", least=0, most=1
    )
    torn: float = setting(4.0, "chosen: a few torn faces must not outweigh all others", least=1)
    poor_misfit: float = setting(
        0.66, "set on FAUST and creatures; checked in docs/lab/benchmarks.md, confidence", least=0
    )
    poor_residual: float = setting(
        0.38, "set on FAUST and creatures; checked in docs/lab/benchmarks.md, confidence", least=0
    )
    poor_stretch: float = setting(1.2, "docs/lab/benchmarks.md, confidence", least=1)
    poor_bending: float = setting(1.7e-3, "docs/lab/design_notes.md", least=0)
    poor_far_residual: float = setting(0.45, "docs/lab/design_notes.md", least=0)
    poor_mismatch: float = setting(0.42, "docs/lab/design_notes.md", least=0)
    doubtful_mismatch: float = setting(0.65, "docs/lab/benchmarks.md, regions of doubt", least=0)
    doubtful_area: float = setting(0.02, "a forearm of a body", least=0, most=1)
    torn_apart: float = setting(0.1, "0.07 to 0.15 do as well: docs/lab/benchmarks.md, confidence", least=0)
    poor_torn_off: float = setting(
        0.005, "half a hand; right maps have at most 0.2 %: docs/lab/benchmarks.md, confidence", least=0
    )
    poor_orientation: float = setting(0.65, "chosen, not measured", least=-1, most=1)
    contradiction: float = setting(0.1, "docs/lab/benchmarks.md, contradicted hints", least=0)
    out_of_pose: float = setting(0.25, "docs/hints.md: up to 0.22 turned by 40°, from 0.29 by 90°", least=0)
    large_component: float = setting(0.05, "a hand is 1 %, a head 8 % of a body", least=0, most=1)
