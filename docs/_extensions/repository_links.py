"""Files of the repository as pages of the site, and links to them and to the examples."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGES = {name: f"/{name.lower()}" for name in ("CONTRIBUTING.md", "CHANGELOG.md", "SECURITY.md")} | {
    "README.md": "/index.md"
}
INCLUDED = re.compile(r"```\{include\} \.\./(\w+\.md)\n.*?```", re.DOTALL)


def to_pages(app, name, source):
    """Include files with their links turned; links to a file, or to examples, lead to the page made from it."""
    text = INCLUDED.sub(
        lambda found: (ROOT / found[1]).read_text(encoding="utf-8").replace("](docs/", "]("), source[0]
    )
    text = re.sub(r"\]\((?:\.\./)*([A-Z]+\.md)", lambda found: f"]({PAGES.get(found[1], found[1])}", text)
    text = re.sub(r"\]\((?:\.\./)*examples/?\)", "](/gallery/index.rst)", text)
    source[0] = re.sub(r"\]\((?:\.\./)*examples/(\w+/\w+)\.py", r"](/gallery/\1.rst", text)


def setup(app):
    """Rewrite the text of each page before it is read."""
    app.connect("source-read", to_pages)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
