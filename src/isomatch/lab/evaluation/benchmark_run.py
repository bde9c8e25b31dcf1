"""The definition of a benchmark run: the pairs of a set, the methods, and how their maps are judged."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, partial
from importlib.metadata import version
from typing import TypeAlias

from isomatch.lab.damage import DamageChoice, DamagedPair, damaged_pair
from isomatch.lab.evaluation.ledger import Row
from isomatch.lab.evaluation.methods import parts_of, settings_digest
from isomatch.lab.sets import benchmark_set
from isomatch.values.settings import Settings, setting

PairNames: TypeAlias = tuple[str, str]


@dataclass(frozen=True)
class BenchmarkRun(Settings):
    """What to run.

    Parameters
    ----------
    set_name : str
        Name of the set, see `benchmark_set`.
    methods : tuple of str
        Keys of ``METHODS``. With "+" and a key of ``CONTINUATIONS``, a method started from the map of another:
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
    methods: tuple[str, ...] = ("isomatch",)
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
        for name in self.methods:
            parts_of(name)
        if self.damage is not None:
            object.__setattr__(self, "damage", str(DamageChoice.parse(self.damage)))

    def chosen_pairs(self) -> tuple[PairNames, ...]:
        """Names of the pairs to run; opens the set, see `benchmark_set` for what it raises."""
        opened = benchmark_set(self.set_name, self.folder, self.landmarks)
        return opened.chosen(self.n_pairs, self.seed).pairs if self.pairs is None else self.pairs

    def load(self, names: PairNames) -> tuple[DamagedPair, DamagedPair]:
        """Read a pair with its dense truth, and with the truth at which errors are measured, both damaged alike."""
        damaged = (
            damaged_pair if self.damage is None else partial(DamageChoice.parse(self.damage), seed=self.seed)
        )
        pair = damaged(benchmark_set(self.set_name, self.folder).load(*names))
        if self.landmarks is None:
            return pair, pair
        return pair, damaged(benchmark_set(self.set_name, self.folder, self.landmarks).load(*names))

    def identity(self, names: PairNames, method: str) -> Row:
        """Values that identify the row of a pair and a method."""
        return {
            "set": self.set_name,
            "damage": self.damage,
            "pair": "-".join(names),
            "method": method,
            "points": self.n_points,
            "seed": self.seed,
            "judged_at": "landmarks" if self.landmarks else "truth",
            "version": installed_version(),
            "settings": settings_digest(method),
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


@cache
def installed_version() -> str:
    """Version of isomatch that is installed."""
    return version("isomatch")
