"""Settings of the match of a part."""

from __future__ import annotations

from dataclasses import dataclass

from isomatch.values.settings import Settings, setting


@dataclass(frozen=True)
class PartSettings(Settings):
    """Settings of the match of a part to a whole.

    Parameters
    ----------
    n_posts : int
        Boundary vertices through which paths may leave the part.
    width, apart : int, float
        Partial assignments that the beam search keeps, and the mean distance, in √area, by which they differ.
    landmark_reach : float
        Distances from landmarks, in √area, up to which they are coordinates of the refinement.
    n_starts : int
        Best starts that are refined, before mirror images are added.
    hopeless : float
        A map is dropped if its score exceeds this × the best score: after the short refinement, but for the two best,
        and before maps are settled.
    sizes : tuple of int
        Functions of the whole in the short refinement.
    soft : float
        Of `IntervalCost`, in √(area of the part).
    near : (float, float)
        Distances along the part, in its √area, whose ratios to those of the images are compared.
    long_boundary : float
        Length of the longest piece of the boundary, in √area, above which a shape may be a part.
    close : bool
        Also match the shapes with their holes closed, as complete ones.
    flipped : int
        As in `SearchSettings`, of shapes with their holes closed, where the best hypothesis is more often wrong.
    closed_score : float
        The map with the holes closed is returned if its cost is less than this times that of the best map of a part.
    bending : tuple of float
        Lengths, in √area of the whole, over which the part resists being stretched when it is bent onto the whole; see
        `register_as_rigid_as_possible`.
    n_bent_vertices : int
        Vertices of the part while contenders bend it.
    n_settled : int
        Best maps that are settled: the part is bent, its map refined from where it lies then, and so on.
    rim, off : float
        Distances, in √area, from the boundary of a part and from its other points, up to which a vertex of the whole is
        matched to it; with less than ``least_trusted``, the second one from both.
    poor_doubt : float
        Doubt above which a map is not sure; see `Quality`.
    little_trusted, clear : float
        Share of the pairs of anchors whose distance on the whole is known, below which a map is not sure, either, unless
        the score of its rival is at least so many times its own.
    least_trusted : float
        Share of the pairs of anchors whose distance on the whole is known, below which ``scale = "auto"`` keeps the unit
        of the files.
    tie : float
        Score of a rival, against the map returned, below which nothing decides between them.
    """

    n_posts: int = setting(60, "chosen on cuts and holes, not one by one", least=4)
    width: int = setting(1000, "chosen on cuts and holes, not one by one", least=1)
    apart: float = setting(0.12, "without it, all would be variants of one", least=0)
    landmark_reach: float = setting(0.3, "docs/robustness.md: parts", least=0)
    n_starts: int = setting(16, "chosen on cuts and holes, not one by one", least=1)
    hopeless: float = setting(3.0, "docs/robustness.md: parts", least=1)
    sizes: tuple[int, ...] = setting((20, 40, 70), "chosen on cuts and holes, not one by one", least=4)
    soft: float = setting(0.18, "chosen on cuts and holes, not one by one", least=0)
    near: tuple[float, ...] = setting((0.08, 0.3), "chosen on cuts and holes, not one by one", least=0)
    long_boundary: float = setting(
        0.15, "complete bodies up to 0.08, bodies without a limb from 0.2", least=0
    )
    close: bool = setting(True, "docs/robustness.md: holes closed")
    flipped: int = setting(6, "mesh018–mesh014 with holes: 30 with 3", least=0)
    closed_score: float = setting(1.1, "chosen, not measured", least=0)
    bending: tuple[float, ...] = setting(
        (0.3, 0.25, 0.2, 0.17, 0.14, 0.11, 0.09, 0.075, 0.06, 0.05), "docs/robustness.md: parts", least=1e-3
    )
    rim: float = setting(0.04, "docs/robustness.md: parts", least=0)
    off: float = setting(0.1, "docs/robustness.md: parts", least=0)
    n_bent_vertices: int = setting(1000, "docs/robustness.md: parts", least=50)
    n_settled: int = setting(3, "docs/robustness.md: parts", least=0)
    poor_doubt: float = setting(3.5e-5, "docs/robustness.md: parts, how the bound was set", least=0)
    least_trusted: float = setting(0.07, "chosen on cuts and holes, not one by one", least=0, most=1)
    little_trusted: float = setting(0.15, "docs/robustness.md: parts", least=0, most=1)
    clear: float = setting(4.0, "docs/robustness.md: parts", least=1)
    tie: float = setting(1.2, "chosen on cuts and holes, not one by one", least=1)
