"""Bases that draw themselves."""

from __future__ import annotations

from typing import TYPE_CHECKING

from isomatch.assets import SurfaceLike
from isomatch.loading.first_use import Shown, view_room

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class PlottedBasis(Shown):
    """A basis, whose spectrum and whose vectors can be drawn."""

    __slots__ = ()

    def plot(
        self,
        surface: SurfaceLike = None,
        *,
        colour_map: str | None = None,
        title: str = "",
        width: int = 1800,
        view: tuple[float, float] | None = None,
    ) -> Figure:
        """Draw the spectrum, or the first four vectors on their surface; see `isomatch.view.plot_basis`.

        Parameters
        ----------
        surface : Mesh, PointCloud, or what `surface_from` takes, optional
            The surface that the basis was made for.
        colour_map : str, optional
            Name of a colour map of matplotlib.
        title : str
            Title above all.
        width : int
            Width in pixels; notebooks show two of them for each pixel of the page.
        view : (float, float), optional
            Where the viewer is, in degrees around the surface and above the horizon: by default (32, 14).

        Returns
        -------
        matplotlib.figure.Figure

        Raises
        ------
        DescriptorError
            If the surface has another number of vertices than the basis.
        """
        figure: Figure = view_room().plot_basis(
            self, surface, colour_map=colour_map, title=title, width=width, view=view
        )
        return figure
