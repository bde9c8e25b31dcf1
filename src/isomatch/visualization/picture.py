"""Figures of surfaces in a row, pixel for pixel, and the colours that show values."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from html import escape
from io import BytesIO
from itertools import count
from textwrap import wrap
from typing import Literal

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties, findfont, get_font
from numpy.typing import ArrayLike

from isomatch._core.arrays import FloatArray, numbers_of
from isomatch._core.cached import cached_property
from isomatch._core.errors import DescriptorError, SettingError
from isomatch.visualization.surface_image import SurfaceView

DPI = 200  # dots per inch; chosen: a letter of 9 points is 25 pixels high
SHARPNESS = 2  # pixels of a picture over pixels of the page, along one axis: 2 on screens of high resolution
MAX_HEIGHT_RATIO = 1.15  # largest height of the panels over their mean width; chosen
MIN_WIDTH = 200  # pixels; smallest width of a picture; chosen
MARGIN, TITLE_HEIGHT = 30, 70  # pixels between panels, and height of a title in pixels; chosen
MIN_BAR_ROOM = 175  # pixels; smallest width of a colour bar with its label; chosen
BAR_WIDTH, BAR_HEIGHT = 24, 0.7  # pixels across a colour bar, and its height over the panel's; chosen
MIN_HEIGHT_BESIDE_BAR = 120  # pixels; least height of panels beside a colour bar, for its label; chosen
TEXT_POINTS = 9  # size of letters in points (1/72 inch); chosen


class Picture(Figure):
    """A matplotlib figure with a size in pixels; ``seen`` describes what it shows."""

    def __init__(self, width: int, height: int, seen: str = "") -> None:
        spare = 1e-6  # pixels added to the width and the height, so that rounding loses no pixel
        super().__init__(((width + spare) / DPI, (height + spare) / DPI), dpi=DPI, facecolor="white")
        FigureCanvasAgg(self)
        self.seen = seen

    def axes_at(self, *place: float) -> Axes:
        """Add axes, whose place is left, bottom, width and height in pixels."""
        return self.add_axes(tuple(np.divide(place, [self.bbox.width, self.bbox.height] * 2)))

    def png(self, *, transparent: bool = False) -> bytes:
        """Return the picture as a PNG file."""
        file = BytesIO()
        self.savefig(file, format="png", dpi=DPI, facecolor="none" if transparent else "white")
        return file.getvalue()

    def html(self, *, transparent: bool = False) -> str:
        """Return the picture as an HTML element, not wider than the page."""
        return (
            f'<img alt="{escape(self.seen)}" width="{round(self.bbox.width / SHARPNESS)}" '
            f'style="max-width:100%;height:auto" src="{png(self.png(transparent=transparent))}">'
        )

    def _repr_html_(self) -> str:
        return self.html()


def compose_picture(
    panels: Sequence[SurfaceView], width: int, *, values: ValuePanel | None = None, title: str, seen: str
) -> Picture:
    """Place panels in a row, all at the same scale, beside a bar that explains the colours of values."""
    if int(width) != width or width < MIN_WIDTH:
        raise SettingError(f"width = {width} is not an integer of at least {MIN_WIDTH} pixels")
    above = TITLE_HEIGHT if title else 0
    below = TITLE_HEIGHT if any(panel.title for panel in panels) else 0
    extents = np.array([panel.extent() for panel in panels])  # widths and heights, (panels, 2)
    right, least = (0, 1) if values is None else (MIN_BAR_ROOM, MIN_HEIGHT_BESIDE_BAR)
    room, scale, height = _fit_panels(extents, width - right, least)
    # A wider bar makes the panels narrower and less high; its label then might need more lines, and a wider bar.
    while values is not None and right < (needed := min(_bar_width(values, height), width // 2)):
        right = needed
        room, scale, height = _fit_panels(extents, width - right, least)
    widths = np.ceil(scale * extents[:, 0]).astype(int)
    widths = np.maximum(widths + (room - int(widths.sum())) // len(panels), 1)
    picture = Picture(width, height + 2 * MARGIN + above + below, seen)
    bottom, left = below + MARGIN, MARGIN
    for panel, panel_width in zip(panels, widths.tolist()):
        image = (255 * panel.pixels(panel_width, height, scale)).round().astype(np.uint8)
        axes = picture.axes_at(left, bottom, panel_width, height)
        axes.set_axis_off()
        axes.imshow(image, interpolation="none", aspect="auto")
        _add_text(picture, panel.title, left + panel_width / 2, bottom / 2)
        left += panel_width + MARGIN
    _add_text(picture, title, width / 2, bottom + height + MARGIN + above / 2, size=TEXT_POINTS + 2)
    if values is not None:
        _add_colour_bar(picture, values, width - right, bottom, height)
    return picture


def _fit_panels(extents: FloatArray, width: int, least: int) -> tuple[int, float, int]:
    """Return the row's width, pixels per unit of the extents (n, 2), and the row's height."""
    room = max(width - MARGIN * (len(extents) + 1), len(extents))
    tallest = MAX_HEIGHT_RATIO * room / len(extents)
    scale = float(min(room / extents[:, 0].sum(), tallest / extents[:, 1].max()))
    return room, scale, max(int(np.ceil(scale * extents[:, 1].max())), least)


def _add_text(picture: Picture, text: str, x: float, y: float, size: int = TEXT_POINTS) -> None:
    """Write a text with its middle at a pixel; a dollar sign in it does not start a formula."""
    x, y = x / picture.bbox.width, y / picture.bbox.height
    picture.text(x, y, _drawable(text), ha="center", va="center", size=size, color="black", parse_math=False)


def _drawable(text: str) -> str:
    """Replace the characters that the font lacks, such as line ends and bytes that are no text."""
    font = get_font(findfont(FontProperties()))
    return "".join(c if font.get_char_index(ord(c)) else "\N{REPLACEMENT CHARACTER}" for c in text)


def _add_colour_bar(picture: Picture, values: ValuePanel, left: int, bottom: int, height: int) -> Axes:
    """Add the bar beside a panel; its label may exceed the bar by a margin at each end."""
    tall = BAR_HEIGHT * height
    axes = picture.axes_at(left, bottom + (height - tall) / 2, BAR_WIDTH, tall)
    bar = picture.colorbar(ScalarMappable(values.scale(), values.colours), cax=axes, extend=values.beyond)
    bar.ax.tick_params(labelsize=TEXT_POINTS - 2, colors="black")
    bar.ax.yaxis.offsetText.set_fontsize(TEXT_POINTS - 2)
    lines = _break_label(_drawable(values.label), tall + 2 * MARGIN)
    bar.set_label("\n".join(lines), size=TEXT_POINTS - 2, color="black", parse_math=False)
    return bar.ax


def _bar_width(values: ValuePanel, height: int) -> int:
    """Measure the width in pixels of a colour bar with its numbers, label and a margin."""
    axes = _add_colour_bar(Picture(MIN_WIDTH, height + 2 * MARGIN), values, 0, MARGIN, height)
    taken = axes.get_tightbbox()
    return MARGIN // 2 + (int(np.ceil(taken.x1)) if taken else 0)


def _break_label(label: str, length: float) -> list[str]:
    """Break a label into the fewest lines, of similar length, that fit a length in pixels."""

    def break_into(n_lines: int) -> list[str]:
        every = (wrap(label, width, break_long_words=False) for width in count(1))
        return next(lines for lines in every if len(lines) <= n_lines)

    measured = Picture(MIN_WIDTH, MIN_WIDTH).text(0, 0, "", size=TEXT_POINTS - 2, parse_math=False)

    def longest(lines: list[str]) -> float:
        measured.set_text("\n".join(lines))
        return measured.get_window_extent().width

    most = max(len(label.split()), 1)
    choices = (break_into(n) for n in range(1, most))
    return next((lines for lines in choices if longest(lines) <= length), break_into(most))


def png(data: bytes) -> str:
    """Embed a PNG file."""
    return "data:image/png;base64," + b64encode(data).decode("ascii")


def vertex_values(values: ArrayLike, n: int, name: str) -> FloatArray:
    """Return n values, nan where not finite; `DescriptorError` if there is not one for each vertex."""
    rows = numbers_of(values, name, DescriptorError)
    if rows.shape != (n,):
        raise DescriptorError(f"{name}: shape {rows.shape}; expected ({n},), one number for each vertex")
    return np.where(np.isfinite(rows), rows, np.nan)


# share of the values below the lower end of a colour bar, and above its upper end; chosen
OUTLIER_SHARE = 0.01
# A colour bar is symmetric around 0 if its lowest value is negative, its highest positive, and the smaller of their
# absolute values exceeds this share of the larger; chosen.
BOTH_SIGNS_RATIO = 0.2
# A colour bar of positive values begins at 0, not at the lowest value, if the lowest over the highest value is below
# this; chosen.
ZERO_START_RATIO = 0.5
# colour maps for values of one sign, and of both signs; the colour-blind can read them
ONE_SIGN_MAP, BOTH_SIGNS_MAP = "cividis", "PuOr_r"


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
        Value of the brightest colour, from 0; by default the bar spans all but a per cent of the values at either end,
        from 0 if they begin near it, and symmetric around 0 if they have both signs.
    colour_map : str, optional
        Name of a colour map of matplotlib; by default ``"cividis"``, or ``"PuOr_r"`` for values of
        both signs.

    Raises
    ------
    SettingError
        If matplotlib has no such colour map.
    """

    values: ArrayLike
    label: str = ""
    highest: float | None = None
    colour_map: str | None = None

    def __post_init__(self) -> None:
        if self.colour_map is not None and self.colour_map not in colormaps:
            raise SettingError(
                f"colour_map = {self.colour_map!r} is no colour map of matplotlib; 'cividis', 'viridis' and 'PuOr_r' are"
            )

    def scale(self) -> Normalize:
        """Return the scale, which begins at the value of the first colour and ends at the last."""
        return Normalize(*self._ends)

    @property
    def colours(self) -> str:
        """Name of the colour map."""
        return self.colour_map or (BOTH_SIGNS_MAP if self._ends[0] == -self._ends[1] else ONE_SIGN_MAP)

    @property
    def beyond(self) -> Literal["neither", "min", "max", "both"]:
        """The ends of the scale that values exceed."""
        low, high = self._ends
        below, above = bool((self._finite < low).any()), bool((self._finite > high).any())
        return "both" if below and above else "min" if below else "max" if above else "neither"

    def rows(self, n: int) -> FloatArray:
        """Return n values, nan where not finite; `DescriptorError` if there are not n."""
        return vertex_values(self.values, n, "values")

    def paint(self, values: FloatArray) -> FloatArray:
        """Screen colours (m, 3) of values (m, 1); nan of nan."""
        return colour_scale(self.colours, *self._ends)(values)

    @cached_property
    def _finite(self) -> FloatArray:
        values = np.asarray(self.values, dtype=np.float64).ravel()
        return values[np.isfinite(values)]

    @cached_property
    def _ends(self) -> tuple[float, float]:
        if self.highest:
            return 0.0, self.highest
        if not len(self._finite):
            return 0.0, 1.0
        low, high = np.quantile(self._finite, [OUTLIER_SHARE, 1 - OUTLIER_SHARE]).tolist()
        if low == high:
            low, high = float(self._finite.min()), float(self._finite.max())
        most = max(abs(low), abs(high))
        if -low > BOTH_SIGNS_RATIO * most and high > BOTH_SIGNS_RATIO * most:
            return -most, most
        low = 0.0 if 0.0 <= low < ZERO_START_RATIO * high else low
        return low, high if high > low else low + 1.0


Paint = Callable[[FloatArray], FloatArray]  # a function from values (m, 1) to screen colours (m, 3)


def colour_scale(name: str, low: float, high: float, bands: int = 0) -> Paint:
    """Make a function from values to screen colours of a colour map, nan of nan; bands have level lines as borders."""
    colour_map = colormaps[name]

    def paint(values: FloatArray) -> FloatArray:
        share = np.clip((values[:, 0] - low) / (high - low), 0.0, 1.0)
        if bands:
            share = (np.minimum(np.floor(share * bands), bands - 1) + 0.5) / bands
        return np.where(np.isnan(share)[:, None], np.nan, colour_map(share)[:, :3])

    return paint


def arranged_panels(
    images: Sequence[FloatArray],
    titles: Sequence[str],
    per_row: int,
    width: float = 8.5,
    title_size: float = 8.0,
) -> tuple[Figure, list[Axes]]:
    """Arrange pictures (h, w, 4) of a common scale in rows; return a figure, ``width`` inches wide, and their axes."""
    cell = np.max([image.shape[:2] for image in images], axis=0)
    n_rows = -(-len(images) // per_row)
    height = width / per_row * cell[0] / cell[1] + 0.3
    figure = Figure((width, n_rows * height), layout="constrained")
    grid = figure.subplots(n_rows, per_row, squeeze=False).ravel()
    for axes in grid:
        axes.set_axis_off()
    for axes, image, title in zip(grid, images, titles):
        padded = np.zeros((*cell, 4))
        top, left = (cell - image.shape[:2]) // 2
        padded[top : top + image.shape[0], left : left + image.shape[1]] = image
        axes.imshow((255 * padded).round().astype(np.uint8), interpolation="antialiased")
        axes.set_title(title, size=title_size, parse_math=False)
    return figure, list(grid[: len(images)])
