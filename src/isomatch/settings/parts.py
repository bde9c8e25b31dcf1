"""Settings of the match of a part."""

from __future__ import annotations

from dataclasses import dataclass

from isomatch.values.settings import Settings, setting


@dataclass(frozen=True)
class PartSettings(Settings):
    """Settings of the match of a part to a whole.

    Parameters
    ----------
    n_anchors : int
        Distance columns of the part, whose images a start consists of.
    n_posts : int
        Boundary vertices through which paths may leave the part.
    n_candidates : int
        Vertices of the whole among which the images of the first anchors are sought.
    n_placed : int
        Anchors that are assigned by the beam search; the others are trilaterated.
    width, apart : int, float
        Partial assignments that the beam search keeps, and the mean distance, in √area, by which they differ.
    led_apart : float
        The same with landmarks, between which maps differ less.
    landmark_reach : float
        Distances from landmarks, in √area, up to which they are coordinates of the refinement.
    signature_cost : float
        Weight of the signatures in the beam search.
    radii : tuple of float
        Radii of the balls, in √area, whose areas are compared in the beam search.
    n_trilaterated, n_starts, n_mirrored : int
        Best assignments that are completed; best of these; the same with mirror images.
    n_varied : int
        Best maps after the short refinement that are composed with maps of the whole onto itself.
    n_contenders : int
        Best starts that are refined to the end, after a short refinement of all.
    hopeless : float
        Maps are given up against which so many times as much speaks as against the best: after the short refinement, but
        for the two best, and before they are settled.
    function_ratio : float
        The part gets as many functions as have eigenvalues up to this times the largest of the whole that is used:
        a boundary needs more functions than the share of the area says.
    n_rough : int
        Vertices of the part in the short refinement.
    sizes : tuple of int
        Functions of the whole in the short refinement.
    largest_unit_change, unit_step : float
        Most that the unit of the files may be off, as a factor, and the ratio of the units that are tried.
    unit_cost : float
        Cost of a start in another unit than that of the files: this times the square of the logarithm of their ratio.
    least_share : float
        Least area of a part over that of the whole, where the units of the files say nothing.
    most_cost, soft : float
        Of `IntervalCost`, in √(area of the part).
    stress_exponent : float
        Score of a refined map = misfit × stress to this power × √(local stress × curvature mismatch).
    near, most_ratio : (float, float), float
        Distances along the part, in its √area, whose ratios to those of the images are compared, and the largest
        logarithm that counts.
    long_boundary : float
        Length of the longest piece of the boundary, in √area, above which a shape may be a part.
    close : bool
        Also match the shapes with their holes closed, as complete ones.
    flipped : int
        As in `SearchSettings`, of shapes with their holes closed, where the best hypothesis is more often wrong.
    closed_score : float
        The map with the holes closed is returned if less than this, over the score of the best map of a part, speaks
        against it.
    bending : tuple of float
        Lengths, in √area of the whole, over which the part resists being stretched when it is bent onto the whole; see
        `register_as_rigid_as_possible`.
    n_bent_vertices, n_bent_in_full : int
        Vertices of the part while contenders bend it; and the last lengths with which the best one bends it in full.
    n_settled, n_bent : int
        Best maps that are settled: the part is bent, its map refined from where it lies then, and so on, so many times.
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

    n_anchors: int = setting(50, "chosen on cuts and holes, not one by one", least=8)
    n_posts: int = setting(60, "chosen on cuts and holes, not one by one", least=4)
    n_candidates: int = setting(300, "chosen on cuts and holes, not one by one", least=20)
    n_placed: int = setting(16, "chosen on cuts and holes, not one by one", least=4)
    width: int = setting(1000, "chosen on cuts and holes, not one by one", least=1)
    apart: float = setting(0.12, "without it, all would be variants of one", least=0)
    led_apart: float = setting(0.04, "chosen on a twisted body between right limbs", least=0)
    landmark_reach: float = setting(0.3, "docs/robustness.md: parts", least=0)
    signature_cost: float = setting(0.25, "chosen on cuts and holes, not one by one", least=0)
    radii: tuple[float, ...] = setting(
        (0.1, 0.15, 0.22, 0.32, 0.45, 0.65, 0.9), "by factors of about √2", least=0
    )
    n_trilaterated: int = setting(80, "chosen on cuts and holes, not one by one", least=1)
    n_starts: int = setting(16, "chosen on cuts and holes, not one by one", least=1)
    n_mirrored: int = setting(24, "chosen on cuts and holes, not one by one", least=1)
    n_varied: int = setting(4, "chosen on cuts and holes, not one by one", least=0)
    n_contenders: int = setting(8, "chosen on cuts and holes, not one by one", least=1)
    hopeless: float = setting(3.0, "docs/robustness.md: parts", least=1)
    function_ratio: float = setting(1.75, "chosen on cuts and holes, not one by one", least=1)
    sizes: tuple[int, ...] = setting((20, 40, 70), "chosen on cuts and holes, not one by one", least=4)
    n_rough: int = setting(500, "chosen on cuts and holes, not one by one", least=50)
    largest_unit_change: float = setting(
        1.4, "FAUST remeshed: bodies of one person differ by up to 1.2", least=1
    )
    unit_step: float = setting(1.1, "tolerance of the intervals", least=1.01)
    unit_cost: float = setting(0.05, "chosen on views, not measured", least=0)
    least_share: float = setting(0.1, "views show 16 % and more", least=0.01, most=1)
    most_cost: float = setting(0.6, "chosen on cuts and holes, not one by one", least=0)
    soft: float = setting(0.18, "chosen on cuts and holes, not one by one", least=0)
    stress_exponent: float = setting(0.25, "chosen on cuts and holes, not one by one", least=0)
    near: tuple[float, ...] = setting((0.08, 0.3), "chosen on cuts and holes, not one by one", least=0)
    most_ratio: float = setting(0.7, "a factor of two", least=0)
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
    n_bent_in_full: int = setting(5, "3 and 10 no better on four parts", least=1)
    n_settled: int = setting(3, "docs/robustness.md: parts", least=0)
    n_bent: int = setting(2, "docs/robustness.md: parts", least=0)
    poor_doubt: float = setting(3.5e-5, "docs/robustness.md: parts, how the bound was set", least=0)
    least_trusted: float = setting(0.07, "chosen on cuts and holes, not one by one", least=0, most=1)
    little_trusted: float = setting(0.15, "docs/robustness.md: parts", least=0, most=1)
    clear: float = setting(4.0, "docs/robustness.md: parts", least=1)
    tie: float = setting(1.2, "chosen on cuts and holes, not one by one", least=1)
