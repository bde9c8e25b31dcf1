"""Settings of the match of several components."""

from __future__ import annotations

from dataclasses import dataclass

from isomatch.values.settings import Settings, setting


@dataclass(frozen=True)
class ComponentSettings(Settings):
    """Settings of the match of shapes of several components.

    Parameters
    ----------
    rival_area, most_rivals : float, int
        Area, over that of the largest component, from which another one may be the partner of the other shape's largest,
        and how many are tried at most.
    spectrum_functions, same_spectrum : int, float
        Eigenvalues that are compared, and the mean difference of their logarithms, above the least, up to which a pair of
        such components is tried.
    falloff : float
        Power of the distance by which less is said about a point by the vertices of the component that carries it.
    most_apart : float
        Distance of a component from where it is carried to, over the sum of its √area and its distance from those that
        carry it, from which it is no partner.
    most_length_ratio : float
        √area of one over that of the other from which they are no partners.
    same_place : float
        Mean distance between a component that is carried along rigidly and its partner, in √area, up to which it fits.
    held : float
        Distance of a component from those that carry it, over its √area, up to which its place tells how it is turned.
    """

    rival_area: float = setting(0.5, "hemispheres differ by less, clothes by more", least=0, most=1)
    most_rivals: int = setting(3, "chosen: nine matches at most", least=1)
    spectrum_functions: int = setting(20, "halves of creatures: poses 0.03, other halves 0.13", least=1)
    same_spectrum: float = setting(0.1, "halves of creatures: poses 0.03, other halves 0.13", least=0)
    falloff: float = setting(4.0, "chosen: sums over a surface converge from 2 on", least=0)
    most_apart: float = setting(0.7, "one eye is 0.9 from the other", least=0)
    most_length_ratio: float = setting(1.4, "parts.largest_unit_change", least=1.01)
    held: float = setting(1.0, "chosen: a thing farther away than its own size may turn by itself", least=0)
    same_place: float = setting(0.02, "chosen: half the spacing of the search vertices", least=0)
