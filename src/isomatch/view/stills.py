"""The picture of a map: corresponding points have the same colour."""

from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from typing import BinaryIO

from isomatch.correspondence import Correspondence
from isomatch.errors import MeshError
from isomatch.storage.files import replaced
from isomatch.surfaces import Mesh
from isomatch.values.arrays import FloatArray
from isomatch.view.camera import camera_of, of_ordinary_size, turn_to_target
from isomatch.view.colours import from_screen, position_colours
from isomatch.view.picture import Panel, Picture, pictured
from isomatch.view.surface_image import SurfaceView
from isomatch.view.value_panel import ValuePanel

WIDTH = 1800
LEAST_AREA = 1e-100  # of a shape of ordinary size; the squares of smaller ones vanish
SEEN = "{} on the left, {} on the right; points of the same colour correspond."


def draw_map(
    source: Mesh,
    target: Mesh,
    correspondence: Correspondence,
    path: str | Path | BinaryIO | None = None,
    *,
    titles: tuple[str, str] = ("source", "target"),
    values: ValuePanel | None = None,
    title: str = "",
    width: int = WIDTH,
    view: tuple[float, float] | None = None,
) -> Picture:
    """Draw both shapes side by side, coloured by the map.

    Parameters
    ----------
    source, target : Mesh
        The two shapes. They are drawn with equal area, and the source is rotated to face like the target.
    correspondence : Correspondence
        The map source → target.
    path : path_like or binary file, optional
        PNG file to write; an existing file is replaced. By default none is written.
    titles : (str, str)
        Titles below the two shapes.
    values : ValuePanel, optional
        Content of a third panel; by default there is none.
    title : str
        Title above all.
    width : int
        Width of the picture in pixels; the height follows from the shapes.
    view : (float, float), optional
        Where the viewer of the target is, in degrees, as for `camera_of`.

    Returns
    -------
    matplotlib.figure.Figure
        The picture, with axes for each panel. Notebooks show it with two pixels for each of the page.

    Raises
    ------
    DescriptorError
        If there is not a value for each source vertex.
    MeshError
        If coordinates differ so much that floats have no area for a shape, or a shape has none.
    SettingError
        If the width is below 200 pixels.
    UnwritableFileError
        If the file cannot be written.

    Notes
    -----
    The target has the colours of `position_colours`. Each source vertex has the colour of its image, or is grey if it is
    unmatched. Time is linear in faces and pixels.
    """
    source, target = (paintable(mesh, name) for mesh, name in zip((source, target), titles))
    camera = camera_of(target, view=view)
    turned = camera @ turn_to_target(source, target, correspondence)
    colours = position_colours(target)
    panels = [
        Panel(SurfaceView(source, turned, correspondence.pull_back(colours), as_is), titles[0]),
        Panel(SurfaceView(target, camera, colours, as_is), titles[1]),
    ]
    seen = SEEN.format(titles[0] or "source", titles[1] or "target")
    if values is not None:
        panels.append(Panel(painted(source, turned, values), titles[0]))
        seen += f" On the far right, the first once more, coloured by {values.label or 'values'}."
    picture = pictured(panels, width, values=values, title=title, seen=seen)
    if path is not None:
        with replaced(Path(path)) if isinstance(path, str | Path) else nullcontext(path) as file:
            file.write(picture.png())
    return picture


def paintable(mesh: Mesh, name: str) -> Mesh:
    """Scale a mesh to ordinary size, and refuse one without area, see `draw_map`."""
    mesh = of_ordinary_size(mesh)
    if not mesh.area > LEAST_AREA:
        raise MeshError(
            f"{name}: cannot be drawn: it has no faces of any area, coordinates that are not finite, or some so much "
            "larger than the others that the surface has no area beside them; check(mesh) says where, repair(mesh) "
            "mends it"
        )
    return mesh


def painted(
    mesh: Mesh, camera: FloatArray, values: ValuePanel, rows: FloatArray | None = None
) -> SurfaceView:
    """Show a mesh in the colours of values at its vertices; of others (n,), if they are given, at the same scale."""
    rows = values.rows(mesh.n_vertices) if rows is None else rows
    return SurfaceView(mesh, camera, rows[:, None], lambda seen: from_screen(values.paint(seen)))


def as_is(colours: FloatArray) -> FloatArray:
    """Take colours in linear light as they are."""
    return colours
