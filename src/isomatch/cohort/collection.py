"""`Collection`: many shapes in correspondence, in a folder that survives every interruption."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from isomatch._core.errors import FormatError, InputError, SettingError
from isomatch._core.files import write_text
from isomatch._core.settings import generator
from isomatch.cohort.jobs import Event, Run
from isomatch.cohort.ledger import Pair, PairRow, writing_ledger
from isomatch.cohort.map_file import PairMaps, maps_of_pair
from isomatch.cohort.plan import (
    OTHER_SHAPES,
    PAIR_PATTERNS,
    Entry,
    Layout,
    Plan,
    checked_units,
    entries_of,
    pairs_of,
    require_distinct_files,
    require_shape_names,
)
from isomatch.cohort.workers import Workers
from isomatch.settings import Config

# fields of the row of a pair that stay when the pair is to be matched again
RETRY_VALUES = ("source_hash", "target_hash", "reflected", "made_with")


@dataclass(frozen=True)
class Collection(Plan):
    """Shapes in a folder with their maps; ``create`` and ``open`` make one.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> from isomatch import Mesh, write_mesh
    >>> triangle = Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    >>> with TemporaryDirectory() as folder:
    ...     for name in "abc":
    ...         write_mesh(f"{folder}/{name}.off", triangle)
    ...     collection = Collection.create(f"{folder}/maps", folder, template="b")
    ...     Collection.open(f"{folder}/maps").wanted_pairs(collection.rows())
    []
    >>> collection.names, collection.pairs, collection.template
    (['a', 'b', 'c'], 'star', 'b')
    """

    @classmethod
    def create(
        cls,
        folder: str | Path,
        shapes: str | Path | Iterable[str | Path | Entry],
        *,
        pairs: str = "star",
        template: str | None = None,
        config: Config | None = None,
        seed: int = 0,
        reflect: str | Iterable[str] | None = None,
        units: Mapping[str, str] | None = None,
        leader: Collection | None = None,
        beside: Collection | None = None,
    ) -> Collection:
        """Make a collection, or continue one with the same settings.

        Shapes may be added and removed, and ``reflect``, ``units``, ``leader`` and ``beside`` may
        change; by default they are as before. `SettingError` if the folder holds a collection with
        other settings, or mirror images are to be found where either orientation is allowed.

        Parameters
        ----------
        folder : path_like
            Where prepared shapes, maps and tables are kept.
        shapes : path_like or iterable of path_like or Entry
            A folder, whose readable files are taken; a pattern such as ``'scans/*.vtp'``; a CSV
            file with a column ``path``, relative to its folder, and perhaps ``name``; or the files,
            or an `Entry` for each, with its name.
        pairs, template, config, seed, reflect
            As the options of ``isomatch collect``. Each pair is matched in both directions. With
            ``reflect="auto"``, mirror images of the template are reflected in a star, and the
            smaller of two groups otherwise.
        units : mapping of str to str, optional
            Units, by name, of shapes whose units differ from most. The unit of the others is found
            by their sizes, or given for ``"*"``.
        leader : Collection, optional
            A collection of surfaces beside these, with the same names, such as bones for their
            cartilages, which is run first. Its template is the default of this one. A map starts
            from the map of its pair in the leader, carried along
            (`isomatch.correspondence.carry_along`), unless that is doubtful; nothing else is
            searched.
        beside : Collection, optional
            A collection of other surfaces of the same subjects, which is run first. Its template is
            the default of this one.
        """
        # Paths are absolute, as workers might run in another folder.
        entries = tuple(Entry(entry.name, entry.path.resolve()) for entry in entries_of(shapes))
        layout = Layout(Path(folder).absolute())
        names = [entry.name for entry in entries]
        require_distinct_files(names, layout.folder)
        if template is not None and template not in names:
            by_file = {entry.path: entry.name for entry in entries}
            if Path(template).resolve() not in by_file:
                raise InputError(f"template {template!r} is no shape of this collection; give name or file")
            template = by_file[Path(template).resolve()]
        if pairs not in PAIR_PATTERNS:
            pairs = str(Path(pairs).resolve())
        if pairs not in ("star", "all"):
            pairs_of(names, pairs, template)
        settings = pairs, template, config or Config(), seed
        sides, units_of = _check_reflect(reflect, names), checked_units(units or {}, names)
        new = cls(layout.folder, entries, *settings, sides, units_of, leader, beside)
        if layout.plan.exists():
            old = cls._read(layout)
            new._require_same(old)
            if pairs == "all":  # old shapes stay in their order, so that the source of a pair stays the same
                place = {name: i for i, name in enumerate(old.names)}
                entries = tuple(sorted(entries, key=lambda entry: place.get(entry.name, len(place))))
            if units is None:
                units_of = {name: unit for name, unit in old.units.items() if name in {OTHER_SHAPES, *names}}
            sides = old.reflect if reflect is None else sides
            neighbours = leader or old.leader, beside or old.beside
            new = cls(layout.folder, entries, *settings, sides, units_of, *neighbours)
        if new.reflect == "auto" and new.config.orientation == "any":
            raise SettingError(
                "reflect = 'auto' finds mirror images by maps that must keep the orientation, and orientation = 'any' "
                "allows both; leave the orientation at 'preserve', or name the shapes"
            )
        layout.folder.mkdir(parents=True, exist_ok=True)
        files = {entry.name: str(entry.path) for entry in entries}
        plan: dict[str, object] = {"shapes": files, "pairs": pairs, "template": template}
        plan |= {"config": new.config.to_dict(), "seed": seed, "reflect": new.reflect, "units": new.units}
        for name in _NEIGHBOURS:
            other: Plan | None = getattr(new, name)
            plan[name] = other and os.path.relpath(other.folder, layout.folder)
        text = json.dumps(plan, indent=2) + "\n"
        if not layout.plan.exists() or layout.plan.read_text(encoding="utf-8") != text:
            write_text(layout.plan, text)
        return new

    @classmethod
    def open(cls, folder: str | Path) -> Collection:
        """Open a collection; `FormatError` if the folder has none, or its plan is damaged."""
        return cls._read(Layout(Path(folder).absolute()))

    @classmethod
    def _read(cls, layout: Layout) -> Collection:
        folder, path = layout.folder, layout.plan
        try:
            plan = json.loads(path.read_text(encoding="utf-8"))
            shapes = tuple(Entry(name, Path(file)) for name, file in plan["shapes"].items())
            config = Config.from_dict(plan["config"])
            generator(plan["seed"])
            require_shape_names(plan["shapes"], str(path))
            sides = plan.get("reflect", ())
            sides = sides if sides == "auto" else tuple(map(str, sides))
            units = checked_units(plan.get("units", {}), plan["shapes"])
            settings = plan["pairs"], plan["template"], config, plan["seed"]
            folders = (plan.get(name) for name in _NEIGHBOURS)
            neighbours = [other and cls.open(os.path.normpath(folder / other)) for other in folders]
            return cls(folder, shapes, *settings, sides, units, *neighbours)
        except FileNotFoundError:
            raise FormatError(f"{folder}: holds no collection; make one with isomatch collect") from None
        except (ValueError, KeyError, TypeError, AttributeError, SettingError) as error:
            raise FormatError(f"{path}: not the plan of a collection ({error}); make it again") from None

    def of(self, names: Iterable[str]) -> Collection:
        """Return the same with some of its shapes, for a task that needs no others."""
        return replace(self, shapes=tuple(Entry(name, self.paths[name]) for name in names))

    def maps(self, source: str, target: str) -> PairMaps:
        """Read the maps of a pair; ``forward`` leads from source to target.

        They belong to the surfaces in the files, also if these were reflected, which keeps vertex
        numbers. `FormatError` if the pair is not matched.
        """
        return maps_of_pair(self.layout, source, target)

    def run(
        self,
        executor: str | Executor | Workers = "local",
        jobs: int | None = None,
        shard: tuple[int, int] = (0, 1),
        time_limit: float | None = None,
    ) -> Iterator[Event]:
        """Prepare the shapes and match the pairs that are not done, and yield each when it is.

        Nothing is done twice, also if the last run was killed. A failure is a row with its reason.
        `UnwritableFileError` if another run does the same shard, or the folder cannot be written.

        The executor is "local": processes of this machine; "dask:ADDRESS": workers of a Dask
        cluster, which see the same files; any executor of ``concurrent.futures``; or the workers of
        a block, see ``workers_of``. ``jobs`` run at once, by default one for each processor. After
        ``time_limit`` seconds nothing new is begun. A shard, its index from 0 and their number, is
        a part of the pairs: several runs, on machines that see the same folder, do one each, and
        prepare the shapes it needs.
        """
        if not 0 <= shard[0] < shard[1]:
            raise InputError(f"shard {shard} is not its index, from 0, and the number of all, such as (0, 8)")
        return Run(self, shard).events(executor, jobs, time_limit)

    def retry(self, which: Literal["failed", "low"]) -> list[Pair]:
        """Let the next run match pairs again that failed or have low confidence, and return them.

        The same input gives the same map, so pairs of low confidence are matched with another seed.
        The surer map is kept, but a map that others contradict is replaced. With "failed", shapes
        that could not be prepared are tried again.
        """
        again = {
            pair: PairRow(
                **{name: getattr(row, name) for name in RETRY_VALUES},
                state="todo",
                time=time.time(),
                attempt=row.attempt + (which == "low"),
                contradicted=row.is_contradicted or bool(row.contradicted),
                again=(f"it was asked for by retry {which}",),
            )
            for pair, row in self.rows().pairs.items()
            if row.verdict == which
        }
        for path in self.layout.ledgers():
            with writing_ledger(path) as ledger:
                for name in [name for name, row in ledger.rows.shapes.items() if row.state == which]:
                    ledger.forget("shapes", name)
                for pair in again.keys() & ledger.rows.pairs.keys():
                    ledger.put(pair, again[pair])
        return list(again)

    def _require_same(self, old: Collection) -> None:
        """Raise `SettingError` unless another collection has the same settings."""
        mine, theirs = self.config.changed(), old.config.changed()
        others = [name for name in {**mine, **theirs} if mine.get(name) != theirs.get(name)]
        plain = ("pairs", "template", "seed")
        if others := others + [name for name in plain if getattr(self, name) != getattr(old, name)]:
            problem = f"holds a collection with other {', '.join(others)}"
            raise SettingError(f"{self.folder}: {problem}; continue it with the same, or give another folder")


_NEIGHBOURS = ("leader", "beside")  # fields of a plan that hold other collections


def _check_reflect(
    reflect: str | Iterable[str] | None, names: Sequence[str]
) -> Literal["auto"] | tuple[str, ...]:
    """Return the names of the shapes to reflect, in order; `InputError` for unknown ones."""
    if reflect == "auto":
        return "auto"
    wanted = {reflect} if isinstance(reflect, str) else set(reflect or ())
    if strangers := ", ".join(sorted(wanted - set(names))):
        raise InputError(f"{strangers} cannot be reflected: no shapes of this collection; give their names")
    return tuple(name for name in names if name in wanted)
