"""The page of a collection, its table of pairs, worst first, and reports of those to look at."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import fields, replace
from functools import partial
from html import escape
from pathlib import Path
from shlex import join
from typing import Any, Literal
from urllib.parse import quote

from isomatch._core.errors import SettingError
from isomatch._core.files import replaced, write_text, writing
from isomatch._core.texts import write_csv
from isomatch.cohort.collection import Collection
from isomatch.cohort.ledger import Pair, PairAgreement, PairRow, Rows, ShapeRow, SurfaceRow
from isomatch.cohort.map_file import as_matched
from isomatch.cohort.plan import Layout
from isomatch.cohort.snapshot import Snapshot
from isomatch.cohort.specimen_page import template_of, text_of
from isomatch.cohort.unusual_shapes import Outlier, outliers
from isomatch.cohort.workers import Task, Workers, workers_of
from isomatch.io import mesh_from
from isomatch.matching import MatchResult, Outcome, Quality
from isomatch.visualization import html_page

# formats of the numbers in the page's table of pairs, by column
FORMATS = {"in doubt": "{:.1%}", "distortion_mean": "{:.1%}", "coverage": "{:.0%}", "matched": "{:.0%}"}
FORMATS |= {"spectral_residual": "{:.2f}", "runner_up": "{:.2f}", "seconds": "{:.1f}"}
# heads on the page of columns that have other names in pairs.csv
HEADS = {"runner_up": "best alternative", "distortion_mean": "distortion"}
MAX_TURNED_SHARE = 0.01  # share of a shape's faces; the page reports it if more are turned over; chosen
MAX_PAIRS = 200  # largest number of pairs on the page; chosen
MEASURES = tuple(field.name for field in fields(Quality))  # names of the measures of a map
PAIR_COLUMNS = (  # columns of pairs.csv
    *("source", "target", "state", "outcome", "outcome_back"),
    *(*MEASURES, *(f"{name}_back" for name in MEASURES)),
    *("inconsistency", "inconsistency_before", "replaced_by", "reflected", "seconds", "memory", "error"),
    *("source_hash", "target_hash", "key"),
)
LOCAL_SOURCES = "'self' file: data:"  # sources of pictures that the content security policy allows
N_SURE_REPORTS = 3  # number of pairs that get a report although they converged, the worst of these; chosen


def write_page(known: Snapshot) -> None:
    """Write ``index.html`` with links to the files that exist, and what ``shapes.csv`` tells of them."""
    layout, rows, lines = known.layout, known.rows, known.surface_rows()
    pairs = worst_first(rows)
    outcomes = Counter(row.ending for _, row in pairs)
    counts = ", ".join(f"{count} {name.lower().replace('_', ' ')}" for name, count in outcomes.most_common())
    prepared = sum(map(rows.is_prepared, rows.shapes))
    title = f"{len(known.names)} shapes in {layout.folder.resolve().name}"
    has_landmarks = any(layout.landmark_view(name).exists() for name in known.names)
    body = template_of("report.html").substitute(
        title=escape(title),
        summary=escape(f"{prepared} shapes prepared. {len(pairs)} pairs: {counts or 'none yet'}."),
        template=escape(known.template or "not yet chosen"),
        landmarks=", with its landmarks" * has_landmarks,
        first=_first(outliers(known.plan, rows)),
        shapes="".join(_figure(known, name, lines.get(name)) for name in known.names),
        count=f"{min(len(pairs), MAX_PAIRS)} of {len(pairs)}, worst first.",
        pairs="".join(_shown(layout, *pair) for pair in pairs[:MAX_PAIRS]),
        columns="".join(f"<th scope=col>{HEADS.get(name, name.replace('_', ' '))}</th>" for name in FORMATS),
    )
    page = html_page(title, body, style=text_of("cohort.css"), images=LOCAL_SOURCES)
    write_text(layout.page, page)


def _first(odd: Sequence[Outlier]) -> str:
    """List what does not fit, if anything does not."""
    item = "<li><b>{1}</b> <small>{0}</small> {2}</li>\n"
    items = "".join(item.format(*map(escape, outlier)) for outlier in odd)
    return f"<h2>To look at first</h2>\n<ul class=first>{items}</ul>" if odd else ""


def _figure(known: Snapshot, name: str, line: SurfaceRow | None) -> str:
    """Show one shape: its picture, a link to its page, and what is wrong with it."""
    line, row = line or SurfaceRow(name=name), known.rows.shapes.get(name, ShapeRow(state="todo"))
    problems = [record.error for record in (row, line) if record.error]
    if line.mirror_image:
        problems.append("seems to be a mirror image")
    if float(line.turned or 0) > MAX_TURNED_SHARE:
        problems.append(f"{float(line.turned):.1%} of the faces are turned over")
    if int(line.extended or 0):
        problems.append(f"{line.extended} template vertices have no counterpart here and were interpolated")
    layout, picture = known.layout, known.layout.thumbnail(name)
    image = f'<img src="{_link(layout, picture)}" alt="" loading=lazy>' if picture.exists() else "<i></i>"
    views = (path for path in (layout.landmark_view(name), layout.view(name)) if path.exists())
    if view := next(views, None):
        image = f'<a href="{_link(layout, view)}" aria-label="{escape(name)} in 3D">{image}</a>'
    problem = f"<small>{escape('; '.join(problems))}</small>" if problems else ""
    side = "<small class=told>reflected</small>" if known.entry(name).reflected else ""
    return f"<figure>{image}<figcaption>{escape(name)}{side}{problem}</figcaption></figure>"


def _shown(layout: Layout, pair: Pair, row: PairRow) -> str:
    """Show one pair: names, outcome, measures, and links to its report and maps if they exist."""
    measures = {**row.forward.measures, "seconds": row.seconds, "in doubt": row.forward.doubtful_area}
    numbers = {name: measures.get(name) for name in FORMATS}
    texts = [FORMATS[name].format(n) if isinstance(n, int | float) else "–" for name, n in numbers.items()]
    cells = "".join(f"<td>{escape(text)}</td>" for text in texts)
    files = {"report": layout.report(pair)} if has_report(layout, pair, row) else {}
    files |= {"maps": layout.maps(pair)} if layout.maps(pair).exists() else {}
    links = [f'<a href="{_link(layout, path)}">{word}</a>' for word, path in files.items()]
    good = row.ending in ("CONVERGED", "PARTIAL")
    words = row.ending.lower().replace("_", " ") + (f": {row.error}" if row.error else "")
    return (
        f"<tr{'' if good else ' class=bad'}><td class=words>{escape(', '.join(pair))}</td>"
        f"<td class=words>{escape(words)}</td><td class=words>{' '.join(links)}</td>{cells}</tr>\n"
    )


def _link(layout: Layout, path: Path) -> str:
    return quote(path.relative_to(layout.folder).as_posix())


def worst_first(rows: Rows) -> list[tuple[Pair, PairRow]]:
    """Order pairs: failed ones first, then by outcome and spectral residual."""

    def goodness(item: tuple[Pair, PairRow]) -> tuple[bool, int, float]:
        summary = item[1].forward
        sureness = summary.outcome.sureness if summary.values else -1
        return item[1].state == "done", sureness, -(summary.measures.get("spectral_residual") or 0.0)

    return sorted(rows.pairs.items(), key=goodness)


def write_table(rows: Rows, path: Path) -> None:
    """Write a line for each pair as CSV, and as Parquet if the package pyarrow is installed."""
    lines = [_line(*item) for item in worst_first(rows)]
    write_csv(path, lines, PAIR_COLUMNS)
    try:
        from pyarrow import Table, parquet
    except ImportError:
        return
    table = Table.from_pylist([{name: line.get(name) for name in PAIR_COLUMNS} for line in lines])
    with replaced(path.with_suffix(".parquet")) as file:
        parquet.write_table(table, file)


def _line(pair: Pair, row: PairRow) -> dict[str, object]:
    line: dict[str, object] = {"source": pair[0], "target": pair[1], **row.to_json()}
    for result, ending in ((row.forward, ""), (row.backward, "_back")):
        if result.values:
            line[f"outcome{ending}"] = result.outcome.name
            line |= {f"{name}{ending}": result.measures.get(name) for name in MEASURES}
    agreement = row.agreement or PairAgreement()
    line |= {"inconsistency": agreement.inconsistency, "inconsistency_before": agreement.before}
    if row.replaced_by:
        line["replaced_by"] = " > ".join(row.replaced_by)
    return {**line, "reflected": ", ".join(row.reflected)}


def write_reports(
    collection: Collection,
    which: int | Literal["doubtful", "all"] = "doubtful",
    executor: str | Executor | Workers = "local",
    jobs: int | None = None,
    time_limit: float | None = None,
) -> Iterator[tuple[Pair, str]]:
    """Write the reports of pairs without one of their present map; yield each with any error.

    A number N chooses the N worst pairs; "doubtful" the pairs on the page that are not
    ``CONVERGED``, and the three next ones; "all" every pair. Other arguments are those of
    `Collection.run`.
    """
    if not isinstance(which, str) and which < 0:
        raise SettingError(f"{which} reports cannot be written; give a number, or doubtful, all or none")
    matched = [item for item in worst_first(collection.rows()) if item[1].state == "done"]
    if which == "doubtful":
        doubtful = sum(row.forward.outcome is not Outcome.CONVERGED for _, row in matched)
        which = min(doubtful + N_SURE_REPORTS, MAX_PAIRS)
    chosen = matched if which == "all" else matched[: int(which)]
    due = [(pair, row) for pair, row in chosen if not has_report(collection.layout, pair, row)]
    if not due:
        return
    folder = collection.layout.folder / "reports"
    with writing(folder):
        folder.mkdir(exist_ok=True)
    tasks = [Task((item,), partial(_write_report_of, collection.of(item[0]))) for item in due]
    with workers_of(executor, jobs, time_limit) as workers:
        for (pair, _), attempt in workers.completed(tasks):
            yield pair, attempt.error


def has_report(layout: Layout, pair: Pair, row: PairRow) -> bool:
    """Whether there is a report of the map that a pair has now."""
    path = layout.report(pair)
    return row.state == "done" and path.exists() and path.stat().st_mtime >= row.time


def _write_report_of(collection: Collection, item: tuple[Pair, PairRow]) -> None:
    """Write the report of a pair, source → target."""
    from isomatch.visualization import write_report  # imports matplotlib: only workers need it

    pair, row = item
    files = [collection.paths[name] for name in pair]
    source_turned, target_turned = (name in row.reflected for name in pair)
    maps = collection.maps(*pair)
    source, target = map(mesh_from, files)
    forward, source, target = as_matched(maps.forward, source, target, (source_turned, target_turned))
    command = join(["isomatch", "match", *map(str, files)])
    if source_turned != target_turned:
        command += " --orientation any"
    command += " -o DIR --landmarks landmarks.txt"
    path = collection.layout.report(pair)
    notes = row.forward.notes  # the result is restored from saved parts: notes say what these lack
    if row.forward.values["alternatives"]:
        notes.append("a collection does not keep alternatives; isomatch match finds them again")
    if row.is_contradicted:
        notes.insert(0, f"other maps contradict it by {row.inconsistency:.2f} √area")
    result = MatchResult.from_dict(dict(row.forward.values), forward, collection.config)
    known: dict[str, Any] = {} if maps.forward_error is None else {"expected_error": maps.forward_error}
    result = replace(result, notes=tuple(notes), **known)
    write_report(path, source, target, result, names=pair, command=command)
