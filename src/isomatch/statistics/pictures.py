"""Pictures of a shape model and of the distances between shapes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from isomatch.statistics.model_quality import ModelCurve
from isomatch.statistics.shape_distances import shape_tree
from isomatch.statistics.shape_model import ShapeModel
from isomatch.storage.files import replaced
from isomatch.surfaces import Mesh
from isomatch.values.arrays import FloatArray
from isomatch.view import arranged_panels, camera_of, colour_scale, surface_image

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BLUE, GREY = "#3f90da", "#717581"  # of Petroff 2021
COLOURS = (BLUE, "#ffa90e", "#bd1f01", "#94a4a2", "#832db6", "#a96b59", "#e76300", "#b9ac70")
RESOLUTION = 300  # pixels per √(area of the mean)
DIVERGING, RISING = "RdBu_r", "viridis"


def draw_modes(path: str | Path, model: ShapeModel, n_modes: int = 3, deviations: float = 2.0) -> None:
    """Draw the mean, and each mode as the mean moved along it in both directions.

    Parameters
    ----------
    path : path_like
        PNG file; an existing one is replaced.
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
    outward = {
        (mode, sign): np.einsum("ij,ij->i", moved.vertices - mean.vertices, mean.vertex_normals)
        for mode in shown
        for sign in (-1, 1)
        for moved in [model.mode_mesh(mode, sign * deviations)]
    }
    largest = (
        max((float(np.quantile(np.abs(moved), 0.995)) for moved in outward.values()), default=0.0) or 1.0
    )
    paint = colour_scale(DIVERGING, -largest, largest)

    def image(mesh: Mesh, values: FloatArray) -> FloatArray:
        return surface_image(mesh, values, paint, camera, RESOLUTION * np.sqrt(mesh.area / mean.area))

    middle = image(mean, np.zeros(mean.n_vertices))
    images, titles = [], []
    for mode in shown:
        low, high = (image(model.mode_mesh(mode, s * deviations), outward[mode, s]) for s in (-1, 1))
        images += [low, middle, high]
        share = f"mode {mode + 1}: {model.variance_ratios[mode]:.1%} of the variance"
        titles += [f"−{deviations:g} sd", share, f"+{deviations:g} sd"]
    if not images:
        images, titles = [middle], ["mean; the shapes do not differ"]
    figure, axes = arranged_panels(images, titles, per_row=min(len(images), 3))
    if shown:
        _add_bar(figure, axes, DIVERGING, -largest, largest, "displacement along the normal of the mean")
    _save(figure, path)


def draw_values(path: str | Path, mesh: Mesh, values: FloatArray, label: str) -> None:
    """Draw a surface from two sides, coloured by a value of at least 0 at each vertex.

    Parameters
    ----------
    path : path_like
        PNG file; an existing one is replaced.
    mesh : Mesh
        The surface.
    values : (n,) array of float
        The values; nan is drawn grey.
    label : str
        What they are, with their unit.
    """
    highest = float(np.nanquantile(values, 0.995)) or 1.0
    front = camera_of(mesh)
    paint = colour_scale(RISING, 0.0, highest)
    images = [
        surface_image(mesh, values, paint, view, RESOLUTION) for view in (front, front * [[-1], [1], [-1]])
    ]
    figure, axes = arranged_panels(images, ["", ""], per_row=2)
    _add_bar(figure, axes, RISING, 0.0, highest, label)
    _save(figure, path)


def draw_quality(path: str | Path, compact: FloatArray, general: ModelCurve, specific: ModelCurve) -> None:
    """Draw compactness, generalisation and specificity against the number of modes.

    Parameters
    ----------
    path : path_like
        PNG file; an existing one is replaced.
    compact, general, specific
        What `compactness`, `generalisation` and `specificity` return.
    """
    from matplotlib.figure import Figure

    figure = Figure((10, 3.2), layout="constrained")
    panels = figure.subplots(1, 3)
    panels[0].plot(np.arange(len(compact)), compact, color=BLUE, marker=".")
    panels[0].set(title="compactness: share of the variance", ylim=(0, 1.03))
    for axes, curve, title in (
        (panels[1], general, "generalisation: error of shapes left out"),
        (panels[2], specific, "specificity: distance of random shapes"),
    ):
        modes = np.arange(len(curve.mean))
        axes.plot(modes, curve.mean, color=BLUE, marker=".")
        low, high = curve.mean - curve.standard_error, curve.mean + curve.standard_error
        axes.fill_between(modes, low, high, color=BLUE, alpha=0.25, linewidth=0)
        axes.set(title=title)
        axes.set_ylim(bottom=0)
    for axes in panels:
        axes.set_xlabel("modes")
        axes.xaxis.get_major_locator().set_params(integer=True)
        axes.title.set_fontsize("medium")
    _save(figure, path)


def draw_tree(path: str | Path, distances: FloatArray, names: Sequence[str], label: str) -> None:
    """Draw the tree of shapes, see `shape_tree`.

    Parameters
    ----------
    path : path_like
        PNG file; an existing one is replaced.
    distances : (m, m) array of float
        Distances between at least two shapes.
    names : sequence of str
        Their names.
    label : str
        What the distances are, with their unit.
    """
    from matplotlib.figure import Figure
    from scipy.cluster.hierarchy import dendrogram

    tree = dendrogram(shape_tree(distances), no_plot=True)
    figure = Figure((7, 1.0 + 0.18 * len(names)), layout="constrained")
    axes = figure.subplots()
    for across, along in zip(tree["icoord"], tree["dcoord"]):
        axes.plot(along, across, color=GREY, linewidth=1)
    axes.set_yticks(5 + 10 * np.arange(len(names)))
    axes.set_yticklabels([names[i] for i in tree["leaves"]], fontsize=7, parse_math=False)
    axes.set_xlabel(label)
    axes.set_xlim(left=0)
    axes.spines[["top", "right", "left"]].set_visible(False)
    _save(figure, path)


def draw_embedding(
    path: str | Path,
    points: FloatArray,
    names: Sequence[str],
    label: str,
    groups: Sequence[str] | None = None,
) -> None:
    """Draw shapes as points of the plane, with their names.

    Parameters
    ----------
    path : path_like
        PNG file; an existing one is replaced.
    points : (m, 2) array of float
        Their places, such as those of `classical_scaling`.
    names : sequence of str
        Their names.
    label : str
        What the distances are, with their unit.
    groups : sequence of str, optional
        A group of each shape, which gives it its colour.
    """
    from matplotlib.figure import Figure

    figure = Figure((7, 6), layout="constrained")
    axes = figure.subplots()
    for i, group in enumerate(sorted(set(groups or [""]))):
        chosen = np.array([of_shape == group for of_shape in groups or [""] * len(names)])
        axes.scatter(
            points[chosen, 0], points[chosen, 1], 18, color=COLOURS[i % len(COLOURS)], label=group or None
        )
    for point, name in zip(points, names):
        axes.annotate(name, point, (3, 3), textcoords="offset points", fontsize=7, parse_math=False)
    if groups:
        axes.legend(fontsize="small")
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_title(label, fontsize="medium")
    _save(figure, path)


def _add_bar(figure: Figure, axes: list[Axes], name: str, low: float, high: float, label: str) -> None:
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    scale = ScalarMappable(Normalize(low, high), name)
    shrink = min(0.6, 2.5 / figure.get_figheight())
    bar = figure.colorbar(scale, ax=axes, shrink=shrink, extend="both" if low else "max")
    bar.set_label(label, size=7)
    bar.ax.tick_params(labelsize=7)


def _save(figure: Any, path: str | Path) -> None:
    with replaced(Path(path)) as file:
        figure.savefig(file, format="png", dpi=150)
