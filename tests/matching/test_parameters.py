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
    r"√area|average distances?|share|ratio|fraction|times|weight|cost|over (the|its|that|parts)|cosine|exponent|power|"
    r"factor|(squared )?distance|residuals?|sign|scores?|doubt|gap|stress|energy|logarithms?|mean .log|singular value|"
    r"radians|standard deviations|radii|areas|lengths|steps|vertices|samples|points|columns|functions|maps|"
    r"regions|landmarks|candidates"
)


def test_each_number_tells_unit_meaning_and_source():
    for made in (
        node for node in ast.parse(PAGE.read_text(encoding="utf-8")).body if isinstance(node, ast.ClassDef)
    ):
        for number in made.body[1:]:
            text = LINES[number.end_lineno - 1].partition("  # ")[2]
            above = number.lineno - 2
            while LINES[above].startswith("    # "):
                text = LINES[above].removeprefix("    # ") + " " + text
                above -= 1
            where = f"{made.name}.{number.target.id}"
            if "float" in ast.unparse(number.annotation):  # a number of things names them
                assert re.search(rf"\b({UNITS})\b|√area", text), f"{where} has no unit: {text}"
            assert len(text.split()) > 4, f"{where} has no meaning: {text}"
            assert re.search(r"[;:] ", text), f"{where} has no source: {text}"


def test_each_number_is_used_and_frozen():
    code = "\n".join(path.read_text(encoding="utf-8") for path in PAGE.parent.rglob("*.py") if path != PAGE)
    used = set(re.findall(r"\b[A-Z_]+\.\w+", code))
    for name, group in GROUPS.items():
        assert is_dataclass(group)
        assert type(group).__dataclass_params__.frozen
        for field in fields(group):
            assert f"{name}.{field.name}" in used, f"{name}.{field.name} is not used"
