"""The 3D view of a page: surfaces as a browser draws them, and the page around them, in one file."""

from __future__ import annotations

import json
from base64 import b64encode
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from importlib.resources import files
from string import Template
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from isomatch._core.arrays import FloatArray, IntArray
from isomatch.surfaces import Mesh
from isomatch.visualization.camera import seen_from, used_vertices
from isomatch.visualization.colours import to_screen
from isomatch.visualization.surface_image import (
    AMBIENT,
    FILL,
    FILL_LIGHT,
    GLOSS,
    GLOSS_EXPONENT,
    KEY,
    KEY_LIGHT,
)

MAX_SHOWN = 30_000  # largest number of vertices of a shape that a page draws; chosen: 16 bits number them
CELL_GROWTH = 1.15  # width of grid cells over their width in the attempt before, in simplification; chosen


def text_of(name: str) -> str:
    """Read a file beside this module."""
    return (files("isomatch.visualization") / name).read_text(encoding="utf-8")


def template(name: str) -> Template:
    """Read a file beside this module, with places to fill."""
    return Template(text_of(name))


def html_page(
    title: str, body: str, *, style: str = "", policy: str = "", images: str = "data:", **parts: str
) -> str:
    """Make a page of HTML that loads nothing from the network; ``style`` is further CSS.

    ``policy`` and ``images`` add to its content security policy; ``root`` and ``kind`` are attributes of the page and of
    its body.

    >>> "<title>a &amp; b</title>" in html_page("a & b", "<p>Text</p>")
    True
    """
    style = text_of("report.css") + style
    given = {"root": "", "kind": "", **parts}
    return template("page.html").substitute(
        title=escape(title), body=body, style=style, policy=policy, images=images, **given
    )


def stage_of(names: Sequence[str], label: str, picture: str = "") -> str:
    """Make the place where surfaces are drawn, with a name for each, in front of a picture, which is HTML.

    The page has elements ``status``, for a message, and ``reset``, a button; `scripts_of` follow it.
    """
    spans = "".join(
        f'<span class="name" id="name{k}">{escape(name)}</span>\n' for k, name in enumerate(names)
    )
    return template("viewer.html").substitute(label=escape(label), names=spans, picture=picture)


def scripts_of(scene: Mapping[str, Any], *scripts: str) -> str:
    """Make the data and the scripts of a 3D view, whose texts use ``viewer`` and ``unpack`` of ``viewer.js``."""
    lights: dict[str, ArrayLike] = {"key": KEY_LIGHT, "fill": FILL_LIGHT, "ambient": AMBIENT}
    lights |= {"key_strength": KEY, "fill_strength": FILL, "gloss": GLOSS, "sharpness": GLOSS_EXPONENT}
    # The page has the lights of the still pictures.
    shaders = template("shaders.html").substitute(
        {name: ", ".join(map(str, np.atleast_1d(light))) for name, light in lights.items()}
    )
    data = f'<script type="application/json" id="scene">{script_json(scene)}</script>\n{shaders}'
    return data + "\n".join(f"<script>\n{text}</script>" for text in (text_of("viewer.js"), *scripts))


def html_table(rows: Iterable[Sequence[object]], heads: Sequence[str] = ()) -> str:
    """Make a table, whose cells are escaped; the first of each row is its name."""
    head = "".join(f'<th scope="col">{escape(name)}</th>' for name in heads)
    body = "".join(
        f'<tr><th scope="row">{escape(str(name))}</th>'
        f"{''.join(f'<td>{escape(str(cell))}</td>' for cell in cells)}</tr>"
        for name, *cells in rows
    )
    return f"<table>{f'<thead><tr>{head}</tr></thead>' * bool(heads)}<tbody>{body}</tbody></table>"


def script_json(value: object) -> str:
    """Format plain values so that no text in them can end the element that they are in."""
    return json.dumps(value).replace("<", "\\u003c")


class DrawnSurface:
    """A surface as a browser draws it, from a camera, see `camera_of`: at most ``most`` vertices, and those ``kept``.

    ``points`` and ``normals`` (n, 3) are in the coordinates of the camera, with unit area and the middle at 0; ``index``
    are the vertices that are shown.
    """

    def __init__(
        self, mesh: Mesh, camera: FloatArray, most: int = MAX_SHOWN, kept: IntArray | Sequence[int] = ()
    ) -> None:
        self._mesh, self._camera = mesh, camera
        self.points = seen_from(camera, mesh)  # positions of the vertices, (n, 3)
        self.normals = mesh.vertex_normals @ camera.T  # normals at the vertices, (n, 3)
        used = used_vertices(mesh)
        self.n_used = len(used)
        shown, self.faces = _simplify(self.points, mesh.sound_faces, used, most)
        self.n_shown = len(shown)
        self.index = np.concatenate([shown, np.setdiff1d(kept, shown).astype(np.int64)])

    def packed_points(self, positions: FloatArray) -> dict[str, Any]:
        """Return positions (k, 3) on the surface, nan if unknown, with its normals there, as `packed` does vertices."""
        points = seen_from(self._camera, self._mesh, positions)
        placed = np.isfinite(points).all(axis=1)
        normals = np.zeros(points.shape)
        normals[placed] = self.normals[cKDTree(self.points).query(points[placed])[1]]
        return {"points": encoded(points, "<f4"), "normals": encoded_normals(normals)}

    def packed_vectors(self, vectors: FloatArray) -> str:
        """Return displacements (n, 3) of the vertices at those that are shown, as `packed` does vertices."""
        return encoded(vectors[self.index] @ self._camera.T / np.sqrt(self._mesh.area), "<f4")

    def packed(self, colours: FloatArray | None = None) -> dict[str, Any]:
        """Return plain values for JSON; arrays are little-endian, in base 64.

        ``index`` (uint32, the user's index of each shown vertex), ``vertices`` (float32 × 3: right, up,
        towards the viewer; unit area, as in still pictures), ``normals`` (int8 × 3), ``faces`` (uint16 × 3), ``extent``,
        ``n_shown`` vertices of the ``n_used`` that faces use, ``colours`` (uint8 × 3) if they are given, (n, 3) in linear
        light.
        """
        drawn = self.points[self.index]
        return {
            "n_used": self.n_used,
            "n_shown": self.n_shown,
            "index": encoded(self.index, "<u4"),
            "vertices": encoded(drawn, "<f4"),
            "normals": encoded_normals(self.normals[self.index]),
            "faces": encoded(self.faces, "<u2"),
            "extent": np.ptp(drawn, axis=0).tolist(),
            **({} if colours is None else {"colours": encoded_colours(colours[self.index])}),
        }


def _simplify(points: FloatArray, faces: IntArray, used: IntArray, most: int) -> tuple[IntArray, IntArray]:
    """Choose at most ``most`` of the used vertices to show; return them, and the faces between them in new indices."""
    # Each cell of a cubic grid keeps the vertex nearest to its middle; corners of faces move to
    # their cell's vertex.
    shown, cell = used, np.arange(len(used))
    # width of the first cells: `most` squares of this width have the area of the surface, 1
    size = most**-0.5
    while len(shown) > most:
        inside, cells = np.modf((points[used] - points[used].min(axis=0)) / size)
        middle_first = ((inside - 0.5) ** 2).sum(axis=1).argsort(kind="stable")
        _, first, among = np.unique(cells[middle_first], axis=0, return_index=True, return_inverse=True)
        shown = used[middle_first[first]]
        cell[middle_first] = among.ravel()
        size *= CELL_GROWTH
    number = np.zeros(len(points), dtype=np.int64)
    number[used] = cell
    corners = number[faces]
    a, b, c = corners.T
    corners = corners[(a != b) & (b != c) & (c != a)]
    if len(shown) < len(used):
        corners = corners[np.unique(np.sort(corners, axis=1), axis=0, return_index=True)[1]]
    return shown, corners


def encoded(values: ArrayLike, dtype: str) -> str:
    """Encode numbers in base 64."""
    return b64encode(np.ascontiguousarray(values, dtype=dtype).tobytes()).decode("ascii")


def encoded_normals(unit: FloatArray) -> str:
    """Encode unit vectors (n, 3) as int8."""
    return encoded(np.rint(127 * unit), "i1")


def encoded_colours(linear: FloatArray) -> str:
    """Encode colours (n, 3) in linear light as uint8 of the screen."""
    return encoded(np.rint(255 * to_screen(linear)), "u1")
