"""Import at first use, to save time: public names, optional packages, `visualization`.

The stub ``__init__.pyi`` beside a package is the only list of its names: type checkers and editors read it as usual.
"""

from __future__ import annotations

import ast
import sys
from importlib import import_module
from pkgutil import get_data
from types import ModuleType
from typing import Any, TypedDict

from isomatch._core.errors import MissingDependencyError


class _Package(ModuleType):
    """A package that looks for a public name where its stub imports it from."""

    def __getattr__(self, name: str) -> Any:
        homes, full = vars(self)["_homes"], f"{self.__name__}.{name}"
        if name in homes:
            if homes[name] == self.__name__:  # the name is a subpackage
                return import_module(full)
            public = getattr(import_module(homes[name]), name)
            super().__setattr__(name, public)
            return public
        if full in homes.values():
            return import_module(full)
        raise AttributeError(f"module {self.__name__!r} has no attribute {name!r}")

    def __setattr__(self, name: str, value: Any) -> None:
        """Set an attribute, except a module with the name of something public, which it would hide."""
        if not (isinstance(value, ModuleType) and name in self._homes):
            super().__setattr__(name, value)

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle by name, as modules do; cloudpickle asks for their exact type."""
        return import_module, (self.__name__,)

    def __dir__(self) -> list[str]:
        """List the public names, and those of every Python module."""
        return sorted({*self.__all__, *(name for name in super().__dir__() if name[:2] == "__" == name[-2:])})


def names_at_first_use(package: str) -> list[str]:
    """Make a package import its public names at first use, as its stub says; return its ``__all__``.

    A stub without ``__all__`` imports each public name ``as`` itself.
    """
    module: Any = sys.modules[package]
    stub = get_data(package, "__init__.pyi")
    body = ast.parse(stub or b"").body
    imports = [node for node in body if isinstance(node, ast.ImportFrom)]
    module._homes = {alias.name: node.module for node in imports for alias in node.names}
    module.__class__ = _Package
    lists = (ast.literal_eval(node.value) for node in body if isinstance(node, ast.Assign))
    return next(lists, sorted(module._homes))


# The package that `pip install` is told to install: the folder of a checkout here; release/prepare.py writes
# the name in an index instead.
PACKAGE = "."


def install_command(extra: str) -> str:
    """Write the command that installs an extra."""
    where = "in the checkout of isomatch, " if PACKAGE == "." else ""
    return f"{where}pip install '{PACKAGE}[{extra}]'"


def package(module: str, extra: str | None, what: str) -> Any:
    """Import a module of an optional package; `MissingDependencyError` says how to install it."""
    try:
        return import_module(module)
    except ImportError as error:
        name = module.partition(".")[0]
        missing = isinstance(error, ModuleNotFoundError) and error.name in (name, module)
        if not missing:
            raise MissingDependencyError(
                f"{what} needs the package {name}, which cannot be loaded: {error}"
            ) from error
        install = install_command(extra) if extra else f"pip install {name}"
        raise MissingDependencyError(f"{what} needs the package {name}; {install}") from None


class PlotOptions(TypedDict, total=False):
    """Keywords that every ``plot`` passes to the subpackage `visualization`."""

    label: str  # what the values are, with their unit
    colour_map: str | None  # name of a colour map of matplotlib
    title: str  # title above the picture
    width: int  # the width in pixels; notebooks show two per pixel of the page
    view: tuple[float, float] | None  # degrees around the shape and above the horizon; (32, 14) by default


def visualization() -> Any:
    """Return the subpackage `visualization`, only for methods that show their object."""
    return import_module("isomatch.visualization")


class Shown:
    """An object that notebooks show as `isomatch.visualization.html_of` represents it."""

    __slots__ = ()

    def _repr_html_(self) -> str:
        html: str = visualization().html_of(self)
        return html
