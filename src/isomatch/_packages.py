"""Optional packages, which are imported when they are needed."""

from importlib import import_module
from typing import Any

from isomatch.errors import MissingDependencyError


def package(module: str, extra: str | None, what: str) -> Any:
    """Import a module of an optional package, which an extra of isomatch installs, or none.

    Raises
    ------
    MissingDependencyError
        If the package is not installed; the message names the extra.
    """
    try:
        return import_module(module)
    except ImportError:
        name = module.partition(".")[0]
        install = f"'isomatch[{extra}]'" if extra else name
        raise MissingDependencyError(f"{what} needs the package {name}; pip install {install}") from None
