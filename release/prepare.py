"""Write the version, and what ``release.toml`` says, wherever they are repeated: ``python release/prepare.py [--check]``.

Each place is one line of a file. While a value is missing, the line is a comment that says "not published yet", or,
in text, says so in place of the value. ``--check`` changes nothing, and fails if something is to be changed.
"""

from __future__ import annotations

import json
import re
import sys
import tomllib
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]
PENDING = "not published yet"
PAPER = "https://arxiv.org/abs/1611.07360"
SCHEMA = "https://raw.githubusercontent.com/Slicer/Slicer/main/Schemas/slicer-extension-catalog-entry-schema-v1.0.1.json#"
INSTALLERS = {
    "uvx isomatch demo": "pip",
    "pip install isomatch": "pip",
    "conda install -c conda-forge isomatch": "conda",
}
FORMS = {
    "version": r"\d+\.\d+\.\d+",
    "address": r"(https://\S+[^/\s])?",
    "slicer_address": r"(https://\S+[^/\s])?",
    "doi": r"(10\.\d{4,9}/\S+)?",
    "date": r"(\d{4}-\d\d-\d\d)?",
}


@dataclass(frozen=True)
class Release:
    """What is published, and where; empty if not yet."""

    version: str
    address: str = ""
    slicer_address: str = ""
    doi: str = ""
    date: str = ""
    indexes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name, form in FORMS.items():
            if not re.fullmatch(form, value := getattr(self, name)):
                raise SystemExit(f"release: {name} = {value!r} is not of the form {form}")
        if not set(self.indexes) <= set(INSTALLERS.values()):
            raise SystemExit(f"release: indexes = {self.indexes} has others than {set(INSTALLERS.values())}")

    @classmethod
    def read(cls, root: Path = ROOT) -> Release:
        """Return what the files of the repository say."""
        text = (root / "src" / "isomatch" / "__init__.py").read_text(encoding="utf-8")
        given = tomllib.loads((root / "release" / "release.toml").read_text(encoding="utf-8"))
        version = re.search(r'^__version__ = "(.+)"', text, re.MULTILINE)[1]
        return cls(version, **given | {"indexes": tuple(given["indexes"])})


class Place(NamedTuple):
    """A line of a file with a value in it, and how the line begins while there is none."""

    file: str
    line: str
    value: str
    comment: str = "# "

    def written(self, text: str) -> str:
        """Return the text of the file with the value in its line, of which there must be one."""
        before, after = map(re.escape, self.line.split("{}"))
        line = self.line.format(self.value) if self.value else self.comment + self.line.format(PENDING)
        text, found = re.subn(f"(?m)^(?:{self.comment})?{before}.*{after}$", lambda _: line, text)
        if found != 1:
            raise SystemExit(f"release: {self.file} has {found} lines {self.line!r}, not one")
        return text


def places(release: Release) -> list[Place]:
    """Return all lines that repeat what is published."""
    raw = release.address and f"{release.address}/raw/v{release.version}"
    icon = raw and f"{raw}/extras/slicer/IsomatchModule/Resources/Icons/IsomatchModule.svg"
    blender, slicer = "extras/blender/isomatch_blender", "extras/slicer/CMakeLists.txt"
    day = date.fromisoformat(release.date) if release.date else None
    return [
        Place("CITATION.cff", "version: {}", release.version),
        Place("CITATION.cff", "date-released: {}", release.date),
        Place("CITATION.cff", "repository-code: {}", release.address),
        Place("CITATION.cff", "doi: {}", release.doi),
        Place("CHANGELOG.md", f"## [{release.version}] - {{}}", release.date or "unreleased"),
        Place("README.md", "[CITATION.cff](CITATION.cff), DOI {}. MIT licence.", release.doi, ""),
        Place("docs/install.md", "$ git clone {} isomatch", release.address or "REPOSITORY_URL"),
        Place("src/isomatch/_core/first_use.py", 'PACKAGE = "{}"', "isomatch" if release.indexes else "."),
        Place("pyproject.toml", 'Source = "{}"', release.address),
        Place("release/recipe.yaml", '  version: "{}"', release.version),
        Place("release/recipe.yaml", "  homepage: {}", release.address),
        Place("release/joss/paper.md", "date: {}", day.strftime("%d %B %Y").lstrip("0") if day else ""),
        Place(f"{blender}/blender_manifest.toml", 'version = "{}"', release.version),
        Place(f"{blender}/blender_manifest.toml", 'website = "{}"', release.address),
        Place(f"{blender}/__init__.py", '    "version": ({}),', release.version.replace(".", ", ")),
        Place(slicer, 'set(EXTENSION_HOMEPAGE "{}")', release.slicer_address or PAPER),
        Place(slicer, 'set(EXTENSION_ICONURL "{}")', icon),
        Place(slicer, 'set(EXTENSION_SCREENSHOTURLS "{}")', raw and f"{raw}/docs/images/demo.png"),
    ]


def prepared(release: Release, root: Path = ROOT) -> dict[str, str]:
    """Return the new text of each file that repeats something."""
    found: dict[str, str] = {".zenodo.json": zenodo(release, root)}
    for place in places(release):
        text = found.get(place.file) or (root / place.file).read_text(encoding="utf-8")
        found[place.file] = place.written(text)
    for line, index in INSTALLERS.items():
        mark = "" if index in release.indexes else f"  # {PENDING}"
        for file in ("README.md", "docs/install.md"):
            found[file] = re.sub(rf"(?m)^((?:\$ )?{line})(?: +# {PENDING})?$", rf"\1{mark}", found[file])
    return found


def zenodo(release: Release, root: Path = ROOT) -> str:
    """Return the description of the software for Zenodo, which takes it before CITATION.cff."""
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    record = {
        "upload_type": "software",
        "title": f"{project['name']}: {project['description'].partition(',')[0]}",
        "description": project["description"],
        "version": release.version,
        "creators": project["authors"],
        "access_right": "open",
        "license": project["license"],
        "keywords": project["keywords"],
        "related_identifiers": [{"identifier": "arXiv:1611.07360", "relation": "references"}],
    }
    return json.dumps(record, indent=2) + "\n"


def catalogue_entry(release: Release) -> str:
    """Return the entry of Slicer's catalogue of extensions."""
    entry = {
        "$schema": SCHEMA,
        "category": "Shape Analysis",
        "scm_revision": "main",
        "scm_url": f"{release.slicer_address}.git" if release.slicer_address else PENDING,
        "tier": 1,
    }
    return json.dumps(entry, indent=2) + "\n"


def released_recipe(release: Release, recipe: str, sha256: str) -> str:
    """Return the recipe of conda-forge with the sdist of the release as its source."""
    sdist = f"{release.address}/releases/download/v${{{{ version }}}}/isomatch-${{{{ version }}}}.tar.gz"
    source = f"  url: {sdist if release.address else PENDING}\n  sha256: {sha256}"
    return re.sub(r"(?m)^  path: \.\..*$", lambda _: source, recipe)


def main() -> None:
    """Write the files that differ, or name them."""
    for file, text in prepared(Release.read()).items():
        path = ROOT / file
        if path.exists() and path.read_text(encoding="utf-8") == text:
            continue
        if "--check" in sys.argv[1:]:
            raise SystemExit(f"{file} differs from what is published; run release/prepare.py")
        path.write_text(text, encoding="utf-8", newline="\n")
        print(file)


if __name__ == "__main__":
    main()
