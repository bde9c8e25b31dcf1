"""Settings of the search for symmetries."""

from __future__ import annotations

from dataclasses import dataclass

from isomatch.values.settings import Settings, setting


@dataclass(frozen=True)
class SymmetrySettings(Settings):
    """Settings of the search for symmetries of one shape.

    Parameters
    ----------
    n_samples : int
        Samples among which symmetries are searched.
    most : int
        Most assignments that are followed up; 0 searches for no symmetries.
    steps : int
        Iterations of closest points from each.
    least_moved, same_map : float
        Mean distances, in √area, from which a map is not the identity, and from which two maps differ.
    largest_residual : float
        Misfit of the distance descriptors, in units of √(average distance / number of search vertices), up to which a
        map is a symmetry: their spacing alone makes about 2.4.
    near, exact : float
        Residuals, over the largest of a symmetry, up to which a map serves in products, and up to which its orientation
        need not be clear, as of one-sided surfaces.
    """

    n_samples: int = setting(200, "chosen: spacing 0.08, less than same_map", least=20)
    most: int = setting(24, "docs/benchmarks.md, symmetry", least=0)
    steps: int = setting(12, "docs/benchmarks.md, symmetry", least=1)
    least_moved: float = setting(
        0.15, "selection.rival_distance: less is a variant, not another map", least=0
    )
    same_map: float = setting(0.1, "the spacing of n_samples", least=0)
    largest_residual: float = setting(3.2, "docs/benchmarks.md, symmetry", least=0)
    near: float = setting(1.5, "chosen, not measured", least=1)
    exact: float = setting(0.75, "chosen, not measured", least=0, most=1)
