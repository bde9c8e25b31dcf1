"""The page of twelve maps tells what comes out."""

import re
import runpy
from pathlib import Path

import pytest

DOCS = Path(__file__).parents[1] / "docs"
PAGE = (DOCS / "twelve_maps.md").read_text(encoding="utf-8")
ROW = re.compile(r"^\| (\d+) \| (.+) \| `(\w+)` \| ([\d.]+) \|$", re.MULTILINE)
FIRST, ADVICE = (
    ROW.findall(part) for part in (PAGE.partition("## The advice")[0], PAGE.partition("## The advice")[2])
)


def test_every_picture_of_the_page_is_there():
    named = re.findall(r"\((images/\S+)\)", PAGE)
    assert len(named) == len(FIRST) == 12
    assert sum((DOCS / name).stat().st_size for name in named) < 600_000


@pytest.mark.long
@pytest.mark.parametrize("number", range(12))
def test_a_map_comes_out_as_told(number):
    drawing = runpy.run_path(str(DOCS / "images/draw_twelve.py"))
    name, make = list(drawing["CASES"].items())[number]
    found = drawing["answers"](make())[1]
    told = [("", FIRST[number][1], *FIRST[number][2:])]
    assert told[0][1].startswith(name)
    assert (float(FIRST[number][3]) > drawing["WRONG"]) == (number >= 6)
    for at, text, outcome, error in ADVICE:
        if int(at) == number + 1:
            label = max(
                (
                    after
                    for after in found
                    if after and f"{after} " in f"{text} ".replace(",", " ").replace('"', " ")
                ),
                key=len,
                default=None,
            )
            told.append((label or "without it", text, outcome, error))
    for label, text, outcome, error in told:
        assert found[label].outcome == outcome, text
        assert (found[label].error > drawing["WRONG"]) == (float(error) > drawing["WRONG"]), text
