"""Output that several commands share: claimed files, surfaces in the shape of others, and notes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import isomatch
from isomatch._core.arrays import FloatArray
from isomatch._core.errors import MeshError
from isomatch._core.files import claimed
from isomatch.cli.inputs import Surface
from isomatch.cli.terminal import INDENT, in_shell, say, say_rows
from isomatch.io import Attribute, Frame


@contextmanager
def claimed_files(*paths: Path | None, force: bool) -> Iterator[None]:
    """Claim single files, see `isomatch._core.files.claimed`; those that exist have to be forced."""
    with ExitStack() as claims:
        for path in filter(None, paths):
            claims.enter_context(claimed(path, [] if force else [path]))
        yield


def require_writable(path: Path, mesh: Surface | None = None, rounded: bool = False) -> None:
    """Raise the error of a mesh file whose format is unknown, needs a package, or rounds the positions of a mesh."""
    mesh = mesh if isinstance(mesh, isomatch.Mesh) else isomatch.Mesh(np.eye(3), [[0, 1, 2]])
    corners = mesh.vertices[mesh.sound_faces].reshape(-1, 3)
    with TemporaryDirectory() as folder:
        try:
            triangles = isomatch.Mesh(corners, np.arange(len(corners)).reshape(-1, 3))
            isomatch.write_mesh(Path(folder) / path.name, triangles, rounded=rounded)
        except MeshError as error:
            raise MeshError(str(error).replace(str(Path(folder) / path.name), str(path))) from None


def write_wrapped(
    path: Path,
    asset: isomatch.Asset,
    frame: Frame | None,
    wrapped: isomatch.Wrapped,
    expected_error: FloatArray,  # expected error at each source vertex, (n_source,)
    rounded: bool = False,
) -> dict[str, Any]:
    """Write the asset of the source in the shape of the target, and say how good it is."""
    # Shape keys turn with the surface, normals and tangents are left out, and the frame is the target's.
    moved = replace(asset.moved(wrapped.mesh.vertices[asset.point_of_vertex]), frame=frame)
    if asset.of_kind("key"):
        unmoved = isomatch.Correspondence(range(len(asset.points)), len(asset.points))
        moved = isomatch.carry_attributes(unmoved, moved, asset, "keys").asset
    former_directions = [a.name for a in moved.attributes if a.kind == "normal" or a.is_tangent]
    scalars = {"expected_error": expected_error, "extended": wrapped.extended.astype(float)}
    measured = [Attribute(name, "point", "scalar", values) for name, values in scalars.items()]
    moved = moved.without_attributes(*former_directions).with_attributes(*measured)
    unwritten = isomatch.write_asset(path, moved, rounded=rounded)
    left_out = [a.name for a in unwritten if all(a is not other for other in measured)]
    return {
        "file": str(path),
        **asdict(wrapped.quality),
        "left_out": left_out,
        "not_of_this_shape": former_directions,
    }


def say_wrapped(record: dict[str, Any]) -> None:
    """Print where the target is in the source's topology, and how good it is."""
    extended = record["extended"]
    say(f"{'  as mesh':<{INDENT}}{record['file']}")
    lines = [
        f"the target with the faces of the source; {record['turned']:.2%} of them are turned over, almost no edge is "
        f"stretched by more than {record['stretch']:.2f} ×, vertices are {record['distance']:.2%} of the size (√area) "
        "off on average",
        f"beside it: {', '.join(record['files_beside'])}" if record["files_beside"] else "",
        f"{extended} vertices have no counterpart and are placed by those around them" if extended else "",
    ]
    say_rows(("", line) for line in lines)
    if former := ", ".join(record["not_of_this_shape"]):
        say(f"not in {record['file']}: {former}; they belong to the former shape")
    say_left_out(record["left_out"], record["file"])
    say_notes(record["notes"])


def say_left_out(names: list[str], file: str | Path) -> None:
    """Print what the format of a file has no place for."""
    if names:
        say(f"not in {file}: {', '.join(names)}, which a {Path(file).suffix} file cannot store")


def notes_on(assets: Mapping[Path, isomatch.Asset]) -> list[str]:
    """Return what the readers of files left out or supposed."""
    return [f"{path}: {note}" for path, asset in assets.items() for note in asset.notes]


def say_notes(notes: Iterable[str]) -> None:
    """Print notes on files or a result."""
    for note in notes:
        say(f"note: {in_shell(note)}")
