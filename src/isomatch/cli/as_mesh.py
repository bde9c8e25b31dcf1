"""The mesh of a result: the source in the shape of the target, as ``match --as-mesh`` writes it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import isomatch
from isomatch.assets import Attribute, Frame, files_beside
from isomatch.cli.outputs import (
    ResultFolder,
    claimed_files,
    notes_on,
    require_writable,
    say_left_out,
    say_notes,
)
from isomatch.cli.terminal import INDENT, json_text, say, say_rows
from isomatch.storage.files import write_text
from isomatch.values.arrays import FloatArray

MESH_LEFT = (
    "{} is of the map before and was left; in Python, MatchResult.as_mesh gives the surface by this one"
)


@dataclass(frozen=True)
class ResultMesh:
    """The mesh file of a result, and what it is made of.

    Parameters
    ----------
    path : Path
        The file.
    source, target : Path
        Files of the two shapes.
    assets : (Asset, Asset)
        What they hold.
    beside : tuple of Path
        Files that are written beside it, see `files_beside`.
    """

    path: Path
    source: Path
    target: Path
    assets: tuple[isomatch.Asset, isomatch.Asset]
    beside: tuple[Path, ...]

    @classmethod
    def read(cls, path: Path, source: Path, target: Path) -> ResultMesh:
        """Read both shapes, once it is known that the file can be written."""
        require_writable(path)
        assets = isomatch.read_asset(source), isomatch.read_asset(target, sound=False)
        return cls(path, source, target, assets, files_beside(path, assets[0]))

    @contextmanager
    def claimed(self, force: bool) -> Iterator[None]:
        """Claim all its files, see `claimed_files`."""
        with claimed_files(self.path, *self.beside, force=force):
            yield

    def write(
        self,
        folder: ResultFolder,
        record: dict[str, Any],
        found: isomatch.MatchResult,
        *shapes: isomatch.Mesh | isomatch.PointCloud,
    ) -> None:
        """Write it for the result in the folder, and add it to the ``record`` there."""
        wrapped = isomatch.wrap(found.map, *shapes)
        record["as_mesh"] = {
            **write_wrapped(self.path, self.assets[0], self.assets[1].frame, wrapped, found.expected_error),
            "files_beside": list(map(str, self.beside)),
            "notes": notes_on(dict(zip((self.source, self.target), self.assets))),
        }
        write_text(folder.result, json_text(record))


def write_wrapped(
    path: Path,
    asset: isomatch.Asset,
    frame: Frame | None,
    wrapped: isomatch.Wrapped,
    expected_error: FloatArray,
) -> dict[str, Any]:
    """Write the asset of the source in the shape of the target, and say how good it is.

    All that it carries is written too, shape keys turned with the surface, but no normals and tangents; the frame of the
    coordinates is that of the target. Where the format takes scalars, the expected error (n_source,) of each vertex is
    added, and whether it is extended.
    """
    moved = replace(asset.moved(wrapped.mesh.vertices[asset.point_of_vertex]), frame=frame)
    if asset.of_kind("key"):
        unmoved = isomatch.Correspondence(range(len(asset.points)), len(asset.points))
        moved = isomatch.carry_attributes(unmoved, moved, asset, "keys").asset
    turned = [
        attribute.name for attribute in moved.attributes if attribute.kind == "normal" or attribute.is_tangent
    ]
    errors = Attribute("expected_error", "point", "scalar", expected_error)
    extended = Attribute("extended", "point", "scalar", wrapped.extended.astype(float))
    own = (errors, extended)
    left = isomatch.write_asset(path, moved.without_attributes(*turned).with_attributes(*own))
    names = [attribute.name for attribute in left if all(attribute is not each for each in own)]
    return {"file": str(path), **asdict(wrapped.quality), "left_out": names}


def say_wrapped(record: dict[str, Any]) -> None:
    """Print where the target is in the source's topology, and how good it is."""
    extended = record["extended"]
    say(f"{'  as mesh':<{INDENT}}{record['file']}")
    lines = [
        f"the target with the faces of the source; {record['turned']:.2%} of them are turned over, almost no edge is "
        f"stretched by more than {record['stretch']:.2f} ×, vertices are {record['distance']:.2%} of the size (√area) "
        "off on average",
        f"materials: {', '.join(record['files_beside'])}" if record["files_beside"] else "",
        f"{extended} vertices have no counterpart and are placed by those around them" if extended else "",
    ]
    say_rows(("", line) for line in lines)
    say_left_out(record["left_out"], record["file"])
    say_notes(record["notes"])
