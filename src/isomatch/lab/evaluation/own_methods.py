"""Methods that a benchmark does not know by name: a function of one's own, and maps that another program wrote."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import cache, cached_property
from hashlib import sha256
from importlib import import_module
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from secrets import token_hex
from typing import Any, NamedTuple

import numpy as np

from isomatch.correspondence import Correspondence, read_map
from isomatch.errors import FormatError, IsomatchError, MapError, MissingFileError, SettingError
from isomatch.matching import MatchResult
from isomatch.surfaces import Mesh, PrecisePoints
from isomatch.values.arrays import IntArray

MAP_SUFFIXES = (".npz", ".npy", ".mat", ".txt", ".map", ".csv")
BETWEEN = ("__", "-", "_")  # names of a pair in the name of its file
EXPECTED = "a function takes two meshes, source and target, and returns an array of target vertices, or a map"


@dataclass(frozen=True, eq=False)
class OwnFunction:
    """A function that is benched as a method.

    Parameters
    ----------
    name : str
        What tables call it.
    function : callable, optional
        The function; by default found by the name, "MODULE:FUNCTION" or "FILE.py:FUNCTION".
    digest : str
        Tells rows that need not be computed again: of a function found by name, all with the same text of its file; of
        one that was handed over, none, because it may use anything that has changed since.
    """

    name: str
    function: Callable[..., Any] | None = None
    digest: str = field(default_factory=token_hex)

    @classmethod
    def named(cls, name: str) -> OwnFunction:
        """Find "MODULE:FUNCTION" or "FILE.py:FUNCTION"; `SettingError` if there is none."""
        module = sys.modules.get(getattr(_found(name), "__module__", None) or "")
        file = getattr(module, "__file__", None)
        return cls(name, None, sha256(Path(file).read_bytes()).hexdigest() if file else "")

    @property
    def is_of_this_process(self) -> bool:
        """Whether other processes would not find the function, such as one defined in a notebook."""
        if self.function is None:
            return False
        module = sys.modules.get(getattr(self.function, "__module__", ""))
        name = getattr(self.function, "__qualname__", "")
        return (
            module is None
            or module.__name__ == "__main__"
            or getattr(module, name, None) is not self.function
        )

    def __call__(self, source: Mesh, target: Mesh, **hints: IntArray) -> MatchResult | Correspondence:
        """Match; what is returned has to be a map of these shapes."""
        found = (self.function or _found(self.name))(source, target, **hints)
        return map_from(found, source, target, self.name)

    def to_dict(self) -> dict[str, Any]:
        """Return what identifies the rows of this method, as plain values."""
        return {"function": self.name, "digest": self.digest}


@cache
def _found(name: str) -> Callable[..., Any]:
    place, _, attribute = name.rpartition(":")
    if not (place and attribute):
        raise SettingError(f"method {name!r} is not MODULE:FUNCTION or FILE.py:FUNCTION")
    try:
        if place.endswith(".py"):
            spec = spec_from_file_location(f"_benched_{sha256(place.encode()).hexdigest()[:8]}", place)
            if spec is None or spec.loader is None or not Path(place).is_file():
                raise SettingError(f"method {name!r}: there is no file {place}")
            module = module_from_spec(spec)
            sys.modules[spec.name] = module
            spec.loader.exec_module(module)
        else:
            module = import_module(place)
    except IsomatchError:
        raise
    except Exception as error:  # whatever a module of others raises when it is imported
        raise SettingError(
            f"method {name!r}: {place} cannot be imported ({type(error).__name__}: {error})"
        ) from error
    function = getattr(module, attribute, None)
    if not callable(function):
        raise SettingError(f"method {name!r}: {place} has no function {attribute!r}; {EXPECTED}")
    return function  # type: ignore[no-any-return]


def map_from(found: Any, source: Mesh, target: Mesh, name: str) -> MatchResult | Correspondence:
    """Take what a function returned as a map of two shapes.

    Raises
    ------
    MapError
        If it is none, or one of other shapes.
    """
    if isinstance(found, MatchResult):
        given = found.map
    elif isinstance(found, Correspondence):
        given = found
    elif isinstance(found, PrecisePoints):
        corners, weights = np.asarray(found.corners), np.asarray(found.barycentric)
        if corners.shape != weights.shape or corners.ndim != 2 or corners.shape[1] != 3:
            raise MapError(f"{name} returned points whose corners and weights are not both (n_source, 3)")
        nearest = corners[np.arange(len(corners)), weights.argmax(axis=1)]
        found = given = Correspondence(nearest, target.n_vertices, corners, weights)
    else:
        array = np.asarray(found)
        if array.ndim != 1 or array.dtype.kind not in "iu":
            raise MapError(
                f"{name} returned {type(found).__name__} of shape {array.shape} and type {array.dtype}; {EXPECTED}"
            )
        found = given = Correspondence(array, target.n_vertices)
    if given.shape != (source.n_vertices, target.n_vertices):
        raise MapError(
            f"{name} returned a map of {given.shape[0]} vertices onto {given.shape[1]}, but the source has "
            f"{source.n_vertices} and the target {target.n_vertices}"
        )
    return found  # type: ignore[no-any-return]


class NamedPair(NamedTuple):
    """Two shapes by name, and the others of their set.

    Parameters
    ----------
    source, target : str
        The names.
    moved : (n_target,) array of int, or None
        What became of the target's vertices, if they were relabelled.
    others : tuple of (str, str)
        All pairs of the run.
    n_target_of : callable
        Number of target vertices of any pair.
    """

    source: str
    target: str
    moved: IntArray | None
    others: tuple[tuple[str, str], ...]
    n_target_of: Callable[[str, str], int]


@dataclass(frozen=True, eq=False)
class MapsInFolder:
    """Maps of another program, benched as a method.

    Parameters
    ----------
    folder : Path
        Holds a file for each pair, ``SOURCE__TARGET``, ``SOURCE-TARGET`` or ``SOURCE_TARGET`` with the suffix .npz, .npy,
        .mat, .txt, .map or .csv: the target vertex of each source vertex, of the shapes as they are in the files of the
        set.
    counts_from : {0, 1}, optional
        What their indices count from. By default the first map that allows one reading only decides for all.
    name : str
        What tables call it; by default the name of the folder.
    """

    folder: Path
    counts_from: int | None = None
    name: str = ""

    def __post_init__(self) -> None:
        if not self.folder.is_dir():
            raise MissingFileError(f"{self.folder}: no such folder of maps; check the name")
        object.__setattr__(self, "name", self.name or self.folder.resolve().name)

    def __call__(self, source: Mesh, target: Mesh, pair: NamedPair) -> tuple[Correspondence, str]:
        """Read the map of a pair, and what was decided about it."""
        path = self.file_of(pair.source, pair.target)
        sizes = target.n_vertices, source.n_vertices
        found = read_map(path, *sizes, counts_from=self.counts_from, allow_doubt=True)
        note = found.note
        if not found.is_certain:
            first = self._shown_to_count_from(pair)
            found = read_map(path, *sizes, counts_from=first)
            note = f"{path.name}: counts from {first}, as other maps of its folder do"
        image, faces = found.map.vertices, found.map.faces
        if pair.moved is not None:
            new = np.append(pair.moved, -1)
            image, faces = new[image], new[faces]
        return Correspondence(image, target.n_vertices, faces, found.map.barycentric), note

    def file_of(self, source: str, target: str) -> Path:
        """File of the map of a pair; an error if there is none, or several."""
        stems = [f"{source}{between}{target}" for between in BETWEEN]
        names = [f"{stem}{suffix}" for stem in stems for suffix in MAP_SUFFIXES]
        found = [self.folder / name for name in names if (self.folder / name).is_file()]
        if not found:
            raise MissingFileError(
                f"{self.folder}: no map of {source} to {target}; expected {names[0]}, or another name or suffix"
            )
        if len(found) > 1:
            raise FormatError(
                f"{self.folder}: {' and '.join(path.name for path in found)} could both be the map; keep one"
            )
        return found[0]

    def _shown_to_count_from(self, pair: NamedPair) -> int:
        """Find what the first map counts from that allows one reading only; `FormatError` if there is none."""
        known: int | None = vars(self).get("_known")
        for source, target in pair.others if known is None else ():
            try:
                path = self.file_of(source, target)
                found = read_map(path, pair.n_target_of(source, target), allow_doubt=True)
            except IsomatchError:  # is reported with its own pair
                continue
            if found.is_certain:
                known = vars(self)["_known"] = found.counts_from
                break
        if known is None:
            raise FormatError(
                f"{self.folder}: all maps of these pairs can count from 0 or from 1; say which, by --maps-from or "
                "counts_from"
            )
        return known

    @cached_property
    def _files(self) -> list[Path]:
        return sorted(path for path in self.folder.iterdir() if path.suffix in MAP_SUFFIXES)

    def to_dict(self) -> dict[str, Any]:
        """Return what identifies the rows of these maps, as plain values: files by size and time of change."""
        return {"counts_from": self.counts_from, "files": stamps(self._files)}


def stamps(files: Iterable[Path]) -> str:
    """Hash the names, sizes and times of change of files."""
    told = sorted(f"{path.name} {path.stat().st_size} {path.stat().st_mtime_ns}" for path in files)
    return sha256("\n".join(told).encode()).hexdigest()[:12]
