"""Make all that a release consists of in ``dist``, and have others judge the packages: ``python release/build.py``.

needs uv in the environment. Beside sdist and wheel there are the zips for Blender and 3D Slicer, the entry of Slicer's
catalogue, the recipe for conda-forge with the hash of the sdist, CITATION.cff, .zenodo.json, the paper for JOSS, sums.
"""

from __future__ import annotations

import hashlib
import shutil
import subprocess
import sys
from pathlib import Path

import prepare

ROOT, DIST = prepare.ROOT, prepare.ROOT / "dist"
COPIED = ("CITATION.cff", ".zenodo.json", "release/joss/paper.md", "release/joss/paper.bib")


def run(*command: object, **options: object) -> None:
    """Run a command; stop if it fails."""
    print("$", *command, flush=True)
    subprocess.run([str(part) for part in command], check=True, **options)


def packages() -> tuple[Path, Path]:
    """Build sdist, and wheel from it, in an empty ``dist``."""
    shutil.rmtree(DIST, ignore_errors=True)
    run("uv", "build", "--quiet", ROOT)
    (sdist,), (wheel,) = DIST.glob("*.tar.gz"), DIST.glob("*.whl")
    return sdist, wheel


def main() -> None:
    """Make all, then run the judges."""
    run(sys.executable, ROOT / "release" / "prepare.py", "--check")
    release, (sdist, wheel) = prepare.Release.read(), packages()
    run(sys.executable, ROOT / "extras" / "zipped.py", DIST)
    for file in COPIED:
        shutil.copy2(ROOT / file, DIST)
    recipe = (ROOT / "release" / "recipe.yaml").read_text(encoding="utf-8")
    hashed = hashlib.sha256(sdist.read_bytes()).hexdigest()
    for name, text in {
        "recipe.yaml": prepare.released_recipe(release, recipe, hashed),
        "IsomatchSlicer.json": prepare.catalogue_entry(release),
    }.items():
        (DIST / name).write_text(text, encoding="utf-8", newline="\n")
    made = [path for path in sorted(DIST.iterdir()) if path.name != ".gitignore"]
    sums = "".join(f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.name}\n" for path in made)
    (DIST / "SHA256SUMS").write_text(sums, encoding="utf-8", newline="\n")
    run("uvx", "twine", "check", "--strict", sdist, wheel)
    run("uvx", "check-wheel-contents", wheel, cwd=ROOT)
    run("uvx", "pyroma", sdist)
    print(*made, DIST / "SHA256SUMS", sep="\n")


if __name__ == "__main__":
    main()
