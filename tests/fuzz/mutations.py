"""Strategies that damage a sound file past its header, in its counts and at its end; how many examples are tried."""

import os
import re

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st

LONG = os.environ.get("ISOMATCH_FUZZ_EXAMPLES", "")
"""Number of examples of each test in a long run, with new ones every time; by default few, and always the same."""

fuzzed = settings(
    max_examples=int(LONG or 30),
    derandomize=not LONG,
    database=None,
    deadline=None,
    suppress_health_check=list(HealthCheck),
)

NUMBERS = [
    b"0", b"-1", b"3", b"255", b"1e9", b"-0.0", b"nan", b"inf", b"-inf", b"1e400", b"1_0", b"2147483648",
    b"18446744073709551616", b"99999999999999999999", b"1" * 5000, b"0x10", b"1.5", b"", b"\xb2", b"1 1", b"\x00",
    b"list", b"#", b"\\\n", b"\r",
]  # fmt: skip
_WORD = re.compile(rb"[^\s]+")
_LINE = re.compile(rb"[^\n]*\n")


@st.composite
def mutated(draw, seed):
    """A file with one to three changes."""
    for _ in range(draw(st.integers(1, 3))):
        seed = draw(st.sampled_from([_one_word, _some_lines, _some_bytes, _end]))(draw, seed)
    return seed


@st.composite
def spliced(draw, one, other):
    """The first lines of one file and the last of another."""
    head, tail = _LINE.findall(one) or [b""], _LINE.findall(other) or [b""]
    return b"".join(head[: draw(st.integers(0, len(head)))] + tail[draw(st.integers(0, len(tail))) :])


def _one_word(draw, data):
    words = list(_WORD.finditer(data))
    if not words:
        return data
    word = draw(st.sampled_from(words))
    return data[: word.start()] + draw(st.sampled_from(NUMBERS)) + data[word.end() :]


def _some_lines(draw, data):
    lines = _LINE.findall(data) or [b""]
    i, j = (draw(st.integers(0, len(lines) - 1)) for _ in range(2))
    how = draw(st.sampled_from(["drop", "repeat", "move"]))
    if how == "drop":
        del lines[i]
    elif how == "repeat":
        lines[j:j] = [lines[i]] * draw(st.sampled_from([1, 2, 1000]))
    else:
        lines.insert(j, lines.pop(i))
    return b"".join(lines)


def _some_bytes(draw, data):
    start = draw(st.integers(0, len(data)))
    return data[:start] + draw(st.binary(max_size=8)) + data[start + draw(st.integers(0, 8)) :]


def _end(draw, data):
    return data[: draw(st.integers(0, len(data)))] if draw(st.booleans()) else data * 2
