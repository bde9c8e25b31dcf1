"""``isomatch bench``: run methods over benchmark sets, resumable, with tables and curves."""

from __future__ import annotations

import sys
from itertools import product
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from isomatch._core.errors import MapError
from isomatch.cli import TALK, Talk, part, say, say_notes
from isomatch_lab import evaluation

MAX_NOTES = 5  # largest number of notes that are shown; chosen


def bench(
    *,
    sets: Annotated[str, Parameter(name="--set")],
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    data: Path | None = None,
    methods: str | None = None,
    method: tuple[str, ...] = (),
    maps: tuple[Path, ...] = (),
    maps_from: Literal[0, 1] | None = None,
    pairs: int | None = None,
    points: int = 1000,
    seed: int = 0,
    jobs: int | None = None,
    landmarks: Path | None = None,
    cycles: bool = False,
    published: Path | None = None,
    damage: tuple[str, ...] = (),
    talk: Talk = TALK,
) -> None:
    """Run methods over benchmark sets and measure their maps against the truth.

    Parameters
    ----------
    sets : str
        A folder of your own with shapes and truth, or the name of one in DATA; or faust_r, tosca_iso_r, scape_r, faust,
        scape, tosca, cross, creatures, organs, example; several with commas. docs/how_to/own_benchmark.md describes what
        a folder of your own consists of.
    output : Path
        Folder for rows.jsonl, index.html, pairs.csv, summary.csv, improvements.csv and curves. Rows that are already
        there are not computed again, unless isomatch, the settings of the method, or files of your own set or method have
        changed.
    data : Path
        Folder of the sets, each in a folder of its name, as archives or as published; creatures, organs and example need
        none.
    methods : str
        isomatch, isomatch_5pt, gdd, gdd_post, phi, functional_maps, functional_maps_5pt, zoomout, zoomout_5pt, gmds,
        gmds_5pt, gw, gw_5pt, sgmds, sgmds_5pt, sgf, sgf_5pt, pyfm; several with commas. gdd, gdd_post, phi and those
        named 5pt are given five true landmarks, far from one another. NAME+isomatch is isomatch started from the map of
        NAME; NAME+gdd and NAME+gdd_post are the paper's methods started from it. By default isomatch, or METHOD and MAPS
        alone.
    method : str
        A function of your own, MODULE:FUNCTION or FILE.py:FUNCTION, that takes two meshes, source and target, and returns
        the target vertex of each source vertex, or a map. May be repeated.
    maps : Path
        Folder of the maps that another program found, SOURCE__TARGET with the suffix .txt, .npy, .npz or .mat: the target
        vertex of each source vertex, in the order of the files of the set. May be repeated.
    maps_from : int
        What these maps count from, 0 or 1; by default the first that allows one reading only decides for all.
    pairs : int
        Number of pairs to draw from each set; all by default.
    points : int
        Number of truth points to judge for each pair.
    seed : int
        Seed of the draws of pairs, points and landmarks.
    jobs : int
        Number of pairs to run at a time, each on one thread; by default one for each processor. With 1, a pair uses all
        threads.
    landmarks : Path
        Folder of hand-picked landmarks, a file for each shape or class as described in ShapeSet.with_landmarks: measure
        errors there, instead of at points of the dense truth.
    cycles : bool
        Also match each target to its source, and record the mean cycle error × 100 / √(source area).
    published : Path
        Folder of published curves to draw for comparison, .npz with 'set|method|x' (errors) and 'set|method|y' (percent).
    damage : str
        Damage to the target of each pair: NAME or NAME:LEVEL, of cut, holes, limb_removed, view, weld, merge, noise,
        decimate, resample; ending in @source or @both, to the source or to both. May be repeated. Errors are measured on
        the whole target.
    talk : Talk
        What is told.
    """
    curves = [] if published is None else evaluation.read_published_curves(published)
    asked = list(product([sets] if Path(sets).is_dir() else sets.split(","), damage or (None,)))
    chosen: list[Any] = methods.split(",") if methods else [] if method or maps else ["isomatch"]
    chosen += [*method, *(evaluation.MapsInFolder(folder, maps_from) for folder in maps)]
    if method:
        sys.path.insert(0, str(Path.cwd()))  # as python -m does
    notes: list[str] = []
    with talk.progress() as tell:
        for number, (name, damage_choice) in enumerate(asked):
            run = evaluation.BenchmarkRun(
                set_name=name,
                methods=tuple(chosen),
                folder=None if data is None else str(data),
                n_pairs=pairs,
                n_points=points,
                seed=seed,
                jobs=jobs,
                landmarks=None if landmarks is None else str(landmarks),
                cycles=cycles,
                damage=damage_choice,
            )
            reach = part(tell, number / len(asked), (number + 1) / len(asked))
            reach(f"{name}: reading", 0.0)
            total = len(run.chosen_pairs()) * len(run.names)
            done = len(evaluation.rows_of(run, output))
            for row in evaluation.run_benchmark(run, output):
                done += 1
                notes += [row["notes"]] if row.get("notes") else []
                notes += [f"{row['pair']} by {row['method']}: {row['problem']}"] if "problem" in row else []
                reach(
                    f"{evaluation.set_label(row)}: last {row['pair']} by {row['method']}",
                    min(done / total, 1.0),
                )
        tell("done", 1.0)
    table = evaluation.write_tables(output, curves)
    notes = list(dict.fromkeys(" ".join(note.split()) for note in notes))
    talk.result({"summary": table, "folder": str(output), "notes": notes}, lambda: _say(table, output, notes))
    if notes and all(row["mean"] is None for row in table):
        raise MapError(f"no pair could be matched and measured; {notes[0]}")


def _say(table: list[dict[str, Any]], output: Path, notes: list[str]) -> None:
    """Print a line for each method, by set, in 80 columns; what is rare stands behind it in words."""
    say("mean geodesic error × 100 / √(target area)", "bold")
    wide = max([6, *(len(row["method"]) for row in table)])
    say(
        f"  {'method':{wide}} {'pairs':>5} {'mean':>6} {'median':>6} {'max':>6} {'> 10':>5} {'seconds':>8} {'cycle':>6}"
    )
    last = None
    for row in evaluation.told_of_parts(table):
        if (name := evaluation.set_label(row)) != last:
            last = name
            say(f"{name}{', at landmarks' * (row['judged_at'] == 'landmarks')}", "bold")
        say(
            f"  {row['method']:{wide}} {row['pairs']:5d} {_number(row['mean'])} {_number(row['median'])} "
            f"{_number(row['max'])} {row['failures']:5d} {_number(row['seconds']):>8} {_number(row['cycle'])}"
            + (f"  IoU {row['iou']:.0%}" if row.get("iou") is not None else "")
            + (f"  where matched {row['error_matched']:.2f}" if row.get("error_matched") is not None else "")
            + (f"  {row['problems']} with a problem" if row["problems"] else "")
        )
    say_notes(notes[:MAX_NOTES])
    if more := len(notes[MAX_NOTES:]):
        say(f"note: {more} more {'note is' if more == 1 else 'notes are'} in pairs.csv")
    say(f"open first: {output / 'index.html'}; also there: pairs.csv, summary.csv, curves.png, curves.svg")


def _number(value: Any) -> str:
    return f"{value:6.2f}" if isinstance(value, float) else f"{'–':>6}"
