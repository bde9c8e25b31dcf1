"""Tables for spreadsheets: no cell runs as a formula, numbers stay numbers, and what was written is read again."""

import csv

import numpy as np
import pytest

from isomatch._core.tables import parse_table, read_table
from isomatch._core.texts import table_text, write_csv
from isomatch.io import Attribute, read_attributes, write_attributes

FORMULAS = ["=1+1", "+cmd|' /C calc'!A0", "-2+3", "@SUM(A1)", "\tx", "\r=1", "'=1", "''@a"]
PLAIN = ["a", "", "'tis", "a=b", "é", "-1.5", "+2", "-inf", "#a"]


def cells(path):
    with path.open(newline="", encoding="utf-8") as file:
        return [cell for row in csv.reader(file) for cell in row]


@pytest.mark.parametrize("word", FORMULAS)
def test_a_formula_is_a_text(tmp_path, word):
    path = tmp_path / "a.csv"
    write_csv(path, [{word: word, "depth": -0.5}], [word, "depth"])
    assert cells(path) == [f"'{word}", "depth", f"'{word}", "-0.5"]
    assert read_table(path).records() == [{word: word, "depth": "-0.5"}]


@pytest.mark.parametrize("word", PLAIN)
def test_any_other_text_is_written_as_it_is(tmp_path, word):
    write_csv(tmp_path / "a.csv", [{"a": word, "b": 1}], ["a", "b"])
    assert cells(tmp_path / "a.csv")[2:] == [word, "1"]
    assert read_table(tmp_path / "a.csv").records() == [{"a": word, "b": "1"}]


def test_cells_are_read_as_they_were_meant():
    words = [word for word in (*FORMULAS, *PLAIN) if word == word.strip()]
    table = parse_table(table_text([["n"] * len(words), words]), "a.csv")
    assert table.rows[1].cells == words


@pytest.mark.parametrize("suffix", [".csv", ".tsv"])
def test_labels_and_names_of_values(tmp_path, suffix):
    words = np.array(["=1+1", "-a", "b"])
    attributes = Attribute("@name", "point", "label", words), Attribute("x", "point", "scalar", [-1.0, 2, 3])
    write_attributes(tmp_path / f"a{suffix}", attributes)
    text = (tmp_path / f"a{suffix}").read_text()
    assert "'@name" in text
    assert "'=1+1" in text
    assert "'-1.0" not in text
    label, scalar = read_attributes(tmp_path / f"a{suffix}")
    assert label.name == "@name"
    assert label.values.tolist() == words.tolist()
    assert scalar.values.tolist() == [-1, 2, 3]
