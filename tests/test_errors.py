"""The tree of errors: what a caller may catch, and that each error is also the one Python has for its kind."""

from doctest import ELLIPSIS, NORMALIZE_WHITESPACE, DocTestParser, DocTestRunner

import pytest

import isomatch
from isomatch._core import errors
from isomatch._core.errors import MissingDependencyError
from isomatch._core.first_use import package

TREE = {
    "InputError": ("IsomatchError", ValueError),
    "MeshError": ("InputError", ValueError),
    "LandmarkError": ("InputError", ValueError),
    "MapError": ("InputError", ValueError),
    "DescriptorError": ("InputError", ValueError),
    "SettingError": ("InputError", ValueError),
    "FormatError": ("IsomatchError", ValueError),
    "MissingFileError": ("FormatError", FileNotFoundError),
    "UnwritableFileError": ("FormatError", OSError),
    "MemoryBudgetError": ("IsomatchError", MemoryError),
    "MissingDependencyError": ("IsomatchError", ImportError),
    "NotConvergedError": ("IsomatchError", Exception),
}


@pytest.mark.parametrize(("name", "parent", "of_python"), [(name, *bases) for name, bases in TREE.items()])
def test_an_error_is_its_parent_and_one_of_python(name, parent, of_python):
    for caught in (getattr(errors, parent), of_python, errors.IsomatchError):
        with pytest.raises(caught, match="where"):
            raise getattr(isomatch, name)("what, where, why, what to do")


def test_the_table_is_complete():
    named = {name for name, value in vars(errors).items() if isinstance(value, type)}
    assert named - {"Iterable"} == {"IsomatchError", *TREE}


@pytest.mark.parametrize("name", ["IsomatchError", *TREE])
def test_an_error_is_named_by_its_public_home_and_its_example_holds(name):
    error = getattr(isomatch, name)
    assert error.__module__ == "isomatch"
    example = DocTestParser().get_doctest(error.__doc__, {**vars(errors)}, name, None, 0)
    assert example.examples
    assert DocTestRunner(verbose=False, optionflags=ELLIPSIS | NORMALIZE_WHITESPACE).run(example).failed == 0


def test_a_missing_file_says_what_it_says():
    """`FileNotFoundError` writes its message differently when it is made of several arguments."""
    assert (
        str(isomatch.MissingFileError("a.ply: no such file; check the name"))
        == "a.ply: no such file; check the name"
    )


def test_a_package_that_cannot_be_loaded_is_not_called_missing(tmp_path, monkeypatch):
    (tmp_path / "half_installed.py").write_text("raise ImportError('libGL.so.1: no such file')")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(MissingDependencyError, match="cannot") as caught:
        package("half_installed", None, "this")
    assert isinstance(caught.value.__cause__, ImportError)
    with pytest.raises(MissingDependencyError, match="pip install not_installed"):
        package("not_installed.part", None, "this")
