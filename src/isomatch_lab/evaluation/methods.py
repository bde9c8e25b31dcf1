"""The methods of a benchmark run: isomatch, published methods, and one's own."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import redirect_stdout
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from hashlib import sha256
from importlib import import_module
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from secrets import token_hex
from time import time
from types import ModuleType
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from isomatch._core.arrays import IntArray
from isomatch._core.errors import FormatError, IsomatchError, MapError, MissingFileError, SettingError
from isomatch._core.settings import Settings
from isomatch.correspondence import Correspondence, read_map
from isomatch.matching import MatchResult, match
from isomatch.settings import Config
from isomatch.shapes import PreparedShape
from isomatch.surfaces import Mesh, PrecisePoints
from isomatch_lab.baselines import BASELINES, Baseline
from isomatch_lab.evaluation.true_landmarks import N_LANDMARKS

MatchInput: TypeAlias = Mesh | PreparedShape


@dataclass(frozen=True)
class Method:
    """How a benchmark runs a method.

    Parameters
    ----------
    function : callable
        Takes source and target, and ``landmarks``, ``initial_map`` and ``config`` where these are given.
    n_landmarks : int
        Number of true landmarks that the method is given.
    preparation : Config, optional
        Settings of the prepared shapes that the method is given; None if it is given meshes.
    config : optional
        Settings that the method is given; None if it takes none.
    reads_maps : bool
        The method is given the names of the pair as well, as `MapsInFolder` is.
    """

    function: Callable[..., Any]
    n_landmarks: int = 0
    preparation: Config | None = field(default_factory=Config)
    config: Settings | None = None
    reads_maps: bool = False

    def __call__(
        self, source: MatchInput, target: MatchInput, priors: Mapping[str, Any]
    ) -> tuple[Correspondence, dict[str, Any]]:
        """Match source to target with priors, by argument name; return the map and the method's diagnostics."""
        settings = {} if self.config is None else {"config": self.config}
        result = self.function(source, target, **priors, **settings)
        if self.reads_maps:
            image, note = result
            return image, {"read": note} if note else {}
        return (result.map, result.to_dict()) if isinstance(result, MatchResult) else (result, {})

    def to_dict(self) -> dict[str, Any]:
        """Return everything that the method is set to, as plain values."""
        return {
            "n_landmarks": self.n_landmarks,
            "preparation": self.preparation and self.preparation.to_dict(),
            "config": self.config and self.config.to_dict(),
        }


def methods_of(baselines: Mapping[str, Baseline]) -> dict[str, Method]:
    """Make the methods of baselines: without priors, and with true landmarks as "NAME_5pt", or NAME if it needs them."""
    methods = {}
    for name, baseline in baselines.items():
        plain = Method(baseline.function, 0, baseline.preparation, baseline.config)
        led = replace(plain, n_landmarks=N_LANDMARKS)
        if baseline.needs_prior:
            methods[name] = led
        else:
            methods[name] = plain
            if baseline.preparation is not None:
                methods[f"{name}_{N_LANDMARKS}pt"] = led
    return methods


METHODS = {  # methods by name
    "isomatch": Method(match, config=Config()),
    f"isomatch_{N_LANDMARKS}pt": Method(match, N_LANDMARKS, config=Config()),
    **methods_of(BASELINES),
}

CONTINUATIONS = {
    "isomatch": Method(match, config=Config(hypotheses="given")),
    **{name: replace(METHODS[name], n_landmarks=0) for name in ("gdd", "gdd_post")},
}
"""Methods that can start from the map of another: "sgmds_5pt+gdd" is GDD started from the map of SGMDS."""


def parts_of(name: str, own_names: Collection[str] = ()) -> tuple[str, str]:
    """Split the name of a method into one of ``METHODS`` or of one's own, and one of ``CONTINUATIONS``, or ""."""
    base, plus, ending = name.partition("+")
    if base not in (*METHODS, *own_names) or (plus and ending not in CONTINUATIONS):
        raise SettingError(
            f"unknown method {name}; choose from {', '.join([*METHODS, *own_names])}, and any of them followed by "
            + " or ".join(f"+{continuation}" for continuation in CONTINUATIONS)
            + "; a function of your own is MODULE:FUNCTION"
        )
    return base, ending


def settings_digest(name: str) -> str:
    """Hash the settings of a method, and of the method that it starts from, in 12 hexadecimal digits."""
    base, ending = parts_of(name)
    return digest_of(METHODS[base].to_dict(), ending)


def digest_of(settings: Mapping[str, Any], ending: str = "") -> str:
    """Hash the settings of a method, and of the continuation named by ``ending``, see `settings_digest`."""
    every = [settings] + ([CONTINUATIONS[ending].to_dict()] if ending else [])
    return sha256(json.dumps(every, sort_keys=True).encode()).hexdigest()[:12]


MAP_SUFFIXES = (".npz", ".npy", ".mat", ".txt", ".map", ".csv")  # suffixes of files of maps
NAME_SEPARATORS = ("__", "-", "_")  # separate the names of a pair in a file name
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
    digest : str, optional
        Tells rows that need not be computed again: of a function found by name, all with the same text of its file; of
        one that was handed over, none, because it may use anything that has changed since.

    Raises
    ------
    SettingError
        If there is no function of this name.
    """

    name: str
    function: Callable[..., Any] | None = None
    digest: str = ""

    def __post_init__(self) -> None:
        if not self.digest:
            digest = _load_function(self.name) if self.function is None else token_hex()
            object.__setattr__(self, "digest", digest)

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

    def __call__(self, source: Mesh, target: Mesh, **priors: IntArray) -> MatchResult | Correspondence:
        """Match; what is returned has to be a map of these shapes. What the function prints goes to standard error."""
        with redirect_stdout(sys.stderr):
            answer = (self.function or _find_function(self.name, self.digest))(source, target, **priors)
        return map_from(answer, source, target, self.name)

    def to_dict(self) -> dict[str, Any]:
        """Return what identifies the rows of this method, as plain values."""
        return {"function": self.name, "digest": self.digest}


_FUNCTIONS: dict[tuple[str, str], Callable[..., Any]] = {}  # functions by name and digest of their text
_TEXTS: dict[str, bytes] = {}  # texts of modules when they were loaded, by name
_BEGAN = time()  # seconds since the epoch; a file that changed later may have been imported before


def _find_function(name: str, digest: str) -> Callable[..., Any]:
    """Give the function of a digest, in whatever process; `SettingError` if its text has changed."""
    if (name, digest) not in _FUNCTIONS and _load_function(name) != digest:
        raise SettingError(f"method {name!r}: its text has changed since the run began; run it again")
    return _FUNCTIONS[name, digest]


def _load_function(name: str) -> str:
    """Load a function as its file is now, and give the digest of this text; `SettingError` if there is none."""
    place, _, attribute = name.rpartition(":")
    if not (place and attribute):
        raise SettingError(f"method {name!r} is not MODULE:FUNCTION or FILE.py:FUNCTION")
    is_file = place.endswith(".py")
    if is_file and not Path(place).is_file():
        raise SettingError(f"method {name!r}: there is no file {place}")
    try:
        with redirect_stdout(sys.stderr):
            text = Path(place).read_bytes() if is_file else b""
            module = _module_of_text(place, text) if is_file else _current_module(place)
    except IsomatchError:
        raise
    except (Exception, SystemExit) as error:  # a foreign module may raise anything when it is imported
        message = f"method {name!r}: {place} cannot be imported ({type(error).__name__}: {error})"
        raise SettingError(message) from error
    function = getattr(module, attribute, None)
    if not callable(function):
        raise SettingError(f"method {name!r}: {place} has no function {attribute!r}; {EXPECTED}")
    texts = [text if is_file else _TEXTS[place]]
    home = sys.modules.get(getattr(function, "__module__", None) or "")
    if home is not None and home is not module:  # the module imports the function from another one
        now = _text_of(home)
        if _TEXTS.setdefault(home.__name__, now) != now:
            raise SettingError(f"method {name!r}: {home.__file__} has changed; start Python again")
        texts.append(now)
    digest = sha256(b"\0".join(texts)).hexdigest()
    _FUNCTIONS[name, digest] = function
    return digest


@cache
def _module_of_text(place: str, text: bytes) -> ModuleType:
    """Run the text of a file; bytes compiled earlier could belong to another text."""
    label = f"_benched_{sha256(place.encode() + text).hexdigest()[:8]}"
    spec = spec_from_file_location(label, place)
    assert spec is not None
    module = sys.modules[label] = module_from_spec(spec)
    exec(compile(text, place, "exec"), module.__dict__)
    return module


def _current_module(place: str) -> ModuleType:
    """Import a module; one whose text has changed since it was imported, or may have, is loaded again."""
    is_new = place not in sys.modules
    module = import_module(place)
    text = _text_of(module)
    before = _TEXTS.get(place)
    if before is None and not is_new and text and Path(str(module.__file__)).stat().st_mtime > _BEGAN:
        before = b""  # the text that was imported is not known
    if before not in (None, text):
        exec(compile(text, str(module.__file__), "exec"), module.__dict__)
    _TEXTS[place] = text
    return module


def _text_of(module: ModuleType) -> bytes:
    file = getattr(module, "__file__", None)
    return Path(file).read_bytes() if file else b""


def map_from(answer: Any, source: Mesh, target: Mesh, name: str) -> MatchResult | Correspondence:
    """Take what a function returned as a map of two shapes."""
    if isinstance(answer, MatchResult):
        image = answer.map
    elif isinstance(answer, Correspondence):
        image = answer
    elif isinstance(answer, PrecisePoints):
        corners, weights = np.asarray(answer.corners), np.asarray(answer.barycentric)
        if corners.shape != weights.shape or corners.ndim != 2 or corners.shape[1] != 3:
            raise MapError(f"{name} returned points whose corners and weights are not both (n_source, 3)")
        nearest = corners[np.arange(len(corners)), weights.argmax(axis=1)]
        answer = image = Correspondence(nearest, target.n_vertices, corners, weights)
    else:
        array = np.asarray(answer)
        if array.ndim != 1 or array.dtype.kind not in "iu":
            raise MapError(
                f"{name} returned {type(answer).__name__} of shape {array.shape} and type {array.dtype}; {EXPECTED}"
            )
        answer = image = Correspondence(array, target.n_vertices)
    if image.shape != (source.n_vertices, target.n_vertices):
        raise MapError(
            f"{name} returned a map of {image.shape[0]} vertices onto {image.shape[1]}, but the source has "
            f"{source.n_vertices} and the target {target.n_vertices}"
        )
    return answer  # type: ignore[no-any-return]


class NamedPair(NamedTuple):
    """Two shapes by name, and the others of their set."""

    source: str
    target: str
    moved: IntArray | None  # (n_target,) new numbers of the target's vertices, if they were renumbered
    others: tuple[tuple[str, str], ...]  # all pairs of the run
    n_target_of: Callable[[str, str], int]  # number of target vertices of any pair
    kept: dict[Any, Any]  # what methods found in the files of all pairs, by method


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
        reading = read_map(path, *sizes, counts_from=self.counts_from, allow_doubt=True)
        note = reading.note
        if not reading.is_certain:
            first = self._shown_to_count_from(pair)
            if first is not None and (first, True) != (reading.counts_from, reading.is_likely):
                reading = read_map(path, *sizes, counts_from=first)
                note = f"{path.name}: counts from {first}, as other maps of its folder do"
            elif first is None and not reading.is_likely:
                raise FormatError(
                    f"{self.folder}: all maps of these pairs can count from 0 or from 1; say which, by --maps-from or "
                    "counts_from"
                )
        image, faces = reading.map.vertices, reading.map.faces
        if pair.moved is not None:
            new = np.append(pair.moved, -1)
            image, faces = new[image], new[faces]
        return Correspondence(image, target.n_vertices, faces, reading.map.barycentric), note

    def file_of(self, source: str, target: str) -> Path:
        """File of the map of a pair; an error if there is none, or several."""
        stems = [f"{source}{between}{target}" for between in NAME_SEPARATORS]
        names = [f"{stem}{suffix}" for stem in stems for suffix in MAP_SUFFIXES]
        paths = [self.folder / name for name in names if (self.folder / name).is_file()]
        if not paths:
            raise MissingFileError(
                f"{self.folder}: no map of {source} to {target}; expected {names[0]}, or another name or suffix"
            )
        if len(paths) > 1:
            raise FormatError(
                f"{self.folder}: {' and '.join(path.name for path in paths)} could both be the map; keep one"
            )
        return paths[0]

    def _shown_to_count_from(self, pair: NamedPair) -> int | None:
        """Find what the first map counts from that allows one reading only; None if there is none."""
        if self not in pair.kept:
            pair.kept[self] = next(self._certain(pair), None)
        first: int | None = pair.kept[self]
        return first

    def _certain(self, pair: NamedPair) -> Iterator[int]:
        for source, target in pair.others:
            try:
                path = self.file_of(source, target)
                reading = read_map(path, allow_doubt=True)
                if not (reading.is_certain or (reading.map.vertices == 0).any()):
                    reading = read_map(path, pair.n_target_of(source, target), allow_doubt=True)
            except IsomatchError:  # the error is reported with its own pair
                continue
            if reading.is_certain:
                yield reading.counts_from

    @cached_property
    def _files(self) -> list[Path]:
        return sorted(path for path in self.folder.iterdir() if path.suffix in MAP_SUFFIXES)

    def to_dict(self) -> dict[str, Any]:
        """Return what identifies the rows of these maps, as plain values: files by size and time of change."""
        return {"counts_from": self.counts_from, "files": stamps(self._files)}


def stamps(files: Iterable[Path]) -> str:
    """Hash the names, sizes and times of change of files."""
    versions = sorted(f"{path.name} {path.stat().st_size} {path.stat().st_mtime_ns}" for path in files)
    return sha256("\n".join(versions).encode()).hexdigest()[:12]
