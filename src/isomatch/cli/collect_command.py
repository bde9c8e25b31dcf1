"""``isomatch collect``: a folder of shapes in correspondence, resumable, on one machine or many."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from cyclopts import App, Parameter

from isomatch import cohort
from isomatch.cli.collect_finished import add, export, landmarks
from isomatch.cli.collect_options import (
    Executor,
    Jobs,
    Reports,
    SemilandmarkOptions,
    TimeLimit,
    names_of,
    shard_of,
    units_of,
)
from isomatch.cli.collect_state import agree, retry, say_cohort, status
from isomatch.cli.inputs import ConfigFile, Output, Seed, read_config, read_outcomes
from isomatch.cli.terminal import TALK, Talk, complain

collect = App(name="collect", default_parameter=Parameter(negative=()))  # the command with subcommands
for command in (status, retry, export, landmarks, agree, add):
    collect.command(command)


@collect.default
def run(
    shapes: str,
    /,
    *,
    output: Output,
    template: str = "auto",
    pairs: str = "star",
    jobs: Jobs = None,
    executor: Executor = "local",
    shard: str = "1/1",
    reflect: str | None = None,
    units: str | None = None,
    landmarks: Path | None = None,
    semilandmarks: SemilandmarkOptions = None,
    time_limit: TimeLimit = None,
    agree: Annotated[bool | None, Parameter(negative="--no-agree")] = None,
    keep_contacts: Annotated[bool, Parameter(negative="--no-keep-contacts")] = True,
    reports: Reports = "doubtful",
    fail_on: str | None = None,
    config: ConfigFile = None,
    seed: Seed = 0,
    talk: Talk = TALK,
) -> None:
    """Match the shapes of a folder with a template, or with one another; run it again to continue.

    Args:
        shapes: A folder, a quoted pattern such as 'scans/*.vtp', or a list.csv with a column path and perhaps name. For
            subjects of several surfaces, which are matched separately: a folder with a folder for each subject,
            with files named like the structures, or a list.csv with the columns subject, structure and file.
        output: Folder for prepared shapes, maps, pairs.csv, index.html, and the shapes in the topology of the template.
        template: Name or file of the template; by default (auto) the shape in the middle of all, by spectra and
            distances.
        pairs: star (default): each shape with the template; all; chain: each with the next; ring: also the last with the
            first, as of a beating heart; or a CSV file with columns source and target.
        shard: i/n: match the i-th of n parts of the pairs. Runs of other parts may go on at the same time, on other
            machines.
        reflect: Shapes to match as their mirror images. auto: those that fit clearly better so, as left ones among right
            ones; none; or their names, separated by commas, or a file of them. Default: as in the last run, first none.
        units: Units of shapes that are in others than most, such as scan7=mm,scan9=cm: um, mm, cm, m or in. They are
            brought to the unit of all others, which is found by their sizes, or given first: m,scan7=mm. none: all are in
            one unit. Default: as in the last run.
        landmarks: File of landmarks and curves of the template, as of 3D Slicer, or folder of such files of several
            shapes, named like them: the folder landmarks gets a file for each shape, and tables; see isomatch collect
            landmarks.
        agree: Once all pairs are matched, replace maps that the others contradict, see isomatch collect agree; by default
            only if all pairs are. Maps of shards are compared by that command.
        fail_on: Outcomes of maps that make the exit code 4, after all files are written, as of isomatch match. Where
            shapes or pairs failed it is 3 in any case; with --strict the first of them ends the run.
        keep_contacts: Of subjects, keep points together that lie on each other in the template; see contacts.csv.
    """
    refused = read_outcomes(fail_on)
    how: dict[str, Any] = {"config": read_config(config), "seed": seed, "reports": reports, "agree": agree}
    how |= {"landmarks": landmarks, "semilandmarks": semilandmarks, "keep_contacts": keep_contacts}
    how |= {"shard": shard_of(shard), "executor": executor, "jobs": jobs, "time_limit": time_limit}
    with talk.progress() as tell:
        found = cohort.run(
            output,
            shapes,
            pairs=pairs,
            template=None if template == "auto" else template,
            reflect=names_of(reflect),
            units=units_of(units),
            **how,
            progress=tell,
            warn=complain,
        )
    say_cohort(found, talk, refused)
