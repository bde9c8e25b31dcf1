"""Lines and numbers of text against plain Python: every float to the last bit, every line with its number."""

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from isomatch._core.errors import FormatError
from isomatch.io.formats._text import read_lines

NOTATIONS = [
    "%r", "%.15g", "%.16g", "%.17g", "%.3f", "%.6f", "%.20f", "%.30f", "%+.2e", "%.17e", "%.18e", "%.19E", "%.40g"
]  # fmt: skip
DIGITS = st.text("0123456789", max_size=30)
EXPONENT = st.just("") | st.builds("{}{:d}".format, st.sampled_from(["e", "E", "e+"]), st.integers(0, 330)) | st.builds(
    "e-{:d}".format, st.integers(0, 350)
)  # fmt: skip
NUMBER = st.builds(
    "{}{}{}{}{}".format, st.sampled_from(["", "-", "+"]), DIGITS, st.sampled_from([".", ""]), DIGITS, EXPONENT
).filter(lambda word: re.search(r"^[-+]?\.?\d", word))


def assert_read_as_python_does(words):
    rows = read_lines("file", "\n".join(words).encode()).parse()
    assert rows.counts.tolist() == [1] * len(words)
    np.testing.assert_array_equal(
        rows.values.view(np.int64), np.array([float(word) for word in words]).view(np.int64)
    )


@pytest.mark.parametrize("notation", NOTATIONS)
def test_random_floats_to_the_last_bit(notation):
    rng = np.random.default_rng(0)
    bits = rng.integers(0, 2**64, 2000, dtype=np.uint64).view(np.float64)
    scaled = rng.normal(size=2000) * 10.0 ** rng.uniform(-40, 40, 2000)
    numbers = np.concatenate([bits[np.isfinite(bits)], scaled, rng.normal(size=2000)])
    assert_read_as_python_does([notation % number for number in numbers.tolist()])


@pytest.mark.long
@given(st.lists(NUMBER, min_size=1))
@settings(max_examples=200, deadline=None)
def test_numbers_in_any_notation(words):
    assert_read_as_python_does(words)


@pytest.mark.parametrize(
    "word", ["", ".", "-", "+.", "e5", "1e", "1e+", "1.2.3", "--1", "1-", "0x10", "1_0", "1d5", "²"]
)
def test_words_that_are_no_numbers(word):
    with pytest.raises(FormatError, match="file:2: expected numbers"):
        read_lines("file", f"1\n 0 {word or '?'} 1\n".encode("latin-1")).parse()


def plain_lines(data, continued):
    """Lines and numbers by plain Python."""
    lines, joined, first = [], "", 1
    text = data.decode("latin-1").replace("\r\n", "\n").replace("\r", "\n")
    for number, line in enumerate(text.split("\n"), start=1):
        if continued and line.endswith("\\"):
            joined += line[:-1] + "  "
            continue
        line = "".join(" " if c in "\t\v\f" else c for c in joined + line)
        line = re.sub("(?:^|(?<= ))#.*", "", line)
        if line.strip():
            lines.append((first, line.lstrip()))
        joined, first = "", number + 1
    return lines


TEXT = st.lists(
    st.sampled_from([b" ", b"\n", b"\r", b"\r\n", b"\\", b"\\\n", b"#", b"f", b"v 1", b"\t", b"\xe9"])
).map(b"".join)  # fmt: skip


@given(TEXT, st.booleans())
@settings(max_examples=300, deadline=None)
def test_lines_are_those_of_plain_python(data, continued):
    lines = read_lines("file", data, continued=continued)
    expected = plain_lines(data + b"\n", continued)
    assert [(number, lines.row(i)) for i, number in enumerate(lines.numbers.tolist())] == expected


@pytest.mark.parametrize("which", range(3))
def test_fields_of_words(which):
    words = {
        "1": "100",
        "1/2": "120",
        "1/2/3": "123",
        "1//3": "103",
        "4/5/": "450",
        "-1/-2": ("-1", "-2", "0"),
    }
    lines = read_lines("file", "".join(f"f {word} {word}\n" for word in words).encode()).starting_with("f")
    found = lines.fields(which)
    assert [found.row(i).split() for i in range(len(found))] == [
        [fields[which]] * 2 for fields in words.values()
    ]
