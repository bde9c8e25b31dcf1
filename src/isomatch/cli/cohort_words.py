"""What the commands tell of collections: how far they are, how pairs ended, and what to look at."""

from __future__ import annotations

from isomatch import Outcome, cohort, visualization
from isomatch.cli.terminal import Talk, say, say_rows

OUTCOMES = 26  # columns of a number of pairs with their outcome


def say_cohort(found: cohort.Cohort, talk: Talk, *, is_answer: bool = False) -> None:
    """Tell how far collections are, in words or as JSON; as an answer, with all files that were damaged."""
    status = found.status(thorough=is_answer)

    def summary() -> None:
        for name, each in found.collections.items():
            if name:
                say(name, "bold")
            _say_status(status[name], each.layout)
        if "" in status:
            return
        for pair, own in found.contacts.items():
            say(f"{pair}: slip {own['slip_before']:.3g}, {own['slip_after']:.3g} after; see contacts.csv")
            for subject, note in own["notes"].items():
                say(f"{subject} is {note}", "bold red")
        folder = found.folder
        say(f"subjects of all structures: {folder / 'corresponded'}; go on with isomatch statistics {folder}")

    talk.result(found.to_json(status), summary, is_answer=is_answer)


def _say_status(status: cohort.Status, layout: cohort.Layout) -> None:
    shapes, pairs, agreement = status.shapes, status.pairs, status.agreement
    done = pairs.get("done", 0) + pairs.get("low", 0)
    failed = f", {pairs['failed']} failed" if pairs.get("failed") else ""
    prepared = f"{shapes['prepared']} of {shapes['all']} shapes prepared"
    say(f"{done} of {pairs['all']} pairs matched{failed}; {prepared}", "bold")
    for outcome in Outcome:
        if count := status.outcomes.get(outcome.name):
            say_rows([(f"{count} {outcome.value}", visualization.HEADLINES[outcome])], indent=OUTCOMES)
    say(f"template {status.template or 'not yet chosen'}")
    if agreement.compared:
        say(
            f"{agreement.compared} pairs compared with compositions: {len(agreement.contradicted)} contradicted, "
            f"{len(agreement.replaced)} replaced"
        )
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
    """Name the shapes that were reflected, and those that seem to be mirror images of the others."""
    if status.reflected:
        say(f"reflected before they were matched: {', '.join(status.reflected)}")
    untried = [name for name, reason in status.mirror_images.items() if reason is None]
    if untried:
        remedy = "run again with --reflect auto, or with the names of those to reflect"
        say(f"seem to be mirror images of the others: {', '.join(untried)}; {remedy}", "bold red")
    for name, reason in status.mirror_images.items():
        if reason is not None:
            say(f"seems to be a mirror image, but not reflected: {name}: {reason}", "bold red")
