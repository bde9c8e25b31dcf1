"""Files of named arrays (``.npz``) with a format version: complete when written, checked when read."""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

import numpy as np

from isomatch._arrays import AnyArray, FloatArray, IntArray
from isomatch._files import opened, replaced
from isomatch.errors import FormatError, some

FIRST_VERSION = 1
"""Format of files that carry no version, which isomatch 0.1 wrote."""

_VERSION = "format_version"
_DAMAGED = (OSError, EOFError, ValueError, KeyError, RuntimeError, zipfile.BadZipFile, zlib.error)


def save_arrays(
    path: str | Path, version: int, arrays: Mapping[str, object], *, compressed: bool = False
) -> None:
    """Write arrays and the version of their format; an earlier file is replaced only by a complete new one."""
    write_arrays(Path(path), {_VERSION: np.array(version), **arrays}, compressed=compressed)


def write_arrays(path: Path, arrays: Mapping[str, object], *, compressed: bool = True) -> None:
    """Write arrays to a file, see `replaced`."""
    with replaced(path) as file:
        (np.savez_compressed if compressed else np.savez)(file, **arrays)  # type: ignore[arg-type]


def require_known_version(path: Path, found: int, known: int) -> None:
    """Raise `FormatError` if a file was written by an isomatch that is too new to be understood."""
    if found > known:
        raise FormatError(
            f"{path}: has format version {found}, and this isomatch reads versions up to {known}; upgrade isomatch"
        )


@dataclass(frozen=True)
class ArrayFile:
    """The arrays of a file, each checked when it is taken; whatever does not fit is a `FormatError`.

    Parameters
    ----------
    path : Path
        The file, for messages.
    what : str
        What it should hold, such as "a map".
    writer : str
        What writes such files.
    arrays : mapping of str to array
        Its contents.
    """

    path: Path
    what: str
    writer: str
    arrays: Mapping[str, AnyArray]

    @classmethod
    def read(cls, path: str | Path, what: str, writer: str, version: int) -> ArrayFile:
        """Read all arrays of a file whose format version is at most ``version``."""
        path = Path(path)
        arrays: dict[str, AnyArray] = {}
        file = cls(path, what, writer, arrays)
        with opened(path) as stream:
            try:
                stored = np.load(stream, allow_pickle=False)
                if isinstance(stored, np.ndarray):
                    raise ValueError("it holds a single array")
                arrays |= dict(stored)
            except _DAMAGED as error:
                file.refuse(str(error))
        require_known_version(
            path, int(file.integers(_VERSION)) if _VERSION in file else FIRST_VERSION, version
        )
        return file

    def __contains__(self, name: str) -> bool:
        return name in self.arrays

    def floats(self, name: str, *shape: int | None) -> FloatArray:
        """Take an array of finite real numbers; ``None`` in its shape is any length."""
        array = self._take(name, "fiu", "numbers", shape)
        if not np.isfinite(array).all():
            self.refuse(f"{name} has entries that are not finite")
        return array

    def integers(self, name: str, *shape: int | None, n: int | None = None) -> IntArray:
        """Take an array of integers; with ``n``, of indices 0…n − 1."""
        array = self._take(name, "iu", "integers", shape)
        if n is not None and len(bad := np.flatnonzero((array < 0) | (array >= n))):
            self.refuse(f"{name} has entries outside 0…{n - 1} at {some(bad)}")
        return array

    def text(self, name: str) -> str:
        """Take a string."""
        return str(self._take(name, "U", "a text", ()))

    def refuse(self, problem: str) -> NoReturn:
        """Raise the `FormatError` that says why this file cannot be used."""
        raise FormatError(
            f"{self.path}: not {self.what} ({problem}); expected a file written by {self.writer}"
        )

    def _take(self, name: str, kinds: str, kind: str, shape: tuple[int | None, ...]) -> AnyArray:
        if name not in self:
            self.refuse(f"it has no array {name!r}")
        array = self.arrays[name]
        fits = array.ndim == len(shape) and all(m in (None, n) for m, n in zip(shape, array.shape))
        if not fits or array.dtype.kind not in kinds:
            wanted = ", ".join("any" if length is None else str(length) for length in shape)
            self.refuse(
                f"{name} has shape {array.shape} and type {array.dtype}, not {kind} of shape ({wanted})"
            )
        return array
