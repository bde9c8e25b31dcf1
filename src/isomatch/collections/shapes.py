"""The shapes of a collection: names and files, from a folder, a pattern or a list."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from glob import glob
from pathlib import Path
from unicodedata import normalize

from isomatch.assets import FORMATS
from isomatch.errors import InputError
from isomatch.storage.files import ignores_case, legible
from isomatch.storage.texts import read_csv

BETWEEN = "__"  # of two names, in the name of the file of their maps
_OF_DEVICES = re.compile(
    r"(con|prn|aux|nul|(com|lpt)[0-9])(\..*)?", re.IGNORECASE
)  # on Windows, whatever the suffix


@dataclass(frozen=True)
class Entry:
    """A shape of a collection.

    Parameters
    ----------
    name : str
        Stands for the shape in tables and names of files.
    path : Path
        Its file.
    reflected : bool
        Whether it is matched as its mirror image.
    """

    name: str
    path: Path
    reflected: bool = False


def entries_of(shapes: str | Path | Iterable[str | Path]) -> tuple[Entry, ...]:
    """List the shapes of a collection.

    Parameters
    ----------
    shapes : path_like, or iterable of path_like
        A folder, all files of which that can be read are taken; a pattern such as ``'scans/*.vtp'``; a CSV file with
        a column ``path``, relative to its folder, and perhaps ``name``; or the files.

    Returns
    -------
    tuple of Entry
        In the order of their names, or of the list. By default a shape has the name of its file without the suffix, see
        `isomatch.storage.files.legible`.

    Raises
    ------
    InputError
        If there are none, two have the same name, or a name cannot be part of that of a file.
    """
    if isinstance(shapes, str | Path):
        entries = _listed(Path(shapes)) if str(shapes).endswith(".csv") else _in_folder(str(shapes))
    else:
        entries = [Entry(legible(Path(path).stem), Path(path)) for path in shapes]
    if not entries:
        raise InputError(
            f"{shapes}: no shapes that can be read; give a folder, a quoted pattern or a list.csv"
        )
    twice = [name for name, count in Counter(entry.name for entry in entries).items() if count > 1]
    if twice:
        raise InputError(
            f"{shapes}: several shapes are named {', '.join(twice)}; give a list.csv with columns name and path"
        )
    bad = unusable_names(entry.name for entry in entries)
    if bad:
        raise InputError(
            f"{shapes}: {', '.join(bad)} cannot be names of shapes: they are parts of file names, joined by {BETWEEN!r}; "
            "give a list.csv with columns name and path"
        )
    devices = [entry.name for entry in entries if _OF_DEVICES.fullmatch(entry.name)]
    if devices:
        raise InputError(
            f"{shapes}: {', '.join(devices)} cannot be names of shapes: files of such names are devices on Windows; give "
            "a list.csv with columns name and path"
        )
    return tuple(entries)


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
            f"{folder}: has one file for the shapes {' and '.join(twice[0])}, as it ignores case; give a list.csv with "
            "columns name and path"
        )


def _in_folder(where: str) -> list[Entry]:
    folder = Path(where)
    paths = folder.iterdir() if folder.is_dir() else map(Path, glob(where))
    return [
        Entry(legible(path.stem), path)
        for path in sorted(paths)
        if path.is_file() and path.suffix.lower() in FORMATS
    ]


def _listed(path: Path) -> list[Entry]:
    rows = read_csv(path)
    if rows and "path" not in rows[0]:
        raise InputError(f"{path}: has no column 'path'; its first line names the columns, such as name,path")
    files = [path.parent / row["path"] for row in rows]
    return [Entry(row.get("name") or legible(file.stem), file) for row, file in zip(rows, files)]
