"""Panels of surfaces in a figure, in rows and at a common scale."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from isomatch.values.arrays import FloatArray

Paint = Callable[[FloatArray], FloatArray]


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
