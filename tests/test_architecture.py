"""The house: which room may import which, who may print, and that every public name says what it is."""

import ast
import importlib
from functools import cache
from pathlib import Path

import pytest

import isomatch

PACKAGE = Path(isomatch.__file__).parent
# A room imports only rooms above it; those of one line do not import each other, but for what BESIDE allows.
HOUSE = """
errors values
loading runtime
storage
surfaces
assets resolution
mending
geodesics
bases
descriptors
correspondence
settings
shapes landmarks
matching
transfer view datasets
statistics
collections serving
lab.sets
lab.damage
lab.baselines
lab.evaluation
lab.paper
cli
"""
BESIDE = {("values", "errors"), ("runtime", "loading"), ("loading", "runtime")}
FOUNDATION = {"errors", "values", "loading", "runtime", "storage"}  # entered by its modules
PARENTS = ("isomatch", "isomatch.lab")  # of which rooms may be imported as modules
LAB = "lab"
ROWS = [line.split() for line in HOUSE.split("\n") if line]
MAY_IMPORT = {
    room: {other for above in ROWS[:number] for other in above} | {room} | {b for a, b in BESIDE if a == room}
    for number, row in enumerate(ROWS)
    for room in row
}
for room in ("cli", "lab.paper"):
    MAY_IMPORT[room].add("__init__")
MAY_IMPORT["__init__"] = {room for row in ROWS for room in row if room != "cli" and not room.startswith(LAB)}
MAY_IMPORT["__main__"] = {"cli", "storage"}
MAY_IMPORT["warm"] = set()  # it runs the command

FILES = sorted([*PACKAGE.rglob("*.py"), *PACKAGE.rglob("*.pyi")])


@cache
def parsed(path):
    return ast.parse(path.read_text(encoding="utf-8"))


def room_in(parts):
    """Room of a module by the parts of its name: two of them in the lab."""
    return ".".join(parts[: 2 if parts[0] == LAB and len(parts) > 1 else 1])


def room_of(path):
    return room_in(
        [part for part in path.relative_to(PACKAGE).with_suffix("").parts if part != "__init__"]
        or ["__init__"]
    )


def imported_rooms(path):
    """Rooms of the package that a file imports, anywhere in it; the package itself counts as ``__init__``."""
    tree = parsed(path)
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}:{node.lineno}: imports are absolute"
            names = (
                [f"{node.module}.{a.name}" for a in node.names] if node.module in PARENTS else [node.module]
            )
        else:
            continue
        for name in names:
            top, *rest = name.split(".")
            if top == "isomatch":
                known = rest and ((PACKAGE / rest[0]).exists() or (PACKAGE / f"{rest[0]}.py").exists())
                yield room_in(rest) if known else "__init__", node.lineno


def test_every_room_has_a_place_in_the_order():
    assert {room_of(path) for path in FILES} <= {*MAY_IMPORT, LAB}


def test_a_room_imports_only_rooms_before_it():
    for path in FILES:
        allowed = MAY_IMPORT.get(room_of(path), {"loading"})
        wrong = [f"line {line}: {room}" for room, line in imported_rooms(path) if room not in allowed]
        assert not wrong, f"{path}: {room_of(path)} may import {sorted(allowed)}"


def side_doors(room, source):
    """Imports of a file that reach into another room, past the names in its ``__all__``."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            modules, names = [alias.name for alias in node.names], []
        elif isinstance(node, ast.ImportFrom):
            modules, names = [node.module], [alias.name for alias in node.names]
        else:
            continue
        for module in modules:
            package, *rest = module.split(".")
            if package != "isomatch" or module in PARENTS or room_in(rest) == room or rest[0] in FOUNDATION:
                continue
            public = importlib.import_module(f"isomatch.{room_in(rest)}").__all__
            if room_in(rest) != ".".join(rest) or not set(names) <= set(public):
                yield f"line {node.lineno}: {module} {', '.join(names)}".rstrip()


def test_a_room_is_entered_by_its_front_door():
    for path in FILES:
        found = list(side_doors(room_of(path), path.read_text(encoding="utf-8")))
        assert not found, f"{path}: import public names from `isomatch.<room>`; export what is missing there"


def test_the_checker_sees_side_doors():
    source = (
        "from isomatch.surfaces.mesh import Mesh\nfrom isomatch.surfaces import Mesh\n"
        "import isomatch.bases.build\nfrom isomatch.bases import signs\nfrom isomatch.view.camera import camera_of\n"
    )
    assert [line.split(":")[0] for line in side_doors("view", source)] == ["line 1", "line 3", "line 4"]


def test_the_checker_sees_imports():
    assert {"cli", "errors"} <= {room for room, _ in imported_rooms(PACKAGE / "cli" / "__init__.py")}


def imported_modules(path):
    """Modules of the package that a file imports, anywhere in it, also for types only."""
    for node in ast.walk(parsed(path)):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        else:
            continue
        for name in names:
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


@pytest.mark.parametrize("room", sorted({room_of(path) for path in FILES}))
def test_no_modules_of_a_room_import_each_other_in_a_circle(room):
    within = {module: path for module, path in MODULES.items() if room_of(path) == room}
    imports = {
        module: within.keys() & set(imported_modules(path)) - {module} for module, path in within.items()
    }
    found = circles(imports)
    assert not found, sorted(found)


def test_the_checker_sees_circles():
    assert circles({"a": {"b"}, "b": {"c"}, "c": {"b"}, "d": {"a"}}) == {"b", "c"}


def test_only_the_command_line_prints_or_exits():
    for path in FILES:
        if room_of(path) in ("cli", "__main__"):
            continue
        for node in ast.walk(parsed(path)):
            if isinstance(node, ast.Call):
                called = ast.unparse(node.func)
                assert called not in ("print", "exit", "quit", "sys.exit"), (
                    f"{path}:{node.lineno} calls {called}"
                )


def test_only_what_shows_itself_reaches_the_room_of_pictures():
    """A method that shows its own object calls `view_room`, which imports a later room; nothing else may."""
    showing = {"plot", "show", "_repr_html_"}
    for path in FILES:
        calls = {
            node.lineno: function.name
            for function in ast.walk(parsed(path))
            if isinstance(function, ast.FunctionDef)
            for node in ast.walk(function)
            if isinstance(node, ast.Call) and ast.unparse(node.func) == "view_room"
        }
        wrong = {line: name for line, name in calls.items() if name not in showing}
        assert not wrong, f"{path}: {wrong} call view_room; only {showing} may"


def test_loops_are_compiled_in_one_way():
    """`compiled` works without a cache and waits for the first call, and coverage leaves out what it decorates."""
    users = {path.name for path in FILES if "import numba" in path.read_text(encoding="utf-8")}
    assert users == {"dispatcher.py"}


@pytest.mark.parametrize("name", isomatch.__all__)
def test_every_public_name_is_documented(name):
    documentation = getattr(isomatch, name).__doc__
    generated = f"{name}("  # what dataclass writes when there is no docstring
    assert documentation
    assert not documentation.startswith(generated)
