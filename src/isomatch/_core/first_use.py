"""What is imported at its first use, so that the rest costs no time: public names, optional packages, `visualization`.

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
            if homes[name] == self.__name__:  # a package within this one, which has names of its own
                return import_module(full)
            public = getattr(import_module(homes[name]), name)
            super().__setattr__(name, public)
            return public
        if full in homes.values():
            return import_module(full)
        raise AttributeError(f"module {self.__name__!r} has no attribute {name!r}")

    def __setattr__(self, name: str, value: Any) -> None:
        """Set an attribute, but no module that is named as something public: its import must not hide that."""
        if not (isinstance(value, ModuleType) and name in self._homes):
            super().__setattr__(name, value)

    def __reduce__(self) -> tuple[Any, ...]:
        """Travel to another process by name, as modules do; cloudpickle asks for their exact type."""
        return import_module, (self.__name__,)

    def __dir__(self) -> list[str]:
        """List the public names, and those that Python gives to every module; not what made the package work."""
        return sorted({*self.__all__, *(name for name in super().__dir__() if name[:2] == "__" == name[-2:])})


def names_at_first_use(package: str) -> list[str]:
    """Make a package import its public names at their first use; return the ``__all__`` of its stub, all else imports."""
    module: Any = sys.modules[package]
    stub = get_data(package, "__init__.pyi")
    body = ast.parse(stub or b"").body
    public: list[str] = next(ast.literal_eval(node.value) for node in body if isinstance(node, ast.Assign))
    imports = [node for node in body if isinstance(node, ast.ImportFrom)]
    module._homes = {alias.name: node.module for node in imports for alias in node.names}
    module.__class__ = _Package
    return public


# release/prepare.py writes it: the name in an index, or the folder of a checkout as long as there is none
PACKAGE = "."


def install_command(extra: str) -> str:
    """Write the command that installs an extra."""
    where = "in the checkout of isomatch, " if PACKAGE == "." else ""
    return f"{where}pip install '{PACKAGE}[{extra}]'"


def package(module: str, extra: str | None, what: str) -> Any:
    """Import a module of an optional package; `MissingDependencyError` if the ``extra``, or none, has to be installed."""
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
    title: str  # text above all
    width: int  # in pixels; notebooks show two of them for each pixel of the page
    view: tuple[float, float] | None  # degrees around the shape and above the horizon, by default (32, 14)


def visualization() -> Any:
    """Return the subpackage `visualization`, for methods that show their own object and for nothing else."""
    return import_module("isomatch.visualization")


class Shown:
    """An object that notebooks show as `isomatch.visualization.html_of` represents it."""

    __slots__ = ()

    def _repr_html_(self) -> str:
        html: str = visualization().html_of(self)
        return html
