"""Colours for the regions of a surface: neighbours contrast, also for the colour-blind."""

from __future__ import annotations

import numpy as np
from matplotlib.colors import to_rgb

from isomatch._core.arrays import FloatArray, IntArray

PALETTE = (  # colours of regions
    "#0b3c5d", "#0072b2", "#56b4e9", "#b5dcf5", "#3d3d8f",
    "#5c3d00", "#a86f00", "#e69f00", "#f7d278", "#f0e442",
    "#5b1046", "#9c3480", "#cc79a7", "#efc4dc", "#8c8c8c",
    "#00442f", "#009e73", "#7fd0b5", "#d55e00", "#f4f4f4",
)  # fmt: skip
TRIALS = 4000  # number of random assignments of colours to regions; the best one is kept; chosen
DEUTERANOPIA = np.array([[0.367, 0.861, -0.228], [0.280, 0.673, 0.047], [-0.012, 0.043, 0.969]])
"""Perceived linear light without green cones: Machado, Oliveira & Fernandes 2009."""


def region_colours(distances: FloatArray, faces: IntArray) -> FloatArray:
    """Give each region, by distances (n, regions) to its centre, a screen colour that contrasts with its neighbours'."""
    n_regions = distances.shape[1]
    owner = distances.argmin(axis=1)[faces]
    pairs = np.unique(np.sort(np.vstack([owner[:, :2], owner[:, 1:], owner[:, ::2]]), axis=1), axis=0)
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    screen = np.array([to_rgb(colour) for colour in PALETTE])
    # the contrast of two colours is their distance, with lightness counted double, for normal or for red–green blind
    # vision, whichever is smaller. The seeded random assignment with the largest least contrast between neighbours wins
    contrast = np.minimum(
        _contrasts(screen), _contrasts(np.clip(screen**2.2 @ DEUTERANOPIA.T, 0, 1) ** (1 / 2.2))
    )
    rng = np.random.default_rng(0)
    orders = np.array([rng.permutation(len(PALETTE))[:n_regions] for _ in range(TRIALS)])
    least = contrast[orders[:, pairs[:, 0]], orders[:, pairs[:, 1]]].min(axis=1)
    return np.asarray(screen[orders[least.argmax()]], dtype=np.float64)


def _contrasts(screen: FloatArray) -> FloatArray:
    """Distances (c, c) between colours."""
    lightness = screen @ [0.3, 0.6, 0.1]
    coordinates = np.column_stack([2 * lightness, screen[:, 2] - lightness, screen[:, 0] - lightness])
    differences: FloatArray = np.linalg.norm(coordinates[:, None] - coordinates[None], axis=2)
    return differences
