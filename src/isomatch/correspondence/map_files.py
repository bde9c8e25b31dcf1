"""Files of maps, of isomatch and of other programs: which array is the map, and its first index."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

import numpy as np

from isomatch._core.array_file import (
    FIRST_VERSION,
    Archive,
    ArrayFormat,
    Stored,
    read_array,
    read_mat,
    require_known_version,
    save_arrays,
)
from isomatch._core.arrays import AnyArray, IntArray
from isomatch._core.errors import FormatError, SettingError
from isomatch._core.files import open_file, replaced
from isomatch._core.tables import read_integers

DIRECTION = "source -> target"  # text in each file: its map leads from the source to the target
FORMAT = ArrayFormat(  # contents of the file of a map
    what="a map",
    writer="Correspondence.save",
    version=1,  # raise it with a change after which earlier versions of isomatch cannot read the file
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

SIDES = ("there", "back")  # prefixes of the arrays of both maps of a pair: from source to target, and back
# each prefix, with the name of the number of vertices of the shape from which its map leads
_ENDS = tuple(zip(SIDES, ("n_source", "n_target")))
PAIR_FORMAT = ArrayFormat(  # contents of the file of the maps of a pair, both ways
    what="the maps of a pair",
    writer="isomatch collect",
    version=1,
    arrays={
        "record": Stored("text"),
        **{f"{side}_vertices": Stored("integer", (n,)) for side, n in _ENDS},
        **{f"{side}_faces": Stored("integer", (n, 3)) for side, n in _ENDS},
        **{f"{side}_barycentric": Stored("float", (n, 3)) for side, n in _ENDS},
        **{f"{side}_expected_error": Stored("float", (n,), group="errors") for side, n in _ENDS},
    },
)

_HEADER = re.compile(  # matches the first lines of the text file of a map
    r"# isomatch map(?:, format version (?P<version>[0-9]{1,9}))?,.*\n"
    r"# (?P<n_source>[0-9]{1,18}) source vertices, (?P<n_target>[0-9]{1,18}) target vertices"
    r"(?:.*\n#.*\n# source hash (?P<source_hash>\w+), target hash (?P<target_hash>\w+))?"
)
MAX_HEADER_BYTES = 1000  # bytes at the start of a text file among which its header is sought; chosen
_LINES = "write one 0-based target vertex on each line, -1 where unmatched"  # the remedy in messages
_MAX_LISTED_ARRAYS = 8  # largest number of arrays of a file that a message lists; chosen


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
) -> tuple[dict[str, Any], IndexBase]:
    """Read the parts of a map, by name, and its first index; arguments as in `Correspondence.load`."""
    suffix, is_ours = path.suffix.lower(), False
    if suffix == ".mat":
        arrays = read_mat(path, "a map", "one array of target vertices")
        parts: dict[str, Any] = {"vertices": choose_vector(path, arrays, n_source, variable)}
    elif suffix == ".npy":
        parts = {"vertices": choose_vector(path, {"the array": read_array(path)}, n_source)}
    elif suffix == ".npz":
        is_ours, parts = _read_arrays(path, n_source, n_target, variable)
    else:
        is_ours, parts = _read_text(path)
    n_stored = int(parts["n_target"]) if "n_target" in parts else None
    if n_stored is not None and n_target not in (None, n_stored):
        raise FormatError(
            f"{path}: is a map onto a target of {n_stored} vertices, not {n_target}; give the map of these two shapes"
        )
    if n_source is not None and len(parts["vertices"]) != n_source:
        raise FormatError(
            f"{path}: maps {len(parts['vertices'])} vertices, but the source has {n_source}; give the map of these two "
            "shapes in this direction"
        )
    n_target = n_target if n_stored is None else n_stored
    image, base = parts["vertices"], IndexBase(0)
    if not is_ours:
        image, base = count_from_zero(path, image, n_target, counts_from)
    n_target = int(image.max(initial=-1)) + 1 if n_target is None else n_target
    return parts | {"vertices": image, "n_target": n_target}, base


def _read_arrays(
    path: Path, n_source: int | None, n_target: int | None, variable: str | None
) -> tuple[bool, dict[str, Any]]:
    """Return whether isomatch wrote an ``.npz`` file, and the parts of its map."""

    def refuse(problem: str) -> NoReturn:
        raise FormatError(f"{path}: not a map ({problem}); expected a file written by {FORMAT.writer}")

    with Archive.opened(path, refuse) as file:
        names = file.names
        is_of_pair = {"record", *(f"{side}_vertices" for side in SIDES)} <= set(names)
        if not {"direction", "format_version"} & set(names):  # files of isomatch have one of these
            if not names:
                refuse("it has no array 'vertices'")
            return False, {"vertices": choose_vector(path, file.read_all(names), n_source, variable)}
    if variable is not None:
        raise FormatError(
            f"{path}: isomatch wrote it, and its map is not {variable!r}; leave out the variable"
        )
    if is_of_pair:
        return True, _read_side(path, n_source, n_target)
    arrays = FORMAT.read(path)
    if arrays.pop("direction", DIRECTION) != DIRECTION:
        raise FormatError(f"{path}: does not map {DIRECTION}; exchange the shapes, or give another map")
    return True, arrays


def pair_parts(arrays: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the parts of both maps of a pair, there and back, from the arrays of `PAIR_FORMAT`.

    `ValueError`, `KeyError` or `TypeError` if the record of the pair is damaged.

    Examples
    --------
    >>> parts = {"vertices": np.array([0]), "faces": np.zeros((1, 3), int), "barycentric": np.eye(3)[:1]}
    >>> arrays = {f"{side}_{name}": part for side in SIDES for name, part in parts.items()}
    >>> there, back = pair_parts({**arrays, "record": '{"source_hash": "a", "target_hash": "b"}'})
    >>> back["source_hash"], back["n_target"]
    ('b', 1)
    """
    record = json.loads(arrays["record"])

    def parts_of(side: str, other: str, source: str, target: str) -> dict[str, Any]:
        weights = arrays[f"{side}_barycentric"].astype(np.float64)
        return {
            "vertices": arrays[f"{side}_vertices"],
            "faces": arrays[f"{side}_faces"],
            "barycentric": weights / weights.sum(axis=1, keepdims=True),
            "source_hash": record[f"{source}_hash"],
            "target_hash": record[f"{target}_hash"],
            "n_target": len(arrays[f"{other}_vertices"]),
        }

    return parts_of(*SIDES, "source", "target"), parts_of(*SIDES[::-1], "target", "source")


def _read_side(path: Path, n_source: int | None, n_target: int | None) -> dict[str, Any]:
    """Read the map of a pair that fits the numbers of vertices, the one from source to target if both fit."""
    try:
        maps = pair_parts(PAIR_FORMAT.read(path))
    except (ValueError, KeyError, TypeError) as error:
        if isinstance(error, FormatError):
            raise
        raise FormatError(f"{path}: not the maps of a pair ({error}); match it again") from None
    for parts in maps:
        if n_source in (None, len(parts["vertices"])) and n_target in (None, parts["n_target"]):
            return parts
    return maps[0]


def _read_text(path: Path) -> tuple[bool, dict[str, Any]]:
    """Return whether isomatch wrote a text, and the parts of its map."""
    with open_file(path) as file:
        header = _HEADER.match(file.read(MAX_HEADER_BYTES).decode("utf-8-sig", errors="replace"))
    if header:
        require_known_version(path, int(header["version"] or FIRST_VERSION), FORMAT.version)

    image = read_integers(path, 1, f"is not a target vertex; {_LINES}")[:, 0]
    if header and len(image) != int(header["n_source"]):
        raise FormatError(
            f"{path}: {len(image)} lines for the {header['n_source']} source vertices of its header; "
            "it is cut short or was edited, copy it again or remove the header"
        )
    if not (header or len(image)):
        raise FormatError(f"{path}: no target vertices; {_LINES}")
    if not header:
        return False, {"vertices": image}
    hashes = {name: header[name] or "" for name in ("source_hash", "target_hash")}
    return True, {"vertices": image, "n_target": int(header["n_target"]), **hashes}


class IndexBase(NamedTuple):
    """The first index of a file, 0 or 1, and how it was found.

    ``is_certain`` if the file or the user says it, or no other reading fits; ``is_likely`` if the
    other reading is unlikely; ``note`` tells a decision, if one was necessary.

    Examples
    --------
    >>> IndexBase(1)
    IndexBase(counts_from=1, is_certain=True, is_likely=True, note='')
    """

    counts_from: int
    is_certain: bool = True
    is_likely: bool = True
    note: str = ""


def choose_vector(
    path: Path, arrays: Mapping[str, Any], n_source: int | None, variable: str | None = None
) -> AnyArray:
    """Choose the array that is a map, one number for each source vertex, by its shape or its name."""
    squeezed = {name: np.squeeze(value) for name, value in arrays.items() if isinstance(value, np.ndarray)}
    shapes = [f"{name} {value.shape}" for name, value in squeezed.items()]
    listed = ", ".join(shapes[:_MAX_LISTED_ARRAYS]) or "no array"
    if variable is not None and variable not in arrays:
        raise FormatError(f"{path}: has no variable {variable!r}; it holds {listed}")
    fitting = {
        name: value
        for name, value in squeezed.items()
        if value.ndim == 1 and value.dtype.kind in "iuf" and n_source in (None, len(value))
        if variable in (None, name)
    }
    vertices = "vertices" if n_source is None else f"{n_source} vertices"
    if not fitting:
        raise FormatError(
            f"{path}: not a map (no array has one number for each of the source's {vertices}); it holds {listed}; "
            "give the map of these two shapes in this direction"
        )
    if len(fitting) > 1:
        names = ", ".join(fitting)
        raise FormatError(
            f"{path}: {names} could each be the map of the source's {vertices}; name one of them as variable, or save it "
            "alone"
        )
    return next(iter(fitting.values()))


def count_from_zero(
    path: Path, indices: AnyArray, n_target: int | None, counts_from: int | None
) -> tuple[IntArray, IndexBase]:
    """Return indices that count from 0; −1 and nan mean unmatched, and 0 in a file that counts from 1."""
    if counts_from not in (None, 0, 1):
        raise SettingError(f"counts_from = {counts_from!r} is neither 0 nor 1")
    if indices.dtype.kind == "f":
        indices = np.where(np.isnan(indices), -1, indices)
        if (indices != np.rint(indices)).any() or (np.abs(indices) > 2**53).any():
            raise FormatError(f"{path}: not a map (fractions are no vertices); give whole numbers")
    image = indices.astype(np.int64)
    base = index_base(path, image, n_target) if counts_from is None else IndexBase(counts_from)
    if base.counts_from == 1:
        image = np.where(image > 0, image - 1, np.where(image == 0, -1, image))
    return image, base


def index_base(path: Path, indices: AnyArray, n: int | None, what: str = "target vertices") -> IndexBase:
    """Find whether indices (m,) of ``what`` count from 0 or from 1, where −1, and maybe 0, means unmatched.

    - The largest is ``n``, their number if known, and none is 0: from 1, for certain.
    - There are 0 and −1, which then means unmatched, or each index from 0 to the largest once:
      from 0, for certain.
    - There are 0 and no −1: likely from 0; but not if 0 occurs several times, more often than any
      other index, as if it meant unmatched.
    - Otherwise from 0, which is not likely. `FormatError` if there are both 0 and ``n``.

    Examples
    --------
    >>> index_base(Path("map.txt"), np.array([2, 4, 1]), 4).note
    'map.txt: counts from 1, as its largest index, 4, is the number of target vertices'
    >>> index_base(Path("map.txt"), np.array([2, 0, 1, 2]), 4)[:3]  # likely from 0
    (0, False, True)
    >>> index_base(Path("map.txt"), np.array([2, 0, -1, 2]), 4)[:3]
    (0, True, True)
    """
    matched = indices[indices >= 0].astype(np.int64)
    if not len(matched):
        return IndexBase(0)
    least, largest = int(matched.min()), int(matched.max())
    if largest == n and least == 0:
        raise FormatError(
            f"{path}: has both 0 and {n}, the number of {what}; if it counts from 1, and 0 means unmatched, say that it "
            "counts from 1, or else give the map of these two shapes"
        )
    if largest == n:
        note = f"{path.name}: counts from 1, as its largest index, {largest}, is the number of {what}"
        return IndexBase(1, note=note)
    if least > 0:
        note = f"{path.name}: indices are read as 0-based; neither 0 nor {n} is among them, which would settle it"
        return IndexBase(0, False, False, "" if n is None else note)
    _, times = np.unique(matched, return_counts=True)
    if len(matched) < len(indices) or len(matched) == len(times) == largest + 1:
        return IndexBase(0)
    if times[0] > max(1, times[1:].max(initial=0)):
        note = f"{path.name}: indices are read as 0-based; its {times[0]} zeros mean unmatched if they are 1-based"
        return IndexBase(0, False, False, note)
    return IndexBase(0, False)
