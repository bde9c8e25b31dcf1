"""The state of a pair, by its row in the ledger."""

from __future__ import annotations

from isomatch.collections.consistency import CONTRADICTED
from isomatch.collections.map_file import SIDES, Record
from isomatch.matching import Outcome


def state_of(record: Record) -> str:
    """Return the state of a pair: "todo", "failed", "low" (matched with low confidence) or "done"."""
    if record["state"] == "done" and Outcome[record["there"]["outcome"]].is_doubtful:
        return "low"
    return str(record["state"])


def is_mirrored(record: Record) -> bool:
    """Whether the mirror image of one of its shapes fits clearly better than the map of a pair."""
    return record["state"] == "done" and any(
        record[side]["outcome"] == Outcome.MIRROR_IMAGE.name for side in SIDES
    )


def is_contradicted(record: Record) -> bool:
    """Whether other maps contradict that of a pair, as far as they were compared."""
    return bool(record.get("agreement", {}).get("inconsistency", 0.0) > CONTRADICTED)


def was_contradicted(record: Record) -> bool:
    """Whether other maps contradict that of a pair, or did before it was to be matched again."""
    return is_contradicted(record) or bool(record.get("contradicted", False))
