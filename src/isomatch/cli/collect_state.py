"""``isomatch collect status``, ``retry`` and ``agree``: how far a collection is, what is done again."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

from isomatch import NotConvergedError, Outcome, cohort, visualization
from isomatch.cli.collect_finished import say_landmarks
from isomatch.cli.collect_options import Executor, Jobs, Reports, TimeLimit
from isomatch.cli.terminal import TALK, Talk, complain, require_complete, say, say_rows

OUTCOME_WIDTH = 26  # columns of the terminal for the number of pairs with an outcome, and its name; chosen


def status(folder: Path, /, *, talk: Talk = TALK) -> None:
    """Tell how far a collection is, and which pairs failed, from all ledgers; write its tables.

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
    sentence = f"{len(again)} pairs will be matched again; run isomatch collect as before"
    talk.result({"pairs": [list(pair) for pair in again]}, lambda: say(sentence))


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
    """Replace the maps that most others contradict by compositions of others, refined.

    A map from a to c disagrees with those from a to b and b to c if one of the three is wrong; many such triangles tell
    which. Maps that stay contradicted have low confidence. Run it again to continue, or after adding shapes.

    Args:
        folder: The folder of a collection whose pairs make triangles, as all do; also of one matched in shards.
    """
    how: dict[str, Any] = {"reports": reports, "executor": executor, "jobs": jobs, "time_limit": time_limit}
    with talk.progress() as tell:
        found = cohort.reconcile(folder, **how, progress=tell, warn=complain)
    say_cohort(found, talk)


def say_cohort(
    found: cohort.Cohort, talk: Talk, refused: tuple[Outcome, ...] = (), *, is_answer: bool = False
) -> None:
    """Tell how far collections are, in words or JSON; as an answer, with all damaged files.

    `IncompleteError` if shapes or pairs failed, `NotConvergedError` if maps ended as one of the refused outcomes.
    """
    status = found.status(thorough=is_answer)

    def summary() -> None:
        for name, collection in found.collections.items():
            if name:
                say(name, "bold")
            _say_status(status[name], collection.layout)
        if found.landmarks:
            say_landmarks(found.landmarks)
        if "" in status:
            return
        for pair, gap in found.contacts.items():
            say(f"{pair}: slip {gap['slip_before']:.3g}, {gap['slip_after']:.3g} after; see contacts.csv")
            for subject, note in gap["notes"].items():
                say(f"{subject} is {note}", "bold red")
        folder = found.folder
        say(f"subjects of all structures: {folder / 'corresponded'}; go on with isomatch statistics {folder}")

    talk.result(found.to_json(status), summary, is_answer=is_answer)
    failed = [
        f"{what} of {name}" if name else what for name, state in status.items() for what in state.failures
    ]
    require_complete(failed, found.folder)
    for outcome in refused:
        if count := sum(state.outcomes.get(outcome.name, 0) for state in status.values()):
            raise NotConvergedError(f"{count} of the maps: {outcome.value}; all files are in {found.folder}")


def _say_status(status: cohort.Status, layout: cohort.Layout) -> None:
    shapes, pairs, agreement = status.shapes, status.pairs, status.agreement
    done = pairs.get("done", 0) + pairs.get("low", 0)
    failed = f", {pairs['failed']} failed" if pairs.get("failed") else ""
    prepared = f"{shapes['prepared']} of {shapes['all']} shapes prepared"
    say(f"{done} of {pairs['all']} pairs matched{failed}; {prepared}", "bold")
    for outcome in Outcome:
        if count := status.outcomes.get(outcome.name):
            say_rows([(f"{count} {outcome.value}", visualization.HEADLINES[outcome])], indent=OUTCOME_WIDTH)
    say(f"template {status.template or 'not yet chosen'}")
    if agreement.compared:
        counts = f"{len(agreement.contradicted)} contradicted, {len(agreement.replaced)} replaced"
        say(f"{agreement.compared} pairs compared with compositions: {counts}")
    loop = status.loop or {"open": []}
    if legs := ", ".join(" to ".join(leg) for leg in loop["open"]):
        say(f"the ring is open, so that shapes are reached one way: no sure maps {legs}", "bold red")
    elif "loop_error" in loop:
        mean, most = (f"{loop[key]:.2%}" for key in ("loop_error", "greatest_loop_error"))
        say(f"once around the ring, vertices are {mean} of √area from themselves, at most {most}")
    if turned := ", ".join(agreement.turned):
        say(f"maps to {turned} mostly reverse the orientation: perhaps mirrored together", "bold red")
    _say_sides(status)
    for outlier in status.outliers:
        if outlier.kind != "broken" and outlier.name not in status.mirror_images:
            say(f"look at {outlier.name}: it {outlier.reason}", "bold red")
    for name, what in status.damaged.items():
        say(f"{name} {what}; run isomatch collect again, which makes it again", "bold red")
    for name, error in status.failures.items():
        say(f"failed: {name}: {error}", "bold red")
    say(f"open first: {layout.page}; the table is {layout.table.name}")


def _say_sides(status: cohort.Status) -> None:
    """Name shapes that were reflected, and those that seem to be mirror images of the others."""
    if status.reflected:
        say(f"reflected before they were matched: {', '.join(status.reflected)}")
    if untried := ", ".join(name for name, reason in status.mirror_images.items() if reason is None):
        remedy = "run again with --reflect auto, or with the names of those to reflect"
        say(f"seem to be mirror images of the others: {untried}; {remedy}", "bold red")
    for name, reason in status.mirror_images.items():
        if reason is not None:
            say(f"seems to be a mirror image, but not reflected: {name}: {reason}", "bold red")
