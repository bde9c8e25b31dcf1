"""Landmarks of some shapes of a collection, carried to the others: the median of what each of them gives."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator, Mapping
from functools import lru_cache
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib import colormaps
from scipy.spatial import cKDTree

from isomatch._core.arrays import FloatArray
from isomatch._core.errors import InputError, IsomatchError
from isomatch._core.files import replaced
from isomatch.cohort.collection import Collection
from isomatch.cohort.map_file import maps_along, require_unchanged
from isomatch.correspondence import Correspondence
from isomatch.io import Asset, read_asset, read_mesh
from isomatch.landmarks import Landmarks, median_landmarks, spread_on_surface
from isomatch.surfaces import Mesh, reflected
from isomatch.transfer import carry_landmarks
from isomatch.visualization import arranged_panels, camera_of, surface_image, turn_to_target

MOST_DRAWN = 24  # shapes
PER_ROW = 6
RESOLUTION = 220.0  # pixels per √area
RADIUS = 0.02  # √area: of a dot
GREY = 0.82

logger = logging.getLogger(__name__)


class LeftOut(NamedTuple):
    """The landmarks that the other templates give for a shape of which they are known."""

    name: str
    carried: Landmarks  # with its expected errors and spread
    error: FloatArray  # (m,) distance of each from the known one, in units of the shape; nan where either has no place


def collected_landmarks(
    collection: Collection,
    files: Mapping[str, str | Path],
    curve_points: int | None = None,
    patches: Mapping[str, str | Path] | None = None,
    surface_points: int = 0,
) -> Iterator[tuple[str, Landmarks]]:
    """Carry the landmarks of some shapes, the templates, to all others.

    Used are the maps of a template with a shape or, where they are not matched with each other, those on the shortest
    path between them, one after the other. Doubtful maps are not used, see `Rows.is_doubtful`; a shape that no other map
    leads to is left out; so is one that fails, with a warning.

    Parameters
    ----------
    collection : Collection
        The collection.
    files : mapping of str to path_like
        File of the landmarks of each template, by its name.
    curve_points : int, optional
        Number of points on each curve; by default as many as it was drawn with.
    patches : mapping of str to path_like, optional
        File of the surface semilandmarks of each template, in one order; they are named surface-1, surface-2, ….
    surface_points : int
        How many more are spread over the first template, and carried to the others.

    Yields
    ------
    str, Landmarks
        Each shape of the collection, and its landmarks: of a template its own, with the points of curves equally spaced;
        of another the medians over templates, with their ``spread`` and ``expected_error``. Of maps one after the
        other, this is the root of the sum of squares.

    Raises
    ------
    InputError
        If a name is no shape of the collection, or there is no template.
    FormatError, LandmarkError
        If a file cannot be read, its landmarks are not on the shape, or maps were changed after they were written.
    """
    templates = _Templates(collection, files, curve_points)
    templates.add_patches(patches or {}, surface_points)
    for name in collection.names:
        try:
            marks = templates.own(name) if name in files else templates.carried(name, files)
        except IsomatchError as error:
            if name in files:
                raise
            logger.warning("%s is left out: %s", name, error)
            continue
        if marks is not None:
            yield name, marks


def landmarks_left_out(
    collection: Collection, files: Mapping[str, str | Path], curve_points: int | None = None
) -> Iterator[LeftOut]:
    """Carry to each template what all others give for it, and compare: errors to be expected of unmarked shapes."""
    templates = _Templates(collection, files, curve_points)
    for name in files:
        carried = templates.carried(name, [other for other in files if other != name])
        if carried is not None:
            own = templates.own(name)
            apart = carried.positions - _positions(own, carried.names)
            yield LeftOut(name, carried, np.asarray(np.linalg.norm(apart, axis=1)))


def _positions(marks: Landmarks, names: tuple[str, ...]) -> FloatArray:
    """Positions of landmarks with given names, nan of one that there is not; in their order if they have these names."""
    if marks.names == names:
        return marks.positions
    place = dict(zip(marks.names, marks.positions))
    nowhere = np.full(3, np.nan)
    return np.array([place.get(name, nowhere) for name in names]).reshape(-1, 3)


class _Templates:
    """The shapes that have landmarks, and what they give for others."""

    def __init__(self, collection: Collection, files: Mapping[str, str | Path], n_points: int | None) -> None:
        if unknown := [name for name in files if name not in collection.paths]:
            raise InputError(
                f"{', '.join(unknown)}: no shapes of {collection.folder}; files are named like shapes"
            )
        if not files:
            raise InputError("no landmarks; give a file for one shape of the collection or more")
        require_unchanged(collection.layout, ["maps"])
        self._collection, self._curve_points = collection, n_points
        self._rows = collection.rows()
        self._read = lru_cache(len(files) + 2)(lambda name: read_asset(collection.paths[name]))
        self._marks = {name: Landmarks.read(path, self._read(name)) for name, path in files.items()}

    def add_patches(self, files: Mapping[str, str | Path], surface_points: int) -> None:
        """Append surface semilandmarks: of a file for each template, and spread over the first and carried to others."""
        if files and set(files) != set(self._marks):
            raise InputError("patches: give those of all shapes that have landmarks, and of no others")
        for name, path in files.items():
            own = Landmarks.read(path, self._read(name)).turned(self._marks[name].axes)
            self._marks[name] = self._marks[name].with_patch(own.positions)
        if surface_points:
            first, *others = self._marks
            start, marks = self._read(first), self._marks[first]
            spread = spread_on_surface(_unwelded(start), surface_points, marks.positions[marks.placed])
            self._marks[first] = marks.with_patch(spread)
            for name in others:
                there, _ = self._map(first, name)
                at = np.full_like(spread, np.nan)
                if there is not None:
                    at = carry_landmarks(there, start, self._read(name), Landmarks(spread)).positions
                self._marks[name] = self._marks[name].with_patch(at)

    def own(self, name: str) -> Landmarks:
        """Return the landmarks of a template, with the points of its curves equally spaced."""
        shape = self._read(name)
        itself = Correspondence(range(len(shape.points)), len(shape.points))
        return carry_landmarks(itself, shape, shape, self._marks[name], curve_points=self._curve_points)

    def carried(self, name: str, templates: Iterable[str]) -> Landmarks | None:
        """Return the median of what some templates give for a shape; None if no sure map leads to it."""
        several, n_points = [], self._curve_points
        for template in templates:
            there, far = self._map(template, name)
            if there is not None:
                ends, own = (self._read(template), self._read(name)), self._marks[template]
                several.append(carry_landmarks(there, *ends, own, curve_points=n_points, expected_error=far))
        return median_landmarks(several, _unwelded(self._read(name))) if several else None

    def _map(self, source: str, target: str) -> tuple[Correspondence | None, FloatArray | None]:
        """Return the map between two shapes with its expected error, by the shortest path of sure ones, or None."""
        path = self._rows.path(source, target)
        if path is None:
            return None, None
        return maps_along(self._collection.layout, path, lambda name: _unwelded(self._read(name)))


def _unwelded(shape: Asset) -> Mesh:
    return Mesh(shape.placed_points, shape.polygons.triangles)


def draw_landmarks(path: str | Path, collection: Collection, found: Mapping[str, Landmarks]) -> None:
    """Draw the landmarks ``found`` for the first 24 shapes as dots, with their expected errors as discs around them.

    Shapes are turned like the template as far as they are written in its topology. A point of the surface takes the
    colour of the nearest landmark in space, so that those behind are not seen. About 0.2 s for a shape.
    """
    rows = collection.rows()
    template = collection.chosen_template(rows)
    middle = None if template is None else _written(collection, template)
    images, names = [], list(islice(found, MOST_DRAWN))
    for name in names:
        mesh, positions = read_mesh(collection.paths[name]), found[name].positions.copy()
        positions[found[name].patch] = np.nan  # too many to be told apart
        if rows.reflected([name]):
            mesh, positions = reflected(mesh), positions * [-1.0, 1.0, 1.0]
        own = _written(collection, name)
        camera = camera_of(mesh if middle is None or own is None else middle)
        if middle is not None and own is not None:
            same = Correspondence(range(own.n_vertices), own.n_vertices)
            camera = camera @ turn_to_target(own, middle, same)
        images.append(_image(mesh, positions, found[name].expected_error, camera))
    figure, _ = arranged_panels(images, names, per_row=min(PER_ROW, len(images)))
    with replaced(Path(path)) as file:
        figure.savefig(file, format="png", dpi=200, bbox_inches="tight", pad_inches=0.05)


def _written(collection: Collection, name: str) -> Mesh | None:
    surface = collection.layout.corresponded(name)
    return read_mesh(surface) if surface.exists() else None


def _image(mesh: Mesh, positions: FloatArray, errors: FloatArray, camera: FloatArray) -> FloatArray:
    """Draw a surface on which each landmark (m, 3) is a dot, in a disc with the radius of its expected error (m,)."""
    colours = colormaps["turbo"](np.linspace(0.1, 0.9, max(len(positions), 2)))[:, :3]
    placed = np.flatnonzero(np.isfinite(positions).all(axis=1))
    tree = cKDTree(positions[placed]) if len(placed) else None
    unit = np.sqrt(mesh.area)

    def paint(seen: FloatArray) -> FloatArray:
        drawn = np.full((len(seen), 3), GREY)
        if tree is None:
            return drawn
        apart, nearest = tree.query(seen)
        colour = colours[placed[nearest]]
        is_disc = apart < np.nan_to_num(errors)[placed[nearest]]
        drawn[is_disc] = 0.6 * GREY + 0.4 * colour[is_disc]
        is_dot = apart < RADIUS * unit
        drawn[is_dot] = colour[is_dot]
        return drawn

    return surface_image(mesh, mesh.vertices, paint, camera, RESOLUTION)
