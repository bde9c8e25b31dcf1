"""Pictures of a map, of a surface with values at its vertices, and of a basis; points are drawn as triangles."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from typing import BinaryIO

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from isomatch._core.arrays import FloatArray, numbers_of
from isomatch._core.errors import DescriptorError, MeshError
from isomatch._core.files import replaced
from isomatch.correspondence import Correspondence
from isomatch.io import SurfaceLike, linear_of, surface_from
from isomatch.spectral import DistanceBasis, LaplaceBasis
from isomatch.surfaces import Graph, Mesh, Surface
from isomatch.visualization.camera import camera_of, of_ordinary_size, turn_to_target
from isomatch.visualization.colours import position_colours
from isomatch.visualization.picture import TEXT_POINTS, Picture, ValuePanel, compose_picture
from isomatch.visualization.surface_image import SurfaceView

WIDTH = 1800  # pixels across a picture of a map or a basis; chosen
# Squared mesh units: a mesh whose area is smaller, after it was scaled to ordinary size, is not drawn; chosen so that
# squares of areas do not round to 0.
MIN_AREA = 1e-100
# alternative text of a picture of a map, with places for the names of both shapes
MAP_TEXT = "{} on the left, {} on the right; points of the same colour correspond."


def draw_map(
    source: Mesh,
    target: Mesh,
    correspondence: Correspondence,
    path: str | Path | BinaryIO | None = None,
    *,
    titles: tuple[str, str] = ("source", "target"),
    values: ValuePanel | None = None,
    title: str = "",
    width: int = WIDTH,
    view: tuple[float, float] | None = None,
) -> Picture:
    """Draw both shapes side by side, coloured by the map.

    Parameters
    ----------
    source, target : Mesh
        The two shapes. They are drawn with equal area, and the source is rotated to face like the target.
    correspondence : Correspondence
        The map source → target.
    path : path_like or binary file, optional
        PNG file to write; an existing file is replaced. By default none is written.
    titles : (str, str)
        Titles below the two shapes.
    values : ValuePanel, optional
        Content of a third panel, the source once more; by default there is none.
    title, width, view
        As for `plot_surface`; the view shows the target.

    Returns
    -------
    matplotlib.figure.Figure
        The picture, with axes for each panel.

    Raises
    ------
    UnwritableFileError
        If the file cannot be written; others as for `plot_surface`.

    Notes
    -----
    The target has the colours of `position_colours`. Each source vertex has the colour of its image, or is grey if it is
    unmatched. Time is linear in faces and pixels.
    """
    source, target = (scale_for_drawing(mesh, name) for mesh, name in zip((source, target), titles))
    camera = camera_of(target, view=view)
    turned = camera @ turn_to_target(source, target, correspondence)
    colours = position_colours(target)
    panels = [
        SurfaceView(source, turned, correspondence.pull_back(colours), title=titles[0]),
        SurfaceView(target, camera, colours, title=titles[1]),
    ]
    seen = MAP_TEXT.format(titles[0] or "source", titles[1] or "target")
    if values is not None:
        panels.append(paint_values(source, turned, values, title=titles[0]))
        seen += f" On the far right, the first once more, coloured by {values.label or 'values'}."
    picture = compose_picture(panels, width, values=values, title=title, seen=seen)
    if path is not None:
        with replaced(Path(path)) if isinstance(path, str | Path) else nullcontext(path) as file:
            file.write(picture.png())
    return picture


def scale_for_drawing(mesh: Mesh, name: str) -> Mesh:
    """Scale a mesh to ordinary size; `MeshError` if it has no area."""
    mesh = of_ordinary_size(mesh)
    if not mesh.area > MIN_AREA:
        raise MeshError(
            f"{name}: cannot be drawn: it has no faces of any area, coordinates that are not finite, or some so much "
            "larger than the others that the surface has no area beside them; check(mesh) says where, repair(mesh) "
            "mends it"
        )
    return mesh


def paint_values(
    mesh: Mesh, camera: FloatArray, values: ValuePanel, rows: FloatArray | None = None, title: str = ""
) -> SurfaceView:
    """Colour a mesh by values at its vertices, or by ``rows`` (n,) on the same scale."""
    rows = values.rows(mesh.n_vertices) if rows is None else rows
    return SurfaceView(mesh, camera, rows[:, None], lambda seen: linear_of(values.paint(seen)), title)


CLAY_COLOUR = linear_of(np.array([200, 200, 196]) / 255)  # colour of a surface without values; chosen
ALONE_WIDTH = 1000  # pixels across a picture of one surface; chosen
N_SHOWN_VECTORS = 4  # largest number of vectors of a basis that are drawn on a surface; chosen
# An eigenvalue below this share of the largest (absolute values) is a rounding error and shown as 0; chosen.
NULL_RATIO = 1e-9
CHART_HEIGHT_RATIO = 0.36  # height of the picture of a spectrum over its width; chosen
# colours of positive and negative eigenvalues, which the colour-blind can tell apart (Okabe & Ito)
POSITIVE, NEGATIVE = "#0072b2", "#d55e00"


def plot_surface(
    surface: Surface,
    values: ArrayLike | None = None,
    *,
    label: str = "",
    colour_map: str | None = None,
    title: str = "",
    width: int = ALONE_WIDTH,
    view: tuple[float, float] | None = None,
) -> Picture:
    """Draw a surface, coloured by values at its vertices.

    Parameters
    ----------
    surface : Mesh or PointCloud
        The surface, of n vertices.
    values : (n,) or (n, 3) array_like of float, optional
        Numbers, whose colours a bar explains, or red, green and blue from 0 to 1; ``nan`` is grey. By default clay.
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

    Examples
    --------
    >>> from isomatch import Mesh
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> figure = plot_surface(square, [0.0, 1.0, 2.0, 1.0], label="height, mm", width=300)
    >>> len(figure.axes), figure.axes[1].get_ylabel()
    (2, 'height, mm')
    """
    mesh = scale_for_drawing(drawable(surface), repr(surface))
    camera, seen = camera_of(mesh, view=view), title or repr(surface)
    rows = None if values is None else numbers_of(values, "values", DescriptorError)
    if rows is None or rows.ndim == 2:
        clay = np.tile(CLAY_COLOUR, (mesh.n_vertices, 1))
        colours = clay if rows is None else linear_of(np.clip(rows, 0.0, 1.0))
        if colours.shape != (mesh.n_vertices, 3):
            raise DescriptorError(
                f"values have shape {colours.shape}; expected ({mesh.n_vertices},) numbers, or 3 columns of colours"
            )
        return compose_picture([SurfaceView(mesh, camera, colours)], width, title=title, seen=seen)
    panel = ValuePanel(rows, label, colour_map=colour_map)
    seen += f", coloured by {label or 'values'}"
    return compose_picture([paint_values(mesh, camera, panel)], width, values=panel, title=title, seen=seen)


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
        The surface that the basis was made for; `DescriptorError` if it has another number of vertices.
    colour_map, title, width, view
        As for `plot_surface`; each function has its own scale, symmetric around 0.
    """
    if surface is None:
        return _spectrum(basis, title, width)
    mesh = scale_for_drawing(drawable(surface_from(surface)), "surface")
    if len(basis.vectors) != mesh.n_vertices:
        raise DescriptorError(
            f"{basis!r} is not one of this surface, which has {mesh.n_vertices} vertices; give the surface that it was "
            "made for"
        )
    camera, panels = camera_of(mesh, view=view), []
    values = np.where(np.abs(basis.values) > NULL_RATIO * np.abs(basis.values).max(), basis.values, 0.0)
    for k, (column, value) in enumerate(zip(basis.vectors.T[:N_SHOWN_VECTORS], values), 1):
        most = float(np.abs(column).max()) or 1.0
        even = ValuePanel([-most, most], colour_map=colour_map)
        name = f"vector {k}, eigenvalue {value:.3g}".replace("-", "−")
        panels.append(paint_values(mesh, camera, even, column, name))
    return compose_picture(panels, width, title=title, seen=f"The first {len(panels)} vectors of {basis!r}")


def _spectrum(basis: DistanceBasis | LaplaceBasis, title: str, width: int) -> Picture:
    """Draw the eigenvalues against their number, and the error against the rank where it is known."""
    picture = Picture(width, round(CHART_HEIGHT_RATIO * width), f"Spectrum of {basis!r}")
    picture.set_layout_engine("constrained")
    errors = basis.error_estimates() if isinstance(basis, DistanceBasis) and basis.held_out else None
    charts = picture.subplots(1, 1 if errors is None else 2, squeeze=False).ravel()
    number = np.arange(1, len(basis.values) + 1)
    if isinstance(basis, DistanceBasis):
        size, positive = np.abs(basis.values), basis.values > 0
        charts[0].scatter(number[positive], size[positive], 12, POSITIVE, label="positive")
        charts[0].scatter(number[~positive], size[~positive], 12, NEGATIVE, label="negative")
        charts[0].set_yscale("log")
        charts[0].legend(fontsize=TEXT_POINTS - 1, frameon=False)
        _label_axes(charts[0], "number", "size of the eigenvalue")
    else:
        charts[0].scatter(number, basis.values, 12, POSITIVE)
        _label_axes(charts[0], "number", "eigenvalue, 1 / squared mesh units")
    if errors is not None:
        charts[1].plot(number, 100 * errors, color=POSITIVE, marker="o", markersize=3, linewidth=1)
        charts[1].set_yscale("log")
        _label_axes(charts[1], "vectors kept", "relative error of the distances, %")
    if title:
        picture.suptitle(title, fontsize=TEXT_POINTS + 2, parse_math=False)
    return picture


def _label_axes(axes: Axes, x: str, y: str) -> None:
    axes.set_xlabel(x, fontsize=TEXT_POINTS)
    axes.set_ylabel(y, fontsize=TEXT_POINTS)
    axes.tick_params(labelsize=TEXT_POINTS - 1)
    axes.spines[["top", "right"]].set_visible(False)


N_NEIGHBOURS = 8  # number of nearest neighbours with which each point of a cloud forms triangles; chosen
# Radians, about 150°: largest angle, at a point, between two successive neighbours that form a triangle with the point;
# a wider angle is taken for a hole or a border of the surface; chosen.
MAX_GAP_ANGLE = 2.6


def drawable(surface: Surface) -> Mesh:
    """Return a mesh with the same vertices that looks like a surface.

    A mesh is returned as it is, a graph refused (`TypeError`). Triangles of points overlap and face away from the
    middle, and are good for nothing but a picture. O(n log n).

    Examples
    --------
    >>> import isomatch
    >>> grid = np.array([[x, y, 0.0] for x in range(5) for y in range(5)])
    >>> drawn = drawable(isomatch.PointCloud(grid))
    >>> drawn.n_vertices, bool(drawn.area > 16)
    (25, True)
    """
    if isinstance(surface, Mesh):
        return surface
    if isinstance(surface, Graph):
        raise TypeError(f"{surface!r} has no positions to draw")
    # The neighbours of each point are sorted around it, in the plane that fits them best.
    points, n = surface.vertices, surface.n_vertices
    k = min(N_NEIGHBOURS, n - 1)
    near = cKDTree(points).query(points, k + 1)[1][:, 1:]
    offsets = points[near] - points[:, None]  # from each point to its k neighbours, (n, k, 3)
    # The last two columns span the plane.
    axes = np.linalg.eigh(np.einsum("nki,nkj->nij", offsets, offsets))[1]
    flat = np.einsum("nki,nij->nkj", offsets, axes[:, :, 1:])
    angles = np.arctan2(flat[..., 1], flat[..., 0])
    order = angles.argsort(axis=1)
    near, angles = (np.take_along_axis(x, order, axis=1) for x in (near, angles))
    gaps = np.mod(np.roll(angles, -1, axis=1) - angles, 2 * np.pi)
    middle = np.broadcast_to(np.arange(n)[:, None], near.shape)
    faces = np.stack([middle, near, np.roll(near, -1, axis=1)], axis=2)[gaps < MAX_GAP_ANGLE]
    faces = faces[np.unique(np.sort(faces, axis=1), axis=0, return_index=True)[1]]
    a, b, c = (points[faces[:, i]] for i in range(3))
    inward = np.einsum("fi,fi->f", np.cross(b - a, c - a), a - points.mean(axis=0)) < 0
    faces[inward] = faces[inward][:, ::-1]
    return Mesh(points, faces)
