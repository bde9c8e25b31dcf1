"""What pages report: tables are those of ``docs/results``, and those of one page were measured with the same."""

import csv
import json
from collections import Counter
from pathlib import Path

import pytest

from isomatch_lab.studies import published, results
from isomatch_lab.studies.result_steps import STEPS, Step

ROOT = Path(__file__).parents[1]
PAGES = {page.relative_to(ROOT).as_posix(): page.read_text(encoding="utf-8") for page in results.pages()}
KNOWN = results.stamps()
TABLES = ROOT / results.RESULTS
ONE = {
    "source": "a1",
    "machine": "m",
    "versions": {"numpy": "2.0"},
    "revision": "r1",
    "date": "2026-01-02",
    "seconds": 9,
}


def stamped_steps(text):
    """Steps of which a page says with what they were measured."""
    named = [place[2] for place in results.MARKED.finditer(text) if place[1] == "stamp"]
    return {step for names in named for step in (names.split("; ") if names else results.steps_of(text))}


@pytest.mark.parametrize("page", [name for name, text in PAGES.items() if "<!-- result:" in text])
def test_a_page_shows_the_committed_tables_with_one_stamp(page):
    text = PAGES[page]
    assert text.count("<!-- result:") == len(results.MARKED.findall(text)), "a place is marked in another way"
    assert results.filled(text, KNOWN) == text, "run python -m isomatch_lab.studies.results --pages"
    assert stamped_steps(text) >= set(results.steps_of(text))


def test_every_table_has_a_step_a_file_and_a_place():
    shown = {table for text in PAGES.values() for table in results.tables_of(text)}
    assert shown == {table for step in STEPS for table in step.tables}
    assert shown == {path.stem for path in TABLES.glob("*.csv")}
    assert set(KNOWN) == {step.name for step in STEPS}


def page_of(*tables):
    return "".join(f"<!-- result: {name} -->\n<!-- end of result -->\n" for name in (*tables, "stamp"))


@pytest.mark.parametrize("change", [{"source": "b2"}, {"machine": "n"}, {"versions": {"numpy": "2.1"}}])
def test_a_page_with_tables_of_different_stamps_is_refused(change):
    page = page_of("engines", "smoothness")
    known = {"engines": ONE, "smoothness": ONE | {"date": "2026-01-03"}}
    assert "Measured in revision r1 (source a1), 2026-01-03" in results.filled(page, known)
    with pytest.raises(SystemExit, match="different stamps"):
        results.filled(page, {"engines": ONE, "smoothness": ONE | change})


def test_tables_without_a_stamp_are_named():
    known = {"engines": ONE, "smoothness": {"source": None, "revision": None}}
    text = results.filled(page_of("engines", "smoothness"), known)
    assert "Measured in revision r1" in text
    assert "Measured earlier, in these revisions: smoothness (not stated)." in text


def test_columns_of_a_table(tmp_path):
    (tmp_path / "engines.csv").write_text('mesh,vertices,"error (> 1), %"\ncat,5,1.5\n')
    page = "a\n<!-- result: engines: error (> 1), %; mesh -->\nold\n<!-- end of result -->\nb\n"
    filled = page.replace("old\n", "| error (> 1), % | mesh |\n|---|---|\n| 1.5 | cat |\n")
    assert results.filled(page, KNOWN, tmp_path) == filled
    assert results.filled(filled, KNOWN, tmp_path) == filled


def test_our_place_is_the_first_only_where_no_published_number_is_better():
    with published.PUBLISHED.open(newline="", encoding="utf-8") as file:
        count = Counter(row["contest"] for row in csv.DictReader(file))
    lines = [line.strip("|").split("|") for line in published.beside(TABLES).splitlines()[2:]]
    assert len(lines) == sum(len(names) for _, names in published.OURS.values())
    for _, key, ours, place, best, _ in lines:
        first, of = place.split(" of ")
        lead = float(best.rpartition(": ")[2]) - float(ours)
        assert (int(first) == 1) == (lead < 0 if key.strip() == "IoU, %" else lead > 0)
        assert int(of) - 1 in count.values()


def test_the_source_is_what_its_files_hold(tmp_path):
    (tmp_path / "a.py").write_text("1")
    before = results.source_hash(tmp_path)
    (tmp_path / "__pycache__").mkdir()
    (tmp_path / "__pycache__" / "a.pyc").write_text("does not count")
    assert results.source_hash(tmp_path) == before
    (tmp_path / "a.npz").write_text("data count")
    assert results.source_hash(tmp_path) != before
    before = results.source_hash(tmp_path)
    (tmp_path / "a.py").rename(tmp_path / "b.py")
    assert results.source_hash(tmp_path) != before


@pytest.fixture
def toy(tmp_path):
    """A step that ends with its second run, and counts them; results and docs are elsewhere."""
    (tmp_path / "docs" / "results").mkdir(parents=True)
    studies = tmp_path / "src" / "isomatch_lab" / "studies"
    studies.mkdir(parents=True)
    for name in results.SHARED:
        (studies / name).write_text("")
    (studies / "toy.py").write_text(
        "import sys, pathlib\n"
        "out = pathlib.Path(sys.argv[1])\n"
        "runs = out / 'runs.txt'\n"
        "runs.write_text((runs.read_text() if runs.exists() else '') + 'x')\n"
        "assert len(runs.read_text()) > 1, 'interrupted'\n"
        "(out / 'table.csv').write_text('a,b\\n1,2\\n')\n"
    )
    return Step(
        "toy",
        1,
        "python -m src.isomatch_lab.studies.toy {out}",
        {"toy": "table.csv"},
        {"toy/runs.txt": "runs.txt"},
    )


def test_an_interrupted_step_continues_and_a_finished_one_is_present(toy, tmp_path):
    with pytest.raises(Exception, match="returned non-zero"):
        results.measure(toy, "data", tmp_path / "out", tmp_path)
    assert not results.is_present(toy, tmp_path)
    results.measure(toy, "data", tmp_path / "out", tmp_path)
    assert results.is_present(toy, tmp_path)
    with (tmp_path / "docs/results/toy.csv").open() as file:
        assert list(csv.DictReader(file)) == [{"a": "1", "b": "2"}]
    assert (tmp_path / "docs/toy/runs.txt").read_text() == "xx"
    stamp = json.loads((tmp_path / "docs/results/stamps.json").read_text())["toy"]
    assert set(stamp) == {*ONE, "command", "scripts"}
    with (tmp_path / "src/isomatch_lab/studies/toy.py").open("a") as file:
        file.write("# changed\n")
    assert not results.is_present(toy, tmp_path)
    with pytest.raises(Exception, match="returned non-zero"):  # it begins anew
        results.measure(toy, "data", tmp_path / "out", tmp_path)
