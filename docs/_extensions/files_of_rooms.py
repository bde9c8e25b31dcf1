"""The tables of files in the pages of the rooms, made from the first lines of the files when the site is built."""

import ast
from pathlib import Path

PACKAGE = Path(__file__).parents[2] / "src" / "isomatch"
FOUNDATION = ("errors.py", "values", "loading", "runtime", "storage")
MARK = "<!-- files -->"


def files_of(room):
    """Files of a room, those of its folders after its own."""
    places = [PACKAGE / name for name in (FOUNDATION if room == "foundation" else (room,))]
    return [
        file
        for place in places
        for file in (
            [place]
            if place.is_file()
            else sorted(place.rglob("*.py"), key=lambda path: (len(path.parts), path))
        )
        if file.name != "__init__.py"
    ]


def table_of(room):
    """The table of a room: each file, and the first line of its docstring."""
    base = PACKAGE if room == "foundation" else PACKAGE / room
    rows = []
    for file in files_of(room):
        name = file.relative_to(base).with_suffix("").as_posix()
        idea = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))).splitlines()[0].rstrip(".")
        rows.append(f"| `{name}` | {idea.replace('``', '`')} |\n")
    return "".join(["| file | one idea |\n|---|---|\n", *rows])


def fill(app, docname, source):
    """Put the table of a room where its page has the mark."""
    folder, _, room = docname.partition("/")
    if folder == "rooms":
        source[0] = source[0].replace(MARK, table_of(room))


def setup(app):
    """Fill the pages as they are read."""
    app.connect("source-read", fill)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
