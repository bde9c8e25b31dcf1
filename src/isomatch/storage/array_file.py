"""Files of named arrays (``.npz``): complete when written, checked when read, headers before contents."""

from __future__ import annotations

import os
import warnings
import zipfile
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from io import BytesIO
from math import prod
from pathlib import Path
from tokenize import TokenError
from typing import Any, BinaryIO, Literal, NamedTuple, NoReturn

import numpy as np
from numpy.lib import format as npy

from isomatch.errors import FormatError, MemoryBudgetError, some
from isomatch.runtime.memory import require_memory, room_for
from isomatch.storage.files import opened, replaced
from isomatch.values.arrays import AnyArray

FIRST_VERSION = 1
"""Format of files that carry no version, which isomatch 0.1 wrote."""

_VERSION = "format_version"
_DAMAGED = (
    OSError, EOFError, ValueError, KeyError, RuntimeError, OverflowError, zipfile.BadZipFile, zlib.error,
    SyntaxError, TokenError, TypeError, MemoryError,
)  # fmt: skip
"""What the zip archive raises, and in the last line the parser of headers of arrays."""
_KINDS = {"float": ("fiu", "numbers"), "integer": ("iu", "integers"), "text": ("U", "a text")}
LONGEST_HEADER = 1000  # bytes of the header of an array; numpy writes 128
LARGEST_RATIO = 1032  # of the sizes before and after deflate
_NUMBERS_OR_TEXT = "fciubU"  # kinds of types
_READ_HEADER = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}


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


def read_array(path: Path) -> AnyArray:
    """Read an ``.npy`` file of numbers or text; `FormatError` if it is none, or holds more or less than it declares."""

    def refuse(problem: str) -> NoReturn:
        raise FormatError(f"{path}: not an array ({problem}); expected a file written by numpy.save")

    with opened(path) as file:
        data = BytesIO(file.read())
    size = len(data.getbuffer())
    try:
        with warnings.catch_warnings(action="ignore"):
            header = Header(*_read_shape(BytesIO(data.getvalue()[:LONGEST_HEADER])))
            if header.dtype.kind not in _NUMBERS_OR_TEXT or header.n_bytes > size:
                refuse(f"it declares shape {header.shape} of type {header.dtype}")
            array: AnyArray = npy.read_array(data, allow_pickle=False)
    except _DAMAGED as error:
        if isinstance(error, FormatError):
            raise
        refuse(str(error).partition("\n")[0] or type(error).__name__)
    return array


def _read_shape(start: BinaryIO) -> tuple[tuple[int, ...], np.dtype[np.generic]]:
    """Read the shape and type that the header of an array declares."""
    shape, _, dtype = _READ_HEADER[npy.read_magic(start)](start)
    return shape, dtype


@dataclass(frozen=True)
class Stored:
    """What one array of a file has to be.

    Parameters
    ----------
    kind : {"float", "integer", "text"}
        Type of its entries. Integers are accepted as floats, and floats have to be finite.
    shape : tuple of int or str
        Its lengths. A name stands for a length that is the same wherever the name occurs.
    positive : bool
        Whether all entries have to be larger than 0.
    index_of : str
        Name of a length n; the entries have to be indices 0…n − 1.
    group : str
        The array may be absent together with all others of its group. By default it may not.
    """

    kind: Literal["float", "integer", "text"]
    shape: tuple[int | str, ...] = ()
    positive: bool = False
    index_of: str = ""
    group: str = ""


@dataclass(frozen=True)
class ArrayFormat:
    """The arrays that a file has to hold.

    Parameters
    ----------
    what : str
        What they make together, such as "a map".
    writer : str
        What writes such files.
    version : int
        Format version of the files; earlier ones are read too.
    arrays : mapping of str to Stored
        What each array has to be, by name. Other arrays are not read.
    filled : tuple of str
        Names of lengths that may not be 0.
    """

    what: str
    writer: str
    version: int
    arrays: Mapping[str, Stored]
    filled: tuple[str, ...] = ()

    def read(self, path: str | Path) -> dict[str, Any]:
        """Read the arrays of a file, each as float32, float64, int64 or, for a text, as a string.

        Headers are checked before any contents are read.

        Raises
        ------
        FormatError
            If the file is missing (`MissingFileError`), damaged or too new, or an array is not as declared.
        MemoryBudgetError
            If the arrays would exceed the memory budget.
        """
        path = Path(path)

        def refuse(problem: str) -> NoReturn:
            raise FormatError(
                f"{path}: not {self.what} ({problem}); expected a file written by {self.writer}"
            )

        with Archive.opened(path, refuse) as stored:
            if _VERSION in stored:
                self._fit({_VERSION: Stored("integer")}, stored)
                require_known_version(path, int(stored.read(_VERSION)), self.version)
            groups = {"", *(each.group for name, each in self.arrays.items() if name in stored)}
            wanted = {name: each for name, each in self.arrays.items() if each.group in groups}
            lengths = self._fit(wanted, stored)
            contents = stored.read_all(wanted)
        for name, each in wanted.items():
            contents[name] = _checked(name, contents[name], each, lengths, refuse)
        return contents

    def _fit(self, wanted: Mapping[str, Stored], stored: Archive) -> dict[str, int]:
        """Refuse headers that do not fit; return the lengths that have names."""
        lengths: dict[str, int] = {}
        for name, each in wanted.items():
            if name not in stored:
                stored.refuse(f"it has no array {name!r}")
            header = stored.header(name)
            expected = [lengths.get(size) if isinstance(size, str) else size for size in each.shape]
            fits = len(header.shape) == len(expected) and all(
                size in (None, found) for size, found in zip(expected, header.shape)
            )
            kinds, kind = _KINDS[each.kind]
            if not fits or header.dtype.kind not in kinds:
                shape = ", ".join("any" if size is None else str(size) for size in expected)
                stored.refuse(
                    f"{name} has shape {header.shape} and type {header.dtype}, not {kind} of shape ({shape})"
                )
            lengths |= {size: found for size, found in zip(each.shape, header.shape) if isinstance(size, str)}
            if any(size in self.filled and not found for size, found in zip(each.shape, header.shape)):
                stored.refuse(f"{name} is empty: it has shape {header.shape}")
        return lengths


def _checked(
    name: str, array: AnyArray, wanted: Stored, lengths: Mapping[str, int], refuse: Callable[[str], NoReturn]
) -> Any:
    """Return an array in a type that compiled code takes, once its entries are checked."""
    if wanted.kind == "text":
        try:
            text = str(array)
        except ValueError:  # beyond the characters of Unicode
            text = "\0"
        return text if text.isprintable() else refuse(f"{name} has characters that cannot be printed")
    if wanted.kind == "float":
        array = np.asarray(array, np.float32 if array.dtype.str[1:] == "f4" else np.float64, order="C")
        if not np.isfinite(array).all():
            refuse(f"{name} has entries that are not finite")
    else:
        array = np.asarray(array, np.int64, order="C")
    if wanted.positive and not (array > 0).all():
        refuse(f"{name} has entries that are not positive")
    if wanted.index_of:
        n = lengths[wanted.index_of]
        bad = np.flatnonzero((array < 0) | (array >= n))
        if len(bad):
            refuse(f"{name} has entries outside 0…{n - 1} at {some(bad)}")
    return array


class Header(NamedTuple):
    """What the header of an array declares."""

    shape: tuple[int, ...]
    dtype: np.dtype[np.generic]

    @property
    def n_bytes(self) -> int:
        """Size of the contents."""
        return self.dtype.itemsize * prod(self.shape)


class Archive:
    """An ``.npz`` file of unknown origin. What cannot be true of its size is refused before memory is allocated.

    Parameters
    ----------
    path : Path
        Its name, for messages.
    stream : file object
        Its bytes.
    refuse : callable
        Raises the error that says what is wrong with it.
    """

    def __init__(self, path: Path, stream: BinaryIO, refuse: Callable[[str], NoReturn]) -> None:
        self.path, self.refuse = path, refuse
        self._size = os.fstat(stream.fileno()).st_size
        with self._refusing_damage():
            self._zip = zipfile.ZipFile(stream)

    @classmethod
    @contextmanager
    def opened(cls, path: Path, refuse: Callable[[str], NoReturn]) -> Iterator[Archive]:
        """Open a file; `MissingFileError` if there is none."""
        with opened(path) as stream:
            yield cls(path, stream, refuse)

    @property
    def names(self) -> list[str]:
        """Names of all arrays."""
        return [name.removesuffix(".npy") for name in self._zip.NameToInfo if name.endswith(".npy")]

    def __contains__(self, name: str) -> bool:
        return f"{name}.npy" in self._zip.NameToInfo

    def header(self, name: str) -> Header:
        """Read what an array declares to be; its size agrees with that of the archive."""
        info = self._zip.NameToInfo[f"{name}.npy"]
        if info.flag_bits & 1:
            self.refuse(f"{name} is encrypted")
        if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            self.refuse(f"{name} is compressed by a method other than deflate")
        with self._refusing_damage(), self._zip.open(info) as member:
            start = BytesIO(member.read(LONGEST_HEADER))  # a header may declare to be longer than memory
            header = Header(*_read_shape(start))
        shape, dtype = header
        if dtype.kind not in _NUMBERS_OR_TEXT or min(shape, default=0) < 0:
            self.refuse(f"{name} is not an array of numbers or text")
        ratio = LARGEST_RATIO if info.compress_type == zipfile.ZIP_DEFLATED else 1
        if start.tell() + header.n_bytes != info.file_size or info.file_size > ratio * min(
            info.compress_size, self._size
        ):
            self.refuse(f"{name} declares shape {shape}, more or less than the file holds")
        return header

    def read(self, name: str) -> AnyArray:
        """Read one array."""
        self.header(name)
        with self._refusing_damage(), self._zip.open(f"{name}.npy") as member:
            array: AnyArray = npy.read_array(member, allow_pickle=False)
            member.read(1)  # at the end, the checksum is compared
        return array

    def read_all(self, names: Iterable[str]) -> dict[str, AnyArray]:
        """Read some arrays; `MemoryBudgetError` if they would exceed the memory budget together."""
        n_bytes = sum(self.header(name).n_bytes for name in names)
        if n_bytes > room_for(self._size):
            raise MemoryBudgetError(
                f"{self.path}: its {self._size} bytes would become {n_bytes}; if you trust it, write it again without "
                "compression (numpy.savez)"
            )
        require_memory(n_bytes, f"{self.path}: reading", "raise the budget if you trust this file")
        return {name: self.read(name) for name in names}

    @contextmanager
    def _refusing_damage(self) -> Iterator[None]:
        try:
            with warnings.catch_warnings(action="ignore"):
                yield
        except _DAMAGED as error:
            self.refuse(str(error).partition("\n")[0] or type(error).__name__)
