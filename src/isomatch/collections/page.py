"""The page of a collection: all shapes in corresponding colours, and all pairs, worst first."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from html import escape
from importlib.resources import files
from string import Template
from typing import Any
from urllib.parse import quote

from isomatch.collections.cohort import Misfit, misfits
from isomatch.collections.collection import Collection
from isomatch.collections.ledger import Rows
from isomatch.collections.reports import has_report
from isomatch.collections.tables import MOST_SHOWN, table_of
from isomatch.matching import Outcome
from isomatch.storage.files import write_text

SHOWN = {
    "in doubt": "{:.1%}",
    "distortion_mean": "{:.1%}",
    "coverage": "{:.0%}",
    "matched": "{:.0%}",
    "misfit": "{:.2f}",
    "rival": "{:.2f}",
    "seconds": "{:.1f}",
}
"""Columns of the table of pairs, and how their numbers are written."""
HEADS = {"rival": "best alternative", "distortion_mean": "distortion"}
"""Heads of columns that say more than their names in ``pairs.csv``."""

MOST_TURNED = 0.01  # share of faces that are turned over, which is not worth a word


def write_page(
    collection: Collection, rows: Rows, template: str | None, lines: Mapping[str, Mapping[str, Any]]
) -> None:
    """Write ``index.html``, with links to the pictures, reports and maps in the folder.

    Parameters
    ----------
    collection : Collection
        The collection.
    rows : Rows
        The contents of its ledgers.
    template : str, optional
        Name of the template.
    lines : mapping of str to mapping
        What is known of the surfaces in the topology of the template, by name.
    """
    layout = collection.layout
    pairs = table_of(rows)
    outcomes = Counter(pair.get("outcome") or pair["state"] for pair in pairs)
    counts = ", ".join(f"{count} {name.lower().replace('_', ' ')}" for name, count in outcomes.most_common())
    prepared = sum(row["state"] == "done" for row in rows.shapes.values())
    page = Template((files("isomatch.collections") / "page.html").read_text(encoding="utf-8")).substitute(
        title=escape(f"{len(collection.shapes)} shapes in {layout.folder.resolve().name}"),
        summary=escape(f"{prepared} shapes prepared. {len(pairs)} pairs: {counts or 'none yet'}."),
        template=escape(template or "not yet chosen"),
        first=_first(misfits(collection, rows)),
        shapes="".join(_figure(collection, name, rows, lines) for name in collection.names),
        count=f"{min(len(pairs), MOST_SHOWN)} of {len(pairs)}, worst first.",
        pairs="".join(_line(collection, pair, rows) for pair in pairs[:MOST_SHOWN]),
        columns="".join(
            f"<th scope=col>{escape(HEADS.get(name, name.replace('_', ' ')))}</th>" for name in SHOWN
        ),
    )
    write_text(layout.page, page)


def _first(found: Sequence[Misfit]) -> str:
    """List what does not fit, if anything does not."""
    if not found:
        return ""
    items = "".join(
        f"<li><b>{escape(name)}</b> <small>{escape(kind)}</small> {escape(reason)}</li>\n"
        for kind, name, reason in found
    )
    return f"<h2>To look at first</h2>\n<ul class=first>{items}</ul>"


def _figure(collection: Collection, name: str, rows: Rows, lines: Mapping[str, Mapping[str, Any]]) -> str:
    """Show one shape: its picture and its problems."""
    line, record = lines.get(name, {}), rows.shapes.get(name, {})
    problems = [str(each["error"]) for each in (record, line) if each.get("error")]
    if line.get("mirror_image"):
        problems.append("seems to be a mirror image")
    if float(line.get("turned") or 0) > MOST_TURNED:
        problems.append(f"{float(line['turned']):.1%} of the faces are turned over")
    if int(line.get("extended") or 0):
        problems.append(f"{line['extended']} vertices without counterpart")
    picture = collection.layout.thumbnail(name)
    image = f'<img src="{_link(collection, picture)}" alt="" loading=lazy>' if picture.exists() else "<i></i>"
    problem = f"<small>{escape('; '.join(problems))}</small>" if problems else ""
    side = "<small class=told>reflected</small>" if rows.reflected([name]) else ""
    return f"<figure>{image}<figcaption>{escape(name)}{side}{problem}</figcaption></figure>"


def _line(collection: Collection, pair: Mapping[str, Any], rows: Rows) -> str:
    """Show one pair: names, outcome, measures, and links to its report and maps, as far as they exist."""
    layout, both = collection.layout, (pair["source"], pair["target"])
    measures = {**pair, "in doubt": _in_doubt(pair)}
    cells = [f"<td>{escape(_text(form, measures.get(name)))}</td>" for name, form in SHOWN.items()]
    links = [
        f'<a href="{_link(collection, path)}">{word}</a>'
        for word, path, exists in (
            ("report", layout.report(both), has_report(layout, both, rows.pairs[both])),
            ("maps", layout.maps(both), layout.maps(both).exists()),
        )
        if exists
    ]
    outcome = pair.get("outcome") or pair["state"]
    good = outcome in ("CONVERGED", "PARTIAL")
    words = outcome.lower().replace("_", " ") + (f": {pair['error']}" if pair.get("error") else "")
    return (
        f"<tr{'' if good else ' class=bad'}><td class=words>{escape(', '.join(both))}</td>"
        f"<td class=words>{escape(words)}</td><td class=words>{' '.join(links)}</td>{''.join(cells)}</tr>\n"
    )


def _link(collection: Collection, path: Any) -> str:
    return quote(path.relative_to(collection.layout.folder).as_posix())


def _in_doubt(pair: Mapping[str, Any]) -> float | None:
    """Share of the surface in the regions of doubt of a pair; None without a map, or if all of it may be wrong."""
    result = pair.get("there") or {}
    regions = result.get("regions", [])
    if not result or (Outcome[result["outcome"]].is_doubtful and not regions):
        return None
    return float(sum(region["area"] for region in regions))


def _text(form: str, value: object) -> str:
    return form.format(value) if isinstance(value, int | float) else "–"
