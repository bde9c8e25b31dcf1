"""``isomatch check`` and ``isomatch repair``: the defects of a mesh, what it is fit for, and what mends it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from os.path import commonpath, dirname, isabs, relpath
from pathlib import Path
from textwrap import fill
from typing import Annotated, Any, Literal, cast, get_args

import numpy as np
from cyclopts import Parameter
from rich.console import Console

import isomatch
from isomatch import shapes, spectral
from isomatch._core.array_file import write_arrays
from isomatch._core.skipped import tell_skipped
from isomatch.cli.distance_command import N_COLUMNS
from isomatch.cli.inputs import Force, Json, Output, Quiet, Rounded, surface_of
from isomatch.cli.outputs import claimed_files, notes_on, say_left_out, say_notes
from isomatch.cli.terminal import Talk, in_shell, say
from isomatch.io import FORMATS, files_beside, meshes_among, prepare_for_writing, read_as_far_as_possible
from isomatch.repair import Repair, without_seams

NUMBER_COLUMNS = 50  # columns of the terminal for the numbers of a table, besides the names; chosen
MIN_NAME_COLUMNS = 12  # columns of the terminal for names in a table, even in a narrow terminal; chosen
# `repair` warns if the number of vertices after welding, over the number before, is below this; chosen: a mesh stored as
# separate triangles keeps a sixth, as six triangles meet at a vertex on average
MIN_SHARE_LEFT = 0.1

Verb = Literal["distance", "basis", "match"]  # commands that might refuse a mesh

# For each command, its first step, which refuses the meshes that the command cannot use.
_FIRST_STEPS: dict[Verb, Callable[[isomatch.Mesh], object]] = {
    "distance": lambda mesh: isomatch.distance_engine(surface_of(mesh)),
    "basis": lambda mesh: spectral.basis_domain(without_seams(mesh)[0], n_columns=N_COLUMNS),
    "match": lambda mesh: shapes.body_of(surface_of(mesh), isomatch.Config().preparation),
}


def check(
    file: Path,
    /,
    *more: Annotated[Path, Parameter(json_list=False)],
    verb: Annotated[Verb | None, Parameter(name="--for")] = None,
    wall: float = 0.05,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Report the defects of meshes, and which commands they are fit for.

    The exit code is 1 if geodesic distances are undefined on any of them or one cannot be read; with --for, if that
    command would refuse any.

    Args:
        file: Mesh: any surface file, such as .ply, .obj or .vtp; or a folder of them.
        more: Further meshes and folders. Of several meshes there is a table, one row for each.
        verb: The command that the exit code is about: distance, basis or match, with their default settings.
        wall: Thickness of walls, in √area, up to which a surface with two sheets back to back is called double-walled.
    """
    paths = [path for place in (file, *more) for path in _meshes(place)]
    several = len(paths) > 1 or file.is_dir()
    records = [_examine(path, wall, in_table=several) for path in paths]
    plain = [{name: value for name, value in record.items() if name != "report"} for record in records]
    summary = partial(_say_several, records) if several else partial(_say_one, records[0])
    Talk(json=json, quiet=quiet).result(plain if several else plain[0], summary)
    bad = {record["file"]: reason for record in records if (reason := _reason_against(record, verb))}
    if several and bad:
        what = f"not fit for {verb}" if verb else "unreadable, or distances are undefined on them"
        raise isomatch.MeshError(f"{len(bad)} of {len(paths)} meshes are {what}: {', '.join(bad)}")
    for name, reason in bad.items():
        raise isomatch.MeshError(f"{name}: {reason}")


def _meshes(place: Path) -> list[Path]:
    """List the meshes in a folder and its subfolders, by name; or the file itself."""
    if not place.is_dir():
        return [place]
    paths = meshes_among(place.rglob("*"))
    if not paths:
        raise isomatch.MissingFileError(f"{place}: no mesh in this folder; known are {', '.join(FORMATS)}")
    return paths


def _examine(path: Path, wall: float, in_table: bool) -> dict[str, Any]:
    """Collect plain values about a file; in a table, an unreadable file is a row, not an error."""
    try:
        asset = read_as_far_as_possible(path)
        mesh = isomatch.Mesh(asset.placed_points, asset.polygons.triangles)
    except isomatch.IsomatchError as error:
        if not in_table:
            raise
        return {"file": str(path), "ok": False, "unreadable": str(error)}
    report = isomatch.check(mesh, wall=wall)
    finite = mesh.vertices[np.isfinite(mesh.vertices).all(axis=1)]
    return {
        "file": str(path),
        **report.to_dict(),
        # The size is the longest side of the box around the finite vertices, in the units of the file.
        "size": float(np.ptp(finite, axis=0).max()) if len(finite) else None,
        "notes": list(asset.notes),
        "report": str(report),
        "refused_by": {verb: _refusal(verb, mesh) for verb in get_args(Verb)},
    }


def _reason_against(record: dict[str, Any], verb: Verb | None) -> str | None:
    """Say why a mesh is bad; None if it is not."""
    if "unreadable" in record:
        return str(record["unreadable"])
    return record["refused_by"][verb] if verb else "; ".join(record["fatal"]) or None


def _say_one(record: dict[str, Any]) -> None:
    """Print the report of one mesh, wrapped to the terminal, and the commands it is fit for."""
    size = "none" if record["size"] is None else f"{record['size']:.4g}"
    say(f"{'longest side, in the units of the file':<45} {size:>7}")
    for line in record["report"].splitlines():
        sentence = in_shell(line)
        say(sentence if len(sentence) <= Console().width else _wrap(sentence))
    for note in record["notes"]:
        say(_wrap(f"note: {note}"))
    say(f"fit for {_fitness(record)}")
    for purpose, reason in record["refused_by"].items():
        if reason:
            say(_wrap(f"not fit for {purpose}: {reason}"))


def _say_several(records: list[dict[str, Any]]) -> None:
    """Print a row for each mesh, and below it a line for each defect, no wider than the terminal."""
    names = _relative_names([record["file"] for record in records])
    room = max(Console().width - NUMBER_COLUMNS, MIN_NAME_COLUMNS)
    name_columns = min(max(map(len, (*names, "file"))), room)
    say(f"{'file':<{name_columns}}  {'vertices':>10} {'faces':>10} {'size':>9}  fit for")
    for name, record in zip(names, records):
        vertices, faces = (f"{record[key]:,}" if key in record else "–" for key in ("n_vertices", "n_faces"))
        size = "–" if record.get("size") is None else f"{record['size']:.4g}"
        style = "" if _fitness(record) != "nothing" else "bold red"
        if len(name) > name_columns:
            say(name, style)
            name = ""
        say(f"{name:<{name_columns}}  {vertices:>10} {faces:>10} {size:>9}  {_fitness(record)}", style)
        for defect in _defects(record):
            say(_wrap(defect, "  "), "dim")
    say(_wrap("Size is the longest side, in the units of the file. isomatch check FILE tells what to do."))


def _fitness(record: dict[str, Any]) -> str:
    """Name the commands that a mesh is fit for."""
    fit = [verb for verb, reason in record.get("refused_by", {}).items() if not reason]
    return "everything" if len(fit) == len(_FIRST_STEPS) else ", ".join(fit) or "nothing"


def _wrap(text: str, indent: str = "") -> str:
    """Break a sentence between words."""
    indents: dict[str, Any] = {"initial_indent": indent, "subsequent_indent": indent + "  "}
    return fill(text, Console().width, **indents, break_long_words=False, break_on_hyphens=False)


def _defects(record: dict[str, Any]) -> list[str]:
    """Name the defects of a mesh, and each reason why commands would refuse it."""
    if "unreadable" in record:
        return [record["unreadable"]]
    defects = [sentence.partition(": ")[0] for sentence in (*record["fatal"], *record["warnings"])]
    reasons: dict[str, list[str]] = {}
    for verb, reason in record["refused_by"].items():
        if reason and reason not in record["fatal"]:
            reasons.setdefault(reason.partition(";")[0], []).append(verb)
    refused = [f"not fit for {', '.join(verbs)}: {reason}" for reason, verbs in reasons.items()]
    return [*defects, *record["notes"], *refused]


def _relative_names(files: list[str]) -> list[str]:
    """Return the paths of files relative to the folder that contains all of them."""
    if len({isabs(file) for file in files}) > 1:
        return files
    common = commonpath([dirname(file) for file in files])
    return [relpath(file, common) if common else file for file in files]


def _refusal(verb: Verb, mesh: isomatch.Mesh) -> str | None:
    try:
        _FIRST_STEPS[verb](mesh)
    except isomatch.MeshError as error:
        return str(error)
    return None


def _require_something_left(file: Path, repaired: Repair, weld: float | None) -> None:
    """Raise `MeshError` if nothing is left to write; warn if few vertices are left."""
    after, n_before = repaired.mesh, len(repaired.new_index)
    what = "points" if not after.n_vertices else "faces" if not after.n_faces else ""
    hint = f"--weld {weld:g} is in the units of the file; " if weld else ""
    if what == "points" or (what and isomatch.read_mesh(file).n_faces):
        remedy = f"so nothing is written; {hint}see isomatch check"
        raise isomatch.MeshError(f"{file}: no {what} would be left, {remedy}")
    if hint and after.n_vertices < MIN_SHARE_LEFT * n_before:
        tell_skipped(f"{file}: {after.n_vertices} of {n_before} vertices are left; {hint}see isomatch check")


_INDICES = ("vertex_index", "new_index", "polygon_index", "face_index")  # arrays in the file NAME.index.npz


def repair(
    file: Path,
    /,
    *,
    output: Output,
    unmerge: float = 0.1,
    weld: float | None = None,
    outer: bool = False,
    opening: float = 0.1,
    without_base: Annotated[bool, Parameter(negative=())] = False,
    rounded: Rounded = False,
    force: Force = False,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Mend a mesh: weld vertices, remove unusable faces, orient the others outward, part limbs that were merged.

    Colours, labels, texture coordinates, weights and all else that the file carries are kept. Where values differ at
    vertices that are welded, the first is.

    Writes the repaired mesh and, next to it, NAME.index.npz with vertex_index (original vertex of each new vertex),
    new_index (new vertex of each original vertex, -1 if removed), polygon_index (original face of each new face, which
    may have any number of corners) and face_index (the same of the triangles that they are cut into).

    Args:
        file: Mesh: any surface file, such as .ply, .obj or .vtp.
        output: File for the repaired mesh.
        unmerge: How far apart limbs that were merged by distance are along the surface, in √area; inf leaves them merged.
        weld: Also weld vertices this near to each other, in the units of the file; isomatch check proposes a distance.
        outer: Keep only the outermost surface, without chambers that are closed or have small openings.
        opening: With --outer: the smallest opening through which a chamber counts as outside, in √area.
        without_base: Cut off the largest planar piece along its rim, as a plate that a scan has grown into.
    """
    index = output.with_suffix(".index.npz")
    with claimed_files(output, index, force=force):
        how: dict[str, Any] = {"outer": outer, "opening": opening, "without_base": without_base}
        how |= {"unmerge": unmerge, "weld": True if weld is None else weld}
        repaired = isomatch.repair(_with_joined_parts(file, output), **how)
        asset = cast(isomatch.Asset, repaired.asset)
        _require_something_left(file, repaired, weld)
        beside = files_beside(output, asset)
        with claimed_files(*beside, force=force):
            left = [attribute.name for attribute in isomatch.write_asset(output, asset, rounded=rounded)]
        write_arrays(index, {name: getattr(repaired, name) for name in _INDICES})
    files, notes = list(map(str, (output, *beside, index))), notes_on({file: asset})
    done = {"file": str(file), "changes": list(repaired.changes), "left_out": left, "notes": notes}

    def summary() -> None:
        for change in repaired.changes:
            say(change)
        say_left_out(left, output)
        say_notes(notes)
        copy = "a copy without these" if left else "an unchanged copy"
        what = "wrote" if repaired.changes else f"found nothing that repair mends; wrote {copy}:"
        say(f"{what} {', '.join(files)}")

    Talk(json=json, quiet=quiet).result(done | {"files": files}, summary)


def _with_joined_parts(file: Path, output: Path) -> Path | isomatch.Asset:
    """Return the file, or one surface of all its parts if the output cannot store parts."""
    mesh_format = FORMATS.get(output.suffix.lower())
    if mesh_format is None or mesh_format.has_parts or file.suffix.lower() not in (".glb", ".gltf"):
        return file
    # A .surf.gii has no place for values. Under the name .gii they stay, until the output is written.
    named = output.with_name(output.name.lower().replace(".surf.gii", ".gii"))
    shown, _ = prepare_for_writing(named, isomatch.read_asset(file, sound=False))
    return replace(shown.placed, parts=(), document=shown.document)
