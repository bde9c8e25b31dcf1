"""The page of one shape of a collection: in 3D beside the template, coloured by the map, with their landmarks."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from isomatch._core.arrays import FloatArray
from isomatch._core.files import write_text
from isomatch.correspondence import Correspondence
from isomatch.landmarks import Landmarks
from isomatch.surfaces import Mesh
from isomatch.visualization import (
    DrawnSurface,
    camera_of,
    html_page,
    position_colours,
    scripts_of,
    stage_of,
    turn_to_target,
)

MAX_SHOWN_VERTICES = 10_000  # largest number of vertices of a surface on a page; chosen
N_STOPS = 9  # number of colours of a scale, between which a browser interpolates; chosen
HELP = "Drag to rotate; the wheel or two fingers zoom."  # how to look at a surface on the page


class Specimen(NamedTuple):
    """A shape as it was matched, with its surface in the topology of the template, and perhaps landmarks."""

    name: str
    mesh: Mesh
    corresponded: Mesh
    marks: Landmarks | None = None  # coordinates as in the mesh, errors in units of its file


def camera_like(template: Mesh, corresponded: Mesh) -> FloatArray:
    """Choose the view (3, 3) of a shape in which it looks like the template, in whatever pose it was scanned."""
    same = Correspondence(range(template.n_vertices), template.n_vertices)
    return camera_of(template) @ turn_to_target(corresponded, template, same, upright=False)


def write_specimen(
    path: Path, specimen: Specimen, template: Specimen, links: Mapping[str, str], high: float = 1.0
) -> None:
    """Write the page of a shape, with links by their words; ``high`` ends the scale of expected errors."""
    marks, is_template = specimen.marks or Landmarks([]), specimen.name == template.name
    sides = [specimen] if is_template else [specimen, template]
    colours = position_colours(template.corresponded)
    cameras = [camera_like(template.corresponded, side.corresponded) for side in sides]
    drawn = [DrawnSurface(side.mesh, camera, MAX_SHOWN_VERTICES) for side, camera in zip(sides, cameras)]
    scene = {
        "shapes": [
            surface.packed(colours[cKDTree(side.corresponded.vertices).query(side.mesh.vertices)[1]])
            for surface, side in zip(drawn, sides)
        ],
        "marks": {
            "names": list(marks.names),
            "semi": np.isin(np.arange(len(marks)), marks.semilandmarks).tolist(),
            "sides": [_place_landmarks(surface, side.marks, marks) for surface, side in zip(drawn, sides)],
            "high": high,
            "ramp": stops("plasma"),
        },
    }
    parts = {
        "name": escape(specimen.name),
        "summary": "The template." if is_template else f"Beside the template, {escape(template.name)}.",
        "links": "".join(f'<a href="{href}">{escape(words)}</a>' for words, href in links.items()),
        "stage": stage_of([side.name for side in sides], "Shapes in 3D"),
        "mapped": "" if len(marks) else " checked",
        "bare": "" if len(marks) else " hidden",
        "few": "" if marks.semilandmarks else " hidden",
        "high": f"{high:.3g}",
        "help": HELP + " Point at a landmark to see its name." * bool(len(marks)),
        "remarks": escape(" ".join(simplified(*item) for item in zip(drawn, [side.name for side in sides]))),
        "listed": _list(marks),
        "scripts": scripts_of(scene, text_of("specimen.js")),
    }
    body = template_of("specimen.html").substitute(parts)
    write_text(path, html_page(specimen.name, body, style=text_of("cohort.css")))


def text_of(name: str) -> str:
    """Read a file beside this module."""
    return (files("isomatch.cohort") / name).read_text(encoding="utf-8")


def template_of(name: str) -> Template:
    """Read a file beside this module, with places to fill."""
    return Template(text_of(name))


def stops(colour_map: str) -> list[list[int]]:
    """Colours of a colour map of matplotlib at equal steps, between which a browser interpolates."""
    from isomatch.visualization import colour_scale  # imports matplotlib, which most pages do not need

    shares = np.linspace(0.0, 1.0, N_STOPS)[:, None]
    colours: list[list[int]] = np.rint(255 * colour_scale(colour_map, 0.0, 1.0)(shares)).astype(int).tolist()
    return colours


def simplified(surface: DrawnSurface, name: str) -> str:
    """Say that a surface is drawn with fewer vertices than it has, if it is."""
    if surface.n_shown == surface.n_used:
        return ""
    return f"{name} is simplified to {surface.n_shown:,} of its {surface.n_used:,} vertices here."


def _place_landmarks(surface: DrawnSurface, known: Landmarks | None, marks: Landmarks) -> dict[str, Any]:
    """Return where known landmarks of a surface are, in the order of the names of others, and their expected errors."""
    known = Landmarks([]) if known is None else known
    rows = {name: row for row, name in enumerate(known.names)}
    found = [*range(len(marks))] if known is marks else [rows.get(name, -1) for name in marks.names]
    # A row is added, with the index −1, as the position of landmarks that have none.
    positions = np.vstack([known.positions, np.full((1, 3), np.nan)])[found]
    errors = np.append(known.expected_error, np.nan)[found].tolist()
    plain = [None if np.isnan(error) else error for error in errors]
    return {"errors": plain, **surface.packed_points(positions)}


def _list(marks: Landmarks) -> str:
    """List the landmarks, the least sure first, as buttons that turn each to the viewer; and those without a place."""
    semi, errors = {*marks.semilandmarks}, marks.expected_error
    order = np.argsort(-np.nan_to_num(errors, nan=-1.0), kind="stable").tolist()
    buttons = "".join(
        f'<button type="button" data-landmark="{row}"><small>{row + 1}</small> {escape(marks.names[row])} '
        f"<b>{'' if np.isnan(errors[row]) else f'{errors[row]:.3g}'}</b></button>"
        for row in order
        if row not in semi and marks.placed[row]
    )
    lost = [name for name, is_placed in zip(marks.names, marks.placed) if not is_placed]
    remark = f"Without a place: {', '.join(lost)}." if lost else ""
    return f'<div class="row">{buttons}</div><p class="soft">{escape(remark)}</p>'
