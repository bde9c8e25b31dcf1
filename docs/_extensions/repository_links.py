"""Links that leave a site: to files of the repository that are pages of it, to examples, and to what is no page of it."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
USERS = ROOT / "docs"  # folder of the users' site, which has the gallery
INCLUDED = re.compile(r"```\{include\} (?:\.\./)+(\w+\.md)\n.*?```", re.DOTALL)
LINK = re.compile(r"(?<!!)\[([^\]]*)\]\((?!\w+:|[#/])([^)#\s]+)(#[^)\s]*)?\)")


def to_pages(app, name, source):
    """Include files of the repository, and turn each link so that it leads to a page, or else names the file."""
    site = Path(app.srcdir).resolve()
    text = INCLUDED.sub(lambda found: (ROOT / found[1]).read_text(encoding="utf-8"), source[0])
    folder = (site / name).parent if text == source[0] else ROOT

    def turn(link):
        words, target, anchor = link[1], (folder / link[2]).resolve(), link[3] or ""
        page = page_of(target, site)
        if page is None:
            return f"{words} (`{target.relative_to(ROOT).as_posix()}`)"
        return f"[{words}](/{page}{anchor})"

    source[0] = LINK.sub(turn, text)


def page_of(target, site):
    """Path below a site of the page made from a file of the repository, or None."""
    examples = ROOT / "examples"
    if site == USERS and target.is_relative_to(examples):
        name = target.relative_to(examples)
        return "gallery/index.rst" if target == examples else f"gallery/{name.with_suffix('.rst').as_posix()}"
    if target.is_relative_to(site) and not target.is_relative_to(site / "dev"):
        return target.relative_to(site).as_posix()
    if target == ROOT / "README.md":
        return "index.md"
    page = f"{target.stem.lower()}.md"
    return page if target.parent == ROOT and (site / page).exists() else None


def setup(app):
    """Rewrite the text of each page before it is read."""
    app.connect("source-read", to_pages)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
