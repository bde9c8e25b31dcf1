"""The zips for Blender and 3D Slicer hold what these look for, and say the version of isomatch."""

import ast
import importlib.util
import tomllib
from pathlib import Path
from zipfile import ZipFile

import pytest

import isomatch

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def zipped():
    """The script as a module."""
    spec = importlib.util.spec_from_file_location("zipped", ROOT / "extras" / "zipped.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_addon_has_its_manifest_and_legacy_info(zipped, tmp_path):
    with ZipFile(zipped.zipped("isomatch_blender", tmp_path)) as archive:
        names = archive.namelist()
        manifest = tomllib.loads(archive.read("isomatch_blender/blender_manifest.toml").decode())
        tree = ast.parse(archive.read("isomatch_blender/__init__.py"))
    assert not [name for name in names if "__pycache__" in name or not name.startswith("isomatch_blender/")]
    info = next(
        ast.literal_eval(node.value)
        for node in tree.body
        if isinstance(node, ast.Assign) and node.targets[0].id == "bl_info"
    )
    assert "isomatch_blender/LICENSE.txt" in names
    assert manifest["id"] == "isomatch_blender"
    assert manifest["version"] == ".".join(map(str, info["version"])) == isomatch.__version__
    assert manifest["blender_version_min"] == ".".join(map(str, info["blender"]))
    assert "wheels" not in manifest


def test_wheels_travel_with_the_addon(zipped, tmp_path):
    wheels = tmp_path / "wheels"
    wheels.mkdir()
    (wheels / "isomatch-1-py3-none-any.whl").write_bytes(b"wheel")
    with ZipFile(zipped.zipped("isomatch_blender", tmp_path, wheels)) as archive:
        manifest = tomllib.loads(archive.read("isomatch_blender/blender_manifest.toml").decode())
        assert manifest["wheels"] == ["./wheels/isomatch-1-py3-none-any.whl"]
        assert archive.read("isomatch_blender/wheels/isomatch-1-py3-none-any.whl") == b"wheel"
    assert manifest["permissions"]["files"]


def test_the_module_of_slicer_is_named_as_slicer_demands(zipped, tmp_path):
    with ZipFile(zipped.zipped("IsomatchSlicer", tmp_path)) as archive:
        names = archive.namelist()
        tree = ast.parse(archive.read("IsomatchSlicer/IsomatchModule/IsomatchModule.py"))
        cmake = archive.read("IsomatchSlicer/IsomatchModule/CMakeLists.txt").decode()
    assert {"IsomatchSlicer/CMakeLists.txt", "IsomatchSlicer/LICENSE.txt"} <= set(names)
    assert "IsomatchSlicer/IsomatchModule/Resources/Icons/IsomatchModule.svg" in names
    assert "set(MODULE_NAME IsomatchModule)" in cmake
    classes = {node.name for node in tree.body if isinstance(node, ast.ClassDef)}
    assert {f"IsomatchModule{part}" for part in ("", "Widget", "Logic", "Test")} <= classes
