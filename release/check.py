"""Try a release: build it, and use it in an empty environment of each Python, from an empty folder.

    python release/check.py 3.11 3.12 …

needs uv in the environment, which finds or fetches the Pythons. The wheel is built from the sdist. In each environment
it is imported, and the examples of the readme are run as they are printed; then the doctests, some of which need extras.
``uvx`` runs the command without an installation, and the conda recipe is rendered. The files are left in ``dist``.
"""

from __future__ import annotations

import os
import shlex
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "tests"))
from build import packages, run
from test_code_blocks import RUN, SHELL, commands, write_shapes

RENDER = """
import sys
from pathlib import Path
from rattler_build import Stage0Recipe, VariantConfig
print(*Stage0Recipe.from_yaml(Path(sys.argv[1]).read_text(encoding="utf-8")).render(VariantConfig()))
"""


def write_examples(folder: Path) -> None:
    """Write shapes and the examples of the readme: what it calls in a shell, then its Python."""
    write_shapes(folder)
    blocks = [block for block in RUN["README.md"] if not block.mark]
    lines = [shlex.join(words) for b in blocks if b.language in SHELL for words in commands(b.code)]
    (folder / "examples.sh").write_text("".join(f"isomatch {line}\n" for line in lines))
    (folder / "examples.py").write_text("".join(b.code for b in blocks if b.language == "python"))


def tried(python: str, wheel: Path) -> str:
    """Install the wheel for one Python and use it; what was tried, and how long it took."""
    started = time.monotonic()
    with tempfile.TemporaryDirectory() as place:
        folder, environment = Path(place, "empty"), Path(place, "environment")
        folder.mkdir()
        run("uv", "venv", "--quiet", "--python", python, environment)
        own = environment / "bin" / "python"
        run("uv", "pip", "install", "--quiet", "--python", own, wheel)
        search = {"PATH": os.pathsep.join([str(own.parent), os.environ["PATH"]])}
        clean = {key: text for key, text in os.environ.items() if not key.startswith("PYTHON")} | search
        options = {"cwd": folder, "env": clean}
        where = f"import isomatch; assert isomatch.__file__.startswith({str(environment)!r}); print(isomatch.__file__)"
        run(own, "-c", where, **options)
        write_examples(folder)
        run("bash", "-e", "examples.sh", **options)
        run(own, "examples.py", **options)
        run("uv", "pip", "install", "--quiet", "--python", own, "pytest", f"{wheel}[creatures,vtk]")
        run(own, "-m", "pytest", "-q", "--doctest-modules", "--pyargs", "isomatch", **options)
    return f"Python {python}: import, doctests, examples of the readme: {time.monotonic() - started:.0f} s"


if __name__ == "__main__":
    _, wheel = packages()
    run("uvx", "--from", wheel, "isomatch", "info")
    recipe = ROOT / "release" / "recipe.yaml"
    run("uv", "run", "--no-project", "--with", "py-rattler-build>=0.60", "python", "-c", RENDER, recipe)
    print(*[tried(python, wheel) for python in sys.argv[1:]], wheel, sep="\n")
