"""The page of numbers: each has a unit, a meaning and a source, and is used."""

import ast
import re
from dataclasses import fields, is_dataclass
from pathlib import Path

from isomatch.matching import parameters

PAGE = Path(parameters.__file__)
LINES = PAGE.read_text(encoding="utf-8").splitlines()
GROUPS = {name: value for name, value in vars(parameters).items() if name.isupper()}


UNITS = (
    r"√area|average distances|share|ratio|fraction|times|weight|cost|this many|this often|"
    r"steps|vertices|samples|points|columns|functions|maps|regions|landmarks|distances|exchanges|candidates|starts|eigenvalues"
)


def test_each_number_tells_unit_meaning_and_source():
    for made in (
        node for node in ast.parse(PAGE.read_text(encoding="utf-8")).body if isinstance(node, ast.ClassDef)
    ):
        shared = any(
            "those without another source: " in line for line in LINES[made.lineno : made.body[1].lineno]
        )
        for number in made.body[1:]:
            comment = LINES[number.end_lineno - 1].partition("  # ")[2]
            unit, _, meaning = comment.partition(": ")
            if "; " in unit:  # one sentence with its unit
                unit, meaning = " ".join(re.findall(UNITS, comment)), comment
            above = number.lineno - 2
            while not meaning and LINES[above].startswith("    # "):
                above -= 1
            meaning = meaning or " ".join(LINES[above + 1 : number.lineno - 1]) or comment
            where = f"{made.name}.{number.target.id}"
            assert unit, f"{where} has no unit"
            assert len(meaning.split()) > 2, f"{where} has no meaning"
            assert shared or "; " in meaning, f"{where} has no source"


def test_each_number_is_used_and_frozen():
    code = "\n".join(path.read_text(encoding="utf-8") for path in PAGE.parent.rglob("*.py") if path != PAGE)
    used = set(re.findall(r"\b[A-Z_]+\.\w+", code))
    for name, group in GROUPS.items():
        assert is_dataclass(group)
        assert type(group).__dataclass_params__.frozen
        for field in fields(group):
            assert f"{name}.{field.name}" in used, f"{name}.{field.name} is not used"
