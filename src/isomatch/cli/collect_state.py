"""``isomatch collect status``, ``retry`` and ``agree``: how far a collection is, and what of it is done again."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

from isomatch import cohort
from isomatch.cli.cohort_words import say_cohort
from isomatch.cli.collect_options import Executor, Jobs, Reports, TimeLimit
from isomatch.cli.terminal import TALK, Talk, complain, say


def status(folder: Path, /, *, talk: Talk = TALK) -> None:
    """Tell how far a collection is, with the pairs that failed, from the ledgers of all shards; write its tables.

    Args:
        folder: The folder of the collection, or of the collections of all structures.
    """
    say_cohort(cohort.Cohort.open(folder), talk, is_answer=True)


def retry(which: Literal["failed", "low"], folder: Path, /, *, talk: Talk = TALK) -> None:
    """Let the next run match pairs again that failed, or that ended with low confidence.

    Args:
        which: failed, or low: with another seed, and the surer map is kept, unless others contradict it.
        folder: The folder of the collection.
    """
    again = cohort.Collection.open(folder).retry(which)
    told = f"{len(again)} pairs will be matched again; run isomatch collect as before"
    talk.result({"pairs": [list(pair) for pair in again]}, lambda: say(told))


def agree(
    folder: Path,
    /,
    *,
    jobs: Jobs = None,
    executor: Executor = "local",
    time_limit: TimeLimit = None,
    reports: Reports = "doubtful",
    talk: Talk = TALK,
) -> None:
    """Find the maps that most others contradict, and replace them by compositions of others, refined.

    A map from a to c disagrees with those from a to b and b to c if one of the three is wrong; many such triangles tell
    which. Maps that stay contradicted have low confidence. Run it again to continue, or after adding shapes.

    Args:
        folder: The folder of a collection whose pairs make triangles, as all do; also of one matched in shards.
    """
    how: dict[str, Any] = {"reports": reports, "executor": executor, "jobs": jobs, "time_limit": time_limit}
    with talk.progress() as tell:
        found = cohort.reconcile(folder, **how, progress=tell, warn=complain)
    say_cohort(found, talk)
