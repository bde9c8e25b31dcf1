"""Files of maps: all arrays in an ``.npz`` file, or the vertices alone in a text; and those of other programs."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from isomatch.correspondence.foreign_maps import Counted, IndexBase, counted_from_zero, the_vector
from isomatch.errors import FormatError
from isomatch.storage.array_file import (
    FIRST_VERSION,
    Archive,
    ArrayFormat,
    Stored,
    read_array,
    read_mat,
    require_known_version,
    save_arrays,
)
from isomatch.storage.files import opened, replaced
from isomatch.storage.texts import read_integers
from isomatch.values.arrays import AnyArray

DIRECTION = "source -> target"
FORMAT = ArrayFormat(
    what="a map",
    writer="Correspondence.save",
    version=1,  # raise it when earlier versions of isomatch could not read the files
    arrays={
        "direction": Stored("text", group="direction"),
        "n_target": Stored("integer", group="n_target"),
        "vertices": Stored("integer", ("n",)),
        "faces": Stored("integer", ("n", 3), group="precise"),
        "barycentric": Stored("float", ("n", 3), group="precise"),
        "source_hash": Stored("text", group="source_hash"),
        "target_hash": Stored("text", group="target_hash"),
    },
)

_HEADER = re.compile(
    r"# isomatch map(?:, format version (?P<version>[0-9]{1,9}))?,.*\n"
    r"# (?P<n_source>[0-9]{1,18}) source vertices, (?P<n_target>[0-9]{1,18}) target vertices"
    r"(?:.*\n#.*\n# source hash (?P<source_hash>\w+), target hash (?P<target_hash>\w+))?"
)
LONGEST_HEADER = 1000  # bytes of a text
_LINES = "write one 0-based target vertex on each line, -1 where unmatched"


def write_map(path: Path, parts: dict[str, Any]) -> None:
    """Write the parts of a map, by name; an empty hash is left out."""
    parts = {name: part for name, part in parts.items() if not isinstance(part, str) or part}
    if path.suffix == ".npz":
        save_arrays(path, FORMAT.version, {"direction": np.array(DIRECTION), **parts}, compressed=True)
        return
    header = (
        f"isomatch map, format version {FORMAT.version}, {DIRECTION}\n"
        f"{len(parts['vertices'])} source vertices, {parts['n_target']} target vertices\n"
        "line i (from 0): 0-based target vertex of source vertex i, -1 if unmatched"
    )
    if "source_hash" in parts and "target_hash" in parts:
        header += f"\nsource hash {parts['source_hash']}, target hash {parts['target_hash']}"
    with replaced(path) as file:
        np.savetxt(file, parts["vertices"], fmt="%d", header=header)


def map_parts(
    path: Path,
    n_target: int | None,
    n_source: int | None = None,
    counts_from: int | None = None,
    variable: str | None = None,
) -> tuple[dict[str, Any], Counted]:
    """Read the parts of a map, by name, and how its indices were taken; for the arguments see `Correspondence.load`.

    Raises
    ------
    FormatError
        If the file holds no map, or one between other numbers of vertices.
    """
    suffix = path.suffix.lower()
    declared, stored = False, None
    if suffix == ".mat":
        arrays = read_mat(path, "a map", "one array of target vertices")
        parts: dict[str, Any] = {"vertices": the_vector(path, arrays, n_source, variable)}
    elif suffix == ".npy":
        parts = {"vertices": the_vector(path, {"the array": read_array(path)}, n_source)}
    elif suffix == ".npz":
        declared, stored, parts = _read_arrays(path, n_source, variable)
    else:
        declared, stored, parts = _read_text(path)
    if stored is not None and n_target not in (None, stored):
        raise FormatError(
            f"{path}: is a map onto a target of {stored} vertices, not {n_target}; give the map of these two shapes"
        )
    if n_source is not None and len(parts["vertices"]) != n_source:
        raise FormatError(
            f"{path}: maps {len(parts['vertices'])} vertices, but the source has {n_source}; give the map of these two "
            "shapes in this direction"
        )
    known = n_target if stored is None else stored
    counted = Counted(parts["vertices"], IndexBase(0))
    if not declared:
        counted = counted_from_zero(path, parts["vertices"], known, counts_from)
    parts |= {"vertices": counted.image, "n_target": known}
    if known is None:
        parts["n_target"] = int(counted.image.max(initial=-1)) + 1
    return parts, counted


def _read_arrays(
    path: Path, n_source: int | None, variable: str | None
) -> tuple[bool, int | None, dict[str, Any]]:
    """Read a map from an ``.npz`` file: whether isomatch wrote it, its number of target vertices, if any, and arrays.

    What isomatch wrote has a direction or a version.
    """

    def refuse(problem: str) -> NoReturn:
        raise FormatError(f"{path}: not a map ({problem}); expected a file written by {FORMAT.writer}")

    with Archive.opened(path, refuse) as file:
        names = file.names
        if not {"direction", "format_version"} & set(names):  # of another program
            if not names:
                refuse("it has no array 'vertices'")
            found: dict[str, AnyArray] = file.read_all(names)
            return False, None, {"vertices": the_vector(path, found, n_source, variable)}
    if variable is not None:
        raise FormatError(
            f"{path}: isomatch wrote it, and its map is not {variable!r}; leave out the variable"
        )
    arrays = FORMAT.read(path)
    if arrays.pop("direction", DIRECTION) != DIRECTION:
        raise FormatError(f"{path}: does not map {DIRECTION}; exchange the shapes, or give another map")
    n_target = arrays.pop("n_target", None)
    return True, None if n_target is None else int(n_target), arrays


def _read_text(path: Path) -> tuple[bool, int | None, dict[str, Any]]:
    """Read a map from a text file: whether isomatch wrote it, its number of target vertices, if any, and vertices."""
    with opened(path) as file:
        header = _HEADER.match(file.read(LONGEST_HEADER).decode("utf-8-sig", errors="replace"))
    if header:
        require_known_version(path, int(header["version"] or FIRST_VERSION), FORMAT.version)

    def refuse(number: int, line: str) -> NoReturn:
        raise FormatError(f"{path}:{number}: {line[:40]!r} is not a target vertex; {_LINES}")

    image = read_integers(path, 1, refuse)[:, 0]
    if header and len(image) != int(header["n_source"]):
        raise FormatError(
            f"{path}: {len(image)} lines for the {header['n_source']} source vertices of its header; "
            "it is cut short or was edited, copy it again or remove the header"
        )
    if not (header or len(image)):
        raise FormatError(f"{path}: no target vertices; {_LINES}")
    hashes = {name: header[name] or "" for name in ("source_hash", "target_hash")} if header else {}
    return header is not None, int(header["n_target"]) if header else None, {"vertices": image, **hashes}
