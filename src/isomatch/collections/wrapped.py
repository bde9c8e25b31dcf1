"""The shapes of a collection in the topology of its template, each with a small picture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.image import imsave

from isomatch.assets import Asset, Attribute, mesh_from, write_asset
from isomatch.collections.kept import digest_of
from isomatch.collections.layout import Layout
from isomatch.collections.map_file import Record, as_matched, maps_of_pair
from isomatch.collections.pairs import Pair
from isomatch.collections.shapes import Entry
from isomatch.correspondence import Correspondence, WrapQuality, median_map, wrap
from isomatch.errors import IsomatchError, UnwritableFileError
from isomatch.statistics import MEASURED
from isomatch.storage.files import is_of_one_file, replaced
from isomatch.surfaces import Mesh, reflected
from isomatch.view import camera_of, position_colours, surface_image, to_screen, turn_to_target

MOST_WAYS = 20  # over other shapes; as many as were measured
PIXELS_PER_UNIT = 110.0  # of a thumbnail: about 200 pixels tall


class PlannedSurface(NamedTuple):
    """A shape to be drawn with the vertices of the template.

    Parameters
    ----------
    entry : Entry
        The shape.
    pair : (str, str), optional
        The pair with the template; None for the template itself.
    key : str
        Identifies the map, and with it the surface.
    scale : float
        What its positions are multiplied by, so that they are in the units of the others.
    ways : tuple of Entry or None
        How the template's vertices come to it: by the map of the pair (None), and over other shapes. Of several ways, the
        median of the images is taken.
    """

    entry: Entry
    pair: Pair | None
    key: str
    scale: float = 1.0
    ways: tuple[Entry | None, ...] = (None,)

    def scaled(self, factor: float) -> PlannedSurface:
        """Return the same surface with positions multiplied by a factor."""
        return self if factor == 1 else self._replace(scale=factor, key=f"{self.key} × {factor:.6g}")


@dataclass(frozen=True)
class WrapJob:
    """The data that all surfaces of a collection share.

    Parameters
    ----------
    layout : Layout
        The folder.
    template : Entry
        The template.
    """

    layout: Layout
    template: Entry

    def wrap_shapes(self, plans: Sequence[PlannedSurface]) -> list[Record]:
        """Write shapes with the vertices of the template, and their pictures; return a line about each."""
        return [self._line(plan) for plan in plans]

    def _line(self, plan: PlannedSurface) -> Record:
        name = plan.entry.name
        line: Record = {"name": name, "key": plan.key, **asdict(WrapQuality(0.0, 1.0, 0.0, 0))}
        line |= {"scale": plan.scale if plan.scale != 1 else "", "ways": len(plan.ways)}
        try:
            template, mesh = map(_mesh, (self.template, plan.entry))
            marks: list[Attribute] = []
            if plan.pair is None:
                template = mesh = reflected(mesh) if plan.entry.reflected else mesh
            else:
                there = self._map(plan, template, mesh)
                turned = self.template.reflected, plan.entry.reflected
                there, template, mesh = as_matched(there, template, mesh, turned)
                wrapped = wrap(there, template, mesh)
                mesh = wrapped.mesh
                line |= asdict(wrapped.quality)
                if wrapped.extended.any():
                    marks = [Attribute(MEASURED, "point", "label", (~wrapped.extended).astype(np.uint8))]
            mesh = mesh.moved(plan.scale * mesh.vertices)
            write_asset(self.layout.corresponded(name), Asset.of_mesh(mesh, marks))
            line["file"] = digest_of(self.layout.corresponded(name))
            _draw(template, mesh, self.layout.thumbnail(name))
        except (IsomatchError, OSError, ValueError, ArithmeticError) as error:
            if isinstance(error, UnwritableFileError) and not is_of_one_file(error):
                raise  # as on a full disk: the shape is not to blame
            line["error"] = f"{type(error).__name__}: {error}"
        return line

    def _map(self, plan: PlannedSurface, template: Mesh, mesh: Mesh) -> Correspondence:
        """Return the map from the template, between the surfaces in the files: the median of all ways."""
        centre, name = self.template.name, plan.entry.name
        maps = []
        for over in plan.ways:
            if over is None:
                maps.append(maps_of_pair(self.layout, centre, name).there)
                continue
            first, second = (
                maps_of_pair(self.layout, *pair).there for pair in ((centre, over.name), (over.name, name))
            )
            maps.append(first.then(second, _mesh(over), mesh))
        return median_map(maps, mesh) if len(maps) > 1 else maps[0]


def _draw(template: Mesh, mesh: Mesh, path: Path) -> None:
    """Draw a shape in the colours of the template's positions, turned like the template."""
    turned = camera_of(template) @ turn_to_target(
        mesh, template, Correspondence(np.arange(mesh.n_vertices), mesh.n_vertices)
    )
    image = surface_image(mesh, position_colours(template), to_screen, turned, PIXELS_PER_UNIT)
    with replaced(path) as file:
        imsave(file, np.clip(image, 0.0, 1.0), format="png")


def _mesh(entry: Entry) -> Mesh:
    return _read(entry.path, entry.path.stat().st_mtime_ns)


@lru_cache(MOST_WAYS + 2)
def _read(path: Path, changed: int) -> Mesh:
    """Read a mesh, or take it from memory if its file has not changed since."""
    return mesh_from(path)
