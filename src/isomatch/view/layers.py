"""Layers of a report: named values at the source's vertices, with their colours."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib import colormaps
from numpy.typing import ArrayLike

from isomatch.correspondence import Correspondence
from isomatch.errors import DescriptorError
from isomatch.matching import MatchResult
from isomatch.surfaces import Mesh
from isomatch.values.arrays import FloatArray, IntArray, numbers_of

# the first two are there of every map
BUILT_IN = ("position", "stretch", "expected error", "mismatch", "doubt")
N_STOPS = 9  # colours of a ramp between which a browser interpolates
LEVELS = 254  # levels of a stored value
NO_VALUE = 255
LARGE_ERROR = 0.05  # √area; the confidence there is ½
MISMATCHED = 1.0  # standard deviations; points drawn at random differ by about 0.8
OUTLIERS = 0.02  # share of the values that may lie beyond the ends of the ramp


@dataclass(frozen=True, eq=False)
class Layer:
    """Values at the source's vertices.

    Parameters
    ----------
    values : (n_source,) array of float
        The values; ``nan`` is drawn grey.
    low, high : float
        Values at the ends of the ramp.
    meaning : str
        What they are, in a few words.
    ratio : bool
        Whether they are ratios, on a logarithmic ramp whose middle is neutral.
    """

    values: FloatArray
    low: float
    high: float
    meaning: str = ""
    ratio: bool = False

    def packed(self, index: IntArray) -> dict[str, Any]:
        """Plain values for JSON; ``levels`` is uint8 at the vertices of ``index``: 0 … 254, 255 where there is none."""
        scaled = np.log if self.ratio else np.asarray
        low, high, values = scaled(self.low), scaled(self.high), scaled(self.values[index])
        shares = np.clip((values - low) / (high - low), 0.0, 1.0)
        ramp = colormaps["PuOr_r" if self.ratio else "cividis"](np.linspace(0.0, 1.0, N_STOPS))[:, :3]
        return {
            "low": self.low,
            "high": self.high,
            "ratio": self.ratio,
            "meaning": self.meaning,
            "ramp": np.rint(255 * ramp).astype(int).tolist(),
            "levels": np.where(np.isnan(shares), NO_VALUE, np.rint(LEVELS * shares)).astype(np.uint8),
        }


def known_layers(result: MatchResult) -> dict[str, Layer]:
    """Layers of all that a result knows of its map: the regions of doubt, the expected error, the mismatch."""
    return {**doubt(result), **expected_error(result), **mismatch(result)}


def user_layers(values: Mapping[str, ArrayLike], n_source: int) -> dict[str, Layer]:
    """Check values by name, and let the ramp span all but the outliers; `DescriptorError` if they do not fit."""
    layers = {}
    for name, layer_values in values.items():
        if name in BUILT_IN:
            raise DescriptorError(f"every report has a layer {name!r} of its own; give yours another name")
        rows = numbers_of(layer_values, f"layer {name!r}", DescriptorError)
        if rows.shape != (n_source,):
            raise DescriptorError(
                f"layer {name!r} has shape {rows.shape}, expected one value for each of the {n_source} source vertices"
            )
        rows = np.where(np.isfinite(rows), rows, np.nan)
        low, high = np.nanquantile(rows, [OUTLIERS, 1 - OUTLIERS]) if np.isfinite(rows).any() else (0.0, 1.0)
        low = 0.0 if 0.0 <= low < 0.5 * high else float(low)
        layers[name] = Layer(rows, low, float(high) if high > low else low + 1.0)
    return layers


def expected_error(result: MatchResult) -> dict[str, Layer]:
    """Show the expected error of each image, from 0 to at least 0.05 √area; nothing where none is known."""
    errors = result.expected_error
    if not np.isfinite(errors).any():
        return {}
    high = max(LARGE_ERROR, float(np.nanquantile(errors, 1 - OUTLIERS)))
    return {"expected error": Layer(errors, 0.0, high, "distance of an image from the right one, in √area")}


def mismatch(result: MatchResult) -> dict[str, Layer]:
    """Show how differently the shapes look around each vertex and its image; nothing where it is not known."""
    if result.mismatch is None or not np.isfinite(result.mismatch).any():
        return {}
    meaning = "how differently the shapes look here, in standard deviations"
    return {"mismatch": Layer(result.mismatch, 0.0, MISMATCHED, meaning)}


def doubt(result: MatchResult) -> dict[str, Layer]:
    """Show the regions of doubt, all else in grey; nothing where the map is not doubtful."""
    if not result.regions:
        return {}
    values = np.full(len(result.map.vertices), np.nan)
    values[np.concatenate([region.vertices for region in result.regions])] = 1.0
    return {"doubt": Layer(values, 0.0, 1.0, "the regions of doubt, all else in grey")}


def stretch(source: Mesh, target: Mesh, correspondence: Correspondence) -> Layer:
    """Compute how much the edges at each vertex are stretched, relative to the median.

    Root of the sum of the squared lengths of the edges' images over that of the edges, of those with two images.
    """
    images = correspondence.pull_back(target.vertices)  # nan where unmatched
    a, b = source.edges.T
    before = ((source.vertices[a] - source.vertices[b]) ** 2).sum(axis=1)
    after = ((images[a] - images[b]) ** 2).sum(axis=1)
    mapped = np.isfinite(after)
    corners = np.concatenate([a[mapped], b[mapped]])
    sums = [
        np.bincount(corners, np.tile(squares[mapped], 2), source.n_vertices) for squares in (after, before)
    ]
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.sqrt(sums[0] / sums[1])
    ratio = np.where(np.isfinite(ratio), np.maximum(ratio, 1e-9), np.nan)
    middle = float(np.nanmedian(ratio)) if np.isfinite(ratio).any() else 1.0
    return Layer(ratio / middle, 0.5, 2.0, "lengths under the map; × 1 is the median", ratio=True)
