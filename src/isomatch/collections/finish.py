"""What a run leaves to look at and to work with."""

from __future__ import annotations

from isomatch.collections.collection import Collection
from isomatch.collections.tables import write_table


def finish(collection: Collection) -> None:
    """Write ``pairs.csv``."""
    write_table(collection.rows(), collection.layout.table)
