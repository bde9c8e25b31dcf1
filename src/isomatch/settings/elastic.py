"""Settings of the match of shapes far from isometric."""

from __future__ import annotations

from dataclasses import dataclass

from isomatch.values.settings import Settings, setting


@dataclass(frozen=True)
class ElasticSettings(Settings):
    """Settings of the match of shapes that are far from isometric.

    Parameters
    ----------
    sought : float
        Misfit of the best map that keeps distances, from which one is sought that lets limbs stretch.
    n_coordinates : int
        Canonical coordinates of each shape.
    forgiven : float
        Relative difference of two distances, in units of the average, that costs nothing.
    inside : float
        A term of the cost, see `IntervalCost`.
    n_starts : int
        Best assignments of the points of either shape.
    bending : tuple of float
        Lengths, in √area, over which the shapes resist being stretched when contenders bend them onto each other; see
        `register_as_rigid_as_possible`.
    n_bent_vertices : int
        Vertices of each shape while contenders bend it.
    most_scaled : float
        How many times as large or as small a piece of the source may become at no cost when the winner is bent; see
        `RigidRegistration`.
    """

    sought: float = setting(0.54, "docs/lab/design_notes.md: when limbs are taken to stretch", least=0)
    n_coordinates: int = setting(8, "Ezuz et al. 2019", least=3)
    forgiven: float = setting(0.3, "chosen on pairs of animals, not one by one", least=0, most=1)
    inside: float = setting(0.1, "docs/lab/robustness.md, other species", least=0)
    n_starts: int = setting(60, "docs/lab/robustness.md, other species", least=1)
    bending: tuple[float, ...] = setting(
        (0.3, 0.25, 0.2, 0.17, 0.14, 0.11, 0.09, 0.075, 0.06, 0.05), "docs/lab/design_notes.md", least=1e-3
    )
    n_bent_vertices: int = setting(1000, "docs/lab/design_notes.md", least=100)
    most_scaled: float = setting(2.0, "docs/lab/design_notes.md: limbs of half and twice the size", least=1)
