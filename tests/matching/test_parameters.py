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
    r"area|average distances|standard deviations|share|ratio|fraction|times|weight|cost|score|energy|energies|doubt|"
    r"residual|exponent|cosine|logarithm|singular value|rank|sign|factor|this many|this often|iterations|steps|"
    r"hypotheses|rotations|anchors|assignments|vertices|samples|points|columns|functions|maps|fits|regions|components|"
    r"landmarks|distance|exchanges|candidates|starts|eigenvalue|variants|lengths"
)


def test_each_number_tells_unit_meaning_and_source():
    for made in (
        node for node in ast.parse(PAGE.read_text(encoding="utf-8")).body if isinstance(node, ast.ClassDef)
    ):
        for number in made.body[1:]:
            last = first = number.lineno - 1  # the comment is on the line of the number, or above it
            while LINES[first - 1].startswith("    # "):
                first -= 1
            above = " ".join(line.strip(" #") for line in LINES[first:last])
            comment = LINES[last].partition("  # ")[2] or above
            where = f"{made.name}.{number.target.id}"
            assert re.search(UNITS, comment), f"{where} has no unit"
            assert len(comment.split()) > 2, f"{where} has no meaning"
            assert "; " in comment, f"{where} has no source"


def test_each_number_is_used_and_frozen():
    code = "\n".join(path.read_text(encoding="utf-8") for path in PAGE.parent.rglob("*.py") if path != PAGE)
    used = set(re.findall(r"\b[A-Z_]+\.\w+", code))
    for name, group in GROUPS.items():
        assert is_dataclass(group)
        assert type(group).__dataclass_params__.frozen
        for field in fields(group):
            assert f"{name}.{field.name}" in used, f"{name}.{field.name} is not used"
