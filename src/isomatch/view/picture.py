"""A figure of surfaces in a row, pixel for pixel, which notebooks show sharply and at the size it was made for."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from io import BytesIO
from itertools import count
from textwrap import wrap

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties, findfont, get_font

from isomatch.errors import SettingError
from isomatch.values.arrays import FloatArray
from isomatch.view.surface_image import SurfaceView
from isomatch.view.value_panel import ValuePanel

DPI = 200
SHARPNESS = 2  # pixels of a picture for each pixel of a page, as many as sharp screens have
TALLEST = 1.15  # largest height of a panel over its width
LEAST_WIDTH = 200  # pixels of a picture
MARGIN, TITLE, COLOUR_BAR = 30, 70, 175  # pixels; the last is what a bar takes at least, with its label
BAR, BAR_HEIGHT = 24, 0.7  # pixels across, and share of the height of a panel
# pixels; least height of panels beside a bar, so that two numbers and a word of its label fit
BESIDE_BAR = 120
TEXT = 9  # points


class Picture(Figure):
    """A figure of matplotlib that belongs to nobody but its holder: pyplot does not know it, and no backend is chosen.

    Parameters
    ----------
    width, height : int
        Size in pixels. Notebooks show it at half of that, as sharp screens have two pixels for each of a page.
    seen : str
        What it shows, for who cannot see it.
    """

    def __init__(self, width: int, height: int, seen: str = "") -> None:
        whole = 1e-6  # of a pixel, so that rounding loses none
        super().__init__(((width + whole) / DPI, (height + whole) / DPI), dpi=DPI, facecolor="white")
        FigureCanvasAgg(self)
        self.seen = seen

    def png(self, *, transparent: bool = False) -> bytes:
        """Return the picture as a PNG file."""
        file = BytesIO()
        self.savefig(file, format="png", dpi=DPI, facecolor="none" if transparent else "white")
        return file.getvalue()

    def html(self, *, transparent: bool = False) -> str:
        """Return the picture as an element of a page, as wide as it was made for or as there is room."""
        return (
            f'<img alt="{escape(self.seen)}" width="{round(self.bbox.width / SHARPNESS)}" '
            f'style="max-width:100%;height:auto" src="{png(self.png(transparent=transparent))}">'
        )

    def _repr_html_(self) -> str:
        return self.html()


@dataclass(frozen=True, eq=False)
class Panel:
    """A surface in a picture, and the title below it."""

    view: SurfaceView
    title: str = ""


def pictured(
    panels: Sequence[Panel], width: int, *, values: ValuePanel | None = None, title: str = "", seen: str = ""
) -> Picture:
    """Place panels in a row, all at the same scale.

    Parameters
    ----------
    panels : sequence of Panel
        At least one.
    width : int
        Width in pixels; the height follows from the shapes.
    values : ValuePanel, optional
        Values whose colours a bar at the right explains.
    title, seen : str
        Title above all, and what the picture shows, for who cannot see it.

    Raises
    ------
    SettingError
        If there is no room for the panels.
    """
    if int(width) != width or width < LEAST_WIDTH:
        raise SettingError(f"width = {width} is not an integer of at least {LEAST_WIDTH} pixels")
    above, below = (TITLE if any(texts) else 0 for texts in ([title], [panel.title for panel in panels]))
    extents = np.array([panel.view.extent() for panel in panels])  # (panels, 2)
    right, least = (0, 1) if values is None else (COLOUR_BAR, BESIDE_BAR)
    room, scale, height = _fitted(extents, width - right, least)
    # a wider bar leaves less height for its label, and that may take more lines
    while values is not None and right < (needed := min(_bar_room(values, height), width // 2)):
        right = needed
        room, scale, height = _fitted(extents, width - right, least)
    widths = np.ceil(scale * extents[:, 0]).astype(int)
    spare = (room - int(widths.sum())) // len(panels)
    widths = np.maximum(widths + spare, 1)
    picture = Picture(width, height + 2 * MARGIN + above + below, seen)
    bottom, left = below + MARGIN, MARGIN
    for panel, panel_width in zip(panels, widths.tolist()):
        image = panel.view.pixels(panel_width, height, scale)
        _add_image(picture, image, left, bottom)
        _add_text(picture, panel.title, left + panel_width / 2, bottom / 2)
        left += panel_width + MARGIN
    _add_text(picture, title, width / 2, bottom + height + MARGIN + above / 2, size=TEXT + 2)
    if values is not None:
        _add_colour_bar(picture, values, width - right, bottom, height)
    return picture


def _fitted(extents: FloatArray, width: int, least: int) -> tuple[int, float, int]:
    """Pixels in a row for all panels, pixels for a unit of their extents (n, 2), and the height of the row."""
    room = max(width - MARGIN * (len(extents) + 1), len(extents))
    tallest = TALLEST * room / len(extents)
    scale = float(min(room / extents[:, 0].sum(), tallest / extents[:, 1].max()))
    return room, scale, max(int(np.ceil(scale * extents[:, 1].max())), least)


def _add_image(picture: Picture, image: FloatArray, left: int, bottom: int) -> None:
    """Show an image (h, w, 4) in axes of its own, pixel for pixel."""
    height, width = image.shape[:2]
    size = np.array([picture.bbox.width, picture.bbox.height] * 2)
    axes = picture.add_axes(tuple(np.array([left, bottom, width, height]) / size))
    axes.set_axis_off()
    axes.imshow((255 * image).round().astype(np.uint8), interpolation="none", aspect="auto")


def _add_text(picture: Picture, text: str, x: float, y: float, size: int = TEXT) -> None:
    """Write a text with its middle at a pixel; a dollar sign in it does not start a formula."""
    x, y = x / picture.bbox.width, y / picture.bbox.height
    picture.text(x, y, _drawable(text), ha="center", va="center", size=size, color="black", parse_math=False)


def _drawable(text: str) -> str:
    """Replace the characters that the font lacks, such as line ends and bytes that are no text."""
    font = get_font(findfont(FontProperties()))
    return "".join(
        character if font.get_char_index(ord(character)) else "\N{REPLACEMENT CHARACTER}"
        for character in text
    )


def _add_colour_bar(picture: Picture, values: ValuePanel, left: int, bottom: int, height: int) -> Axes:
    """Add the bar beside a panel; its label is at most a margin longer than the bar at either end, if words allow it."""
    size = np.array([picture.bbox.width, picture.bbox.height] * 2)
    tall = BAR_HEIGHT * height
    axes = picture.add_axes(tuple(np.array([left, bottom + (height - tall) / 2, BAR, tall]) / size))
    bar = picture.colorbar(ScalarMappable(values.scale(), values.colours), cax=axes, extend=values.beyond)
    bar.ax.tick_params(labelsize=TEXT - 2, colors="black")
    bar.ax.yaxis.offsetText.set_fontsize(TEXT - 2)
    lines = _in_lines(_drawable(values.label), tall + 2 * MARGIN)
    bar.set_label("\n".join(lines), size=TEXT - 2, color="black", parse_math=False)
    return bar.ax


def _bar_room(values: ValuePanel, height: int) -> int:
    """Pixels that a colour bar takes beside a panel of a height, with its numbers, its label and a margin."""
    axes = _add_colour_bar(Picture(LEAST_WIDTH, height + 2 * MARGIN), values, 0, MARGIN, height)
    taken = axes.get_tightbbox()
    return MARGIN // 2 + (int(np.ceil(taken.x1)) if taken else 0)


def _in_lines(label: str, length: float) -> list[str]:
    """Break a label of a colour bar into as few lines as fit into a length in pixels, all nearly as long."""

    def broken(n_lines: int) -> list[str]:
        every = (wrap(label, width, break_long_words=False) for width in count(1))
        return next(lines for lines in every if len(lines) <= n_lines)

    measured = Picture(LEAST_WIDTH, LEAST_WIDTH).text(0, 0, "", size=TEXT - 2, parse_math=False)

    def longest(lines: list[str]) -> float:
        measured.set_text("\n".join(lines))
        return measured.get_window_extent().width

    most = len(label.split())
    return next(
        (lines for n in range(1, most) if longest(lines := broken(n)) <= length), broken(max(most, 1))
    )


def png(data: bytes) -> str:
    """Embed a PNG file."""
    return "data:image/png;base64," + b64encode(data).decode("ascii")
