"""The folder of a collection, and the keys that identify its contents."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import lru_cache
from hashlib import blake2b
from importlib.metadata import version
from pathlib import Path

from isomatch.collections.pairs import Pair
from isomatch.collections.shapes import BETWEEN
from isomatch.settings import Config
from isomatch.storage.files import UNFINISHED, remove_unfinished

OLD = 3600.0  # seconds; files are written in a few


@dataclass(frozen=True)
class Layout:
    """Where each file of a collection is.

    Parameters
    ----------
    folder : Path
        The folder.
    """

    folder: Path

    @property
    def plan(self) -> Path:
        """The shapes and the settings of the collection."""
        return self.folder / "collection.json"

    @property
    def table(self) -> Path:
        """One line for each pair."""
        return self.folder / "pairs.csv"

    @property
    def shapes_table(self) -> Path:
        """One line for each shape in the topology of the template."""
        return self.folder / "shapes.csv"

    @property
    def page(self) -> Path:
        """The page to look at."""
        return self.folder / "index.html"

    def prepared(self, key: str) -> Path:
        """Return the path of the prepared shape with a key."""
        return self.folder / "prepared" / f"{key}.npz"

    def maps(self, pair: Pair) -> Path:
        """Return the path of the maps of a pair, both directions."""
        return self.folder / "maps" / f"{BETWEEN.join(pair)}.npz"

    def corresponded(self, name: str) -> Path:
        """Return the path of a shape's surface in the topology of the template."""
        return self.folder / "corresponded" / f"{name}.ply"

    def report(self, pair: Pair) -> Path:
        """Return the path of the report of a pair."""
        return self.folder / "reports" / f"{BETWEEN.join(pair)}.html"

    def thumbnail(self, name: str) -> Path:
        """Return the path of a small picture of a shape."""
        return self.folder / "thumbnails" / f"{name}.png"

    @property
    def landmarks(self) -> Path:
        """The folder of the landmarks of all shapes."""
        return self.folder / "landmarks"

    def ledger(self, shard: tuple[int, int] = (0, 1)) -> Path:
        """Return the path of the ledger of a shard (index from 0, count)."""
        index, count = shard
        return self.folder / ("ledger.sqlite" if count == 1 else f"ledger_{index + 1}_of_{count}.sqlite")

    def ledgers(self) -> list[Path]:
        """Find the ledgers of all shards."""
        return sorted(self.folder.glob("ledger*.sqlite"))

    def remove_unfinished(self, shard: tuple[int, int]) -> None:
        """Remove unfinished files of killed runs; while other shards may be at work, only files too old to be theirs."""
        # listed before the ledgers: a run that is writing one of these files has a ledger by then
        unfinished = list(self.folder.glob(f"**/{UNFINISHED.format('*')}"))
        alone = shard[1] == 1 and self.ledgers() == [self.ledger(shard)]
        remove_unfinished(unfinished, 0.0 if alone else OLD)


def key_of(config: Config, seed: int, *surfaces: str) -> str:
    """Return the key of a result: it depends on the surfaces (see `identity_of`), the settings and this version."""
    text = json.dumps([_settings(config), seed, *surfaces])
    return blake2b(text.encode(), digest_size=16).hexdigest()


def identity_of(content_hash: str, reflected: bool) -> str:
    """Identify a surface, by the hash of that in the user's file, as it is matched."""
    return f"{content_hash} reflected" if reflected else content_hash


@lru_cache
def _settings(config: Config) -> str:
    return json.dumps([version("isomatch"), config.to_dict()], sort_keys=True)
