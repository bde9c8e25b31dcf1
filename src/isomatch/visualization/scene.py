"""The data with which a browser draws both shapes, their maps and layers of values; large shapes are simplified."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from matplotlib import colormaps
from numpy.typing import ArrayLike

from isomatch._core.arrays import FloatArray, IntArray
from isomatch._core.errors import DescriptorError
from isomatch.correspondence import Correspondence
from isomatch.matching import MatchResult
from isomatch.surfaces import Mesh
from isomatch.visualization.camera import camera_of, of_ordinary_size, turn_to_target
from isomatch.visualization.colours import UNMATCHED_GREY, position_colours
from isomatch.visualization.picture import vertex_values
from isomatch.visualization.viewer import MAX_SHOWN, DrawnSurface, encoded, encoded_colours, encoded_normals

Side = Literal["source", "target"]  # one of the two shapes of a match


def scene_of(
    source: Mesh,
    target: Mesh,
    maps: Mapping[str, Correspondence],
    *,
    layers: Mapping[str, Layer] | None = None,
    landmarks: IntArray | None = None,
    most: int = MAX_SHOWN,
) -> dict[str, Any]:
    """Collect the data of a report's 3D view; layers are values at the source's vertices under the first map."""
    # The dictionary has plain values, for JSON; arrays are little-endian, in base 64:
    # source, target: as `DrawnSurface.packed`, with colours (uint8 × 3) of the target
    # filed: the rotation (3 rows) that turns the source back to its orientation in the file
    # maps: for each map its name, and at each shown source vertex: images (int32, the user's index of the target vertex,
    #   −1 if unmatched), points and normals of the precise images, colours, and layers by name, see `Layer.packed`
    first = next(iter(maps.values()), None)
    drawn = DrawnPair(source, target, first, landmarks=landmarks, most=most)
    return {**drawn.shapes(), **drawn.maps(maps, layers or {})}


class DrawnPair:
    """Both shapes as a browser draws them; maps between them can be added later."""

    def __init__(
        self,
        source: Mesh,
        target: Mesh,
        facing: Correspondence | None = None,  # The source is turned to face like the target under this map.
        *,
        landmarks: IntArray | None = None,  # Simplification keeps the vertices of these pairs, (q, 2).
        most: int = MAX_SHOWN,
    ) -> None:
        self._source, self._target = of_ordinary_size(source), of_ordinary_size(target)
        self._camera = camera_of(self._target)
        self._turn = self._turn_of(facing)
        kept = np.zeros((2, 0), dtype=np.int64) if landmarks is None else landmarks.T
        self._from_source = DrawnSurface(self._source, self._camera @ self._turn, most, kept[0])
        self._from_target = DrawnSurface(self._target, self._camera, most, kept[1])
        self._colours = position_colours(self._target)

    def shapes(self) -> dict[str, Any]:
        """Return ``source``, ``target`` and ``filed`` of `scene_of`."""
        lying = self._from_source.points[self._from_source.index] @ self._filed(self._turn).T
        at_source = self._from_source.packed()
        at_source["extent"] = np.maximum(at_source["extent"], 2 * np.abs(lying).max(axis=0)).tolist()
        at_target = self._from_target.packed(self._colours)
        return {"source": at_source, "target": at_target, "filed": self._filed(self._turn).ravel().tolist()}

    def maps(self, maps: Mapping[str, Correspondence], layers: Mapping[str, Layer]) -> dict[str, Any]:
        """Return ``maps`` of `scene_of`, and the ``filed`` of the first; ``layers`` are values under that."""
        packed: list[dict[str, Any]] = []
        for name, correspondence in maps.items():
            map_layers = {"stretch": stretch(self._source, self._target, correspondence)}
            map_layers |= {} if packed else dict(layers)
            packed.append({"name": name, **self._packed_map(correspondence, map_layers)})
        turn = self._turn_of(next(iter(maps.values()), None))
        return {"filed": self._filed(turn).ravel().tolist(), "maps": packed}

    def _packed_map(self, correspondence: Correspondence, layers: Mapping[str, Layer]) -> dict[str, Any]:
        index, target = self._from_source.index, self._from_target
        columns = target.points, target.normals, self._colours
        points, normals, colours = (correspondence.pull_back(values)[index] for values in columns)
        unmatched = ~correspondence.matched[index]
        points[unmatched], normals[unmatched], colours[unmatched] = 0.0, 0.0, UNMATCHED_GREY
        return {
            "images": encoded(correspondence.vertices[index], "<i4"),
            "points": encoded(points, "<f4"),
            "normals": encoded_normals(normals),
            "colours": encoded_colours(colours),
            "layers": {name: layer.packed(index) for name, layer in layers.items()},
        }

    def shown_near(self, side: Side, vertex: int) -> int:
        """Return a vertex if it is shown, or else the nearest one that is; user's indices."""
        shape = self._from_source if side == "source" else self._from_target
        if vertex in shape.index:
            return vertex
        distances = np.linalg.norm(shape.points[shape.index] - shape.points[vertex], axis=1)
        return int(shape.index[distances.argmin()])

    def _turn_of(self, facing: Correspondence | None) -> FloatArray:
        return np.eye(3) if facing is None else turn_to_target(self._source, self._target, facing)

    def _filed(self, turn: FloatArray) -> FloatArray:
        """Return the rotation, in camera coordinates, that undoes a turn of the source."""
        return self._camera @ turn.T @ self._camera.T


# Names of the layers of colours that reports make by themselves: the first two for each map, the last three only for
# the map of the result.
BUILT_IN_LAYERS = ("position", "stretch", "expected error", "descriptor distance", "doubt")
# number of colours of a scale sent to the browser, which interpolates between them; chosen
N_RAMP_COLOURS = 9
# byte sent to the browser for the upper end of a scale (0 is the lower end), and for a vertex without a value
MAX_LEVEL, NO_VALUE_LEVEL = 254, 255
# √(target area); the scale of expected errors ends here or higher; an image with this error has a confidence of ½
MIN_ERROR_RANGE = 0.05
# upper end of the colours of descriptor distances, in standard deviations of the descriptor; chosen: two random points
# have a distance of about 0.8 on average
DESCRIPTOR_RANGE = 1.0
# largest share of the values below the lower end of a scale, or above its upper end; chosen
OUTLIER_SHARE = 0.02


@dataclass(frozen=True, eq=False)
class Layer:
    """Values at the source's vertices."""

    values: FloatArray  # a value for each source vertex, (n_source,); nan is drawn grey
    low: float  # value at the lower end of the scale of colours
    high: float  # value at the upper end of the scale of colours
    meaning: str = ""  # what the legend says
    ratio: bool = False  # whether the scale of colours is logarithmic, with a neutral colour in the middle

    def packed(self, index: IntArray) -> dict[str, Any]:
        """Plain values for JSON; ``levels`` are uint8 at the vertices of ``index``, 255 where there is no value."""
        scaled = np.log if self.ratio else np.asarray
        low, high, values = scaled(self.low), scaled(self.high), scaled(self.values[index])
        shares = np.clip((values - low) / (high - low), 0.0, 1.0)
        ramp = colormaps["PuOr_r" if self.ratio else "cividis"](np.linspace(0.0, 1.0, N_RAMP_COLOURS))[:, :3]
        return {
            "low": self.low,
            "high": self.high,
            "ratio": self.ratio,
            "meaning": self.meaning,
            "ramp": np.rint(255 * ramp).astype(int).tolist(),
            "levels": encoded(np.where(np.isnan(shares), NO_VALUE_LEVEL, np.rint(MAX_LEVEL * shares)), "u1"),
        }


def layers_of(result: MatchResult) -> dict[str, Layer]:
    """Make the layers of a result: regions of doubt, expected error, descriptor distance."""
    layers = {}
    if result.regions:
        values = np.full(len(result.map.vertices), np.nan)
        values[np.concatenate([region.vertices for region in result.regions])] = 1.0
        layers["doubt"] = Layer(values, 0.0, 1.0, "the regions of doubt, all else in grey")
    errors, descriptor_distance = result.expected_error, result.descriptor_distance
    if np.isfinite(errors).any():
        high = max(MIN_ERROR_RANGE, float(np.nanquantile(errors, 1 - OUTLIER_SHARE)))
        meaning = "distance of an image from the right one, in √area"
        layers["expected error"] = Layer(errors, 0.0, high, meaning)
    if descriptor_distance is not None and np.isfinite(descriptor_distance).any():
        meaning = "how differently the shapes look here, in standard deviations"
        layers["descriptor distance"] = Layer(descriptor_distance, 0.0, DESCRIPTOR_RANGE, meaning)
    return layers


def user_layers(values: Mapping[str, ArrayLike], n_source: int) -> dict[str, Layer]:
    """Make layers of named values, after checks of names and lengths (`DescriptorError`)."""
    layers = {}
    for name, layer_values in values.items():
        if name in BUILT_IN_LAYERS:
            raise DescriptorError(f"every report has a layer {name!r} of its own; give yours another name")
        rows = vertex_values(layer_values, n_source, f"layer {name!r}")
        low, high = 0.0, 1.0
        if np.isfinite(rows).any():
            low, high = np.nanquantile(rows, [OUTLIER_SHARE, 1 - OUTLIER_SHARE])
        low = 0.0 if 0.0 <= low < 0.5 * high else float(low)
        layers[name] = Layer(rows, low, float(high) if high > low else low + 1.0)
    return layers


def stretch(source: Mesh, target: Mesh, correspondence: Correspondence) -> Layer:
    """Compute how much the edges at each vertex are stretched, relative to the median."""
    # The stretch at a vertex is √(Σ |φ(a) − φ(b)|² / Σ |a − b|²), where both sums run over its edges ab whose ends have
    # images φ(a), φ(b).
    images = correspondence.pull_back(target.vertices)  # images are nan where unmatched
    a, b = source.edges.T
    before = ((source.vertices[a] - source.vertices[b]) ** 2).sum(axis=1)
    after = ((images[a] - images[b]) ** 2).sum(axis=1)
    mapped = np.isfinite(after)
    corners = np.concatenate([a[mapped], b[mapped]])
    long, short = (np.bincount(corners, np.tile(x[mapped], 2), source.n_vertices) for x in (after, before))
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.sqrt(long / short)
    ratio = np.where(np.isfinite(ratio), np.maximum(ratio, 1e-9), np.nan)
    middle = float(np.nanmedian(ratio)) if np.isfinite(ratio).any() else 1.0
    return Layer(ratio / middle, 0.5, 2.0, "lengths under the map; × 1 is the median", ratio=True)
