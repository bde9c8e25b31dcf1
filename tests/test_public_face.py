"""The public face: every public name and its signature, as recorded in ``public_face.txt``.

After a change that is meant, run ``python tests/test_public_face.py`` and commit the new record with it.
"""

import ast
import difflib
import enum
import importlib
import inspect
import re
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path

import numpy as np

import isomatch
import isomatch.correspondence
from isomatch._core.cached import cached_property
from isomatch._core.settings import Settings

RECORD = Path(__file__).with_name("public_face.txt")
EXTENDED = {  # what a stranger implements, or registers in, by subpackage
    "isomatch.io": ("FORMATS", "MeshFormat"),
    "isomatch.geodesics": ("ENGINES", "ColumnEngine", "DistanceEngine", "MetricSpace"),
    "isomatch.correspondence": ("Embedding",),
    "isomatch.matching": (
        "REFINEMENTS",
        "Fit",
        "Priors",
        "Joint",
        "Refinement",
        "MatchingModel",
        "Problem",
        "Solution",
        "Start",
    ),
    "isomatch_lab.baselines": ("BASELINES", "Baseline"),
    "isomatch_lab.damage": ("DAMAGES", "Damage"),
    "isomatch_lab.evaluation": ("METHODS", "Method"),
}
PACKAGE = Path(isomatch.__file__).parent
SUBPACKAGES = sorted(
    ".".join(stub.parent.relative_to(PACKAGE).parts) for stub in PACKAGE.glob("*/**/__init__.pyi")
)
WITHOUT_EXAMPLE = {  # shrinks to nothing: an entry that has an example is refused
    "BothDirections",
    "MatchResult",
    "Outcome",
    "PreparedShape",
    "Quality",
    "prepare",
    "write_asset",
}
OPERATORS = {"__matmul__", "__rmatmul__", "__call__", "__len__", "__getitem__", "__iter__", "__contains__"}


def test_the_public_face_is_the_recorded_one():
    recorded, found = RECORD.read_text(encoding="utf-8").splitlines(), list(public_face())
    difference = "\n".join(difflib.unified_diff(recorded, found, "recorded", "found", lineterm="", n=0))
    assert not difference, (
        f"the public face has changed:\n{difference}\nIf this is meant, run `python tests/test_public_face.py`."
    )


def test_the_record_sees_names_signatures_and_methods():
    lines = list(public_face())
    for line in (
        "isomatch.Mesh: class (vertices: ArrayLike, faces: ArrayLike)",
        "isomatch.Mesh.area: property -> float",
        "isomatch.MissingFileError: exception (FormatError, FileNotFoundError)",
    ):
        assert line in lines
    assert any(
        line.startswith("isomatch.Correspondence.load: classmethod (path: str | Path") for line in lines
    )


def test_every_name_of_the_first_subpackages_has_an_example():
    without = {
        name
        for module in (isomatch, isomatch.correspondence)
        for name in module.__all__
        if (documented := as_written(getattr(module, name))) and not has_example(documented)
    }
    assert without == WITHOUT_EXAMPLE


def test_a_list_of_parameters_is_that_of_the_signature():
    for module_name in ("isomatch", *(f"isomatch.{subpackage}" for subpackage in SUBPACKAGES)):
        module = importlib.import_module(module_name)
        for name in module.__all__:
            documented = as_written(getattr(module, name))
            methods = vars(documented).values() if inspect.isclass(documented) else ()
            for one in filter(None, (documented, *methods)):
                one = getattr(one, "__func__", one)
                if (listed := listed_parameters(one)) and (one is documented or inspect.isfunction(one)):
                    taken = {
                        each for each in inspect.signature(one).parameters if each not in ("self", "cls")
                    }
                    assert listed == taken, f"{module_name}.{name}: {one}"


def listed_parameters(documented) -> set[str]:
    """Names in the section of parameters; none if there is no section."""
    text = inspect.getdoc(documented) or ""
    _, _, section = text.partition("Parameters\n----------\n")
    heads = re.split(r"^.+\n-{3,}$", section, maxsplit=1, flags=re.MULTILINE)[0]
    return {
        name.strip(" *")
        for head in re.findall(r"^\S.*$", heads, re.MULTILINE)
        for name in head.partition(" : ")[0].split(",")
    }


def has_example(documented) -> bool:
    return bool(re.search(r"^Examples\n-{8}\n(.*\n)*?>>> ", inspect.getdoc(documented) or "", re.MULTILINE))


def as_written(thing):
    """Return a class or a function, of a compiled one that which was written, and None for anything else."""
    thing = getattr(thing, "py_func", thing)
    return thing if inspect.isclass(thing) or inspect.isfunction(thing) else None


def public_face() -> Iterator[str]:
    """Describe every public name, one to a line; what has a name already is described by that."""
    named = {}
    for module_name, names in {"isomatch": isomatch.__all__, **EXTENDED}.items():
        module = importlib.import_module(module_name)
        for name in sorted(names):
            thing = getattr(module, name)
            thing = getattr(thing, "py_func", thing)  # of a compiled function, the one that was written
            full = f"{module_name}.{name}"
            if isinstance(thing, Mapping):
                yield f"{full}: mapping of {', '.join(getattr(key, '__name__', str(key)) for key in thing)}"
            elif not (inspect.isclass(thing) or inspect.isfunction(thing)):
                yield f"{full}: {assigned(module, name)}"
            elif thing in named:
                yield f"{full}: {named[thing]}"
            elif inspect.isfunction(thing):
                named[thing] = full
                yield f"{full}: function {signature(thing)}"
            else:
                named[thing] = full
                yield from class_lines(full, thing)


def class_lines(full, cls) -> Iterator[str]:
    if issubclass(cls, Exception):
        yield f"{full}: exception ({', '.join(base.__name__ for base in cls.__bases__)})"
    elif issubclass(cls, enum.Enum):
        yield f"{full}: enumeration {', '.join(cls.__members__)}"
    elif getattr(cls, "_is_protocol", False):
        yield f"{full}: protocol"
    else:
        yield f"{full}: class {signature(cls)}"
        given = inspect.signature(cls).parameters
        for field in fields(cls) if is_dataclass(cls) else ():
            if field.name not in given:
                yield f"{full}.{field.name}: attribute {annotation(field.type)}"
    for name in sorted(dir(cls)):
        home = next((base for base in cls.__mro__ if name in vars(base)), cls)
        if home.__module__.startswith("isomatch") and (not name.startswith("_") or name in OPERATORS):
            yield from member_lines(f"{full}.{name}", vars(home).get(name))


def member_lines(full, member) -> Iterator[str]:
    if isinstance(member, property | cached_property):
        getter = member.fget if isinstance(member, property) else member.func
        yield f"{full}: property -> {annotation(inspect.signature(getter).return_annotation)}"
    elif isinstance(member, classmethod | staticmethod):
        shown = signature(member.__func__, bound=isinstance(member, classmethod))
        yield f"{full}: {type(member).__name__} {shown}"
    elif inspect.isfunction(member):
        yield f"{full}: method {signature(member, bound=True)}"


def signature(callable_, bound: bool = False) -> str:
    """Write a signature: annotations as they are in the source, defaults by ``repr``."""
    whole = inspect.signature(callable_)

    def shown(given, write):
        return given if given is whole.empty else Plain(write(given))

    parameters = [
        parameter.replace(
            annotation=shown(parameter.annotation, annotation), default=shown(parameter.default, default)
        )
        for parameter in list(whole.parameters.values())[bound:]
    ]
    returned = whole.empty if inspect.isclass(callable_) else shown(whole.return_annotation, annotation)
    return str(whole.replace(parameters=parameters, return_annotation=returned))


class Plain(str):
    """Text that is written without quotes."""

    __slots__ = ()
    __repr__ = str.__str__


def annotation(given) -> str:
    return given if isinstance(given, str) else without_modules(inspect.formatannotation(given))


def default(thing) -> str:
    """Write a default, shortly: of an array its shape, of settings, a class or a function the name."""
    if isinstance(thing, np.ndarray):
        return f"array of shape {thing.shape}"
    if isinstance(thing, Settings):
        return f"{type(thing).__name__}()"
    return getattr(thing, "__name__", None) or without_modules(repr(thing))


def assigned(module, name) -> str:
    """Find what a subpackage assigns to a name, as it is in the source: aliases of types stay short and the same."""
    for path in sorted(Path(module.__file__).parent.rglob("*.py")):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
            if any(isinstance(target, ast.Name) and target.id == name for target in targets):
                return ast.unparse(node.value)
    raise AssertionError(f"{module.__name__}.{name} is assigned nowhere in its subpackage")


def without_modules(text: str) -> str:
    return re.sub(r"\b(?:isomatch|typing|numpy|pathlib)\.(?:\w+\.)*(?=\w)", "", text)


if __name__ == "__main__":
    RECORD.write_text("\n".join([*public_face(), ""]), encoding="utf-8")
