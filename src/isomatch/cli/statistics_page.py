"""The page of ``isomatch statistics``: every picture, what was found, and links to the tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from importlib.resources import files
from itertools import accumulate
from string import Template
from typing import Any
from urllib.parse import quote

PICTURES = {
    "modes": "The mean, and the mean moved along each mode. The colour is the displacement along its normal.",
    "scores": "The shapes by their scores along the first two modes.",
    "variance": "How much each vertex varies.",
    "groups": "Where the means of the groups differ, and how far they are apart there.",
    "asymmetry": "The asymmetry that is common to all shapes.",
    "allometry": "Shape without size, in the direction in which it changes with size, against size.",
    "quality": "By the number of modes: the share described, the error of shapes left out, how near random ones are.",
    "embedding": "The shapes by the differences of their geodesic distances.",
    "dendrogram": "The tree of the same.",
}
"""What each picture shows, in the order of the page."""

SCALES = {
    "keep": "Size is part of the shape (scale keep)",
    "remove": "All shapes are brought to one size (scale remove)",
}
WEIGHTS = {
    "area": "a vertex counts by its share of the area (weights area)",
    "uniform": "all vertices count alike (weights uniform)",
}


def page_of(
    folder: str,
    record: Mapping[str, Any],
    told: Sequence[str],
    pictures: Sequence[str],
    written: Sequence[str],
) -> str:
    """Return the text of the page, whose pictures are beside it."""
    of = {name.rpartition(".")[0]: name for name in pictures}
    figures = "".join(_figure(of[name], words) for name, words in PICTURES.items() if name in of)
    tables = [name for name in written if name.endswith((".csv", ".npz")) and "/" not in name]
    doubts = [f"{' and '.join(doubt['names'])} {doubt['reason']}" for doubt in record["doubts"]]
    return Template((files("isomatch.cli") / "statistics_page.html").read_text(encoding="utf-8")).substitute(
        title=escape(f"Statistics of {_counted(record)}"),
        folder=escape(folder),
        settings=escape(
            f"{SCALES[record['scale']]}; {WEIGHTS[record['weights']]}. "
            f"Seed {record['seed']}, isomatch {record['isomatch']}."
        ),
        first=f"<h2>To look at first</h2>{_listed(doubts)}" if doubts else "",
        told=_listed(told),
        modes="".join(
            f"<tr><td>{i}</td><td>{share:.1%}</td><td>{sum_:.1%}</td></tr>"
            for i, (share, sum_) in enumerate(zip(record["shares"][:10], accumulate(record["shares"])), 1)
        ),
        figures=figures,
        tables=", ".join(f'<a href="{quote(name)}">{escape(name)}</a>' for name in tables),
    )


def _counted(record: Mapping[str, Any]) -> str:
    n = len(record["shapes"])
    return f"{n} shapes" if record["mirror"] is None else f"{n // 2} shapes and their mirror images"


def _figure(file: str, words: str) -> str:
    shown = (
        f'<a href="{quote(file)}">{escape(file)}</a>'
        if file.endswith(".pdf")
        else f'<a href="{quote(file)}"><img src="{quote(file)}" alt="" loading=lazy></a>'
    )
    return f"<figure>{shown}<figcaption>{escape(words)}</figcaption></figure>\n"


def _listed(lines: Sequence[str]) -> str:
    return "<ul>" + "".join(f"<li>{escape(line)}</li>" for line in lines) + "</ul>" if lines else ""
