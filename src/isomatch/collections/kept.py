"""Whether the files that a collection keeps are as they were written, by the digests in its ledgers."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from hashlib import blake2b
from pathlib import Path
from typing import NamedTuple

from isomatch.collections.layout import Layout
from isomatch.collections.ledger import Ledger, Rows, read_ledgers, writing_ledger
from isomatch.collections.map_file import PairMaps, Record
from isomatch.collections.pairs import Pair
from isomatch.errors import FormatError
from isomatch.runtime.threads import n_threads
from isomatch.storage.files import opened

KEPT = ("prepared", "maps", "corresponded", "landmarks")
"""Folders of the files that have a digest."""
MISSING, CHANGED = "is missing", "was changed after it was written"
MOST_NAMED = 5  # files in an error


def digest_of(path: Path) -> str:
    """Return the digest of the bytes of a file."""
    found = blake2b(digest_size=16)
    with opened(path) as file:
        while block := file.read(2**20):
            found.update(block)
    return found.hexdigest()


def put_files(ledger: Ledger, layout: Layout, digests: dict[Path, str]) -> None:
    """Write rows of files in the folder of a collection."""
    for path, digest in digests.items():
        name = path.relative_to(layout.folder).as_posix()
        ledger.put_file(name, {"state": "done", "time": time.time(), "file": digest})


def keep_files(layout: Layout, paths: Iterable[Path]) -> None:
    """Write the digests of files in the folder of a collection to its ledger."""
    with writing_ledger(layout.ledger()) as ledger:
        put_files(ledger, layout, {path: digest_of(path) for path in paths})


def changed_files(layout: Layout, rows: Rows, folders: Iterable[str] = KEPT) -> dict[Path, str]:
    """Find the files that are not as they were written.

    Parameters
    ----------
    layout : Layout
        The folder of the collection.
    rows : Rows
        The contents of its ledgers.
    folders : iterable of str
        Of which folders in it, see `KEPT`.

    Returns
    -------
    dict of Path to str
        What is wrong with each: ``MISSING`` or ``CHANGED``. Maps of pairs that are to be matched again are not looked at.

    Notes
    -----
    All bytes are read, since neither time nor size of a file tells that a disk lost some.
    """
    wanted = set(folders)
    kept = [each for each in _kept(layout, rows) if each.path.parent.name in wanted]
    with ThreadPoolExecutor(n_threads()) as threads:
        return {each.path: found for each, found in zip(kept, threads.map(_wrong, kept)) if found}


def require_unchanged(layout: Layout, folders: Iterable[str]) -> None:
    """Raise `FormatError` if files of some folders of a collection are not as they were written."""
    found = changed_files(layout, read_ledgers(layout.ledgers()), folders)
    if found:
        named = [f"{path} {what}" for path, what in list(found.items())[:MOST_NAMED]]
        more = f" and {len(found) - MOST_NAMED} more" if len(found) > MOST_NAMED else ""
        raise FormatError(
            f"{', '.join(named)}{more}; run isomatch collect again, which makes what is damaged again"
        )


class _Kept(NamedTuple):
    """A file, its row, and the pair that it holds the maps of."""

    path: Path
    row: Record
    pair: Pair | None = None


def _kept(layout: Layout, rows: Rows) -> Iterator[_Kept]:
    for row in rows.shapes.values():
        if "file" in row:
            yield _Kept(layout.prepared(row["key"]), row)
    for pair, row in rows.pairs.items():
        if "file" in row and rows.is_current(pair):
            yield _Kept(layout.maps(pair), row, pair)
    for name, row in rows.files.items():
        yield _Kept(layout.folder / name, row)


def _wrong(kept: _Kept) -> str:
    with suppress(FormatError, OSError):  # the second: the disk does not give it
        if digest_of(kept.path) == kept.row["file"] or (kept.pair and _was_just_replaced(kept)):
            return ""
    return CHANGED if kept.path.exists() else MISSING


def _was_just_replaced(kept: _Kept) -> bool:
    """Whether a comparison of maps replaced those of a pair, and was killed before it wrote the row."""
    record = PairMaps.load(kept.path).record
    return bool(
        record.get("key") == kept.row["key"]
        and record.get("replaced_by") != kept.row.get("replaced_by")
        and "replaced_by" in record
    )
