"""Tables of values as csv, pandas, R and spreadsheets write them, with what they mean; drawn at random."""

import csv
import io
from dataclasses import dataclass, field

import numpy as np
from hypothesis import strategies as st

MISSING = ["", "NA", "nan", "NaN", "."]
WORDS = ["left", "right front", "007", "Größe", "a,b", "a;b", 'say "x"', "#1", "x y", "1e", "12a"]


@dataclass
class Written:
    """A text in bytes, and the columns that it is to be read as: numbers, or words."""

    data: bytes
    columns: dict[str, list] = field(default_factory=dict)


@st.composite
def tables(draw, n=7):
    """A table of ``n`` rows for the vertices of a surface."""
    width = draw(st.integers(1, 3))
    separator = draw(st.sampled_from([",", ";", "\t", " "]))
    comma = separator != "," and draw(st.booleans())
    has_names = draw(st.booleans())
    index = draw(
        st.sampled_from(["none", "none", "vertex 0", "vertex 1", "pandas", "R csv", "R table", "shuffled"])
    )
    index = index if has_names else "none"
    quote = draw(st.sampled_from([csv.QUOTE_MINIMAL, csv.QUOTE_NONNUMERIC]))
    quote = csv.QUOTE_NONNUMERIC if index.startswith("R") or separator == " " else quote
    missing = draw(st.sampled_from(MISSING))
    missing = missing or ("NA" if separator == " " else "")
    columns = {f"column{i}": draw(_column(n)) for i in range(width)}
    rows = [[] for _ in range(n)]
    for values in columns.values():
        for row, value in zip(rows, values):
            is_none = value is None or (isinstance(value, float) and np.isnan(value))
            text = missing if is_none else value if isinstance(value, str) else _Number(value, comma)
            row.append(text)
    names = [*columns]
    order = draw(st.permutations(range(n))) if index == "shuffled" else [*range(n)]
    if index != "none":
        start = 1 if index in ("vertex 1", "R csv", "R table") else 0
        quoted = str if index.startswith("R") else lambda number: _Number(number, False)
        rows = [[quoted(i + start), *rows[i]] for i in order]
        title = {"pandas": [""], "R csv": [""], "R table": []}.get(index, ["vertex"])
        names = [*title, *names]
    text = io.StringIO()
    writer = csv.writer(text, delimiter=separator, quoting=quote, lineterminator="\n")
    for row in [names] * has_names + rows:
        if (
            len(row) == 1 and row[0] == ""
        ):  # as csv and pandas write it; R and spreadsheets leave the line empty
            text.write(draw(st.sampled_from(['""\n', "\n"])))
        else:
            writer.writerow(
                [
                    each.text if isinstance(each, _Number) and quote == csv.QUOTE_MINIMAL else each
                    for each in row
                ]
            )
    content = text.getvalue().replace("\n", draw(st.sampled_from(["\n", "\r\n"])))
    encoding = draw(st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "cp1252"]))
    return Written(content.encode(encoding), columns)


class _Number(float):
    """A number that csv does not quote, written with a decimal point or a comma."""

    def __new__(cls, value, comma):
        made = super().__new__(cls, value)
        text = repr(value) if isinstance(value, int) else f"{value:.6g}"
        made.text = text.replace(".", ",") if comma else text
        return made

    def __repr__(self):
        return self.text

    __str__ = __repr__


@st.composite
def _column(draw, n):
    kind = draw(st.sampled_from(["whole", "float", "word"]))
    of = {
        "whole": st.integers(-3, 300),
        "float": st.integers(-30000, 30000).map(lambda i: float(f"{i / 1000 + 0.0005:.6g}")),
        "word": st.sampled_from(WORDS),
    }[kind]
    values = draw(st.lists(of, min_size=n, max_size=n))
    for i in draw(st.sets(st.integers(0, n - 1), max_size=2)):
        values[i] = None
    return values


@st.composite
def clouds(draw, n=5):
    """A cloud of ``n`` points, with or without names of columns, in any order if they have names."""
    numbers = st.integers(-30000, 30000).map(lambda i: i / 1000)
    points = draw(st.lists(st.tuples(numbers, numbers, numbers), min_size=n, max_size=n))
    separator = draw(st.sampled_from([",", ";", "\t", " ", "   ", ", "]))
    comma = "," not in separator and draw(st.booleans())
    header = draw(st.sampled_from(["", "x y z", "Z,Y,X", "# y z x", "//X Y Z", "z x y quality"]))
    names = [name.strip("#/").lower() for name in header.replace(",", " ").split() if name.strip("#/")]
    order = ["xyz".find(name) for name in names] or [0, 1, 2]
    rows = [[str(0.25 if axis < 0 else point[axis]) for axis in order] for point in points]
    lines = [separator.join(row) for row in rows]
    lines = [line.replace(".", ",") for line in lines] if comma else lines
    first = header.replace(",", " ").replace(" ", separator) if header[:1] not in "#/" else header
    text = draw(st.sampled_from(["\n", "\r\n"])).join([*[first] * bool(header), *lines])
    encoding = draw(st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "utf-16-le"]))
    return Written(text.encode(encoding), {"points": points})
