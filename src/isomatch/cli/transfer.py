"""``isomatch transfer``: carry labels, colours, textures and skinning weights from one file to the other by a map."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

import isomatch
from isomatch.assets import files_beside, holds_values, read_attributes, told_apart, write_attributes
from isomatch.cli.inputs import naming_files
from isomatch.cli.outputs import claimed_files, notes_on, say_left_out, say_notes
from isomatch.cli.terminal import TALK, Talk, say
from isomatch.cli.transfer_landmarks import transfer_landmarks
from isomatch.storage.files import replaced
from isomatch.transfer import Labelling, NumbersAs, Side


def transfer(
    map_file: Annotated[Path, Parameter(name="MAP")],
    source: Path,
    target: Path,
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    data: str | None = None,
    values: list[Path] | None = None,
    to: Side | None = None,
    labels: Labelling = "nearest",
    numbers_as: Annotated[NumbersAs | None, Parameter(name="--as")] = None,
    bake: int | None = None,
    landmarks: Path | None = None,
    curve_points: int | None = None,
    force: bool = False,
    talk: Talk = TALK,
) -> None:
    """Carry what one file holds, or files of its values, to the other: labels, colours, textures, weights, landmarks.

    Polygons, seams, transforms and units of the file that receives stay as they are.

    Parameters
    ----------
    map_file : Path
        Map source -> target of these two files: map.npz, as match writes it, or that of another program: a text of
        one target vertex on each line, an .npy or .mat.
    source : Path
        Mesh that the map starts from.
    target : Path
        Mesh that the map goes to.
    output : Path
        Surface file to write: what receives, with the data of the other. Its own format keeps everything. Or a file for
        the data alone: .annot, .label.gii, .func.gii, .shape.gii, lh.thickness, .npy, .csv.
    data : str
        What to carry, separated by commas: labels, colours, scalars, vectors, normals, uv, weights, keys, names of
        attributes, or all (default; with --values, all of these files).
    values : list[Path]
        File of labels or numbers of the mesh that gives, one for each point or face, in the formats of --output. Repeat
        it for several.
    to : str
        Which of the two receives: source or target. By default the source, and of landmarks the target.
    labels : str
        Labels of points: nearest (default), or majority of the area around each.
    numbers_as : str
        Take numbers for labels, which are never averaged, or for values. By default integers and few distinct whole
        numbers are labels.
    bake : int
        Instead, paint a texture of this width and height for the texture coordinates of the file that receives, from the
        texture (of a glTF or OBJ file) or the colours of the other. It is written beside the output as a PNG file too.
    landmarks : Path
        Instead, carry these points and curves: .mrk.json or .fcsv of 3D Slicer, .pp of MeshLab, or a table name,x,y,z.
        The output is any of these, or .tps.
    curve_points : int
        Number of equally spaced points on each carried curve; by default as many as it was drawn with.
    force : bool
        Replace an existing file.
    talk : Talk
        What is told.
    """
    if landmarks is None and curve_points is not None:
        raise isomatch.SettingError("--curve-points needs --landmarks with a curve")
    if landmarks is not None:
        if data is not None or values or bake:
            raise isomatch.SettingError(
                "--landmarks are carried alone; run again without them for --data, --values or --bake"
            )
        transfer_landmarks(
            map_file,
            source,
            target,
            landmarks,
            output,
            to=to or "target",
            curve_points=curve_points,
            force=force,
            talk=talk,
        )
        return
    to = to or "source"
    picture = output.with_suffix(".png") if bake else None
    with talk.progress() as tell, claimed_files(output, picture, force=force):
        tell("reading", 0.0)
        ends = [isomatch.read_asset(source), isomatch.read_asset(target)]
        giver = 1 if to == "source" else 0
        given = told_apart(each for path in values or () for each in read_attributes(path, ends[giver]))
        ends[giver] = ends[giver].with_attributes(*given)
        assets = ends[0], ends[1]
        words = (
            [word.strip() for word in data.split(",")] if data else [each.name for each in given] or ["all"]
        )
        n_target = None if map_file.suffix == ".npz" else len(assets[1].points)
        n_source = (
            len(assets[0].points) if map_file.suffix == ".mat" else None
        )  # of several arrays, by which it is found
        correspondence = isomatch.Correspondence.load(map_file, n_target, n_source)
        tell("carrying", 0.3)
        names: tuple[str, ...]
        taken: tuple[str, ...] = ()
        counts: dict[str, int]
        with naming_files(source=source, target=target):
            if bake:
                baked = isomatch.bake_texture(correspondence, *assets, bake, to=to)
                asset, names, notes = baked.asset, ("texture",), baked.notes
                counts = {"n_unmatched_texels": baked.unmatched}
            else:
                carried = isomatch.carry_attributes(
                    correspondence, *assets, words, to=to, labels=labels, numbers_as=numbers_as
                )
                asset, names, notes = carried.asset, carried.names, carried.notes
                taken = carried.taken_as_labels
                counts = {"n_unmatched": carried.unmatched, "n_across_seams": carried.across_seams}
        tell("writing", 0.8)
        beside = (
            [] if holds_values(output) else [each for each in files_beside(output, asset) if each != picture]
        )
        with claimed_files(*beside, force=force):
            left = _written(output, asset, names)
        if picture:
            with replaced(picture) as file:
                file.write(baked.png)
        tell("done", 1.0)
    told = notes_on(dict(zip((source, target), assets)))
    record = {
        "files": [str(path) for path in (output, *beside, picture) if path],
        "to": to,
        "carried": [name for name in names if name not in left],
        "left_out": left,
        "taken_as_labels": list(taken),
        **counts,
    }
    if told or notes:
        record["notes"] = [*told, *notes]
    talk.result(record, lambda: _summary(record, output))


def _written(output: Path, asset: isomatch.Asset, names: Collection[str]) -> list[str]:
    """Write the asset, or what was carried alone; return the names of what has no place there."""
    if not holds_values(output):
        return [attribute.name for attribute in isomatch.write_asset(output, asset)]
    carried = [attribute for attribute in asset.attributes if attribute.name in names]
    left = [attribute.name for attribute in write_attributes(output, carried)]
    if set(names) <= set(left):
        reason = (
            f"a {output.suffix} file has no place for {', '.join(left)}" if left else "nothing was carried"
        )
        raise isomatch.FormatError(
            f"{output}: {reason}; name other --data or --values, or write another format"
        )
    return left


def _summary(record: dict[str, Any], output: Path) -> None:
    say(f"carried to the {record['to']}: {', '.join(record['carried']) or 'nothing'}")
    if record["taken_as_labels"]:
        say(
            f"taken for labels, which are not averaged: {', '.join(record['taken_as_labels'])}; --as values interpolates"
        )
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
