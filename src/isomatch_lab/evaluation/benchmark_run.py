"""The definition of a benchmark run: the pairs of a set, the methods, and how their maps are judged."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property, partial
from importlib.metadata import version
from typing import Any, TypeAlias

from isomatch._core.errors import SettingError
from isomatch._core.settings import Settings, setting
from isomatch_lab.damage import DamageChoice, DamagedPair, damaged_pair
from isomatch_lab.evaluation.ledger import Row
from isomatch_lab.evaluation.methods import (
    METHODS,
    MapsInFolder,
    Method,
    NamedPair,
    OwnFunction,
    digest_of,
    parts_of,
    stamps,
)
from isomatch_lab.sets import BenchmarkSet, benchmark_set

PairNames: TypeAlias = tuple[str, str]  # names of source and target


@dataclass(frozen=True)
class BenchmarkRun(Settings):
    """What to run.

    Parameters
    ----------
    set_name : str
        Name of the set, or the path of a folder of your own, see `benchmark_set`.
    methods : tuple
        Keys of ``METHODS``; functions of your own, which take two meshes and return a map, or their names as
        "MODULE:FUNCTION" or "FILE.py:FUNCTION"; `OwnFunction`, which gives one another name; and `MapsInFolder`, maps of
        another program. With "+" and a key of ``CONTINUATIONS``, a method started from the map of another:
        "sgmds_5pt+gdd".
    folder : str, optional
        Folder of the sets.
    n_pairs : int, optional
        Number of pairs to draw; all by default.
    n_points : int
        Number of truth points to judge for each pair.
    seed : int
        Seed of the draws of pairs, of truth points and of true landmarks.
    jobs : int, optional
        Number of pairs to run at a time, each on one thread; by default one for each processor. With ``jobs=1`` a pair
        uses all threads.
    landmarks : str, optional
        Folder of hand-picked landmarks, see `ShapeSet.with_landmarks`. Errors and curves are then measured at all
        landmarks of a shape, instead of at points drawn from the dense truth. Everything else, the landmarks that
        methods are given included, still rests on the dense truth.
    cycles : bool
        Also match the target to the source with the same method, and record the mean cycle error, see `cycle_errors`. The
        seconds of a row do not include this.
    distortion : bool
        Also record the mean squared distortion of each map, over the distances from 100 random points to 1000. It costs
        up to three distance columns a point, more than the errors.
    table_distortion : bool
        Also record the distortion as in the paper's table: over the distances from a quarter of ``n_points`` random
        points to all of them.
    pairs : tuple of (str, str), optional
        Names of the pairs to run, instead of a draw.
    damage : str, optional
        Damage to the shapes, as `DamageChoice.parse` reads it: "cut:0.3" or "noise@both", for example. What it draws
        depends on the seed of the run and the pair.

    Raises
    ------
    SettingError
        If a method or a damage is unknown, or a number is out of range.
    """

    set_name: str
    methods: tuple[str | OwnFunction | MapsInFolder | Callable[..., Any], ...] = ("isomatch",)
    folder: str | None = None
    n_pairs: int | None = setting(None, least=1)
    n_points: int = setting(1000, least=1)
    seed: int = setting(0, least=0)
    jobs: int | None = setting(None, least=1)
    landmarks: str | None = None
    cycles: bool = False
    distortion: bool = True
    table_distortion: bool = False
    pairs: tuple[PairNames, ...] | None = None
    damage: str | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "methods", tuple(map(_own_or_name, self.methods)))
        if len(set(self.names)) < len(self.names):
            raise SettingError(f"two methods have one name, of {', '.join(self.names)}; give each its own")
        for name in self.names:
            parts_of(name, self._own)
        if self.damage is not None:
            object.__setattr__(self, "damage", str(DamageChoice.parse(self.damage)))
        maps = [method.name for method in self._own.values() if isinstance(method, MapsInFolder)]
        if maps and (self.damage is not None or self.cycles):
            raise SettingError(
                f"{maps[0]} are maps of undamaged shapes in one direction; leave out the damage and the cycles, or give "
                "a function"
            )

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the methods."""
        return tuple(str(getattr(method, "name", method)) for method in self.methods)

    @cached_property
    def _own(self) -> dict[str, OwnFunction | MapsInFolder]:
        """Methods that are not of ``METHODS``, by name, without what they continue with."""
        own_methods = {
            method.name: method for method in self.methods if isinstance(method, OwnFunction | MapsInFolder)
        }
        for name in self.methods:
            base = name.partition("+")[0] if isinstance(name, str) else ""
            if ":" in base and base not in own_methods:
                own_methods[base] = OwnFunction(base)
        return own_methods

    @cached_property
    def _sets(self) -> dict[str | None, BenchmarkSet]:
        """The set, opened with and without landmarks."""
        return {}

    @cached_property
    def _kept(self) -> dict[Any, Any]:
        """Numbers of vertices by shape, and what methods found in the files of all pairs."""
        return {}

    def __getstate__(self) -> dict[str, Any]:
        # the loaders of made sets cannot be pickled for other processes
        return {name: value for name, value in vars(self).items() if name not in ("_sets", "_kept")}

    def _opened(self, landmarks: str | None) -> BenchmarkSet:
        if landmarks not in self._sets:
            self._sets[landmarks] = benchmark_set(self.set_name, self.folder, landmarks)
        return self._sets[landmarks]

    @cached_property
    def _data(self) -> str | None:
        """Hash of names, sizes and times of change of the files of a set of one's own; None for others."""
        files = self._opened(None).files
        return stamps(files) if files else None

    def _digest(self, name: str) -> str:
        base, ending = parts_of(name, self._own)
        return digest_of((self._own.get(base) or METHODS[base]).to_dict(), ending)

    @property
    def in_this_process(self) -> bool:
        """Whether a method is a function that other processes would not find, as in a notebook."""
        return any(
            isinstance(method, OwnFunction) and method.is_of_this_process for method in self._own.values()
        )

    @property
    def needs_our_loops(self) -> bool:
        """Whether a method uses loops of isomatch, whose loading must not count in its seconds."""
        return any(name not in self._own for name in self.names)

    def method(self, base: str) -> Method:
        """Take a method by its name, without what it continues with."""
        own_method = self._own.get(base)
        if own_method is None:
            return METHODS[base]
        return Method(own_method, preparation=None, reads_maps=isinstance(own_method, MapsInFolder))

    def chosen_pairs(self) -> tuple[PairNames, ...]:
        """Names of the pairs to run; opens the set, see `benchmark_set` for what it raises."""
        opened = self._opened(self.landmarks)
        return opened.chosen(self.n_pairs, self.seed).pairs if self.pairs is None else self.pairs

    def load(self, names: PairNames) -> tuple[DamagedPair, DamagedPair]:
        """Read a pair with its dense truth, and with the truth at which errors are measured, both damaged alike."""
        damaged = (
            damaged_pair if self.damage is None else partial(DamageChoice.parse(self.damage), seed=self.seed)
        )
        pair = damaged(self._opened(None).load(*names))
        if self.landmarks is None:
            return pair, pair
        return pair, damaged(self._opened(self.landmarks).load(*names))

    def named(self, names: PairNames, pair: DamagedPair) -> NamedPair:
        """Give what a method that reads maps needs to know of a pair."""
        opened, sizes = self._opened(None), self._kept

        def n_target_of(source: str, target: str) -> int:
            if target not in sizes:
                sizes[target] = opened.load(source, target).target.n_vertices
            return int(sizes[target])

        return NamedPair(*names, pair.whole.moved, self.chosen_pairs(), n_target_of, self._kept)

    def identity(self, names: PairNames, method: str) -> Row:
        """Values that identify the row of a pair and a method."""
        return {
            "set": self._opened(None).name,
            "damage": self.damage,
            "pair": "-".join(names),
            "method": method,
            "points": self.n_points,
            "seed": self.seed,
            "judged_at": "landmarks" if self.landmarks else "truth",
            "version": installed_version(),
            "settings": self._digest(method),
            "data": self._data,
        }

    def is_complete(self, row: Row) -> bool:
        """Whether a row has every measure of this run, and so no problem."""
        wanted = {
            "error": True,
            "cycle": self.cycles,
            "distortion_l2": self.distortion,
            "distortion_table": self.table_distortion,
        }
        return all(name in row for name, asked in wanted.items() if asked)


def _own_or_name(method: Any) -> str | OwnFunction | MapsInFolder:
    """Take a function as a method of its name; `SettingError` if it is no method, or has no name of its own."""
    if isinstance(method, str | OwnFunction | MapsInFolder):
        name = getattr(method, "name", "")
        if name in METHODS or "+" in name:
            raise SettingError(f"a method of your own cannot be called {name!r}; give it another name")
        return method
    if not callable(method):
        raise SettingError(f"method {method!r} is neither a name nor a function")
    name = getattr(method, "__name__", "")
    if not name.isidentifier() or name in METHODS:
        raise SettingError(f"{method!r} needs a name of its own in tables; give OwnFunction(name, function)")
    return OwnFunction(name, method)


@cache
def installed_version() -> str:
    """Version of isomatch that is installed."""
    return version("isomatch")
