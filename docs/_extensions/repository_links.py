"""Links that leave ``docs/`` for a file of the repository, which the site shows as a page of its own."""

import re
from pathlib import PurePosixPath

PAGES = {
    "CONTRIBUTING.md": "/contributing.md",
    "CHANGELOG.md": "/changelog.md",
    "SECURITY.md": "/security.md",
    "README.md": "/index.md",
}


def to_pages(app, name, source):
    """Send links such as ``../CONTRIBUTING.md`` and ``../examples/NAME.py`` to the pages made from these files."""

    def page(match):
        path = PurePosixPath(match["path"])
        if path.name in PAGES:
            return f"]({PAGES[path.name]}"
        return f"](/gallery/{path.parent.name}/{path.stem}.rst"

    source[0] = re.sub(r"\]\((?:\.\./)+(?P<path>\w+\.md|examples/\w+/\w+\.py)", page, source[0])


def setup(app):
    """Rewrite the text of each page before it is read."""
    app.connect("source-read", to_pages)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
