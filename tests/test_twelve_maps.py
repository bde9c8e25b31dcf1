"""The page of twelve maps says what comes out, and its pictures are there."""

import re
import sys
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[1] / "docs"
sys.path.insert(0, str(DOCS / "images"))
from draw_twelve import CASES, WRONG  # noqa: E402

PAGE = (DOCS / "twelve_maps.md").read_text(encoding="utf-8")
ROWS = {
    cells[0]: cells
    for line in PAGE.splitlines()
    if len(cells := [c.strip() for c in line.strip("|").split("|")]) == 5
}


def test_the_page_has_all_cases_with_their_pictures():
    assert [name for name in ROWS if name.isdigit()] == list(CASES)
    for name in CASES:
        (picture,) = re.findall(r"\]\((.*?)\)", ROWS[name][1])
        assert (DOCS / picture).is_file()
    wrong = [name for name in CASES if float(ROWS[name][3]) > WRONG]
    assert wrong == list(CASES)[:6]


@pytest.mark.long
@pytest.mark.parametrize("name", CASES)
def test_what_the_page_says_comes_out(name):
    case, (_, _, outcome, error, done) = CASES[name](), ROWS[name]
    result = case.matched()
    assert outcome == f"`{result.outcome.name}`"
    assert case.error(result.map) == pytest.approx(float(error), abs=0.5)
    if best := re.search(r"\*\*([\d.]+)\*\*", done):  # of what was tried
        after = [case.error(then.map) for then in case.after().values()]
        assert min(abs(each - float(best[1])) for each in after) < 0.5
