"""``isomatch transfer``: labels, colours, textures, weights and landmarks carried from one file to the other by a map."""

from __future__ import annotations

from collections.abc import Collection
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from cyclopts import Parameter

import isomatch
import isomatch.landmarks as shape_landmarks
from isomatch._core.errors import FormatError, LandmarkError, SettingError
from isomatch._core.files import replaced
from isomatch.cli.inputs import Force, Output, Rounded, naming_files, split_words
from isomatch.cli.outputs import claimed_files, notes_on, say_left_out, say_notes
from isomatch.cli.terminal import TALK, Talk, say
from isomatch.io import (
    files_beside,
    holds_values,
    number_equal_names,
    png_of,
    read_attributes,
    write_attributes,
)
from isomatch.transfer import Carried, Labelling, NumbersAs, Side


def transfer(
    map_file: Annotated[Path, Parameter(name="MAP")],
    source: Path,
    target: Path,
    /,
    *,
    output: Output,
    data: str | None = None,
    values: list[Path] | None = None,
    to: Side | None = None,
    labels: Labelling = "nearest",
    numbers_as: Annotated[NumbersAs | None, Parameter(name="--as")] = None,
    bake: int | None = None,
    landmarks: Path | None = None,
    curve_points: int | None = None,
    rounded: Rounded = False,
    force: Force = False,
    talk: Talk = TALK,
) -> None:
    """Carry what one file holds, or files of its values, to the other: labels, colours, textures, weights, landmarks.

    Polygons, seams, transforms and units of the file that receives stay as they are.

    Args:
        map_file: Map source -> target of these two files: map.npz, as match writes it, or a map of
            another program: a text with one target vertex on each line, an .npy or .mat.
        source: Mesh that the map starts from.
        target: Mesh that the map goes to.
        output: Surface file to write: what receives, with the data of the other; all is kept in the format of its own
            file. Or a file for the data alone: .annot, .label.gii, .func.gii, .shape.gii, lh.thickness, .npy, .csv.
        data: What to carry, separated by commas: labels, colours, scalars, vectors, normals, uv, weights, keys, names of
            attributes, or all (default; with --values, all of these files).
        values: File of labels or numbers of the mesh that gives, one for each point or face, in the formats of --output.
            Repeat it for several.
        to: Which of the two receives: source or target. By default the source, and of landmarks the target.
        labels: Labels of points: nearest (default), or majority of the area around each.
        numbers_as: Take numbers for labels, which are never averaged, or for values. By default integers and few distinct
            whole numbers are labels.
        bake: Instead, paint a texture of this width and height for the texture coordinates of the file that receives,
            from the texture (of a glTF or OBJ file) or the colours of the other. It is written beside the output as a PNG
            file too.
        landmarks: Instead, carry these points and curves: .mrk.json or .fcsv of 3D Slicer, .pp of MeshLab, or a table
            name,x,y,z. The output is any of these, or .tps.
        curve_points: Number of equally spaced points on each carried curve; by default as many as it was drawn with.
    """
    ends, words = (source, target), split_words(data, "--data")
    if landmarks is None and curve_points is not None:
        raise SettingError("--curve-points needs --landmarks with a curve")
    if landmarks is not None:
        if data is not None or values or bake:
            message = "--landmarks are carried alone; run again without them for --data, --values or --bake"
            raise SettingError(message)
        _transfer_landmarks(map_file, ends, landmarks, output, to or "target", curve_points, force, talk)
        return
    to = to or "source"
    picture = output.with_suffix(".png") if bake else None
    with talk.progress() as tell, claimed_files(output, picture, force=force):
        tell("reading", 0.0)
        assets = isomatch.read_asset(source), isomatch.read_asset(target)
        giver = assets[to == "source"]
        read_values = number_equal_names(a for path in values or () for a in read_attributes(path, giver))
        giver = giver.with_attributes(*read_values)
        assets = (assets[0], giver) if to == "source" else (giver, assets[1])
        words = words or [attribute.name for attribute in read_values] or ["all"]
        n_target = len(assets[1].points)
        # A .mat or .npz may hold several maps; the number of source vertices selects one.
        n_source = len(assets[0].points) if map_file.suffix in (".mat", ".npz") else None
        correspondence = isomatch.Correspondence.load(map_file, n_target, n_source)
        tell("carrying", 0.3)
        with naming_files(source=source, target=target):
            if bake:
                baked = isomatch.bake_texture(correspondence, *assets, bake, to=to)
                carried = Carried(baked.asset, ("texture",), 0, 0, baked.notes)
                counts = {"n_unmatched_texels": baked.unmatched}
            else:
                kinds: dict[str, Any] = {"labels": labels, "numbers_as": numbers_as}
                carried = isomatch.carry_attributes(correspondence, *assets, words, to=to, **kinds)
                counts = {"n_unmatched": carried.unmatched, "n_across_seams": carried.across_seams}
        tell("writing", 0.8)
        side_files = () if holds_values(output) else files_beside(output, carried.asset)
        other_files = [path for path in side_files if path != picture]
        pictures = {picture: baked.png} if picture else {}
        if picture and len(baked.tiles) > 1:  # each tile in a file named by its UDIM number, as NAME.1002.png
            pictures = {picture.with_suffix(f".{i}.png"): png_of(tile) for i, tile in baked.tiles.items()}
            other_files += [path for path in pictures if path not in other_files]
        with claimed_files(*other_files, force=force):
            left_out = _write(output, carried.asset, carried.names, rounded)
            for path, png in pictures.items():
                with replaced(path) as file:
                    file.write(png)
        tell("done", 1.0)
    notes = [*notes_on(dict(zip(ends, assets))), *carried.notes]
    record: dict[str, Any] = {
        "files": [*dict.fromkeys(map(str, (output, *other_files, *pictures)))],
        "to": to,
        "carried": [name for name in carried.names if name not in left_out],
        "left_out": left_out,
        "taken_as_labels": list(carried.taken_as_labels),
        **counts,
    }
    if notes:
        record["notes"] = notes
    talk.result(record, lambda: _say_summary(record, output))


def _write(output: Path, asset: isomatch.Asset, names: Collection[str], rounded: bool) -> list[str]:
    """Write the asset or the carried values; return attributes that the file cannot store."""
    if not holds_values(output):
        return [attribute.name for attribute in isomatch.write_asset(output, asset, rounded=rounded)]
    carried = [attribute for attribute in asset.attributes if attribute.name in names]
    left_out = [attribute.name for attribute in write_attributes(output, carried, asset)]
    if set(names) <= set(left_out):
        no_place = f"a {output.suffix} file has no place for {', '.join(left_out)}"
        reason = no_place if left_out else "nothing was carried"
        raise FormatError(f"{output}: {reason}; name other --data or --values, or write another format")
    return left_out


def _say_summary(record: dict[str, Any], output: Path) -> None:
    say(f"carried to the {record['to']}: {', '.join(record['carried']) or 'nothing'}")
    if labels := ", ".join(record["taken_as_labels"]):
        say(f"taken for labels, which are not averaged: {labels}; --as values interpolates")
    say_left_out(record["left_out"], output)
    for count, meaning in (
        ("n_unmatched", "vertices are unmatched and have no value"),
        ("n_unmatched_texels", "texels are unmatched and grey"),
        ("n_across_seams", "faces lie across a seam of the texture and were kept on one side"),
    ):
        if record.get(count):
            say(f"{record[count]} {meaning}")
    say_notes(record.get("notes", ()))
    say(f"wrote {', '.join(record['files'])}")


def _transfer_landmarks(
    map_file: Path,
    ends: tuple[Path, Path],
    landmarks: Path,
    output: Path,
    to: Side,
    curve_points: int | None,
    force: bool,
    talk: Talk,
) -> None:
    """Carry the landmarks of a file by `isomatch.carry_landmarks`, write and print them."""
    shape_landmarks.writer_of(output)
    with talk.progress() as tell, claimed_files(output, force=force):
        tell("reading", 0.0)
        assets = isomatch.read_asset(ends[0]), isomatch.read_asset(ends[1])
        found = _read_map(map_file, *(len(asset.points) for asset in assets))
        giver, receiver = assets if to == "target" else assets[::-1]
        try:
            marks = isomatch.Landmarks.read(landmarks, giver)
        except LandmarkError as error:
            side = "source" if to == "target" else "target"
            raise LandmarkError(f"{error}. They are taken as landmarks of the {side}, see --to") from None
        tell("carrying", 0.3)
        with naming_files(source=ends[0], target=ends[1]):
            carried = isomatch.carry_landmarks(found, *assets, marks, to=to, curve_points=curve_points)
        tell("writing", 0.8)
        left_out = isomatch.write_landmarks(output, carried)
        tell("done", 1.0)
    columns = zip(carried.names, carried.positions.tolist(), carried.expected_error.tolist())
    record = {
        "files": [str(output)],
        "to": to,
        "landmarks": [dict(zip(("name", "position", "expected_error"), row)) for row in columns],
        "n_unmatched": int((~carried.placed).sum()),
        "left_out": list(left_out),
        "notes": [*notes_on(dict(zip(ends, assets))), *_note_assumed_axes(carried, giver, receiver, output)],
    }
    talk.result(record, lambda: _say_landmarks(record, carried, output))


def _read_map(path: Path, n_source: int, n_target: int) -> Any:
    """Read a map, with the expected errors if it has them."""
    if path.suffix != ".npz":
        return isomatch.Correspondence.load(path, n_target)
    with suppress(FormatError):
        return isomatch.MatchResult.load(path)
    return isomatch.Correspondence.load(path, n_target, n_source)


def _note_assumed_axes(
    carried: isomatch.Landmarks, giver: isomatch.Asset, receiver: isomatch.Asset, output: Path
) -> list[str]:
    """Note that the receiver names no axes, so that its axes are assumed to be the giver's."""
    axes = [asset.frame.axes if asset.frame else None for asset in (giver, receiver)]
    if axes[0] is None or axes[1] is not None:
        return []
    return [
        f"{output}: is said to be in {carried.axes} like the other surface, as that which receives says no space"
    ]


def _say_landmarks(record: dict[str, Any], landmarks: isomatch.Landmarks, output: Path) -> None:
    say(f"carried to the {record['to']}: {len(landmarks)} landmarks, {len(landmarks.curves)} curves")
    errors = landmarks.expected_error
    if np.isfinite(errors).any():
        worst = int(np.nanargmax(errors))
        name = landmarks.names[worst] or f"number {worst + 1}"
        say(f"expected error: median {np.nanmedian(errors):.4g}, at most {errors[worst]:.4g} ({name})")
    if missing := [name or str(i + 1) for i, name in enumerate(landmarks.names) if not landmarks.placed[i]]:
        say(f"without an image: {', '.join(missing)}")
    say_left_out(record["left_out"], output)
    say_notes(record["notes"])
    say(f"wrote {output}")
