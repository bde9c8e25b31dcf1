"""What a release consists of: one version everywhere, a readme without dangling links, equal requirements."""

import importlib.util
import re
import tomllib
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement

import isomatch

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
RECIPE = yaml.safe_load((ROOT / "release" / "recipe.yaml").read_text(encoding="utf-8"))
CONDA_NAMES = {"matplotlib": "matplotlib-base", "robust_laplacian": "robust-laplacian"}


def required(lines):
    """Names and ranges of versions of some requirements, as conda-forge names them."""
    found = map(Requirement, lines)
    return {(CONDA_NAMES.get(each.name, each.name), str(each.specifier)) for each in found}


def test_one_version():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    heading = re.search(r"^## \[(.+?)\]", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert "version" in PROJECT["dynamic"]
    assert {citation["version"], heading[1], RECIPE["context"]["version"]} == {isomatch.__version__}


def test_pythons_are_those_of_the_classifiers():
    named = [c.split(" :: ")[-1] for c in PROJECT["classifiers"] if "Python :: 3." in c]
    assert f">={named[0]}" == PROJECT["requires-python"] == f">={RECIPE['context']['python_min']}"
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert re.search(r"^PYTHONS \?= (.*)$", makefile, re.MULTILINE)[1].split() == named


def test_conda_recipe_requires_what_the_project_requires():
    run = [line for line in RECIPE["requirements"]["run"] if not line.startswith("python ")]
    assert required(run) == required(PROJECT["dependencies"])
    (entry_point,) = PROJECT["scripts"].items()
    assert RECIPE["build"]["python"]["entry_points"] == [" = ".join(entry_point)]
    assert RECIPE["about"]["summary"] == PROJECT["description"]


@pytest.fixture(scope="module")
def with_whole_links():
    """The function that makes the readme of the package."""
    pytest.importorskip("hatchling", reason="needs hatchling, which builds the package")
    spec = importlib.util.spec_from_file_location("hatch_build", ROOT / "hatch_build.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.with_whole_links


def test_readme_of_the_package_has_no_dangling_links(with_whole_links):
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    own = re.findall(r"\]\((?!\w+:|#)([^)#]+)", text)
    assert own
    assert all((ROOT / path).exists() for path in own)
    bare = with_whole_links(text, None, "1.2")
    assert not re.search(r"\]\((?!\w+:|#)|docs/images", bare)
    whole = with_whole_links(text, "https://example.org/isomatch", "1.2")
    assert whole.count("](https://example.org/isomatch/") == len(own)
    assert "![" in whole
    assert "](https://example.org/isomatch/raw/v1.2/docs/images/first_pose.png)" in whole


def test_links_that_are_whole_stay(with_whole_links):
    text = "[a](https://a.org/b) [c](#d) ![e](f.png) [g](h.md#i)"
    assert with_whole_links(text, None, "2") == "[a](https://a.org/b) [c](#d)  g"
    assert with_whole_links(text, "s", "2").endswith("![e](s/raw/v2/f.png) [g](s/blob/v2/h.md#i)")
