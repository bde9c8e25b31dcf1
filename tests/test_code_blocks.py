"""Every code block of README, CONTRIBUTING and docs runs: the blocks of a page in order, in one folder and namespace.

Python runs as it is, and so do the lines of shell blocks that call ``isomatch``, through the app in this process. A line
``<!-- not run: REASON -->`` before a block excepts it; ``<!-- long: REASON -->`` leaves it to the long tests.
"""

import io
import re
import shlex
import shutil
from pathlib import Path
from typing import NamedTuple

import matplotlib.image
import numpy as np
import pytest

import isomatch
from corresponded import random_shapes
from isomatch import Asset, Mesh
from isomatch.cli import main
from isomatch.datasets import example_pair
from isomatch.decimation import decimate
from isomatch.io import Attribute, Polygons, with_texture
from isomatch_lab.procedural import creature
from later import some_later

pytestmark = pytest.mark.usefixtures("prepared_once", "small_pictures")
ROOT = Path(__file__).parents[1]
PAGES = [
    *(ROOT / name for name in ("README.md", "CONTRIBUTING.md")),
    *(
        page
        for page in sorted((ROOT / "docs").rglob("*.md"))
        if "/_" not in page.relative_to(ROOT).as_posix()
    ),
]
BLOCK = re.compile(
    r"^(?:<!-- (?P<mark>not run|long): (?P<reason>\S[^\n]*) -->\n+)?"
    r"(?P<fence>`{3,})(?P<language>\w+)[^\n]*\n(?P<code>.*?)^(?P=fence)$",
    re.MULTILINE | re.DOTALL,
)
SCANS = ("a", "b", "mean")
GROUPS = {f"{group}{i}": group for group in ("patient", "control") for i in range(3)}
WRITING = ("isomatch demo keys", "isomatch demo landmarks")  # commands that write the files of their page
SHELL = ("sh", "bash", "console")
MATCHED: dict[tuple[str, str], isomatch.MatchResult] = {}


class Block(NamedTuple):
    """Code of a page, the line of the page before it, and how it is marked."""

    language: str
    code: str
    line: int
    mark: str | None


def blocks(text):
    """All blocks of a page that could run, in order."""
    return [
        Block(found["language"], found["code"], text.count("\n", 0, found.start("code")), found["mark"])
        for found in BLOCK.finditer(text)
        if found["language"] in ("python", *SHELL)
    ]


def commands(code):
    """Arguments of each call of isomatch in a shell block."""
    lines = (line.removeprefix("$ ") for line in code.replace("\\\n", " ").splitlines())
    return [shlex.split(line, comments=True)[1:] for line in lines if line.startswith("isomatch ")]


def run(page, wanted):
    """Run the blocks of a page that are wanted; a failure shows the line of the page."""
    namespace = {"__name__": "__main__"}
    for block in wanted:
        if block.language == "python":
            exec(compile("\n" * block.line + block.code, page, "exec"), namespace)
        else:
            for arguments in commands(block.code):
                assert main(arguments) == 0, f"{page}:{block.line + 1}: isomatch {shlex.join(arguments)}"


@pytest.fixture(scope="module")
def shapes(tmp_path_factory):
    """A folder of the files that the pages name."""
    folder = tmp_path_factory.mktemp("shapes")
    write_shapes(folder)
    return folder


def write_shapes(folder):
    """Write the files that the pages name."""
    for part in ("scans", "OUT/corresponded"):
        (folder / part).mkdir(parents=True)
    for name, animal, made in zip("ab", ("cat", "lion"), example_pair()):
        isomatch.write_mesh(folder / f"{name}.ply", made.mesh)
        isomatch.write_asset(folder / f"{animal}.glb", textured(made.mesh))
    for i, name in enumerate(SCANS):
        isomatch.write_mesh(folder / f"scans/{name}.ply", decimate(creature(1500, pose=i).mesh, 700).mesh)
    alike = random_shapes(len(GROUPS) + 1)
    for name, vertices in zip([*GROUPS, "../../new_scored"], alike.vertices, strict=True):
        isomatch.write_mesh(folder / f"OUT/corresponded/{name}.ply", Mesh(vertices, alike.faces))
    (folder / "list.csv").write_text("\n".join(["path", *(f"scans/{name}.ply" for name in SCANS)]))
    (folder / "groups.csv").write_text("\n".join(["name,group", *map(",".join, GROUPS.items())]))


def textured(mesh):
    """An animal with a picture on it and two joints."""
    place = (mesh.vertices - mesh.vertices.min(axis=0)) / np.ptp(mesh.vertices, axis=0)
    weights = np.column_stack([place[:, 0], 1 - place[:, 0]])
    data = (
        Attribute("uv", "point", "uv", place[:, :2]),
        Attribute("weights", "point", "weights", weights, names={0: "head", 1: "tail"}),
    )
    picture = io.BytesIO()
    matplotlib.image.imsave(picture, np.eye(4), format="png")
    return with_texture(Asset(mesh.vertices, Polygons.of_triangles(mesh.faces), data), picture.getvalue())


@pytest.fixture(autouse=True)
def matched_once(monkeypatch):
    """Most pages begin with the same match; it is made again only where more is asked for."""
    match = isomatch.match
    plain = {"config": isomatch.Config(), "seed": 0}  # what the command line says where nothing is asked for

    def once(source, target, **options):
        shapes = [
            isomatch.read_mesh(shape) if isinstance(shape, str) else shape for shape in (source, target)
        ]
        asked = {name: each for name, each in options.items() if name != "progress" and each is not None}
        if not asked.items() <= plain.items() or not all(isinstance(shape, Mesh) for shape in shapes):
            return match(source, target, **options)
        key = tuple(shape.content_hash for shape in shapes)
        if key not in MATCHED:
            MATCHED[key] = match(source, target)
        return MATCHED[key]

    monkeypatch.setattr(isomatch, "match", once)


def test_blocks_are_told_by_language_and_mark():
    page = "```python\n1\n```\n<!-- not run: needs DATA -->\n```sh\nisomatch a\n```\n"
    page += "<!-- long: -->\n```console\n$ isomatch b\n```\n"
    assert [(b.language, b.mark, b.line) for b in blocks(page)] == [
        ("python", None, 1),
        ("sh", "not run", 5),
        ("console", None, 9),
    ]
    assert commands("$ isomatch match a \\\n  b # why\nls\n") == [["match", "a", "b"]]


def test_a_block_that_fails_shows_its_line():
    with pytest.raises(ZeroDivisionError) as failed:
        run("page.md", [Block("python", "x = 1\n", 2, None), Block("python", "\nx / 0\n", 9, None)])
    assert (str(failed.traceback[-1].path), failed.traceback[-1].lineno) == ("page.md", 10)
    with pytest.raises(AssertionError, match="isomatch"):
        run("page.md", [Block("sh", "isomatch match nothing.ply none.ply -o x\n", 5, None)])


RUN = {page.relative_to(ROOT).as_posix(): blocks(page.read_text(encoding="utf-8")) for page in PAGES}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_no_block_is_overlooked(page):
    fences = re.findall(
        r"^[ >]*`{3,}(?:python|sh|bash|console)\b", page.read_text(encoding="utf-8"), re.MULTILINE
    )
    assert len(fences) == len(RUN[page.relative_to(ROOT).as_posix()]), "a block is indented or not closed"


@pytest.mark.parametrize(
    "page",
    some_later(
        [page for page, found in RUN.items() if any(not b.mark for b in found)],
        lambda page: page == "README.md",
    ),
)
def test_blocks_run(page, shapes, tmp_path, monkeypatch):
    if not any(block.code.startswith(WRITING) for block in RUN[page]):
        shutil.copytree(shapes, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    run(page, [block for block in RUN[page] if not block.mark])


@pytest.mark.long
@pytest.mark.parametrize(
    "page", [page for page, found in RUN.items() if any(b.mark == "long" for b in found)]
)
def test_long_blocks_run(page, shapes, in_threads, tmp_path, monkeypatch):
    shutil.copytree(shapes, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    run(page, [block for block in RUN[page] if block.mark != "not run"])
