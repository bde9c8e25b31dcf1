"""The lock file of the development environment: it meets what the project requires, and every file has a hash."""

import re
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement

ROOT = Path(__file__).parents[1]
LOCKED = (ROOT / "requirements-dev.txt").read_text().replace("\\\n", " ")
PYTHONS = ("3.11", "3.12", "3.13")


def required(extra):
    """Requirements of an extra, those of the extras it includes, and those of the library."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    for line in [*project["dependencies"], *project["optional-dependencies"][extra]]:
        requirement = Requirement(line)
        if requirement.name == project["name"]:
            for other in requirement.extras:
                yield from required(other)
        else:
            yield requirement


def normal(name):
    return re.sub(r"[-_.]+", "-", name).lower()


@pytest.mark.parametrize("python", PYTHONS)
def test_each_requirement_is_met(python):
    pins = {}
    for line in LOCKED.splitlines():
        pin = Requirement(line.partition("--hash")[0]) if "==" in line else None
        if pin and (
            not pin.marker
            or pin.marker.evaluate({"python_full_version": f"{python}.0", "sys_platform": "linux"})
        ):
            assert normal(pin.name) not in pins
            pins[normal(pin.name)] = str(pin.specifier).removeprefix("==")
    for requirement in required("dev"):
        found = pins.get(normal(requirement.name))
        assert found, f"{requirement} is not locked; run `make lock`"
        assert found in requirement.specifier, f"{requirement} is locked at {found}; run `make lock`"


def test_every_entry_has_hashes_and_no_address():
    entries = [line for line in LOCKED.splitlines() if line and not line.lstrip().startswith("#")]
    for entry in entries:
        assert re.fullmatch(
            r"[\w.-]+(\[[\w,.-]+\])?==[\w.]+( ; [^\\:/]+)?( +--hash=sha256:[0-9a-f]{64})+ *", entry
        ), entry[:80]
