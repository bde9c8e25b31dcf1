"""The page of two shapes and their maps in 3D: what the report, a notebook's view and the page to work in share."""

from __future__ import annotations

import json
from collections.abc import Mapping
from html import escape
from importlib.resources import files
from string import Template
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from isomatch.correspondence import Correspondence
from isomatch.errors import LandmarkError
from isomatch.matching import MatchResult
from isomatch.surfaces import Mesh
from isomatch.values.arrays import IntArray, array_of
from isomatch.view import lighting
from isomatch.view.outcome_colours import outcome_colour
from isomatch.view.summary import summary_of

MOST_ALTERNATIVES = 4
LEAST_TURN = 0.1  # degrees of a turn worth telling
SIDES = ("source", "target")
_INLINED = {"style": "report.css", "landmark_script": "landmarks.js", "script": "report.js"}


def page_of(
    shapes: tuple[Mesh, Mesh],
    names: tuple[str, str],
    scene: Mapping[str, Any],
    pairs: IntArray,
    *,
    style: str = "",
    policy: str = "",
    kind: str = "",
    work: str = "",
    sureness: str = "",
    **parts: str,
) -> str:
    """Fill the template with the contents of every page, and with the given parts as HTML.

    ``pairs`` are the landmarks with which the list begins; a page that is served adds to ``style`` and to the content
    security ``policy``, has a ``kind``, and a script to ``work`` with.
    """
    # the list is kept for these shapes and landmarks
    given = {"shapes": [mesh.content_hash for mesh in shapes], "landmarks": pairs.tolist()}
    inlined = {name: text_of(file) for name, file in _INLINED.items()}
    return template("report.html").substitute(
        **parts,
        policy=policy,
        kind=kind,
        work=work,
        sureness=f'<p id="sureness">{escape(sureness)}</p>\n' if sureness else "",
        title=escape(f"isomatch: {names[0]} → {names[1]}"),
        pair=escape(" → ".join(f"{n} ({m.n_vertices:,} vertices)" for n, m in zip(names, shapes))),
        source_name=escape(title_of("source", names[0])),
        target_name=escape(title_of("target", names[1])),
        given=_json(given),
        scene=_json(scene),
        **_lights(),
        **{**inlined, "style": inlined["style"] + style},
    )


def told_of(result: MatchResult) -> dict[str, str]:
    """Say what came out, for the head of a page: parts of `page_of`."""
    summary = summary_of(result)
    return {
        "colour": outcome_colour(result.outcome),
        "headline": escape(summary.headline),
        "sureness": summary.sureness,
        "advice": escape(summary.advice_in_python),
    }


def maps_of(result: MatchResult) -> dict[str, Correspondence]:
    """Name the map of a result and the alternatives that are shown beside it."""
    others = enumerate(result.alternatives[:MOST_ALTERNATIVES], 1)
    return {"the map": result.map} | {f"alternative {i}": other.map for i, other in others}


def text_of(name: str) -> str:
    """Read a file beside this module."""
    return (files("isomatch.view") / name).read_text(encoding="utf-8")


def template(name: str) -> Template:
    """Read a file beside this module, with places to fill."""
    return Template(text_of(name))


def _json(value: object) -> str:
    return json.dumps(value).replace("<", "\\u003c")  # so that no text in it can end the element


def pairs_on(landmarks: ArrayLike | None, source: Mesh, target: Mesh) -> IntArray:
    """Return those landmarks whose vertices both shapes have, (q, 2)."""
    pairs = array_of(
        np.zeros((0, 2), dtype=np.int64) if landmarks is None else landmarks, "landmarks", LandmarkError
    )
    if pairs.ndim != 2 or pairs.shape[1] != 2 or pairs.dtype.kind not in "iu":
        raise LandmarkError(
            f"landmarks have shape {pairs.shape} and type {pairs.dtype}; expected rows (source vertex, target vertex)"
        )
    inside = (pairs >= 0) & (pairs < [source.n_vertices, target.n_vertices])
    return np.asarray(pairs[inside.all(axis=1)], dtype=np.int64)


def _lights() -> dict[str, str]:
    """Give the shader the same lights as the still pictures."""
    directions = {"key": lighting.KEY_LIGHT, "fill": lighting.FILL_LIGHT}
    strengths = {"ambient": lighting.AMBIENT, "key_strength": lighting.KEY, "fill_strength": lighting.FILL}
    numbers = {**strengths, "gloss": lighting.GLOSS, "sharpness": lighting.SHARPNESS}
    return {name: ", ".join(map(str, direction)) for name, direction in directions.items()} | {
        name: str(float(number)) for name, number in numbers.items()
    }


def remarks_on(scene: Mapping[str, Any], result: MatchResult) -> list[str]:
    """Explain what the view leaves out, and from which side it shows the source."""
    remarks = simplified(scene)
    if not result.map.matched.all():
        remarks.insert(0, f"Grey: {(~result.map.matched).sum():,} source vertices without an image.")
    angle = np.degrees(np.arccos(np.clip((np.trace(np.reshape(scene["filed"], (3, 3))) - 1) / 2, -1, 1)))
    if angle > LEAST_TURN:
        remarks.append(
            f"In 3D the source lies as in its file. The map implies that it faces like the target after a turn of "
            f"{angle:.0f}°; “turned by the map” and the pictures show it so. Where shapes lie alike in their files, look "
            "at both: turned by the map, even a map that exchanges front and back looks right."
        )
    return remarks


def simplified(scene: Mapping[str, Any]) -> list[str]:
    """Say which shape is drawn with fewer vertices than it has."""
    return [
        f"In 3D the {side} is simplified to {shown:,} of its {used:,} vertices; pictures and numbers are those of the "
        "full shape."
        for side in SIDES
        if (shown := scene[side]["n_shown"]) < (used := scene[side]["n_used"])
    ]


def title_of(side: str, name: str) -> str:
    """Name a shape by its side and its file."""
    return side if name == side else f"{side}: {name}"
