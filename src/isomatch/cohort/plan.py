"""The plan of a collection: shapes, pairs and settings, paths of files, and keys."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from glob import glob
from hashlib import blake2b
from importlib.metadata import version
from itertools import combinations, pairwise
from pathlib import Path
from typing import Any, Literal, TypeVar, cast
from unicodedata import normalize

import numpy as np
from scipy.spatial.distance import cdist

from isomatch._core.arrays import FloatArray
from isomatch._core.cached import cached_property
from isomatch._core.errors import InputError
from isomatch._core.files import UNFINISHED, ignores_case, legible, remove_unfinished, require_names
from isomatch._core.skipped import tell_skipped
from isomatch._core.tables import read_table
from isomatch.cohort.ledger import (
    N_EIGENVALUES,
    N_QUANTILES,
    OriginRow,
    Pair,
    PairRow,
    Rows,
    ShapeRow,
    read_ledgers,
)
from isomatch.cohort.shape_statistics import METRES
from isomatch.io import meshes_among
from isomatch.settings import Config
from isomatch.shapes import PreparedShape

# An unfinished file that was last changed longer ago, in seconds, belongs to no run, as files take seconds; chosen.
STALE_AGE = 3600.0
NO_SETTING = "—"  # text in place of a setting that an earlier version did not have
R = TypeVar("R", ShapeRow, PairRow)
MAX_MEDOID_SAMPLE = 1000  # to find the medoid, each shape is compared with at most this many shapes; chosen
NAME_SEPARATOR = "__"  # text between the names of two shapes in the name of the file of their maps
PAIR_PATTERNS = ("star", "all", "chain", "ring")  # ways to choose pairs, see `pairs_of`
OTHER_SHAPES = "*"  # name by which ``units`` gives the unit of all shapes that it does not name
# The unit of the other shapes is clear if it brings their median size (√area) to within this factor of the median size
# of the shapes whose unit is given; chosen.
MAX_SIZE_RATIO = 2.0
# A task or shard takes the pairs between two groups of this many shapes together, so that each is read once; chosen.
TILE_SIDE = 8
_NAMES_REMEDY = "give a list.csv with columns name and path"  # advice for names that no file can have


class Layout:
    """The paths of the files in the folder of a collection."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.plan = folder / "collection.json"  # the shapes and the settings
        self.table = folder / "pairs.csv"  # a line for each pair
        self.shapes_table = folder / "shapes.csv"  # a line for each shape in the template's topology
        self.page = folder / "index.html"
        self.landmarks = folder / "landmarks"  # a file of landmarks for each shape

    def prepared(self, key: str) -> Path:
        """Return the path of the prepared shape with a key."""
        return self.folder / "prepared" / f"{key}.npz"

    def maps(self, pair: Pair) -> Path:
        """Return the path of the maps of a pair, both directions."""
        return self.folder / "maps" / f"{NAME_SEPARATOR.join(pair)}.npz"

    def corresponded(self, name: str) -> Path:
        """Return the path of a shape's surface in the topology of the template."""
        return self.folder / "corresponded" / f"{name}.ply"

    def report(self, pair: Pair) -> Path:
        """Return the path of the report of a pair."""
        return self.folder / "reports" / f"{NAME_SEPARATOR.join(pair)}.html"

    def thumbnail(self, name: str) -> Path:
        """Return the path of a small picture of a shape."""
        return self.folder / "thumbnails" / f"{name}.png"

    def view(self, name: str) -> Path:
        """Return the path of the page of a shape in 3D."""
        return self.folder / "views" / f"{name}.html"

    def landmark_view(self, name: str) -> Path:
        """Return the path of the page of a shape with its landmarks."""
        return self.landmarks / "views" / f"{name}.html"

    def ledger(self, shard: tuple[int, int] = (0, 1)) -> Path:
        """Return the path of the ledger of a shard (index from 0, count)."""
        index, count = shard
        return self.folder / ("ledger.sqlite" if count == 1 else f"ledger_{index + 1}_of_{count}.sqlite")

    def ledgers(self) -> list[Path]:
        """Find the ledgers of all shards."""
        return sorted(self.folder.glob("ledger*.sqlite"))

    def remove_unfinished(self, shard: tuple[int, int]) -> None:
        """Remove unfinished files of killed runs; beside other shards, only old files."""
        # We list the files before the ledgers: a run makes its ledger before the files that it writes.
        unfinished = list(self.folder.glob(f"**/{UNFINISHED.format('*')}"))
        is_only_run = shard[1] == 1 and self.ledgers() == [self.ledger(shard)]
        remove_unfinished(unfinished, 0.0 if is_only_run else STALE_AGE)


def key_of(config: Config, seed: int, *surfaces: str) -> str:
    """Hash what a result depends on: surfaces (see `identity_of`), settings and this version."""
    text = json.dumps([_settings(config), seed, *surfaces])
    return blake2b(text.encode(), digest_size=16).hexdigest()


def identity_of(content_hash: str, reflected: bool) -> str:
    """Identify a surface as it is matched, by the content hash of the user's file."""
    return f"{content_hash} reflected" if reflected else content_hash


def identity_of_map(row: PairRow) -> str:
    """Identify the map of a matched pair, also if a composition of others replaced it."""
    return " > ".join((row.key, *row.replaced_by))


@lru_cache
def _settings(config: Config) -> str:
    return json.dumps([version("isomatch"), config.to_dict()], sort_keys=True)


def made_with(config: Config, seed: int) -> tuple[str, dict[str, Any]]:
    """Return the digest of the settings and this version, and these as plain values."""
    text = json.dumps({"isomatch": version("isomatch"), "seed": seed, **config.to_dict()}, sort_keys=True)
    return blake2b(text.encode(), digest_size=8).hexdigest(), json.loads(text)


def why_again(old: R, new: R, names: Sequence[str], origins: Mapping[str, OriginRow]) -> list[str]:
    """List what differs between two rows of a named shape, or of a pair."""
    reasons = list(old.again) if old.state == "todo" else []
    for name, was, now in zip(names, old.hashes, new.hashes):
        if was and now and was != now:
            reasons.append(f"the contents of {name} changed")
    # ``reflected`` of a pair is a tuple of names, ``reflected`` of a shape is true or false
    sides = (cast(Any, row).reflected for row in (old, new))
    before, after = (set(names if side is True else side or ()) for side in sides)
    reasons += [f"{name} is matched as its mirror image" for name in sorted(after - before)]
    reasons += [f"{name} is not matched as its mirror image any more" for name in sorted(before - after)]
    if isinstance(old, PairRow) and isinstance(new, PairRow) and old.led_by != new.led_by:
        reasons.append("the map that it starts from changed")
    if old.made_with in origins and new.made_with in origins:
        first: dict[str, Any] = dict(_flatten(origins[old.made_with].made_with))
        second: dict[str, Any] = dict(_flatten(origins[new.made_with].made_with))
        for name in dict.fromkeys((*first, *second)):
            was, now = first.get(name, NO_SETTING), second.get(name, NO_SETTING)
            reasons += [f"{name} {was} → {now}"] if was != now else []
    return reasons


def _flatten(values: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield settings, those of stages named as in a file of settings: ``search.rank``."""
    for name, value in values.items():
        if isinstance(value, dict):
            yield from _flatten(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value


def features_of(shape: PreparedShape) -> tuple[float, ...]:
    """Describe a shape by its spectrum and quantiles of distances, whatever its size and pose."""
    n = N_EIGENVALUES + 1
    values = np.full(n, np.nan)
    scaled = shape.laplace.values[:n] * shape.laplace.weights.sum()
    values[: len(scaled)] = scaled
    spectrum = values[1:] / (4 * np.pi * np.arange(1, n))  # Weyl's law: λ_i ≈ 4π i / area
    vertices = shape.sample_vertices[: shape.config.n_search]
    distances = shape.distances_between(vertices)[np.triu_indices(len(vertices), 1)]  # distances in √area
    quantiles = np.quantile(distances, (np.arange(N_QUANTILES) + 0.5) / N_QUANTILES)
    return tuple(np.concatenate([spectrum, quantiles]).tolist())


def medoid(features: FloatArray) -> int:
    """Find the row of the shape with the least mean distance to the others, or to a sample."""
    rows = np.nan_to_num(features)  # (m, q)
    spread = rows.std(axis=0)
    rows = rows / np.where(spread > 0, spread, 1.0)  # features in standard deviations
    others = rows[:: len(rows) // MAX_MEDOID_SAMPLE + 1]
    blocks = (rows[i : i + MAX_MEDOID_SAMPLE] for i in range(0, len(rows), MAX_MEDOID_SAMPLE))
    return int(np.concatenate([cdist(block, others).mean(axis=1) for block in blocks]).argmin())


@dataclass(frozen=True)
class Plan:
    """The shapes, pairs and settings of a `Collection`, see `Collection.create`."""

    folder: Path
    shapes: tuple[Entry, ...]  #: names and files
    pairs: str
    template: str | None  #: name of the template; None for the medoid, found once all shapes are prepared
    config: Config
    seed: int
    reflect: Literal["auto"] | tuple[str, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict)
    leader: Plan | None = None
    beside: Plan | None = None

    @property
    def layout(self) -> Layout:
        """The paths of its files."""
        return Layout(Path(self.folder))

    @property
    def names(self) -> list[str]:
        """Names of the shapes."""
        return [entry.name for entry in self.shapes]

    @cached_property
    def paths(self) -> dict[str, Path]:
        """File of each shape, by name."""
        return {entry.name: entry.path for entry in self.shapes}

    def entry(self, name: str, rows: Rows) -> Entry:
        """Return a shape as it is to be matched: reflected if asked for; with "auto", as before."""
        is_reflected = bool(rows.reflected([name])) if self.reflect == "auto" else name in self.reflect
        return Entry(name, self.paths[name], is_reflected)

    def rows(self) -> Rows:
        """Read what is known of the shapes so far from the ledgers of all shards."""
        return read_ledgers(self.layout.ledgers()).of(self.names)

    def chosen_template(self, rows: Rows) -> str | None:
        """Return the template: asked for, of the leader or collection beside, or medoid; None if unknown."""
        if self.template is not None:
            return self.template
        tried = [name for name in self.names if name in rows.shapes]
        usable = [name for name in tried if rows.is_prepared(name)]
        possible = set(usable)
        centres = Counter(source for source, _ in rows.pairs if source in possible)
        if self.pairs == "star" and centres:  # a star keeps its template when shapes are added
            return centres.most_common(1)[0][0]
        for other in filter(None, (self.leader, self.beside)):
            if (led := other.chosen_template(other.rows())) in usable:
                return led
        if not usable or len(tried) < len(self.names):
            return None
        return usable[medoid(np.array([rows.shapes[name].features for name in usable]))]

    def wanted_pairs(self, rows: Rows) -> list[Pair]:
        """List the pairs to match whose shapes could be prepared."""
        pairs = pairs_of(self.names, self.pairs, self.chosen_template(rows))
        return [pair for pair in pairs if all(map(rows.is_prepared, pair))]


@dataclass(frozen=True)
class Entry:
    """A shape of a collection."""

    name: str  # name of the shape in tables and files
    path: Path
    reflected: bool = False  # whether it is matched as its mirror image


def entries_of(shapes: str | Path | Iterable[str | Path | Entry]) -> tuple[Entry, ...]:
    """List the shapes of a collection, see `Collection.create`, by name or as listed."""
    if not isinstance(shapes, str | Path):
        entries = [x if isinstance(x, Entry) else Entry(legible(Path(x).stem), Path(x)) for x in shapes]
    elif str(shapes).lower().endswith(".csv") and not Path(shapes).is_dir():
        entries = _in_table(Path(shapes))
    else:
        folder = Path(shapes)
        paths = folder.iterdir() if folder.is_dir() else map(Path, glob(str(shapes)))
        entries = [Entry(legible(path.stem), path) for path in meshes_among(paths)]
        inner = [path for path in sorted(folder.iterdir()) if path.is_dir()] if folder.is_dir() else []
        if passed := ", ".join(path.name for path in inner if meshes_among(path.iterdir())):
            tell_skipped(f"{folder}: the surfaces in its folders {passed} are left out; give one folder")
    if not entries:
        remedy = "give a folder, a quoted pattern or a list.csv"
        raise InputError(f"{shapes}: no shapes that can be read; {remedy}")
    names = [entry.name for entry in entries]
    if repeated := [name for name, count in Counter(names).items() if count > 1]:
        raise InputError(f"{shapes}: several shapes are named {', '.join(repeated)}; {_NAMES_REMEDY}")
    require_shape_names(names, str(shapes))
    return tuple(entries)


def _in_table(path: Path) -> list[Entry]:
    remedy = "its first line names the columns, such as name,path"
    rows = read_table(path).records(("path",), ("name",), remedy)
    files = [path.parent / row["path"] for row in rows]
    return [Entry(row.get("name") or legible(file.stem), file) for row, file in zip(rows, files)]


def require_shape_names(names: Collection[str], where: str) -> None:
    """Raise `InputError` for names whose pairs share a file, as "a_" with "b", "a" with "_b"."""
    require_names(names, "shape", where, _NAMES_REMEDY)
    has_leading = any(name.startswith("_") for name in names)
    for name in names:
        if NAME_SEPARATOR in name or (has_leading and name.endswith("_")):
            why = f"two are joined by {NAME_SEPARATOR!r} in names of files"
            raise InputError(f"{where}: {name!r} cannot be the name of a shape: {why}; {_NAMES_REMEDY}")


def require_distinct_files(names: Iterable[str], folder: Path) -> None:
    """Raise `InputError` if two names differ in case only, in a folder that ignores case."""
    alike: dict[str, list[str]] = {}
    for name in names:
        alike.setdefault(normalize("NFC", name).lower(), []).append(name)
    twice = [" and ".join(same) for same in alike.values() if len(same) > 1]
    if twice and ignores_case(folder):
        problem = f"has one file for the shapes {twice[0]}, as it ignores case"
        raise InputError(f"{folder}: {problem}; {_NAMES_REMEDY}")


def pairs_of(names: Sequence[str], pattern: str, template: str | None) -> list[Pair]:
    """List the pairs to match, by a pattern of `Collection.create` or its CSV file."""
    if pattern == "star":
        return [(template, name) for name in names if template and name != template]
    if pattern == "all":
        return list(combinations(names, 2))
    if pattern == "chain":
        return list(pairwise(names))
    if pattern == "ring":
        if len(names) < 3:
            raise InputError(f"a ring has at least three shapes, not {len(names)}; match a chain")
        return list(pairwise([*names, names[0]]))
    return _read_pairs(Path(pattern), names)


def _read_pairs(path: Path, names: Collection[str]) -> list[Pair]:
    remedy = "give columns source and target, named in the first line"
    rows = read_table(path).records(("source", "target"), (), remedy)
    pairs = [(row["source"], row["target"]) for row in rows]
    if not pairs:
        raise InputError(f"{path}: no pairs; {remedy}")
    if strangers := sorted({name for pair in pairs for name in pair} - set(names)):
        raise InputError(f"{path}: {', '.join(strangers)} are no shapes of this collection; give their names")
    if any(a == b for a, b in pairs):
        raise InputError(f"{path}: a shape is paired with itself; remove these lines")
    by_ends: dict[frozenset[str], Pair] = {}
    for pair in pairs:
        by_ends.setdefault(frozenset(pair), pair)
    return list(by_ends.values())


def tiles_of(pairs: Sequence[Pair], names: Sequence[str], side: int, most: int) -> list[list[Pair]]:
    """Group up to ``most`` pairs of ``side`` by ``side`` shapes, so that each is loaded once."""
    block = {name: i // side for i, name in enumerate(names)}
    groups: dict[tuple[int, int], list[Pair]] = {}
    for a, b in pairs:
        groups.setdefault((block[a], block[b]), []).append((a, b))
    return [group[i : i + most] for group in groups.values() for i in range(0, len(group), most)]


def checked_units(units: Mapping[str, str], names: Iterable[str]) -> dict[str, str]:
    """Return the units of shapes by name; `InputError` if a name or a unit is not known."""
    if strangers := sorted(set(units) - {OTHER_SHAPES, *names}):
        raise InputError(f"{', '.join(strangers)}: units of no shape of this collection; give their names")
    if unknown := sorted({*units.values()} - set(METRES)):
        raise InputError(f"{', '.join(unknown)}: unknown units; known are {', '.join(METRES)}")
    return dict(units)


def common_unit(units: Mapping[str, str], rows: Rows) -> str | None:
    """Return the unit of the shapes whose unit is not given, by ``"*"`` or sizes, if clear."""
    named = {name: unit for name, unit in units.items() if name != OTHER_SHAPES}
    if OTHER_SHAPES in units or not named:
        return units.get(OTHER_SHAPES)
    sizes = {name: row.area**0.5 for name, row in rows.shapes.items() if row.area}
    others = [size for name, size in sizes.items() if name not in named]
    in_metres = [sizes[name] * METRES[unit] for name, unit in named.items() if name in sizes]
    if not others:
        return Counter(named.values()).most_common(1)[0][0]
    if not in_metres:
        return None
    ratio = float(np.median(in_metres)) / float(np.median(others))  # metres in the unit of the other shapes
    nearest = min(METRES, key=lambda unit: abs(np.log(ratio / METRES[unit])))
    return nearest if abs(np.log(ratio / METRES[nearest])) < np.log(MAX_SIZE_RATIO) else None


def scales_of(units: Mapping[str, str], rows: Rows) -> dict[str, float]:
    """Return the factor of the positions of each shape for which it is not 1."""
    common = common_unit(units, rows)
    if common is None:
        return {}
    named = {name: unit for name, unit in units.items() if name != OTHER_SHAPES and unit != common}
    return {name: METRES[unit] / METRES[common] for name, unit in named.items()}
