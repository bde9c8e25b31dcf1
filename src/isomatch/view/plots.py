"""Pictures of one object: a surface with values at its vertices, a basis and its functions."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from isomatch.assets import SurfaceLike, surface_from
from isomatch.bases import DistanceBasis, LaplaceBasis
from isomatch.errors import DescriptorError
from isomatch.surfaces import Surface
from isomatch.values.arrays import numbers_of
from isomatch.view.camera import camera_of
from isomatch.view.colours import from_screen
from isomatch.view.picture import TEXT, Panel, Picture, pictured
from isomatch.view.points import drawable
from isomatch.view.stills import WIDTH, as_is, paintable, painted
from isomatch.view.surface_image import SurfaceView
from isomatch.view.value_panel import ValuePanel

CLAY = from_screen(np.array([200, 200, 196]) / 255)  # as in the report
ALONE = 1000  # pixels; the width of the picture of one surface
N_SHOWN = 4  # functions of a basis on a surface
NULL = 1e-9  # of the largest eigenvalue; smaller ones are rounding errors
CHART_HEIGHT = 0.36  # of the width
POSITIVE, NEGATIVE = "#0072b2", "#d55e00"  # safe for the colour-blind (Okabe & Ito)


def plot_surface(
    surface: Surface,
    values: ArrayLike | None = None,
    *,
    label: str = "",
    colour_map: str | None = None,
    title: str = "",
    width: int = ALONE,
    view: tuple[float, float] | None = None,
) -> Picture:
    """Draw a surface, coloured by values at its vertices.

    Parameters
    ----------
    surface : Mesh or PointCloud
        The surface, of n vertices.
    values : (n,) or (n, 3) array_like of float, optional
        Numbers, whose colours a bar explains, or colours, red, green and blue from 0 to 1. ``nan`` is grey; by default
        all is clay.
    label : str
        What the numbers are, with their unit.
    colour_map : str, optional
        Name of a colour map of matplotlib, see `ValuePanel`.
    title : str
        Title above the surface.
    width : int
        Width of the picture in pixels.
    view : (float, float), optional
        Where the viewer is, in degrees around the surface and above the horizon, as for `camera_of`.

    Returns
    -------
    matplotlib.figure.Figure
        The picture. Notebooks show it with two pixels for each of the page.

    Raises
    ------
    DescriptorError
        If the values do not fit.
    MeshError
        If the surface has no area.
    SettingError
        If there is no such colour map, or the width is below 200 pixels.
    TypeError
        If it is a graph, which has no positions.

    Notes
    -----
    Time is linear in faces and pixels.

    Examples
    --------
    >>> from isomatch import Mesh
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> figure = plot_surface(square, [0.0, 1.0, 2.0, 1.0], label="height, mm", width=300)
    >>> len(figure.axes), figure.axes[1].get_ylabel()
    (2, 'height, mm')
    """
    mesh = paintable(drawable(surface), repr(surface))
    camera, seen = camera_of(mesh, view=view), title or repr(surface)
    rows = None if values is None else numbers_of(values, "values", DescriptorError)
    if rows is None or rows.ndim == 2:
        colours = (
            np.tile(CLAY, (mesh.n_vertices, 1)) if rows is None else from_screen(np.clip(rows, 0.0, 1.0))
        )
        if colours.shape != (mesh.n_vertices, 3):
            raise DescriptorError(
                f"values have shape {colours.shape}; expected ({mesh.n_vertices},) numbers, or 3 columns of colours"
            )
        return pictured([Panel(SurfaceView(mesh, camera, colours, as_is))], width, title=title, seen=seen)
    panel = ValuePanel(rows, label, colour_map=colour_map)
    shown = painted(mesh, camera, panel)
    return pictured(
        [Panel(shown)], width, values=panel, title=title, seen=f"{seen}, coloured by {label or 'values'}"
    )


def plot_basis(
    basis: DistanceBasis | LaplaceBasis,
    surface: SurfaceLike = None,
    *,
    colour_map: str | None = None,
    title: str = "",
    width: int = WIDTH,
    view: tuple[float, float] | None = None,
) -> Picture:
    """Draw the spectrum of a basis, or its first four vectors on their surface.

    Parameters
    ----------
    basis : DistanceBasis or LaplaceBasis
        Of a distance basis, the spectrum comes with the error of each smaller rank if columns were held out.
    surface : Mesh, PointCloud, or what `surface_from` takes, optional
        The surface that the basis was made for.
    colour_map, title, width, view
        As for `plot_surface`; each function has a scale of its own, as far above as below 0.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    DescriptorError
        If the surface has another number of vertices than the basis.
    """
    if surface is None:
        return _spectrum(basis, title, width)
    mesh = paintable(drawable(surface_from(surface)), "surface")
    if len(basis.vectors) != mesh.n_vertices:
        raise DescriptorError(
            f"{basis!r} is not one of this surface, which has {mesh.n_vertices} vertices; give the surface that it was "
            "made for"
        )
    camera, panels = camera_of(mesh, view=view), []
    values = np.where(np.abs(basis.values) > NULL * np.abs(basis.values).max(), basis.values, 0.0)
    for k, (column, value) in enumerate(zip(basis.vectors.T[:N_SHOWN], values), 1):
        most = float(np.abs(column).max()) or 1.0
        even = ValuePanel([-most, most], colour_map=colour_map)
        panels.append(
            Panel(
                painted(mesh, camera, even, column), f"vector {k}, eigenvalue {value:.3g}".replace("-", "−")
            )
        )
    return pictured(panels, width, title=title, seen=f"The first {len(panels)} vectors of {basis!r}")


def _spectrum(basis: DistanceBasis | LaplaceBasis, title: str, width: int) -> Picture:
    """Draw the eigenvalues against their number, and the error against the rank where it is known."""
    picture = Picture(width, round(CHART_HEIGHT * width), f"Spectrum of {basis!r}")
    picture.set_layout_engine("constrained")
    is_distance = isinstance(basis, DistanceBasis)
    errors = basis.error_estimates() if isinstance(basis, DistanceBasis) and basis.held_out else None
    charts = picture.subplots(1, 1 if errors is None else 2, squeeze=False).ravel()
    number = np.arange(1, len(basis.values) + 1)
    if is_distance:
        size = np.abs(basis.values)
        for name, colour, chosen in (
            ("positive", POSITIVE, basis.values > 0),
            ("negative", NEGATIVE, basis.values <= 0),
        ):
            charts[0].scatter(number[chosen], size[chosen], 12, colour, label=name)
        charts[0].set_yscale("log")
        charts[0].legend(fontsize=TEXT - 1, frameon=False)
        _named(charts[0], "number", "size of the eigenvalue")
    else:
        charts[0].scatter(number, basis.values, 12, POSITIVE)
        _named(charts[0], "number", "eigenvalue, 1 / squared mesh units")
    if errors is not None:
        charts[1].plot(number, 100 * errors, color=POSITIVE, marker="o", markersize=3, linewidth=1)
        charts[1].set_yscale("log")
        _named(charts[1], "vectors kept", "relative error of the distances, %")
    if title:
        picture.suptitle(title, fontsize=TEXT + 2, parse_math=False)
    return picture


def _named(axes: Axes, x: str, y: str) -> None:
    axes.set_xlabel(x, fontsize=TEXT)
    axes.set_ylabel(y, fontsize=TEXT)
    axes.tick_params(labelsize=TEXT - 1)
    axes.spines[["top", "right"]].set_visible(False)
