"""Landmarks of some shapes of a collection, carried to the others: the median of what each of them gives."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from functools import lru_cache
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib import colormaps
from scipy.spatial import cKDTree

from isomatch.assets import Asset, read_asset, read_mesh
from isomatch.collections.collection import Collection
from isomatch.collections.map_file import maps_along, require_unchanged
from isomatch.correspondence import Correspondence
from isomatch.errors import InputError, IsomatchError
from isomatch.landmarks import Landmarks, median_landmarks, spread_on_surface
from isomatch.statistics import SlidSemilandmarks, slid_semilandmarks
from isomatch.storage.files import replaced
from isomatch.surfaces import Mesh, reflected
from isomatch.transfer import carry_landmarks
from isomatch.values.arrays import FloatArray
from isomatch.view import arranged_panels, camera_of, surface_image, turn_to_target

MOST_DRAWN = 24  # shapes
PER_ROW = 6
RESOLUTION = 220.0  # pixels per √area
RADIUS = 0.02  # √area: of a dot
GREY = 0.82
LEAST_PLACED = 0.5  # share of the landmarks of a shape that slide


class LeftOut(NamedTuple):
    """The landmarks that the other templates give for a shape of which they are known."""

    name: str
    carried: Landmarks  # with its expected errors and spread
    error: FloatArray  # (m,) distance of each from the known one, in units of the shape; nan where either has no place


def collected_landmarks(
    collection: Collection,
    files: Mapping[str, str | Path],
    curve_points: int | None = None,
    *,
    patches: Mapping[str, str | Path] | None = None,
    surface_points: int = 0,
    failed: dict[str, IsomatchError] | None = None,
) -> Iterator[tuple[str, Landmarks]]:
    """Carry the landmarks of some shapes, the templates, to all others.

    Used are the maps of a template with a shape or, where they are not matched with each other, those on the shortest
    path between them, one after the other. Doubtful maps are not used, see `Rows.is_doubtful`; a shape that no other map
    leads to is left out.

    Parameters
    ----------
    collection : Collection
        The collection.
    files : mapping of str to path_like
        File of the landmarks of each template, by its name.
    curve_points : int, optional
        Number of points on each curve; by default as many as it was drawn with.
    patches : mapping of str to path_like, optional
        File of the surface semilandmarks of each template, in one order. They are named surface-1, surface-2, ….
    surface_points : int
        How many more are spread over the first template, and carried to the others.
    failed : dict, optional
        Takes up the errors of shapes that are no templates, which are then left out.

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
            if failed is None or name in files:
                raise
            failed[name] = error
            continue
        if marks is not None:
            yield name, marks


def slid_landmarks(
    collection: Collection, found: Mapping[str, Landmarks]
) -> tuple[dict[str, Landmarks], SlidSemilandmarks]:
    """Slide the points of curves and patches of the landmarks ``found`` for shapes, see `slid_semilandmarks`.

    Returns
    -------
    dict of str to Landmarks
        Those with the same landmarks as the first, of which at least half have a place, after they have slid.
    SlidSemilandmarks
        The same as arrays; reflected, x → −x, where a shape was matched as its mirror image.
    """
    first = next(iter(found.values()))
    names = [
        name for name, each in found.items() if each.is_like(first) and each.placed.mean() >= LEAST_PLACED
    ]
    meshes, turned = (
        [_unwelded(read_asset(collection.paths[name])) for name in names],
        collection.rows().reflected(names),
    )
    signs = np.array([[[-1.0 if name in turned else 1.0, 1.0, 1.0]] for name in names])
    meshes = [reflected(mesh) if name in turned else mesh for name, mesh in zip(names, meshes)]
    positions = signs * [found[name].positions for name in names]
    slid = slid_semilandmarks(positions, meshes, first.curves, first.patch)
    moved = {name: replace(found[name], positions=own) for name, own in zip(names, signs * slid.positions)}
    return moved, slid


def landmarks_left_out(
    collection: Collection, files: Mapping[str, str | Path], curve_points: int | None = None
) -> Iterator[LeftOut]:
    """Carry to each template what all others give for it, and compare it with its own landmarks.

    Yields each template that the others lead to; none if there is only one. So the errors are those to be expected of a
    shape of which nothing was marked, from one template less. Arguments and errors are those of `collected_landmarks`.
    """
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
        """Let all templates have surface semilandmarks, from their files, and spread over the first one."""
        if files and set(files) != set(self._marks):
            raise InputError("patches: give those of the shapes that have landmarks, and of no others")
        for name, path in files.items():
            own = Landmarks.read(path, self._read(name)).turned(self._marks[name].axes)
            self._marks[name] = _with_patch(self._marks[name], own.positions)
        if surface_points:
            first, *others = self._marks
            there = self._marks[first].positions[self._marks[first].placed]
            spread = spread_on_surface(_unwelded(self._read(first)), surface_points, there)
            self._marks[first] = _with_patch(self._marks[first], spread)
            for name in others:
                carried = self._from(first, name, Landmarks(spread))
                nowhere = np.full_like(spread, np.nan)
                self._marks[name] = _with_patch(
                    self._marks[name], nowhere if carried is None else carried.positions
                )

    def own(self, name: str) -> Landmarks:
        """Return the landmarks of a template, with the points of its curves equally spaced."""
        shape = self._read(name)
        itself = Correspondence(range(len(shape.points)), len(shape.points))
        return carry_landmarks(itself, shape, shape, self._marks[name], curve_points=self._curve_points)

    def carried(self, name: str, templates: Iterable[str]) -> Landmarks | None:
        """Return the median of what some templates give for a shape; None if no sure map leads to it."""
        given = (self._from(template, name, self._marks[template]) for template in templates)
        several = [each for each in given if each is not None]
        return median_landmarks(several, _unwelded(self._read(name))) if several else None

    def _from(self, source: str, target: str, marks: Landmarks) -> Landmarks | None:
        """Carry landmarks by the map between two shapes, or the shortest path of sure ones; None if there is none."""
        path = self._rows.path(source, target)
        if path is None:
            return None
        there, far = maps_along(self._collection.layout, path, lambda name: _unwelded(self._read(name)))
        ends, n_points = (self._read(source), self._read(target)), self._curve_points
        return carry_landmarks(there, *ends, marks, curve_points=n_points, expected_error=far)


def _with_patch(marks: Landmarks, positions: FloatArray) -> Landmarks:
    """Append points that lie anywhere on the surface."""
    m, n, k = len(marks), len(positions), len(marks.patch)
    return Landmarks(
        np.concatenate([marks.positions, positions]),
        [*marks.names, *(f"surface-{k + i + 1}" for i in range(n))],
        marks.curves,
        axes=marks.axes,
        unit=marks.unit,
        patch=[*marks.patch, *range(m, m + n)],
    )


def _unwelded(shape: Asset) -> Mesh:
    return Mesh(shape.placed_points, shape.polygons.triangles)


def draw_landmarks(path: str | Path, collection: Collection, found: Mapping[str, Landmarks]) -> None:
    """Draw the landmarks ``found`` for the first 24 shapes as dots, with their expected errors as discs around them.

    Those of a patch are left out. Shapes are turned like the template as far as they are written in its topology. A point of the surface takes the
    colour of the nearest landmark in space, so that those behind are not seen. About 0.2 s for a shape.
    """
    rows = collection.rows()
    template = collection.chosen_template(rows)
    middle = None if template is None else _written(collection, template)
    images, names = [], list(islice(found, MOST_DRAWN))
    for name in names:
        mesh, shown = (
            read_mesh(collection.paths[name]),
            np.setdiff1d(np.arange(len(found[name])), found[name].patch),
        )
        positions, errors = found[name].positions[shown], found[name].expected_error[shown]
        if rows.reflected([name]):
            mesh, positions = reflected(mesh), positions * [-1.0, 1.0, 1.0]
        own = _written(collection, name)
        camera = camera_of(mesh if middle is None or own is None else middle)
        if middle is not None and own is not None:
            same = Correspondence(range(own.n_vertices), own.n_vertices)
            camera = camera @ turn_to_target(own, middle, same)
        images.append(_image(mesh, positions, errors, camera))
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
