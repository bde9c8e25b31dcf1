"""What the commands tell of collections: how far they are, their landmarks, and how unusual new subjects are."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import accumulate
from pathlib import Path
from typing import Any

import numpy as np

from isomatch import Outcome, cohort, visualization
from isomatch.cli.terminal import Talk, say, say_rows, say_table

OUTCOMES = 26  # columns of a number of pairs with their outcome
LABEL = 16  # columns of a label


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


def say_landmarks(tables: cohort.LandmarkTables) -> None:
    """Print what was written about landmarks."""
    n = len(tables.templates)
    start = f"wrote the landmarks of {len(tables.shapes)} shapes to {tables.folder}"
    say(f"{start}, from {n} template{'s' * (n != 1)}")
    if first := tables.check_first:
        which = ", ".join(f"{name} ({error:.3g})" for name, error in first.items())
        say(
            f"check first, by their expected errors in the units of the files: {which}; look at landmarks.png"
        )
    for name, mean in tables.mean_spread.items():
        say(f"{name}: mean spread {mean:.4g}, largest at {tables.largest_spread[name]}")
    for name, error in tables.left_out_errors.items():
        say(
            f"{name}, carried from the others: error {error.mean:.4g} in the mean, at most {error.largest:.4g} at "
            f"{error.at}"
        )
    if slid := tables.slid:
        mean, _, before, after = (float(np.mean(column)) for column in [*zip(*slid)][1:])
        say(f"slid by {mean:.4g} in the mean; mean bending energy {before:.4g}, now {after:.4g}")
    doubtful, half_turned = [" and ".join(pair) for pair in tables.doubtful], tables.half_turned
    for told, names, style in (
        (f"not written, because {tables.format} has no place for them:", tables.not_written, ""),
        ("with other landmarks or curves, so not in the tables:", tables.other_landmarks, ""),
        ("reflected in the tables, as they were matched:", tables.reflected, ""),
        (f"brought into {tables.axes} in the tables, from the space of their files:", half_turned, ""),
        ("not used, because they are doubtful: the maps of", doubtful, "bold red"),
        ("not slid, as they have other landmarks, or few have a place:", tables.not_slid, "bold red"),
        ("failed, or no map that is sure leads to:", tables.left_out, "bold red"),
    ):
        if names:
            say(f"{told} {', '.join(names)}", style)


def say_scored(record: Mapping[str, Any], folder: Path) -> None:
    """Print how unusual new shapes are."""
    usual, m, k = record["usual"], record["n_left_out"], record["n_modes"]
    for line in record["shapes"]:
        say(line["name"], "bold")
        far = f"{line['mahalanobis']:.3g} standard deviations from the mean, p = {line['p_value']:.2g} (χ², {k} modes)"
        off = f"{line['error']:.4g} from what the modes describe (root mean square)"
        where = f"at most {line['farthest_error']:.4g}, at vertex {line['farthest_vertex']}"
        if m:
            far += f"; {line['as_far']} of {m} shapes, each left out, are as far, their median is "
            far += f"{usual['mahalanobis']:.3g}"
            off += f"; {line['as_badly_described']} of {m} are as badly described, their median is {usual['errors']:.4g}"
        if line.get("landmark"):
            where += f", nearest to the landmark {line['landmark']}"
        say_rows([("in the model", far), ("off the model", off), ("where", where)], LABEL)
        if line["measured"] < 1:
            say_rows(
                [("measured", f"{line['measured']:.0%} of its vertices; the others tell nothing")], LABEL
            )
    say(f"the table is {folder / 'scored.csv'}; where: {folder / 'scored'}, residual of each vertex")


def say_statistics(found: cohort.Results) -> None:
    """Print how shapes vary, and what else was found."""
    model = found.model
    if model is None:
        return
    size = f"{len(model.names)} shapes of {len(model.mean):,} vertices"
    say(f"{size} vary in {model.n_modes} mode{'s' * (model.n_modes != 1)}", "bold")
    shares = found.record["shares"]
    modes = zip(shares[:10], accumulate(shares), model.deviations.tolist())
    say_table(
        (f"mode {i}", f"{share:.1%} of the variance, sd {deviation:.4g}", f"{total:.1%} so far")
        for i, (share, total, deviation) in enumerate(modes, 1)
    )
    for line in found.told:
        say(line)
    say(f"open first: {found.folder / 'index.html'}; {len(found.files)} files are there")
