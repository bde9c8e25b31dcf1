"""The processor, kernels of linear algebra and package versions, which decide the last digits."""

from __future__ import annotations

import platform
import re
from collections.abc import Iterable
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import threadpoolctl

from isomatch._core.threads import processors


def processor() -> str:
    """Name the processor and the number of its cores that may be used."""
    listed = Path("/proc/cpuinfo")
    model = re.search(r"model name\s*: (.+)", listed.read_text(encoding="utf-8")) if listed.exists() else None
    name = model[1] if model else platform.processor() or platform.machine()
    n = processors()
    return f"{name}, {n} processor{'s' * (n != 1)}"


def kernels() -> str:
    """Name the loaded libraries of linear algebra with their kernels (``OPENBLAS_CORETYPE``)."""
    import scipy.linalg  # noqa: F401 - only libraries that are loaded are listed

    libraries = [pool for pool in threadpoolctl.threadpool_info() if pool["user_api"] == "blas"]
    named = (
        f"{pool['internal_api']} {pool['version']} {pool.get('architecture') or ''}".rstrip()
        for pool in libraries
    )
    return ", ".join(named) or "not recognised"


def versions(packages: Iterable[str]) -> dict[str, str]:
    """Return the version of each package, or "not installed"."""

    def find_version(package: str) -> str:
        try:
            return version(package)
        except PackageNotFoundError:
            return "not installed"

    return {package: find_version(package) for package in packages}
