"""Files of named arrays (``.npz``, ``.npy``, ``.mat``), written whole, their headers read first."""

from __future__ import annotations

import os
import warnings
import zipfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from io import BytesIO
from math import prod
from pathlib import Path
from typing import IO, Any, BinaryIO, Literal, NoReturn

import numpy as np
from numpy.lib import format as npy

from isomatch._core.arrays import AnyArray
from isomatch._core.errors import FormatError, IsomatchError, MemoryBudgetError, some
from isomatch._core.files import open_file, read_bytes, replaced
from isomatch._core.memory import require_memory, room_for

FIRST_VERSION = 1  # version of the format of files that do not name a version, as the first ones do not
_VERSION = "format_version"  # name of the array that holds the version of the format in each file
# kinds of numpy types (`dtype.kind`) that a stored array may have, and their name in messages
_KINDS = {"float": ("fiu", "numbers"), "integer": ("iu", "integers"), "text": ("U", "a text")}
MAX_HEADER_BYTES = 1000  # largest number of bytes of the header of an array; chosen: numpy writes 128
# numpy's readers of the header of an array, by the version of numpy's file format
_READ_HEADER = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}

Header = tuple[tuple[int, ...], np.dtype[np.generic]]  # shape and type of an array
Refuse = Callable[[str], NoReturn]  # a function that raises the error about a damaged file


def save_arrays(
    path: str | Path, version: int, arrays: Mapping[str, object], *, compressed: bool = False
) -> None:
    """Write arrays and the version of their format, see `replaced`."""
    write_arrays(Path(path), {_VERSION: np.array(version), **arrays}, compressed=compressed)


def write_arrays(path: Path, arrays: Mapping[str, object], *, compressed: bool = True) -> None:
    """Write arrays to a file, see `replaced`."""
    with replaced(path) as file:
        (np.savez_compressed if compressed else np.savez)(file, **arrays)  # type: ignore[arg-type]


def require_known_version(path: Path, version: int, newest: int) -> None:
    """Raise `FormatError` if a file was written by a newer isomatch."""
    if version > newest:
        raise FormatError(
            f"{path}: has format version {version}, and this isomatch reads versions up to {newest}; upgrade isomatch"
        )


@contextmanager
def _refusing_damage(refuse: Refuse) -> Iterator[None]:
    try:
        with warnings.catch_warnings(action="ignore"):
            yield
    except IsomatchError:
        raise
    except Exception as error:  # zipfile, zlib, numpy and scipy raise many kinds of errors for damaged files
        refuse(str(error).partition("\n")[0] or type(error).__name__)


def _header(start: IO[bytes], size: int, refuse: Refuse) -> Header:
    """Read the header of an array; header and array must have ``size`` bytes together."""
    # only this beginning is read, as a header might declare more bytes than there is memory
    beginning = BytesIO(start.read(MAX_HEADER_BYTES))
    shape, _, dtype = _READ_HEADER[npy.read_magic(beginning)](beginning)
    if dtype.kind not in "fciubU" or min(shape, default=0) < 0:
        refuse(f"{dtype} of shape {shape} is not an array of numbers or text")
    if beginning.tell() + dtype.itemsize * prod(shape) != size:
        refuse(f"it declares shape {shape}, more or less than the file holds")
    return shape, dtype


def read_array(path: Path) -> AnyArray:
    """Read an ``.npy`` file of numbers or text; `FormatError` if it is damaged or anything else."""

    def refuse(problem: str) -> NoReturn:
        raise FormatError(f"{path}: not an array ({problem}); expected a file written by numpy.save")

    with open_file(path) as file, _refusing_damage(refuse):
        _header(file, os.fstat(file.fileno()).st_size, refuse)
        file.seek(0)
        array: AnyArray = npy.read_array(file, allow_pickle=False)
    return array


@dataclass(frozen=True)
class Stored:
    """The requirements on one array of a file."""

    kind: Literal["float", "integer", "text"]  # integers are also taken as floats; floats have to be finite
    shape: tuple[int | str, ...] = ()  # lengths; a name stands for the same length in all arrays
    positive: bool = False  # whether all entries have to be positive
    index_of: str = ""  # name of a length n; entries have to be indices 0…n − 1
    group: str = ""  # name of a group: either all of its arrays are in the file, or none


@dataclass(frozen=True)
class ArrayFormat:
    """The arrays that a file has to hold."""

    what: str  # what the file holds, such as "a map", for messages
    writer: str  # the function that writes such files
    version: int  # the version of the format; earlier ones are read too
    arrays: Mapping[str, Stored]  # the arrays by name; others are not read
    filled: tuple[str, ...] = ()  # names of lengths that must not be 0

    def read(self, path: str | Path) -> dict[str, Any]:
        """Read the arrays of a file, as float32, float64, int64 or string, after checking all headers."""
        path = Path(path)

        def refuse(problem: str) -> NoReturn:
            raise FormatError(
                f"{path}: not {self.what} ({problem}); expected a file written by {self.writer}"
            )

        with Archive.opened(path, refuse) as stored:
            if _VERSION in stored:
                self._fit({_VERSION: Stored("integer")}, stored)
                require_known_version(path, int(stored.read(_VERSION)), self.version)
            groups = {"", *(array.group for name, array in self.arrays.items() if name in stored)}
            wanted = {name: array for name, array in self.arrays.items() if array.group in groups}
            lengths = self._fit(wanted, stored)
            arrays = stored.read_all(wanted)
        return {name: _check_entries(name, arrays[name], wanted[name], lengths, refuse) for name in wanted}

    def _fit(self, wanted: Mapping[str, Stored], stored: Archive) -> dict[str, int]:
        """Refuse headers that do not fit; return the lengths that have names."""
        lengths: dict[str, int] = {}
        for name, array in wanted.items():
            if name not in stored:
                stored.refuse(f"it has no array {name!r}")
            shape, dtype = stored.header(name)
            sizes = [lengths.get(size) if isinstance(size, str) else size for size in array.shape]
            fits = len(shape) == len(sizes) and all(a in (None, b) for a, b in zip(sizes, shape))
            kinds, kind = _KINDS[array.kind]
            if not fits or dtype.kind not in kinds:
                expected = ", ".join("any" if size is None else str(size) for size in sizes)
                stored.refuse(f"{name} has shape {shape} and type {dtype}, not {kind} of shape ({expected})")
            named = {size: n for size, n in zip(array.shape, shape) if isinstance(size, str)}
            if any(size in self.filled and not n for size, n in named.items()):
                stored.refuse(f"{name} is empty: it has shape {shape}")
            lengths |= named
        return lengths


def _check_entries(
    name: str, array: AnyArray, wanted: Stored, lengths: Mapping[str, int], refuse: Refuse
) -> Any:
    """Check the entries of an array and convert it to a type that compiled code takes."""
    if wanted.kind == "text":
        try:
            text = str(array)
        except ValueError:  # an entry is no character of Unicode
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


class Archive:
    """An ``.npz`` file of unknown origin, read through the directory of the zip archive."""

    def __init__(self, path: Path, stream: BinaryIO, refuse: Refuse) -> None:
        self.path, self.refuse, self._size = path, refuse, os.fstat(stream.fileno()).st_size
        with _refusing_damage(refuse):
            self._zip = zipfile.ZipFile(stream)

    @classmethod
    @contextmanager
    def opened(cls, path: Path, refuse: Refuse) -> Iterator[Archive]:
        """Open a file; `MissingFileError` if there is none, the error of ``refuse`` if it is damaged."""
        with open_file(path) as stream:
            yield cls(path, stream, refuse)

    @property
    def names(self) -> list[str]:
        """Names of all arrays."""
        return [name.removesuffix(".npy") for name in self._zip.NameToInfo if name.endswith(".npy")]

    def __contains__(self, name: str) -> bool:
        return f"{name}.npy" in self._zip.NameToInfo

    def header(self, name: str) -> Header:
        """Read the shape and type of an array, which have to fit its size in the directory."""
        info = self._zip.NameToInfo[f"{name}.npy"]
        # methods of compression other than deflate might claim much memory
        if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            self.refuse(f"{name} is compressed by a method other than deflate")

        def refuse(problem: str) -> NoReturn:
            self.refuse(f"{name}: {problem}")

        with _refusing_damage(refuse), self._zip.open(info) as member:
            header = _header(member, info.file_size, refuse)
        return header

    def read(self, name: str) -> AnyArray:
        """Read one array."""
        return self.read_all([name])[name]

    def read_all(self, names: Iterable[str]) -> dict[str, AnyArray]:
        """Read some arrays; `MemoryBudgetError` if they would exceed the memory budget together."""
        headers = {name: self.header(name) for name in names}
        n_bytes = sum(dtype.itemsize * prod(shape) for shape, dtype in headers.values())
        if n_bytes > room_for(self._size):  # compressed zeros take a thousandth of their size
            raise MemoryBudgetError(
                f"{self.path}: its {self._size} bytes would become {n_bytes}; if you trust it, write it again without "
                "compression (numpy.savez)"
            )
        require_memory(n_bytes, f"{self.path}: reading", "raise the budget if you trust this file")
        arrays: dict[str, AnyArray] = {}
        for name in headers:
            with _refusing_damage(self.refuse), self._zip.open(f"{name}.npy") as member:
                arrays[name] = npy.read_array(member, allow_pickle=False)
                member.read(1)  # a read at the end makes zipfile compare the checksum
        return arrays


def read_mat(path: Path, what: str, expected: str) -> dict[str, Any]:
    """Read the variables of a ``.mat`` file by name, structs as objects, without axes of length 1."""
    from scipy.io import loadmat

    def refuse(problem: str) -> NoReturn:
        raise FormatError(
            f"{path}: not {what} ({problem}); expected a MATLAB file before version 7.3 (save -v7) with {expected}"
        )

    data = BytesIO(read_bytes(path))
    with _refusing_damage(refuse):
        stored = loadmat(data, squeeze_me=True, struct_as_record=False)
    return {name: value for name, value in stored.items() if not name.startswith("__")}
