"""The page of a collection, its table of pairs, worst first, and the reports of those to look at."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import fields, replace
from functools import partial
from html import escape
from importlib.resources import files
from pathlib import Path
from shlex import join
from string import Template
from typing import Any, Literal
from urllib.parse import quote

from isomatch._core.errors import SettingError
from isomatch._core.files import replaced, write_text, writing
from isomatch._core.texts import write_csv
from isomatch.cohort.collection import Collection
from isomatch.cohort.entries import Pair
from isomatch.cohort.jobs import row_of
from isomatch.cohort.ledger import Record, Rows, is_contradicted
from isomatch.cohort.map_file import as_matched
from isomatch.cohort.outliers import Outlier, outliers
from isomatch.cohort.plan import Layout
from isomatch.cohort.workers import Task, Workers, late_after, workers_of
from isomatch.io import mesh_from
from isomatch.matching import MatchResult, Outcome, Quality
from isomatch.visualization import write_report

SHOWN = {  # columns of the table of pairs on the page, and how their numbers are written
    "in doubt": "{:.1%}",
    "distortion_mean": "{:.1%}",
    "coverage": "{:.0%}",
    "matched": "{:.0%}",
    "spectral_residual": "{:.2f}",
    "runner_up": "{:.2f}",
    "seconds": "{:.1f}",
}
# where they say more than in pairs.csv
HEADS = {"runner_up": "best alternative", "distortion_mean": "distortion"}
MOST_TURNED = 0.01  # share of faces that are turned over, which is not worth a word
MOST_SHOWN = 200  # pairs on the page
MEASURES = tuple(each.name for each in fields(Quality))
COLUMNS = (
    *("source", "target", "state", "outcome", "outcome_back"),
    *(*MEASURES, *(f"{name}_back" for name in MEASURES)),
    *("inconsistency", "inconsistency_before", "replaced_by", "reflected", "seconds", "memory", "error"),
    *("source_hash", "target_hash", "key"),
)
ALSO = 3  # the worst of the pairs that are not in doubt


def write_page(
    collection: Collection, rows: Rows, template: str | None, lines: Mapping[str, Mapping[str, Any]]
) -> None:
    """Write ``index.html``, with links to the files of the folder; lines tell of the surfaces written, by name."""
    layout = collection.layout
    pairs = table_of(rows)
    outcomes = Counter(pair.get("outcome") or pair["state"] for pair in pairs)
    counts = ", ".join(f"{count} {name.lower().replace('_', ' ')}" for name, count in outcomes.most_common())
    prepared = sum(row["state"] == "done" for row in rows.shapes.values())
    page = Template((files("isomatch.cohort") / "report.html").read_text(encoding="utf-8")).substitute(
        title=escape(f"{len(collection.shapes)} shapes in {layout.folder.resolve().name}"),
        summary=escape(f"{prepared} shapes prepared. {len(pairs)} pairs: {counts or 'none yet'}."),
        template=escape(template or "not yet chosen"),
        first=_first(outliers(collection, rows)),
        shapes="".join(_figure(collection, name, rows, lines) for name in collection.names),
        count=f"{min(len(pairs), MOST_SHOWN)} of {len(pairs)}, worst first.",
        pairs="".join(_shown(collection, pair, rows) for pair in pairs[:MOST_SHOWN]),
        columns="".join(f"<th scope=col>{HEADS.get(name, name.replace('_', ' '))}</th>" for name in SHOWN),
    )
    write_text(layout.page, page)


def _first(odd: Sequence[Outlier]) -> str:
    """List what does not fit, if anything does not."""
    item = "<li><b>{1}</b> <small>{0}</small> {2}</li>\n"
    items = "".join(item.format(*map(escape, outlier)) for outlier in odd)
    return f"<h2>To look at first</h2>\n<ul class=first>{items}</ul>" if odd else ""


def _figure(collection: Collection, name: str, rows: Rows, lines: Mapping[str, Mapping[str, Any]]) -> str:
    """Show one shape: its picture and its problems."""
    line, record = lines.get(name, {}), rows.shapes.get(name, {})
    problems = [str(each["error"]) for each in (record, line) if each.get("error")]
    if line.get("mirror_image"):
        problems.append("seems to be a mirror image")
    if float(line.get("turned") or 0) > MOST_TURNED:
        problems.append(f"{float(line['turned']):.1%} of the faces are turned over")
    if int(line.get("extended") or 0):
        problems.append(f"{line['extended']} vertices of the template without counterpart")
    picture = collection.layout.thumbnail(name)
    image = f'<img src="{_link(collection, picture)}" alt="" loading=lazy>' if picture.exists() else "<i></i>"
    problem = f"<small>{escape('; '.join(problems))}</small>" if problems else ""
    side = "<small class=told>reflected</small>" if rows.reflected([name]) else ""
    return f"<figure>{image}<figcaption>{escape(name)}{side}{problem}</figcaption></figure>"


def _shown(collection: Collection, pair: Mapping[str, Any], rows: Rows) -> str:
    """Show one pair: names, outcome, measures, and links to its report and maps, as far as they exist."""
    layout, both = collection.layout, (pair["source"], pair["target"])
    measures = {**pair, "in doubt": _in_doubt(pair)}
    numbers = {name: measures.get(name) for name in SHOWN}
    texts = [SHOWN[name].format(n) if isinstance(n, int | float) else "–" for name, n in numbers.items()]
    cells = "".join(f"<td>{escape(text)}</td>" for text in texts)
    files = {"report": layout.report(both)} if has_report(layout, both, rows.pairs[both]) else {}
    files |= {"maps": layout.maps(both)} if layout.maps(both).exists() else {}
    links = [f'<a href="{_link(collection, path)}">{word}</a>' for word, path in files.items()]
    outcome = pair.get("outcome") or pair["state"]
    good = outcome in ("CONVERGED", "PARTIAL")
    words = outcome.lower().replace("_", " ") + (f": {pair['error']}" if pair.get("error") else "")
    return (
        f"<tr{'' if good else ' class=bad'}><td class=words>{escape(', '.join(both))}</td>"
        f"<td class=words>{escape(words)}</td><td class=words>{' '.join(links)}</td>{cells}</tr>\n"
    )


def _link(collection: Collection, path: Any) -> str:
    return quote(path.relative_to(collection.layout.folder).as_posix())


def _in_doubt(pair: Mapping[str, Any]) -> float | None:
    """Share of the surface in the regions of doubt of a pair; None without a map, or if all of it may be wrong."""
    result = pair.get("there") or {}
    areas = [region["area"] for region in result.get("regions", [])]
    is_unclear = not result or (Outcome[result["outcome"]].is_doubtful and not areas)
    return None if is_unclear else float(sum(areas))


def table_of(rows: Rows) -> list[dict[str, Any]]:
    """One row for each pair, with the columns ``COLUMNS``; worst first: failed, then by outcome and spectral residual."""
    lines = [_line(pair, record) for pair, record in rows.pairs.items()]
    return sorted(lines, key=_goodness)


def write_table(rows: Rows, path: Path) -> None:
    """Write the table as CSV, and beside it as Parquet if the package pyarrow is installed."""
    lines = table_of(rows)
    write_csv(path, lines, COLUMNS)
    try:
        from pyarrow import Table, parquet
    except ImportError:
        return
    table = Table.from_pylist([{name: line.get(name) for name in COLUMNS} for line in lines])
    with replaced(path.with_suffix(".parquet")) as file:
        parquet.write_table(table, file)


def _line(pair: Pair, record: Record) -> dict[str, Any]:
    line: dict[str, Any] = {"source": pair[0], "target": pair[1], **record}
    for side, ending in (("there", ""), ("back", "_back")):
        result = record.get(side)
        if result:
            line[f"outcome{ending}"] = result["outcome"]
            line |= {f"{name}{ending}": result["quality"].get(name) for name in MEASURES}
    agreement = record.get("agreement", {})
    line |= {"inconsistency": agreement.get("inconsistency"), "inconsistency_before": agreement.get("before")}
    if "replaced_by" in record:
        line["replaced_by"] = " > ".join(record["replaced_by"])
    line["reflected"] = ", ".join(record.get("reflected", ()))
    return line


def _goodness(line: dict[str, Any]) -> tuple[bool, int, float]:
    sureness = Outcome[line["outcome"]].sureness if line.get("outcome") else -1
    return line["state"] == "done", sureness, -(line.get("spectral_residual") or 0.0)


def write_reports(
    collection: Collection,
    which: int | Literal["doubtful", "all"] = "doubtful",
    executor: str | Executor | Workers = "local",
    jobs: int | None = None,
    time_limit: float | None = None,
) -> Iterator[tuple[Pair, Record]]:
    """Write the reports of pairs that have none of their present map; yield each with its ``state`` or ``error``.

    Of the pairs, these are so many of the worst; the "doubtful" ones on the page, which are not ``CONVERGED``, with the
    three next; or "all". Other arguments are those of `Collection.run`.
    """
    if not isinstance(which, str) and which < 0:
        raise SettingError(f"{which} reports cannot be written; give a number, or doubtful, all or none")
    late = late_after(time_limit)
    rows = collection.rows()
    chosen = _chosen(table_of(rows), which)
    due = [(pair, row) for pair in chosen if not has_report(collection.layout, pair, row := rows.pairs[pair])]
    if not due:
        return
    folder = collection.layout.folder / "reports"
    with writing(folder):
        folder.mkdir(exist_ok=True)
    tasks = [Task((each,), partial(row_of, partial(_written, collection.of(each[0])))) for each in due]
    with workers_of(executor, jobs) as workers:
        for (pair, _), row in workers.completed(tasks, late):
            yield pair, row if isinstance(row, dict) else {"state": "failed", "error": str(row)}


def has_report(layout: Layout, pair: Pair, record: Record) -> bool:
    """Whether there is a report of the map that a pair has now."""
    path = layout.report(pair)
    return record["state"] == "done" and path.exists() and path.stat().st_mtime >= record["time"]


def _chosen(lines: list[dict[str, Any]], which: int | str) -> list[Pair]:
    """Choose from the lines of the table, worst first."""
    matched = [line for line in lines if line["state"] == "done"]
    if which == "doubtful":
        which = min(sum(line["outcome"] != Outcome.CONVERGED.name for line in matched) + ALSO, MOST_SHOWN)
    return [(line["source"], line["target"]) for line in matched[: None if which == "all" else int(which)]]


def _written(collection: Collection, item: tuple[Pair, Record]) -> Record:
    """Write the report of a pair, source → target."""
    pair, record = item
    files = [collection.paths[name] for name in pair]
    source_turned, target_turned = (name in record.get("reflected", ()) for name in pair)
    maps = collection.maps(*pair)
    source, target = map(mesh_from, files)
    there, source, target = as_matched(maps.there, source, target, (source_turned, target_turned))
    command = join(["isomatch", "match", *map(str, files)])
    if source_turned != target_turned:
        command += " --orientation any"
    command += " -o DIR --landmarks landmarks.txt"
    path = collection.layout.report(pair)
    # the result of a match, restored from its saved parts; notes say what is not in them
    summary = record["there"]
    notes = list(summary["notes"])
    if summary["alternatives"]:
        notes.append("a collection does not keep alternatives; isomatch match finds them again")
    if is_contradicted(record):
        notes.insert(0, f"other maps contradict it by {record['agreement']['inconsistency']:.2f} √area")
    result = replace(MatchResult.from_dict(summary, there, collection.config), notes=tuple(notes))
    if maps.there_error is not None:
        result = replace(result, expected_error=maps.there_error)
    write_report(path, source, target, result, names=pair, command=command)
    return {"bytes": path.stat().st_size}
