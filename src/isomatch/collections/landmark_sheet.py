"""A picture of the landmarks of all shapes, turned alike, in which a landmark has one colour."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import islice
from pathlib import Path

import numpy as np
from matplotlib import colormaps
from scipy.spatial import cKDTree

from isomatch.assets import read_mesh
from isomatch.collections.collection import Collection
from isomatch.correspondence import Correspondence
from isomatch.landmarks import Landmarks
from isomatch.storage.files import replaced
from isomatch.surfaces import Mesh, reflected
from isomatch.values.arrays import FloatArray
from isomatch.view import arranged_panels, camera_of, surface_image, turn_to_target

MOST_DRAWN = 24  # shapes
PER_ROW = 6
RESOLUTION = 220.0  # pixels per √area
RADIUS = 0.02  # √area: of a dot
GREY = 0.82


def draw_landmarks(path: str | Path, collection: Collection, found: Mapping[str, Landmarks]) -> None:
    """Draw the landmarks of the first 24 shapes as dots, and their expected errors as paler discs around them.

    Parameters
    ----------
    path : path_like
        PNG file; an existing one is replaced.
    collection : Collection
        The collection; shapes are turned like its template as far as they are written in its topology.
    found : mapping of str to Landmarks
        Landmarks of its shapes by name, such as `collected_landmarks` yields.

    Notes
    -----
    A point of the surface takes the colour of the nearest landmark in space, so that those behind are not seen. About
    0.2 s for a shape.
    """
    rows = collection.rows()
    template = collection.chosen_template(rows)
    middle = None if template is None else _written(collection, template)
    images, names = [], list(islice(found, MOST_DRAWN))
    for name in names:
        mesh, positions = read_mesh(collection.paths[name]), found[name].positions
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
