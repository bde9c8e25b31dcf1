"""Landmarks of some shapes of a collection, carried to the others: the median of what each of them gives."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache
from pathlib import Path

from isomatch.assets import read_mesh
from isomatch.collections.collection import Collection
from isomatch.correspondence import Correspondence
from isomatch.errors import InputError
from isomatch.landmarks import Landmarks, median_landmarks
from isomatch.surfaces import Mesh
from isomatch.transfer import carry_landmarks


def collected_landmarks(
    collection: Collection, files: Mapping[str, str | Path], curve_points: int | None = None
) -> Iterator[tuple[str, Landmarks]]:
    """Carry the landmarks of some shapes, the templates, to all others.

    Parameters
    ----------
    collection : Collection
        Whose maps are used: those of a template with a shape, or, where they are not matched with each other, both maps
        with the template of the collection, one after the other.
    files : mapping of str to path_like
        File of the landmarks of each template, by its name.
    curve_points : int, optional
        Number of points on each curve; by default as many as it was drawn with.

    Yields
    ------
    str, Landmarks
        Each shape of the collection, and its landmarks: of a template its own, with the points of curves equally spaced;
        of another the medians over templates, with their ``spread``. Doubtful maps are not used, see `Rows.is_doubtful`;
        a shape that no other map leads to is left out.

    Raises
    ------
    InputError
        If a name is no shape of the collection, or there is no template.
    FormatError, LandmarkError
        If a file cannot be read, or its landmarks are not on the shape.
    """
    if unknown := [name for name in files if name not in collection.paths]:
        raise InputError(
            f"{', '.join(unknown)}: no shapes of {collection.folder}; files are named like shapes"
        )
    if not files:
        raise InputError("no landmarks; give a file for one shape of the collection or more")
    read = lru_cache(len(files) + 2)(lambda name: read_mesh(collection.paths[name]))
    own = {name: Landmarks.read(path, read(name)) for name, path in files.items()}
    between = _maps(collection, read)
    for name in collection.names:
        if name in own:
            mesh = read(name)
            itself = Correspondence(range(mesh.n_vertices), mesh.n_vertices)
            yield name, carry_landmarks(itself, mesh, mesh, own[name], curve_points=curve_points)
            continue
        carried = [
            carry_landmarks(found, read(template), read(name), marks, curve_points=curve_points)
            for template, marks in own.items()
            if (found := between(template, name)) is not None
        ]
        if carried:
            yield name, median_landmarks(carried, read(name))


def _maps(collection: Collection, read: Callable[[str], Mesh]) -> Callable[[str, str], Correspondence | None]:
    """Return a function that gives the map between two shapes, directly or over the template, or None."""
    rows = collection.rows()
    centre = collection.chosen_template(rows)
    sure = {frozenset(pair) for pair in rows.pairs if rows.is_current(pair) and not rows.is_doubtful(pair)}

    def between(source: str, target: str) -> Correspondence | None:
        if {source, target} in sure:
            return collection.maps(source, target).there
        if centre is None or not {frozenset((source, centre)), frozenset((centre, target))} <= sure:
            return None
        first, second = collection.maps(source, centre).there, collection.maps(centre, target).there
        return first.then(second, read(centre), read(target))

    return between
