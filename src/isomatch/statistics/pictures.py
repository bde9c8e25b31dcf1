"""Pictures of surfaces: the modes of a model, values on its mean."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from isomatch.statistics.charts import DPI, save_figure
from isomatch.statistics.shape_model import ShapeModel
from isomatch.surfaces import Mesh
from isomatch.values.arrays import FloatArray
from isomatch.view import arranged_panels, camera_of, colour_scale, surface_image

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH = 6.5  # inches of a picture
FILLED = 0.9  # of the width of a panel, that the widest surface takes
TEXT = 9.0  # points
BAR = 0.7  # inches that a colour bar takes, with its numbers and its label
KNOWN = 0.5  # share of the value of a point that is known, from which it is drawn
DIVERGING, RISING = "RdBu_r", "viridis"


def draw_modes(path: str | Path, model: ShapeModel, n_modes: int = 3, deviations: float = 2.0) -> None:
    """Draw the mean, and each mode as the mean moved along it in both directions.

    Parameters
    ----------
    path : path_like
        PNG file of 300 dots per inch, or ``.pdf`` or ``.svg``; an existing one is replaced.
    model : ShapeModel
        The model.
    n_modes : int
        Number of modes, as far as there are.
    deviations : float
        How far, in standard deviations.

    Notes
    -----
    All shapes are seen from one side and at one scale. The colour is the displacement along the normal of the mean.
    """
    mean = model.mesh()
    camera = camera_of(mean)
    shown = range(min(n_modes, model.n_modes))
    moved = {(mode, sign): model.mode_mesh(mode, sign * deviations) for mode in shown for sign in (-1, 1)}
    outward = {
        (mode, sign): np.einsum("ij,ij->i", mesh.vertices - mean.vertices, mean.vertex_normals)
        for (mode, sign), mesh in moved.items()
    }
    largest = max((float(np.quantile(np.abs(each), 0.995)) for each in outward.values()), default=0.0) or 1.0
    paint = colour_scale(DIVERGING, -largest, largest)

    density = _density([mean, *moved.values()], camera, per_row=3)

    def image(mesh: Mesh, values: FloatArray) -> FloatArray:
        return surface_image(mesh, values, paint, camera, density * np.sqrt(mesh.area))

    middle = image(mean, np.zeros(mean.n_vertices))
    images, titles = [], []
    for mode in shown:
        low, high = (image(moved[mode, sign], outward[mode, sign]) for sign in (-1, 1))
        images += [low, middle, high]
        share = f"mode {mode + 1}: {model.variance_ratios[mode]:.1%} of the variance"
        titles += [f"−{deviations:g} sd", share, f"+{deviations:g} sd"]
    if not images:
        images, titles = [middle], ["mean; the shapes do not differ"]
    figure, axes = arranged_panels(images, titles, min(len(images), 3), WIDTH, TEXT)
    if shown:
        _add_bar(figure, axes, DIVERGING, -largest, largest, "displacement along the normal of the mean")
    save_figure(figure, path)


def draw_values(path: str | Path, mesh: Mesh, values: FloatArray, label: str) -> None:
    """Draw a surface from two sides, coloured by a value of at least 0 at each vertex.

    Parameters
    ----------
    path : path_like
        PNG file of 300 dots per inch, or ``.pdf`` or ``.svg``; an existing one is replaced.
    mesh : Mesh
        The surface.
    values : (n,) array of float
        The values; nan is drawn grey.
    label : str
        What they are, with their unit; without any value, it is all that is said.
    """
    known = np.isfinite(values)
    highest = float(np.quantile(values[known], 0.995)) if known.any() else 0.0
    front = camera_of(mesh)
    paint = colour_scale(RISING, 0.0, highest or 1.0)
    density = _density([mesh], front, per_row=2) * np.sqrt(mesh.area)

    def paint_known(seen: FloatArray) -> FloatArray:
        share = np.where(seen[:, 1:] < KNOWN, np.nan, seen[:, 1:])
        return paint(seen[:, :1] / share)

    columns = np.column_stack([np.where(known, values, 0.0), known])
    images = [
        surface_image(mesh, columns, paint_known, view, density)
        for view in (front, front * [[-1], [1], [-1]])
    ]
    figure, axes = arranged_panels(images, ["", ""], 2, WIDTH, TEXT)
    if known.any():
        _add_bar(figure, axes, RISING, 0.0, highest or 1.0, label)
    else:
        figure.supxlabel(label, size=TEXT)
    save_figure(figure, path)


def _density(meshes: Sequence[Mesh], camera: FloatArray, per_row: int) -> float:
    """Pixels per unit of length, with which the widest of some surfaces fills a panel."""
    widest = max(float(np.ptp(mesh.vertices[np.unique(mesh.faces)] @ camera[0])) for mesh in meshes)
    return DPI * FILLED * WIDTH / per_row / (widest or 1.0)


def _add_bar(figure: Figure, axes: list[Axes], name: str, low: float, high: float, label: str) -> None:
    """Add a colour bar below all panels."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    scale = ScalarMappable(Normalize(low, high), name)
    figure.set_figheight(figure.get_figheight() + BAR)
    bar = figure.colorbar(
        scale, ax=axes, location="bottom", shrink=0.6, aspect=40, extend="both" if low else "max"
    )
    bar.set_label(label, size=TEXT)
    bar.ax.tick_params(labelsize=TEXT)
