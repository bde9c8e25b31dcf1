"""Settings of the match of a part."""

from __future__ import annotations

from dataclasses import dataclass

from isomatch.values.settings import Settings, setting


@dataclass(frozen=True)
class PartSettings(Settings):
    """Settings of the match of a part to a whole.

    Parameters
    ----------
    hopeless : float
        A map is dropped if its score exceeds this × the best score: after the short refinement, but for the two best,
        and before maps are settled.
    long_boundary : float
        Length of the longest piece of the boundary, in √area, above which a shape may be a part.
    close : bool
        Also match the shapes with their holes closed, as complete ones.
    closed_score : float
        The map with the holes closed is returned if its cost is less than this times that of the best map of a part.
    little_missing, most_there : float
        Shares of the area of the whole, by the units of the files, from which a part is matched with its holes closed
        first; the second one where few distances are known (``little_trusted``). If that is sure, the part is matched
        from there, without a search of its own.
    bending : tuple of float
        Lengths, in √area of the whole, over which the part resists being stretched when it is bent onto the whole; see
        `register_as_rigid_as_possible`.
    n_bent_vertices : int
        Vertices of the part while contenders bend it.
    n_settled : int
        Best maps that are settled: the part is bent, its map refined from where it lies then, and so on.
    rim, off : float
        Distances, in √area, from the boundary of a part and from its other points, up to which a vertex of the whole is
        matched to it; where hardly any distance on the whole is known, the second one from both.
    poor_doubt : float
        Doubt above which a map is not sure; see `Quality`.
    little_trusted, clear : float
        Share of the pairs of anchors whose distance on the whole is known, below which a map is not sure, either, unless
        the score of its best alternative is at least so many times its own.
    mismatch_weight : float
        As `SelectionSettings.mismatch_weight`, of parts; also of roughly refined maps, over everything that is known.
    n_common : int
        Of two overlapping parts of one body: regions in common that are refined, the likeliest ones.
    sure_common : float
        How much more alike than at random the parts must look in the best of them for it to be sure; see ``CommonDoubt``.
    tie : float
        Score of an alternative, against the map returned, below which nothing decides between them.
    """

    hopeless: float = setting(3.0, "docs/lab/robustness.md: parts", least=1)
    long_boundary: float = setting(
        0.15, "complete bodies up to 0.08, bodies without a limb from 0.2", least=0
    )
    close: bool = setting(True, "docs/lab/robustness.md: holes closed")
    closed_score: float = setting(1.1, "chosen, not measured", least=0)
    little_missing: float = setting(0.85, "docs/lab/design_notes.md", least=0)
    most_there: float = setting(0.6, "docs/lab/design_notes.md", least=0)
    bending: tuple[float, ...] = setting(
        (0.3, 0.25, 0.2, 0.17, 0.14, 0.11, 0.09, 0.075, 0.06, 0.05),
        "docs/lab/robustness.md: parts",
        least=1e-3,
    )
    rim: float = setting(0.04, "docs/lab/robustness.md: parts", least=0)
    off: float = setting(0.1, "docs/lab/robustness.md: parts", least=0)
    n_bent_vertices: int = setting(1000, "docs/lab/robustness.md: parts", least=50)
    n_settled: int = setting(3, "docs/lab/robustness.md: parts", least=0)
    poor_doubt: float = setting(8.5e-5, "docs/lab/robustness.md: parts, how the bound was set", least=0)
    little_trusted: float = setting(0.15, "docs/lab/robustness.md: parts", least=0, most=1)
    clear: float = setting(2.0, "docs/lab/robustness.md: parts", least=1)
    mismatch_weight: float = setting(6.0, "docs/lab/design_notes.md", least=0)
    n_common: int = setting(8, "docs/lab/design_notes.md", least=1)
    sure_common: float = setting(0.5, "docs/lab/design_notes.md", least=0)
    tie: float = setting(1.2, "chosen on cuts and holes, not one by one", least=1)
