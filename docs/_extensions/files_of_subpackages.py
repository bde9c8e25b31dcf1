"""The tables of files in the pages of the subpackages, made from the first lines of the files when the site is built."""

import ast
from pathlib import Path

PACKAGE = Path(__file__).parents[2] / "src" / "isomatch"
MARK = "<!-- files -->"


def files_of(subpackage):
    """Files of a subpackage, those of its folders after its own."""
    place = PACKAGE / subpackage
    return [
        file
        for file in sorted(place.rglob("*.py"), key=lambda path: (len(path.parts), path))
        if file.name != "__init__.py"
    ]


def table_of(subpackage):
    """The table of a subpackage: each file, and the first line of its docstring."""
    base = PACKAGE / subpackage
    rows = []
    for file in files_of(subpackage):
        name = file.relative_to(base).with_suffix("").as_posix()
        idea = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))).splitlines()[0].rstrip(".")
        rows.append(f"| `{name}` | {idea.replace('``', '`')} |\n")
    return "".join(["| file | one idea |\n|---|---|\n", *rows])


def fill(app, docname, source):
    """Put the table of a subpackage where its page has the mark."""
    folder, _, subpackage = docname.partition("/")
    if folder == "subpackages":
        source[0] = source[0].replace(MARK, table_of(subpackage))


def setup(app):
    """Fill the pages as they are read."""
    app.connect("source-read", fill)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
