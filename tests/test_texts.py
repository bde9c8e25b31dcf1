"""Small rules about texts and choices: encodings, order of names, names of files, separators, indices, ties."""

import numpy as np
import pytest

from isomatch._core.errors import some
from isomatch._core.files import legible
from isomatch._core.texts import decode_text, encoding_of, natural_order, table_text, unescape
from isomatch._core.ties import first_largest, first_of_rank


def test_an_encoding_is_found_by_the_bytes():
    assert encoding_of("Füße".encode()) == "utf-8"
    assert encoding_of("Füße".encode("latin-1")) == "cp1252"


@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be", "utf-16", "utf-32", "utf-8-sig"])
def test_a_text_is_read_in_any_unicode_with_or_without_a_mark(encoding):
    assert decode_text("name;Füße\na;1,5\n".encode(encoding)) == "name;Füße\na;1,5\n"


def test_names_sort_as_people_count():
    assert sorted(["b10", "b9", "A1", "b"], key=natural_order) == ["A1", "b", "b9", "b10"]


def test_bytes_of_names_that_are_no_letters_can_be_told():
    assert legible("Füße 5%") == "Füße 5%"
    assert legible("F\udcfc\udcdfe 5%") == "F%FC%DFe 5%25"


def test_an_apostrophe_is_taken_off_formulas_alone():
    assert [unescape(cell) for cell in ("'=1+1", "'tis")] == ["=1+1", "'tis"]
    assert table_text([["name", "depth"], ["=1+1", -0.5], ["-a", "-2"]]) == "name,depth\n'=1+1,-0.5\n'-a,-2\n"


def test_many_indices_are_counted():
    assert some(range(8)) == "0, 1, 2, 3, 4, … (8 in all)"
    assert some([4, 2]) == "4, 2"


def test_the_first_of_equals_is_taken():
    assert first_largest(np.array([1.0, 3.0 - 1e-9, 3.0])) == 1
    assert first_of_rank(np.array([5.0, 2.0 + 1e-9, 1.0, 2.0]), 2) == 1
