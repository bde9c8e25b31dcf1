"""Pictures of statistics: charts of scores, quality and likeness, modes and values on the mean."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from isomatch._core.arrays import BoolArray, FloatArray, IntArray
from isomatch._core.errors import SettingError
from isomatch._core.files import replaced
from isomatch.cohort.shape_statistics.likeness import shape_tree
from isomatch.cohort.shape_statistics.linear_model import ShapeRegression
from isomatch.cohort.shape_statistics.shape_model import ModelCurve, ShapeModel
from isomatch.surfaces import Mesh
from isomatch.visualization import arranged_panels, camera_of, colour_scale, surface_image

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.transforms import Bbox

PictureFormat = Literal["png", "pdf", "svg"]  # suffixes of pictures
Groups = Sequence[str] | None  # the group of each shape

BLUE, GREY = "#3f90da", "#717581"  # colours that colour-blind readers can tell apart (Petroff 2021)
# colours of groups, in order, that colour-blind readers can tell apart
COLOURS = (BLUE, "#ffa90e", "#bd1f01", "#94a4a2", "#832db6", "#a96b59", "#e76300", "#b9ac70")
DPI = 300  # dots per inch; chosen, as for print
CHART_SIZE = (5.6, 4.5)  # inches; width and height of a scatter plot; all charts have this width; chosen
MAX_TICKS = 6  # largest number of ticks along x, or along a colour bar; chosen: their numbers do not overlap
NAME_SIZE = 8  # points; size of the letters in the names of shapes; chosen
SURFACES_WIDTH = 6.5  # inches; width of a picture of surfaces or landmarks; chosen
FILLED_SHARE = 0.9  # width of the widest surface in its panel over the width of the panel; chosen
TEXT_SIZE = 9.0  # points; size of the letters in titles and numbers; chosen
BAR_HEIGHT = 0.7  # inches; height of a colour bar with its numbers and label; chosen
MIN_KNOWN = 0.5  # a pixel is coloured if the vertices with a value have at least this weight in it; chosen
SIGNED_MAP, RISING_MAP = "RdBu_r", "viridis"  # colour maps for values of both signs, and for values from 0


def draw_scores(
    path: str | Path, model: ShapeModel, groups: Groups = None, modes: tuple[int, int] = (0, 1)
) -> None:
    """Draw the scores of shapes along two modes as points, with the convex hulls of groups.

    The file is PNG, or ``.pdf`` or ``.svg``; an existing one is replaced. Modes are counted from 0;
    a single one is drawn alone. Colours tell the groups; a shape without a group has "".
    """
    across, up = modes if model.n_modes > 1 else (modes[0], None)
    if not all(0 <= mode < model.n_modes for mode in (across, up) if mode is not None):
        raise SettingError(f"modes {modes} are not among the {model.n_modes} modes, counted from 0")
    along_up = np.zeros(len(model.names)) if up is None else model.scores[:, up]
    points = np.column_stack([model.scores[:, across], along_up])
    figure, (axes,) = _chart()
    for draw_axis in (axes.axhline, axes.axvline):
        draw_axis(0, color=GREY, linewidth=0.5, zorder=0)
    _draw_hulls(axes, points, groups)
    _scatter(axes, points, model.names, groups)
    axes.set_xlabel(_of_mode(model, across))
    if up is None:
        axes.set_yticks([])
    else:
        axes.set_ylabel(_of_mode(model, up))
        axes.set_aspect("equal", adjustable="datalim")
    _save_scatter(figure, path)


def _of_mode(model: ShapeModel, mode: int) -> str:
    return f"score of mode {mode + 1} ({model.variance_ratios[mode]:.1%} of the variance)"


def draw_regression(
    path: str | Path,
    regression: ShapeRegression,
    variable: FloatArray,
    names: Sequence[str],
    label: str,
    groups: Groups = None,
) -> None:
    """Draw the scores of a regression on a variable (m,), with its line, as `draw_scores`."""
    figure, (axes,) = _chart()
    scores = regression.scores[:, 0]
    ends = np.array([variable.min(), variable.max()])
    slope, level = np.polyfit(variable, scores, 1)
    axes.plot(ends, slope * ends + level, color=GREY, linewidth=1, zorder=0)
    _scatter(axes, np.column_stack([variable, scores]), names, groups)
    axes.set_xlabel(label)
    axes.set_ylabel("regression score, in units of the shapes")
    test = f"{regression.r_squared:.1%} of the variance of shape, p = {regression.p_value:.4g}"
    settings = f"{regression.n_permutations} permutations, seed {regression.seed}"
    axes.set_title(f"{test} ({settings})", fontsize="medium")
    _save_scatter(figure, path)


def draw_quality(path: str | Path, compact: FloatArray, general: ModelCurve, specific: ModelCurve) -> None:
    """Draw compactness, generalisation and specificity by number of modes, as `draw_scores`."""
    figure, panels = _chart(3, 6.6)
    panels[0].plot(np.arange(len(compact)), compact, color=BLUE, marker=".")
    panels[0].set(title="compactness: share of the variance", ylim=(0, 1.03))
    titles = "generalisation: error of shapes left out", "specificity: distance of random shapes"
    for axes, curve, title in zip(panels[1:], (general, specific), titles):
        modes = np.arange(len(curve.mean))
        axes.plot(modes, curve.mean, color=BLUE, marker=".")
        low, high = curve.mean - curve.standard_error, curve.mean + curve.standard_error
        axes.fill_between(modes, low, high, color=BLUE, alpha=0.25, linewidth=0)
        axes.set(title=title)
        axes.set_ylim(bottom=0)
    for axes in panels:
        axes.set_xlabel("modes")
        axes.locator_params(axis="x", integer=True)
        axes.title.set_fontsize("small")
    save_figure(figure, path)


def draw_tree(path: str | Path, distances: FloatArray, names: Sequence[str], label: str) -> None:
    """Draw a tree of named shapes, see `shape_tree`, as `draw_scores`; label names distances."""
    from scipy.cluster.hierarchy import dendrogram

    tree = dendrogram(shape_tree(distances), no_plot=True)
    figure, (axes,) = _chart(height=1.0 + 0.2 * len(names))
    for across, along in zip(tree["icoord"], tree["dcoord"]):
        axes.plot(along, across, color=GREY, linewidth=1)
    axes.set_yticks(5 + 10 * np.arange(len(names)))
    axes.set_yticklabels([names[i] for i in tree["leaves"]], fontsize=NAME_SIZE, parse_math=False)
    axes.set_xlabel(label)
    axes.set_xlim(left=0)
    axes.spines[["top", "right", "left"]].set_visible(False)
    save_figure(figure, path)


def draw_embedding(
    path: str | Path, points: FloatArray, names: Sequence[str], label: str, groups: Groups = None
) -> None:
    """Draw shapes as named points (m, 2), as `draw_scores`; the label names the distances."""
    figure, (axes,) = _chart()
    _scatter(axes, points, names, groups)
    axes.set_aspect("equal", adjustable="datalim")
    axes.locator_params(axis="x", nbins=MAX_TICKS)
    axes.set_title(label, fontsize="medium")
    _save_scatter(figure, path)


def draw_motion(path: str | Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Draw how the regions of a series change, a panel for each known measure, as `draw_scores`.

    The rows are those of `motion_by_region` for one shape after the other, with its ``name``.
    """
    names, regions = (list(dict.fromkeys(row[key] for row in rows)) for key in ("name", "region"))
    table = {key: np.reshape([row[key] for row in rows], (len(names), -1)) for key in list(rows[0])[2:]}
    shown = [key for key, values in table.items() if np.isfinite(values).any()]
    figure, panels = _chart(len(shown), 1.0 + 1.5 * len(shown))
    ticks = np.unique(np.linspace(0, len(names) - 1, MAX_TICKS).astype(int))
    for axes, key in zip(panels, shown):
        axes.set_prop_cycle(color=["black", *COLOURS])
        lines = axes.plot(table[key])
        axes.set_title(key.replace("_", " "), fontsize="small")
        axes.set_xticks(ticks, [names[i] for i in ticks], rotation=15, size=NAME_SIZE, parse_math=False)
    legend = figure.legend(lines, regions, loc="outside lower center", ncols=5, fontsize=NAME_SIZE)
    for text in legend.get_texts():
        text.set_parse_math(False)
    save_figure(figure, path)


def _chart(n_panels: int = 1, height: float = CHART_SIZE[1]) -> tuple[Figure, list[Axes]]:
    """Make a figure with panels one below the other."""
    from matplotlib.figure import Figure

    figure = Figure((CHART_SIZE[0], height), layout="constrained")
    return figure, list(figure.subplots(n_panels, 1, squeeze=False)[:, 0])


def save_figure(figure: Figure, path: str | Path) -> None:
    """Write a figure as PNG, PDF or SVG, by the suffix, whole and without a date."""
    kind = Path(path).suffix.lower().removeprefix(".")
    if kind not in get_args(PictureFormat):
        raise SettingError(f"{path}: pictures are written as {', '.join(get_args(PictureFormat))}")
    from matplotlib import rc_context

    undated = {"pdf": {"CreationDate": None}, "svg": {"Date": None}}.get(kind)
    with replaced(Path(path)) as file, rc_context({"svg.hashsalt": "isomatch"}):
        figure.savefig(file, format=kind, dpi=DPI, bbox_inches="tight", pad_inches=0.08, metadata=undated)


def _scatter(axes: Axes, points: FloatArray, names: Sequence[str], groups: Groups) -> None:
    """Draw named points (m, 2) in the colours of their groups."""
    for group, colour, chosen in _chosen(groups, len(names)):
        axes.scatter(points[chosen, 0], points[chosen, 1], 18, color=colour, label=group or "no group")
    if groups:
        for text in axes.legend(fontsize="small").get_texts():
            text.set_parse_math(False)
    axes.margins(0.1)
    for point, name in zip(points, names):
        axes.annotate(name, point, (3, 3), textcoords="offset points", fontsize=NAME_SIZE, parse_math=False)


def _save_scatter(figure: Figure, path: str | Path) -> None:
    """Write a scatter plot; a name that would cover one before it is left out."""
    figure.draw_without_rendering()
    taken: list[Bbox] = []
    for label in list(figure.axes[0].texts):
        box = label.get_window_extent()
        if any(box.overlaps(other) for other in taken):
            label.remove()
        else:
            taken.append(box)
    save_figure(figure, path)


def _draw_hulls(axes: Axes, points: FloatArray, groups: Groups) -> None:
    """Draw the convex hull of each group of three points or more that are not on a line."""
    from scipy.spatial import ConvexHull, QhullError

    for group, colour, chosen in _chosen(groups, len(points)):
        if not group or chosen.sum() < 3:
            continue
        try:
            hull = ConvexHull(points[chosen])
        except QhullError:  # the points are on a line
            continue
        corners = points[chosen][hull.vertices].T
        axes.fill(*corners, facecolor=colour, edgecolor=colour, alpha=0.15, linewidth=0, zorder=0)
        axes.fill(*corners, fill=False, edgecolor=colour, linewidth=0.8, zorder=0)


def _chosen(groups: Groups, m: int) -> list[tuple[str, str, BoolArray]]:
    """Return name, colour and members (m,) of each group; without groups, of one for all."""
    of = np.array(groups or [""] * m, dtype=str)
    named = [group for group in sorted(set(of.tolist())) if group]
    colours = {group: COLOURS[i % len(COLOURS)] for i, group in enumerate(named)}
    rest = [] if groups and (of != "").all() else [("", GREY if groups else BLUE, of == "")]
    return [*((group, colour, of == group) for group, colour in colours.items()), *rest]


def draw_landmarks(
    path: str | Path,
    shown: Mapping[str, FloatArray],
    mean: FloatArray,
    links: IntArray,
    values: FloatArray | None = None,
    label: str = "",
) -> None:
    """Draw configurations of landmarks (n, d) by title, over the mean in grey, as `draw_scores`.

    Links (l, 2) are landmarks that a line joins. In space, each configuration is seen from two
    sides: along the direction in which the mean is thinnest, and along the next. Values (n,) give
    landmarks their colours; the label names them.
    """
    from matplotlib.colors import Normalize
    from matplotlib.figure import Figure

    sides = [np.eye(2)]
    if mean.shape[1] == 3:
        principal = np.linalg.svd(mean - mean.mean(axis=0), full_matrices=False)[2]
        principal = principal * np.sign(principal[0, np.abs(principal[0]).argmax()])
        sides = [principal[[0, 1]], principal[[0, 2]]]
    per_row = 4 // len(sides)
    rows = -(-len(shown) // per_row)
    columns = min(len(shown), per_row) * len(sides)
    figure = Figure((SURFACES_WIDTH, 0.5 + rows * SURFACES_WIDTH / max(columns, 2)), layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    high = None if values is None else float(np.nanmax(np.abs(values), initial=0.0)) or 1.0
    for panel in panels:
        panel.set_axis_off()
    for i, (title, points) in enumerate(shown.items()):
        for j, side in enumerate(sides):
            panel = panels[i * len(sides) + j]
            for drawn, colour in ((mean, "#c4c7cb"), (points, BLUE)):
                seen = drawn @ side.T
                for line in links.tolist():
                    panel.plot(*seen[line].T, color=colour, linewidth=0.9, zorder=1)
                if values is not None and colour == BLUE:
                    panel.scatter(*seen.T, 14, c=values, cmap=RISING_MAP, norm=Normalize(0, high), zorder=3)
                else:
                    panel.scatter(*seen.T, 6, color=colour, zorder=2)
            panel.set_aspect("equal", adjustable="datalim")
            panel.set_title(title if j == 0 else "", fontsize="small", parse_math=False)
    if high is not None:
        _add_bar(figure, list(panels), RISING_MAP, 0.0, high, label)
    save_figure(figure, path)


def draw_values(
    path: str | Path,
    mesh: Mesh,
    values: FloatArray,
    label: str,
    *,
    views: Mapping[str, FloatArray] | None = None,
    high: float | None = None,
) -> None:
    """Draw a surface from two sides, coloured by a value at each vertex.

    Values (n,) that are nan are drawn grey; if any is below 0, the colours tell signs. The label
    names them, with their unit; without any value, only the label is written. Views are directions
    (3,) from which the surface is seen, by title. The scale ends at ``high``, by default near the
    largest value.
    """
    has_value = np.isfinite(values)
    if high is None:
        high = float(np.quantile(np.abs(values[has_value]), 0.995)) if has_value.any() else 0.0
    high = high or 1.0
    name, low = (SIGNED_MAP, -high) if (values < 0).any() else (RISING_MAP, 0.0)
    front = camera_of(mesh)
    seen = {title: _turn_camera(front, direction) for title, direction in (views or {}).items()}
    cameras = seen or {"": front, " ": front * [[-1], [1], [-1]]}
    paint = colour_scale(name, low, high)
    used = mesh.vertices[np.unique(mesh.faces)]
    widest = max(float(np.ptp(used @ camera[0])) for camera in cameras.values()) or 1.0
    density = DPI * FILLED_SHARE * SURFACES_WIDTH / 2 / widest * np.sqrt(mesh.area)  # pixels per √area

    def paint_known(seen: FloatArray) -> FloatArray:
        share = np.where(seen[:, 1:] < MIN_KNOWN, np.nan, seen[:, 1:])
        return paint(seen[:, :1] / share)

    columns = np.column_stack([np.where(has_value, values, 0.0), has_value])
    images = [surface_image(mesh, columns, paint_known, camera, density) for camera in cameras.values()]
    figure, axes = arranged_panels(images, list(cameras), 2, SURFACES_WIDTH, TEXT_SIZE)
    if has_value.any():
        _add_bar(figure, axes, name, low, high, label)
    else:
        figure.supxlabel(label, size=TEXT_SIZE)
    save_figure(figure, path)


def _turn_camera(front: FloatArray, to: FloatArray) -> FloatArray:
    """Turn a camera, see `camera_of`, to another direction, upright if possible."""
    up = front[1] if abs(front[1] @ to) < 0.7 else front[2]
    right = np.cross(up, to) / np.linalg.norm(np.cross(up, to))
    return np.array([right, np.cross(to, right), to])


def _add_bar(figure: Figure, axes: list[Axes], name: str, low: float, high: float, label: str) -> None:
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from matplotlib.ticker import MaxNLocator

    scale = ScalarMappable(Normalize(low, high), name)
    figure.set_figheight(figure.get_figheight() + BAR_HEIGHT)
    beyond = "both" if low else "max"
    ticks = MaxNLocator(MAX_TICKS)
    placed: Any = {"location": "bottom", "shrink": 0.6, "aspect": 40}
    bar = figure.colorbar(scale, ax=axes, **placed, extend=beyond, ticks=ticks)
    bar.set_label(label, size=TEXT_SIZE)
    bar.ax.tick_params(labelsize=TEXT_SIZE)
