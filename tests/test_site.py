"""The sources of the two sites: pages have a place, links and citations lead somewhere, names are listed."""

import importlib.util
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import isomatch

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
DEV = DOCS / "dev"  # of the developers' site
GENERATED = ("reference/names", "reference/subpackages", "gallery", "_build")
PAGES = sorted(
    page
    for page in DOCS.rglob("*.md")
    if not page.relative_to(DOCS).as_posix().startswith(GENERATED) and page.parent.name != "_extensions"
)
EXAMPLES = sorted(ROOT.glob("examples/*/*.py"))
LINK = re.compile(r"\[[^\]]*\]\((?!https?:|mailto:)([^)#\s]*)(?:#([^)\s]+))?\)")


def extension(name):
    """A module of ``docs/_extensions``."""
    spec = importlib.util.spec_from_file_location(name, DOCS / "_extensions" / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def without_code(page):
    return re.sub(r"^```(?!\{).*?^```$", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)


def toctree(page):
    """Pages that a page lists."""
    for block in re.findall(
        r"^```\{toctree\}\n(.*?)^```", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL
    ):
        for entry in block.split("\n"):
            if entry and not entry.startswith(":"):
                yield from page.parent.glob(f"{entry}.*")


def anchors(page):
    """Anchors of the headings of a page, as GitHub and the site make them."""
    headings = re.findall(r"^#+ (.+)$", without_code(page), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_every_page_is_in_a_table_of_contents():
    listed = {entry for page in PAGES for entry in toctree(page)}
    assert set(PAGES) - listed == {DOCS / "index.md", DEV / "index.md"}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(DOCS).as_posix())
def test_links_of_a_page_lead_somewhere(page):
    wrong = []
    for path, anchor in LINK.findall(without_code(page)):
        target = (page.parent / path).resolve() if path else page
        is_dead = not target.exists() or (anchor and target.suffix == ".md" and anchor not in anchors(target))
        if is_dead or target.is_relative_to(DEV) > page.is_relative_to(
            DEV
        ):  # pages for users lead to no others
            wrong.append(f"{path}#{anchor}" if anchor else path)
    assert not wrong


def test_a_constant_that_cites_a_decision_names_its_record():
    headings = re.findall(r"^## (.+)$", (DEV / "decisions.md").read_text(encoding="utf-8"), re.MULTILINE)
    for file in (ROOT / "src").rglob("*.py"):
        text = re.sub(r"\n( *# *| +)", " ", file.read_text(encoding="utf-8"))
        for cited in text.split("decisions.md")[1:]:
            assert cited.startswith(tuple(f", {heading.lower()}" for heading in headings)), (
                f"{file}: {cited[:40]}"
            )


def test_a_page_that_a_constant_cites_has_the_heading():
    for file in (ROOT / "src").rglob("*.py"):
        for page, cited in re.findall(r"(docs/\w+\.md), ([^\n\":;]+)", file.read_text(encoding="utf-8")):
            headings = re.findall(r"^#+ (.+)$", (ROOT / page).read_text(encoding="utf-8"), re.MULTILINE)
            assert cited.lower() in map(str.lower, headings), f"{file}: {page}, {cited}"


def test_every_name_of_the_public_face_is_in_the_reference():
    listed = re.findall(r"^   (\w+)$", (DOCS / "reference/api.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert sorted(listed) == sorted(isomatch.__all__)


def test_every_example_has_a_place():
    assert sorted(extension("in_order").ORDER) == sorted(example.stem for example in EXAMPLES)


@pytest.mark.long
def test_the_house_is_drawn_from_the_imports():
    house = extension("house")
    assert house.PICTURE.read_text(encoding="utf-8") == house.drawing(house.imports()), (
        "the imports have changed: run python docs/_extensions/house.py"
    )


@pytest.mark.long
@pytest.mark.parametrize("site", [DOCS, DEV], ids=lambda site: site.name)
def test_a_site_is_built_without_a_warning(site, tmp_path):
    places = Path(sys.executable).parent, Path(sys.prefix, "docs", "bin")  # the second is that of `make docs`
    builder = shutil.which("sphinx-build", path=os.pathsep.join(map(str, places)))
    if builder is None:
        pytest.skip("needs `make docs`, or pip install 'isomatch[docs]'")
    command = [builder, "-n", "-W", "--keep-going", "-q", site, tmp_path / "html"]
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "loops")}  # of the builder's numba
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    assert done.returncode == 0, done.stderr
