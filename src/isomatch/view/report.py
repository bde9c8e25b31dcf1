"""The report of a match in one HTML file: outcome, pictures, a 3D view, quality, alternatives, settings."""

from __future__ import annotations

import json
from collections.abc import Mapping
from html import escape
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from isomatch.correspondence import Correspondence
from isomatch.errors import LandmarkError
from isomatch.matching import MatchResult, Outcome
from isomatch.storage.files import write_text
from isomatch.surfaces import Mesh
from isomatch.values.arrays import IntArray, array_of
from isomatch.view import lighting
from isomatch.view.layers import known_layers, user_layers
from isomatch.view.picture import png
from isomatch.view.report_sections import (
    drawn,
    paragraphs,
    pictures_of_alternatives,
    sentence,
    table,
    table_against,
    table_of_quality,
    table_of_regions,
    tables_of_run,
    versions,
)
from isomatch.view.scene import scene_of
from isomatch.view.stills import WIDTH
from isomatch.view.summary import summary_of

MOST_ALTERNATIVES = 4
LEAST_TURN = 0.1  # degrees of a turn worth telling
COMMAND = "isomatch match SOURCE TARGET -o DIR --landmarks landmarks.txt"

# safe for the colour-blind (Okabe & Ito); the text states the outcome as well
COLOURS = {Outcome.CONVERGED: "#0072b2", Outcome.LOW_CONFIDENCE: "#d55e00", Outcome.MIRROR_IMAGE: "#d55e00"}
UNDECIDED = "#e69f00"
_SIDES = ("source", "target")
_INLINED = {"style": "report.css", "landmark_script": "landmarks.js", "script": "report.js"}
_HELPED_BY_LANDMARKS = (Outcome.HINTS_CONTRADICTED, Outcome.SYMMETRY_AMBIGUOUS, Outcome.LOW_CONFIDENCE)


def write_report(
    path: str | Path,
    source: Mesh,
    target: Mesh,
    result: MatchResult,
    *,
    names: tuple[str, str] = _SIDES,
    picture: str | Path | None = None,
    facts: Mapping[str, object] | None = None,
    layers: Mapping[str, ArrayLike] | None = None,
    landmarks: ArrayLike | None = None,
    command: str = COMMAND,
) -> None:
    """Write the report of a match: one HTML file that loads nothing from the network.

    Parameters
    ----------
    path : path_like
        File to write; an existing file is replaced.
    source, target : Mesh
        The two matched shapes.
    result : MatchResult
        Result of `match` for them.
    names : (str, str)
        Names of the two shapes, such as those of their files.
    picture : path_like, optional
        PNG file of `draw_map` to embed; by default it is drawn.
    facts : mapping of str to object, optional
        Additional rows for the table about the run.
    layers : mapping of str to (n_source,) array_like of float, optional
        Values at the source's vertices by name, such as errors or a confidence, that can be shown as colours; ``nan`` is
        grey. Positions, the stretch of the edges and, where they are known, the expected error, the mismatch and the
        regions of doubt are always there.
    landmarks : (q, 2) array_like of int, optional
        Pairs (source vertex, target vertex) with which the list of landmarks begins; pairs of vertices that the shapes
        do not have are left out.
    command : str
        Command that matches again with the saved landmarks, to be copied.

    Raises
    ------
    DescriptorError
        If a layer does not have one number for each source vertex, or has the name of one that is always there.
    LandmarkError
        If landmarks are not pairs of integers.
    UnwritableFileError
        If the file cannot be written.

    Notes
    -----
    The 3D view shows the source as it lies in its file. Pictures turn it by the rotation that the map implies, under
    which even a map that exchanges front and back looks right. A shape of more than 30 000 vertices is simplified in the
    3D view, and the report says so; pictures and numbers are those of the full shape. The size is about 75 bytes per
    shown vertex and 30 for each alternative, plus the pictures.
    """
    maps = maps_of(result)
    pairs = pairs_on(landmarks, source, target)
    scene = scene_of(
        source,
        target,
        maps,
        layers=known_layers(result) | user_layers(layers or {}, source.n_vertices),
        landmarks=pairs,
    )
    titles = title_of("source", names[0]), title_of("target", names[1])
    if picture is None:
        still = png(drawn(source, target, result.map, titles, WIDTH))
    else:
        still = png(Path(picture).read_bytes()) if picture else ""
    helped = result.outcome in _HELPED_BY_LANDMARKS
    details = template("details.html").substitute(
        against=table_against(result),
        regions=table_of_regions(result),
        alternatives=pictures_of_alternatives(
            source, target, result, result.alternatives[:MOST_ALTERNATIVES]
        ),
        quality=table_of_quality(result),
        notes=paragraphs(map(sentence, result.notes or ["Nothing was repaired, left out or replaced."])),
    )
    page = page_of(
        (source, target),
        names,
        scene,
        pairs,
        **told_of(result),
        picture=f'<img src="{still}" alt="Source on the left, target on the right; points of the same colour '
        'correspond.">'
        if still
        else "",
        plain="Points of the same colour correspond.",
        maps="".join(f"<option>{escape(name)}</option>" for name in maps),
        remarks=paragraphs(remarks_on(scene, result)),
        picking=" checked" if helped else "",
        landmarks=_list(command, shown=helped or bool(len(pairs))),
        details=details,
        run=tables_of_run(result, facts or {}),
    )
    write_text(Path(path), page)


def write_landmark_picker(
    path: str | Path,
    source: Mesh,
    target: Mesh,
    reason: str,
    *,
    names: tuple[str, str] = _SIDES,
    facts: Mapping[str, object] | None = None,
    landmarks: ArrayLike | None = None,
    command: str = COMMAND,
) -> None:
    """Write the report of a match that found no map: both shapes in 3D, to pick landmarks for another match.

    Parameters
    ----------
    reason : str
        Why no map was found.
    path, source, target, names, facts, landmarks, command
        As for `write_report`.

    Raises
    ------
    LandmarkError
        If landmarks are not pairs of integers.
    UnwritableFileError
        If the file cannot be written.
    """
    pairs = pairs_on(landmarks, source, target)
    scene = scene_of(source, target, {}, landmarks=pairs)
    page = page_of(
        (source, target),
        names,
        scene,
        pairs,
        colour=COLOURS[Outcome.LOW_CONFIDENCE],
        headline="No map was found",
        advice=escape(sentence(reason.rstrip(".")) + "."),
        picture="",
        plain="Pick landmarks below.",
        maps="",
        remarks=paragraphs(simplified(scene)),
        picking=" checked",
        landmarks=_list(command, shown=True),
        details="",
        run=table("Run", {**(facts or {}), **versions()}),
    )
    write_text(Path(path), page)


def _list(command: str, *, shown: bool) -> str:
    """Make the list of landmarks, with the command that matches again."""
    unpicked = "" if shown else " hidden"
    return template("landmarks.html").substitute(unpicked=unpicked, command=escape(command))


def maps_of(result: MatchResult) -> dict[str, Correspondence]:
    """Name the map of a result and the alternatives that are shown beside it."""
    others = enumerate(result.alternatives[:MOST_ALTERNATIVES], 1)
    return {"the map": result.map} | {f"alternative {i}": other.map for i, other in others}


def told_of(result: MatchResult) -> dict[str, str]:
    """Say what came out, for the head of a page: parts of `page_of`."""
    summary = summary_of(result)
    return {
        "colour": COLOURS.get(result.outcome, UNDECIDED),
        "headline": escape(summary.headline),
        "sureness": summary.sureness,
        "advice": escape(summary.advice_in_python),
    }


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
        for side in _SIDES
        if (shown := scene[side]["n_shown"]) < (used := scene[side]["n_used"])
    ]


def title_of(side: str, name: str) -> str:
    """Name a shape by its side and its file."""
    return side if name == side else f"{side}: {name}"
