"""The house: which subpackage may import which, who may print, and that every public name says what it is."""

import ast
import importlib
import re
from functools import cache
from pathlib import Path

import pytest

import isomatch
import isomatch_lab

PACKAGE = Path(isomatch.__file__).parent
STUDY = Path(isomatch_lab.__file__).parent
# A subpackage imports only subpackages above it; those of one line do not import each other.
HOUSE = """
_core
surfaces
io decimation
repair
geodesics
spectral
descriptors
correspondence
settings
shapes landmarks
matching
transfer visualization datasets evaluation
cohort server
cli
"""
LAB = """
procedural
sets
damage
baselines
evaluation
paper
commands
studies
"""  # those of isomatch_lab; all may import every public name of isomatch
CORE = "_core"  # entered by its modules
PRINTS_OR_EXITS = re.compile(r"\b(print|exit|quit)\b")


def allowed(house):
    """The subpackages that each subpackage may import."""
    rows = [line.split() for line in house.strip().split("\n")]
    return {
        subpackage: {other for above in rows[:number] for other in above} | {subpackage}
        for number, row in enumerate(rows)
        for subpackage in row
    }


MAY_IMPORT, LAB_MAY_IMPORT = allowed(HOUSE), allowed(LAB)
MAY_IMPORT["__init__"] = set(MAY_IMPORT) - {"cli"}
MAY_IMPORT["cli"].add("__init__")
MAY_IMPORT["__main__"] = {"cli", CORE}
MAY_IMPORT["warm"] = set()  # it runs the command

FILES = sorted([*PACKAGE.rglob("*.py"), *PACKAGE.rglob("*.pyi")])
LAB_FILES = sorted([*STUDY.rglob("*.py"), *STUDY.rglob("*.pyi")])


def subpackage_of(path):
    """Subpackage of a file: the first folder below its package, or the file itself."""
    package = STUDY if path.is_relative_to(STUDY) else PACKAGE
    parts = [part for part in path.relative_to(package).with_suffix("").parts if part != "__init__"]
    return parts[0] if parts else "__init__"


@cache
def text_of(path):
    return path.read_text(encoding="utf-8")


@cache
def parsed(path):
    return ast.parse(text_of(path))


@cache
def imports_of(path):
    return list(imports(parsed(path)))


def imports(tree):
    """Modules, names and lines that a file imports, anywhere in it."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((alias.name, [], node.lineno) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"line {node.lineno}: imports are absolute"
            if node.module in ("isomatch", "isomatch_lab"):
                yield from ((f"{node.module}.{alias.name}", [], node.lineno) for alias in node.names)
            else:
                yield node.module, [alias.name for alias in node.names], node.lineno


def imported_subpackages(path, package="isomatch"):
    """Subpackages of a package that a file imports; the package itself counts as ``__init__``."""
    folder = {"isomatch": PACKAGE, "isomatch_lab": STUDY}[package]
    for module, _, line in imports_of(path):
        top, *rest = module.split(".")
        if top == package:
            known = rest and ((folder / rest[0]).exists() or (folder / f"{rest[0]}.py").exists())
            yield rest[0] if known else "__init__", line


def test_every_subpackage_has_a_place_in_the_order():
    assert {subpackage_of(path) for path in FILES} <= {*MAY_IMPORT}
    assert {subpackage_of(path) for path in LAB_FILES} <= {*allowed(LAB), "__init__"}


def test_a_subpackage_imports_only_subpackages_before_it():
    for files, package, may_import in (
        (FILES, "isomatch", MAY_IMPORT),
        (LAB_FILES, "isomatch_lab", LAB_MAY_IMPORT),
    ):
        for path in files:
            subpackages = may_import.get(subpackage_of(path), set()) | {CORE}
            wrong = [
                f"line {line}: {subpackage}"
                for subpackage, line in imported_subpackages(path, package)
                if subpackage not in subpackages
            ]
            assert not wrong, f"{path}: {subpackage_of(path)} may import {sorted(subpackages)}"


def test_isomatch_never_imports_the_lab():
    for path in FILES:
        assert not list(imported_subpackages(path, "isomatch_lab")), path


def side_doors(subpackage, imports):
    """Imports of a file that reach into another subpackage of isomatch, past the names in its ``__all__``."""
    for module, names, line in imports:
        package, *rest = module.split(".")
        if package != "isomatch" or not rest or rest[0] == subpackage or rest[0] == CORE:
            continue
        if rest[0] == "__version__" or rest[0] in isomatch.__all__:
            continue
        inner = PACKAGE.joinpath(
            *rest, "__init__.pyi"
        ).exists()  # a package with public names, perhaps within another
        if not inner or not set(names) <= set(importlib.import_module(module).__all__):
            yield f"line {line}: {module} {', '.join(names)}".rstrip()


def test_a_subpackage_is_entered_by_its_front_door():
    for path in [*FILES, *LAB_FILES]:
        subpackage = "of the lab" if path in LAB_FILES else subpackage_of(path)
        doors = list(side_doors(subpackage, imports_of(path)))
        assert not doors, (
            f"{path}: import public names from `isomatch.<subpackage>`; export what is missing there"
        )


def test_a_cohort_stands_above_all_others():
    """The study of many shapes uses public names of the matcher, and only commands use it."""
    users = {
        subpackage_of(path)
        for path in FILES
        if any(subpackage == "cohort" for subpackage, _ in imported_subpackages(path))
    }
    assert users <= {"cohort", "cli", "__init__"}, "the last one passes on `Collection`"
    for path in (path for path in FILES if subpackage_of(path) == "cohort"):
        assert not list(side_doors("cohort", imports_of(path))), path


def test_the_checker_sees_side_doors():
    source = (
        "from isomatch.surfaces.mesh import Mesh\nfrom isomatch.surfaces import Mesh\n"
        "import isomatch.spectral.build\nfrom isomatch.spectral import signs\n"
        "from isomatch.visualization.camera import camera_of\n"
        "from isomatch.cohort.shape_statistics import ShapeModel\nfrom isomatch.cohort.plan import Layout\n"
    )
    doors = side_doors("visualization", imports(ast.parse(source)))
    assert [line.split(":")[0] for line in doors] == ["line 1", "line 3", "line 4", "line 7"]


def test_the_checker_sees_imports():
    assert {"cli", CORE} <= {
        subpackage for subpackage, _ in imported_subpackages(PACKAGE / "cli" / "program.py")
    }


def imported_modules(path):
    """Modules of the package that a file imports, anywhere in it, also for types only."""
    for module, names, _ in imports_of(path):
        for name in [f"{module}.{name}" for name in names] or [module]:
            while name and name not in MODULES:
                name = name.rpartition(".")[0]
            if name:
                yield name


MODULES = {
    ".".join(
        part for part in ("isomatch", *path.relative_to(PACKAGE).with_suffix("").parts) if part != "__init__"
    ): path
    for path in FILES
    if path.suffix == ".py"
}


def circles(imports):
    """Modules that import themselves by way of others; ``imports`` gives those of each."""
    reached = {module: set(found) for module, found in imports.items()}
    for through in reached:
        for found in reached.values():
            if through in found:
                found |= reached[through]
    return {module for module, found in reached.items() if module in found}


@pytest.mark.parametrize("subpackage", sorted({subpackage_of(path) for path in FILES}))
def test_no_modules_of_a_subpackage_import_each_other_in_a_circle(subpackage):
    within = {module: path for module, path in MODULES.items() if subpackage_of(path) == subpackage}
    imports = {
        module: within.keys() & set(imported_modules(path)) - {module} for module, path in within.items()
    }
    found = circles(imports)
    assert not found, sorted(found)


def test_the_checker_sees_circles():
    assert circles({"a": {"b"}, "b": {"c"}, "c": {"b"}, "d": {"a"}}) == {"b", "c"}


def test_only_the_command_line_prints_or_exits():
    for path in FILES:
        if subpackage_of(path) in ("cli", "__main__", "studies") or not PRINTS_OR_EXITS.search(text_of(path)):
            continue
        for node in ast.walk(parsed(path)):
            if isinstance(node, ast.Call):
                called = ast.unparse(node.func)
                assert called not in ("print", "exit", "quit", "sys.exit"), (
                    f"{path}:{node.lineno} calls {called}"
                )


def test_only_what_shows_itself_reaches_the_subpackage_of_pictures():
    """A method that shows its own object calls `visualization`, which imports a later subpackage; nothing else may."""
    showing = {"plot", "show", "_repr_html_", "__str__"}
    for path in (path for path in FILES if "visualization(" in text_of(path)):
        calls = {
            node.lineno: function.name
            for function in ast.walk(parsed(path))
            if isinstance(function, ast.FunctionDef)
            for node in ast.walk(function)
            if isinstance(node, ast.Call) and ast.unparse(node.func) == "visualization"
        }
        wrong = {line: name for line, name in calls.items() if name not in showing}
        assert not wrong, f"{path}: {wrong} call visualization; only {showing} may"


def test_loops_are_compiled_in_one_way():
    """`compiled` works without a cache, and coverage leaves out what it decorates."""
    users = {path.name for path in [*FILES, *LAB_FILES] if "import numba" in path.read_text(encoding="utf-8")}
    assert users == {"compiled.py"}


@pytest.mark.parametrize("name", isomatch.__all__)
def test_every_public_name_is_documented(name):
    documentation = getattr(isomatch, name).__doc__
    generated = f"{name}("  # what dataclass writes when there is no docstring
    assert documentation
    assert not documentation.startswith(generated)
