"""Optional packages, which are imported when they are needed."""

from importlib import import_module
from typing import Any

from isomatch.errors import MissingDependencyError


def package(module: str, extra: str, what: str) -> Any:
    """Import a module of an optional package.

    Raises
    ------
    MissingDependencyError
        If the package is not installed; the message names the extra.
    """
    try:
        return import_module(module)
    except ImportError:
        name = module.partition(".")[0]
        raise MissingDependencyError(
            f"{what} needs the package {name}; pip install 'isomatch[{extra}]'"
        ) from None
