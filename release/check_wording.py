"""Check comments, docstrings and names of the sources for wording that readers have to decipher.

Comments begin with what the thing is, and say it in whole clauses; a pronoun names nothing.
"""

from __future__ import annotations

import ast
import io
import re
import sys
import tokenize
from collections.abc import Iterator
from pathlib import Path

OPENINGS = re.compile(
    r"^(over|of which|of what|that of|but for|so many|as far as|than that)\b", re.IGNORECASE
)
TURNS = re.compile(r"\b(of which|that of|but for|so many|as far as)\b", re.IGNORECASE)
PRONOUNS = {"apart", "each", "here", "it", "own", "so", "that", "them", "there", "those", "told"}


def faults_of(path: Path) -> Iterator[tuple[int, str]]:
    """Yield line and message of each fault of a file."""
    text = path.read_text(encoding="utf-8")
    previous_line = 0
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT:
            words = token.string.lstrip("# ")
            line = token.start[0]
            goes_on = line == previous_line + 1 and token.line.lstrip().startswith("#")
            previous_line = line
            pattern = TURNS if goes_on or not OPENINGS.match(words) else OPENINGS
            if found := pattern.search(words):
                yield line, f"comment with {found.group()!r}"
    for node in ast.walk(ast.parse(text)):
        documented = isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef))
        if found := TURNS.search((documented and ast.get_docstring(node)) or ""):  # type: ignore[arg-type]
            yield getattr(node, "lineno", 1), f"docstring with {found.group()!r}"
        name = _bound_name(node)
        if name in PRONOUNS:
            line = getattr(node, "lineno", None) or node.target.lineno  # type: ignore[attr-defined]
            yield line, f"{name!r} is a pronoun, not a name"


def _bound_name(node: ast.AST) -> str | None:
    """Name that a node binds, if it binds one."""
    if isinstance(node, ast.arg):
        return node.arg
    if isinstance(node, (ast.Assign, ast.For, ast.NamedExpr, ast.comprehension)):
        targets = node.targets if isinstance(node, ast.Assign) else [node.target]
        names = {name.id for target in targets for name in ast.walk(target) if isinstance(name, ast.Name)}
        return next(iter(names & PRONOUNS), None)
    return node.name if isinstance(node, (ast.FunctionDef, ast.ClassDef)) else None


def main(folders: list[str]) -> int:
    """Print the faults of all files below some folders; 1 if there are any."""
    found = [
        f"{path}:{line}: {message}"
        for folder in folders
        for path in sorted(Path(folder).rglob("*.py"))
        for line, message in faults_of(path)
    ]
    print("\n".join(found) if found else "Wording is plain.")
    return int(bool(found))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:] or ["src"]))
