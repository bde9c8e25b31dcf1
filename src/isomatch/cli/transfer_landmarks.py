"""``isomatch transfer --landmarks``: points and curves marked on one shape, carried to the other."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

import isomatch
import isomatch.landmarks as shape_landmarks
from isomatch.cli.inputs import naming_files
from isomatch.cli.outputs import claimed_files, notes_on, say_left_out, say_notes
from isomatch.cli.terminal import Talk, say
from isomatch.errors import FormatError, LandmarkError
from isomatch.transfer import Side


def transfer_landmarks(
    map_file: Path,
    source: Path,
    target: Path,
    landmarks: Path,
    output: Path,
    *,
    to: Side,
    curve_points: int | None,
    force: bool,
    talk: Talk,
) -> None:
    """Carry the landmarks of a file, see `isomatch.carry_landmarks`, write and tell them."""
    shape_landmarks.writer_of(output)
    with talk.progress() as tell, claimed_files(output, force=force):
        tell("reading", 0.0)
        assets = isomatch.read_asset(source), isomatch.read_asset(target)
        shapes = _surface(assets[0]), _surface(assets[1])
        given = _read_map(map_file, shapes[1])
        try:
            own = isomatch.Landmarks.read(landmarks, _points_of(shapes[to == "source"]))
        except LandmarkError as error:
            marked = "source" if to == "target" else "target"
            raise LandmarkError(f"{error}. They are taken as landmarks of the {marked}, see --to") from None
        tell("carrying", 0.3)
        with naming_files(source=source, target=target):
            carried = isomatch.carry_landmarks(given, *shapes, own, to=to, curve_points=curve_points)
        tell("writing", 0.8)
        left = isomatch.write_landmarks(output, carried)
        tell("done", 1.0)
    record = {
        "files": [str(output)],
        "to": to,
        "landmarks": described(carried),
        "n_unmatched": int((~carried.placed).sum()),
        "left_out": list(left),
        "notes": notes_on(dict(zip((source, target), assets))),
    }
    talk.result(record, lambda: _summary(record, carried, output))


def described(landmarks: isomatch.Landmarks) -> list[dict[str, Any]]:
    """Plain values of landmarks."""
    rows = zip(landmarks.names, landmarks.positions.tolist(), landmarks.expected_error.tolist())
    return [{"name": name, "position": place, "expected_error": error} for name, place, error in rows]


def _surface(asset: isomatch.Asset) -> isomatch.Asset | isomatch.PointCloud:
    return asset if len(asset.polygons) else isomatch.PointCloud(asset.placed_points)


def _points_of(shape: isomatch.Asset | isomatch.PointCloud) -> isomatch.Mesh | isomatch.PointCloud:
    """Return the surface with the points of the file, whose numbers a file of landmarks may have."""
    if isinstance(shape, isomatch.PointCloud):
        return shape
    return isomatch.Mesh(shape.placed_points, shape.polygons.triangles)


def _read_map(path: Path, target: isomatch.Asset | isomatch.PointCloud) -> Any:
    """Read a map, with the expected errors if it has them."""
    if path.suffix != ".npz":
        n_target = len(target.points) if isinstance(target, isomatch.Asset) else target.n_vertices
        return isomatch.Correspondence.load(path, n_target)
    with suppress(FormatError):
        return isomatch.MatchResult.load(path)
    return isomatch.Correspondence.load(path)


def _summary(record: dict[str, Any], landmarks: isomatch.Landmarks, output: Path) -> None:
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
