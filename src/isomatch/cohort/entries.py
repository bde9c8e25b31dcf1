"""The shapes of a collection, from a folder, a pattern or a list; and which pairs of them are matched."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from glob import glob
from itertools import combinations, pairwise
from pathlib import Path
from unicodedata import normalize

from isomatch._core.errors import InputError
from isomatch._core.files import ignores_case, legible
from isomatch._core.texts import read_csv
from isomatch.io import meshes_among

BETWEEN = "__"  # of two names, in the name of the file of their maps
PATTERNS = ("star", "all", "chain", "ring")
SIDE = 8  # shapes at either side of the tiles that shards are cut from
# on Windows, whatever the suffix
_OF_DEVICES = re.compile(r"(con|prn|aux|nul|(com|lpt)[0-9])(\..*)?", re.IGNORECASE)
_NAMED = "give a list.csv with columns name and path"
Pair = tuple[str, str]
"""Names of two shapes; both directions are matched."""


@dataclass(frozen=True)
class Entry:
    """A shape of a collection."""

    name: str  # stands for the shape in tables and names of files
    path: Path
    reflected: bool = False  # whether it is matched as its mirror image


def entries_of(shapes: str | Path | Iterable[str | Path | Entry]) -> tuple[Entry, ...]:
    """List the shapes of a collection, see `Collection.create`, in the order of their names, or of the list."""
    if not isinstance(shapes, str | Path):
        entries = [
            each if isinstance(each, Entry) else Entry(legible(Path(each).stem), Path(each))
            for each in shapes
        ]
    elif str(shapes).endswith(".csv"):
        entries = _in_table(Path(shapes))
    else:
        folder = Path(shapes)
        paths = folder.iterdir() if folder.is_dir() else map(Path, glob(str(shapes)))
        entries = [Entry(legible(path.stem), path) for path in meshes_among(paths)]
    if not entries:
        raise InputError(
            f"{shapes}: no shapes that can be read; give a folder, a quoted pattern or a list.csv"
        )
    names = [entry.name for entry in entries]
    if twice := [name for name, count in Counter(names).items() if count > 1]:
        raise InputError(f"{shapes}: several shapes are named {', '.join(twice)}; {_NAMED}")
    if bad := unusable_names(names):
        raise InputError(
            f"{shapes}: {', '.join(bad)} cannot be names of shapes: they are parts of file names, joined by {BETWEEN!r}; "
            f"{_NAMED}"
        )
    if devices := [name for name in names if _OF_DEVICES.fullmatch(name)]:
        raise InputError(
            f"{shapes}: {', '.join(devices)} cannot be names of shapes: files of such names are devices on Windows; "
            f"{_NAMED}"
        )
    return tuple(entries)


def _in_table(path: Path) -> list[Entry]:
    rows = read_csv(path)
    if rows and "path" not in rows[0]:
        raise InputError(f"{path}: has no column 'path'; its first line names the columns, such as name,path")
    files = [path.parent / row["path"] for row in rows]
    return [Entry(row.get("name") or legible(file.stem), file) for row, file in zip(rows, files)]


def unusable_names(names: Iterable[str]) -> list[str]:
    """List the names that cannot be parts of names of files, or would make the same one: a_ and b, a and _b."""
    names = list(names)
    mixed = any(name.startswith("_") for name in names)
    return [
        name
        for name in names
        if not name or BETWEEN in name or (mixed and name.endswith("_")) or set(name) & set('/\\:*?"<>|')
    ]


def require_files_of_their_own(names: Iterable[str], folder: Path) -> None:
    """Raise `InputError` if files of two names would be the same one in a folder that ignores case."""
    alike: dict[str, list[str]] = {}
    for name in names:
        alike.setdefault(normalize("NFC", name).lower(), []).append(name)
    twice = [same for same in alike.values() if len(same) > 1]
    if twice and ignores_case(folder):
        raise InputError(
            f"{folder}: has one file for the shapes {' and '.join(twice[0])}, as it ignores case; {_NAMED}"
        )


def pairs_of(names: Sequence[str], pattern: str, template: str | None) -> list[Pair]:
    """List the pairs to match, each two shapes once: by a pattern of `Collection.create`, or from its CSV file."""
    if pattern == "star":
        return [(template, name) for name in names if template and name != template]
    if pattern == "all":
        return list(combinations(names, 2))
    if pattern == "chain":
        return list(pairwise(names))
    if pattern == "ring":
        if len(names) < 3:
            raise InputError(f"a ring has at least three shapes, not {len(names)}; match a chain")
        return list(pairwise([*names, names[0]]))
    return _listed(Path(pattern), names)


def _listed(path: Path, names: Collection[str]) -> list[Pair]:
    rows = read_csv(path)
    if not rows or not {"source", "target"} <= set(rows[0]):
        raise InputError(f"{path}: no pairs; give columns source and target, named in the first line")
    pairs = [(row["source"], row["target"]) for row in rows]
    if strangers := sorted({name for pair in pairs for name in pair} - set(names)):
        raise InputError(f"{path}: {', '.join(strangers)} are no shapes of this collection; give their names")
    if any(a == b for a, b in pairs):
        raise InputError(f"{path}: a shape is paired with itself; remove these lines")
    by_ends: dict[frozenset[str], Pair] = {}
    for pair in pairs:
        by_ends.setdefault(frozenset(pair), pair)
    return list(by_ends.values())


def tiles_of(pairs: Sequence[Pair], names: Sequence[str], side: int, most: int) -> list[list[Pair]]:
    """Group pairs, at most so many, of at most ``side`` shapes with as many others, so that shapes are loaded once."""
    block = {name: i // side for i, name in enumerate(names)}
    groups: dict[tuple[int, int], list[Pair]] = {}
    for a, b in pairs:
        groups.setdefault((block[a], block[b]), []).append((a, b))
    return [group[i : i + most] for group in groups.values() for i in range(0, len(group), most)]
