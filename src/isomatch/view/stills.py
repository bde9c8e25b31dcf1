"""The picture of a map: corresponding points have the same colour."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np
from matplotlib import colormaps
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties, findfont, get_font
from numpy.typing import ArrayLike

from isomatch.correspondence import Correspondence
from isomatch.errors import MeshError
from isomatch.storage.files import replaced
from isomatch.surfaces import Mesh
from isomatch.values.arrays import FloatArray
from isomatch.view.camera import camera_of, of_ordinary_size, turn_to_target
from isomatch.view.colours import from_screen, position_colours
from isomatch.view.surface_image import SurfaceView

WIDTH = 1800
DPI = 200
TALLEST = 1.15  # largest height of a panel over its width
LEAST_AREA = 1e-100  # of a shape of ordinary size; the squares of smaller ones vanish
MARGIN, TITLE, COLOUR_BAR = 30, 70, 110  # pixels


@dataclass(frozen=True, eq=False)
class ValuePanel:
    """Another view of the source, coloured by a value at each vertex.

    Parameters
    ----------
    values : (n_source,) array_like of float
        The values; ``nan`` is drawn grey.
    label : str
        Label of the colour bar, with the unit.
    highest : float, optional
        Value of the brightest colour; by default the 99th percentile.
    """

    values: ArrayLike
    label: str
    highest: float | None = None

    def scale(self) -> Normalize:
        """Return the colour scale, from 0 to the highest value."""
        values = np.asarray(self.values, dtype=np.float64)
        finite = values[np.isfinite(values)]
        highest = self.highest or (float(np.quantile(finite, 0.99)) if len(finite) else 1.0)
        return Normalize(0.0, highest or 1.0)


def draw_map(
    source: Mesh,
    target: Mesh,
    correspondence: Correspondence,
    path: str | Path | BinaryIO,
    *,
    titles: tuple[str, str] = ("source", "target"),
    values: ValuePanel | None = None,
    width: int = WIDTH,
) -> None:
    """Draw both shapes side by side, coloured by the map.

    Parameters
    ----------
    source, target : Mesh
        The two shapes. They are drawn with equal area, and the source is rotated to face like the target.
    correspondence : Correspondence
        The map source → target.
    path : path_like or binary file
        PNG file to write; an existing file is replaced.
    titles : (str, str)
        Titles below the two shapes.
    values : ValuePanel, optional
        Content of a third panel; by default there is none.
    width : int
        Width of the picture in pixels; the height follows from the shapes.

    Raises
    ------
    MeshError
        If coordinates differ so much that floats have no area for a shape.
    UnwritableFileError
        If the file cannot be written.

    Notes
    -----
    The target has the colours of `position_colours`. Each source vertex has the colour of its image, or is grey if it is
    unmatched. Time is linear in faces and pixels.
    """
    source, target = of_ordinary_size(source), of_ordinary_size(target)
    for mesh, title in zip((source, target), titles):
        if not mesh.area > LEAST_AREA:
            raise MeshError(
                f"{title}: cannot be drawn, as some coordinates are so much larger than the others that the surface has "
                "no area beside them; remove vertices that are far away"
            )
    camera = camera_of(target)
    turned = camera @ turn_to_target(source, target, correspondence)
    colours = position_colours(target)
    panels = [
        _Panel(SurfaceView(source, turned, correspondence.pull_back(colours), _as_is), titles[0]),
        _Panel(SurfaceView(target, camera, colours, _as_is), titles[1]),
    ]
    if values is not None:
        shown = np.asarray(values.values, dtype=np.float64)
        scaled = from_screen(colormaps["cividis"](values.scale()(shown))[:, :3])
        scaled = np.where(np.isnan(shown)[:, None], np.nan, scaled)
        panels.append(_Panel(SurfaceView(source, turned, scaled, _as_is), titles[0]))
    figure = _arranged(panels, width, 0 if values is None else COLOUR_BAR)
    if values is not None:
        _add_colour_bar(figure, values)
    with replaced(Path(path)) if isinstance(path, str | Path) else nullcontext(path) as file:
        figure.savefig(file, format="png", dpi=DPI)


@dataclass(frozen=True, eq=False)
class _Panel:
    view: SurfaceView
    title: str


def _arranged(panels: Sequence[_Panel], width: int, right: int) -> Figure:
    """Place the panels in a row, all at the same scale, with titles below."""
    extents = np.array([panel.view.extent() for panel in panels])  # (panels, 2)
    room = width - right - MARGIN * (len(panels) + 1)
    tallest = TALLEST * room / len(panels)
    scale = min(room / extents[:, 0].sum(), tallest / extents[:, 1].max())
    height = max(int(np.ceil(scale * extents[:, 1].max())), 1)
    widths = np.ceil(scale * extents[:, 0]).astype(int)
    spare = (room - int(widths.sum())) // len(panels)
    widths = np.maximum(widths + spare, 1)
    figure = Figure((width / DPI, (height + 2 * MARGIN + TITLE) / DPI), dpi=DPI, facecolor="white")
    FigureCanvasAgg(figure)
    left = MARGIN
    for panel, panel_width in zip(panels, widths):
        image = panel.view.pixels(int(panel_width), height, scale)
        figure.figimage(image, left, TITLE + MARGIN, origin="upper")
        middle = (left + panel_width / 2) / width
        figure.text(
            middle,
            (TITLE + MARGIN) / 2 / figure.bbox.height,
            _drawable(panel.title),
            ha="center",
            va="center",
            size=8,
            parse_math=False,  # a dollar sign in a file name does not start a formula
        )
        left += int(panel_width) + MARGIN
    return figure


def _drawable(title: str) -> str:
    """Replace the characters that the font of a title lacks, such as line ends and bytes that are no text."""
    font = get_font(findfont(FontProperties()))
    return "".join(
        character if font.get_char_index(ord(character)) else "\N{REPLACEMENT CHARACTER}"
        for character in title
    )


def _as_is(colours: FloatArray) -> FloatArray:
    return colours


def _add_colour_bar(figure: Figure, values: ValuePanel) -> None:
    axes = figure.add_axes((1 - COLOUR_BAR / figure.bbox.width, 0.25, 0.01, 0.55))
    bar = figure.colorbar(ScalarMappable(values.scale(), "cividis"), cax=axes, extend="max")
    bar.ax.tick_params(labelsize=6)
    bar.set_label(values.label, size=6)
