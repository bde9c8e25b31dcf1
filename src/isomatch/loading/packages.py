"""Optional packages, which are imported when they are needed."""

from importlib import import_module
from typing import Any

from isomatch.errors import MissingDependencyError


def package(module: str, extra: str | None, what: str) -> Any:
    """Import a module of an optional package, which an extra of isomatch installs, or none.

    Raises
    ------
    MissingDependencyError
        If the package is not installed, and the message names the extra, or if it cannot be loaded.
    """
    try:
        return import_module(module)
    except ImportError as error:
        name = module.partition(".")[0]
        missing = isinstance(error, ModuleNotFoundError) and error.name in (name, module)
        if not missing:
            raise MissingDependencyError(
                f"{what} needs the package {name}, which cannot be loaded: {error}"
            ) from error
        install = f"'isomatch[{extra}]'" if extra else name
        raise MissingDependencyError(f"{what} needs the package {name}; pip install {install}") from None
