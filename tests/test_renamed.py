"""Old names work for one version more, and say so."""

import importlib

import pytest

import isomatch
from isomatch import _renamed, correspondence
from isomatch._renamed import REMOVED_IN, RENAMED


@pytest.mark.parametrize(("old", "new"), RENAMED.items())
def test_an_old_name_gives_what_the_new_one_gives_and_warns(old, new):
    module, _, name = old.rpartition(".")
    message = rf"{old} is now {new}; the old name will be removed in isomatch {REMOVED_IN}"
    with pytest.warns(DeprecationWarning, match=message) as caught:
        found = getattr(importlib.import_module(module), name)
    assert found is importlib.import_module(new)
    assert caught[0].filename == __file__, "the warning points to the line that uses the old name"


def test_an_old_module_can_be_imported_from():
    with pytest.warns(
        DeprecationWarning, match=r"isomatch\.maps\.Correspondence is now isomatch\.correspond"
    ):
        from isomatch.maps import Correspondence
    with pytest.warns(DeprecationWarning, match=r"isomatch\.maps is now"):
        import isomatch.maps as maps
    assert Correspondence is correspondence.Correspondence
    assert maps is correspondence


def test_a_name_in_a_module_can_be_renamed_too(monkeypatch):
    monkeypatch.setitem(RENAMED, "isomatch.correspond", "isomatch.match")
    with pytest.warns(DeprecationWarning, match=r"isomatch\.correspond is now isomatch\.match"):
        assert _renamed.old_names("isomatch")("correspond") is isomatch.match


def test_names_that_never_were_stay_unknown():
    with pytest.raises(AttributeError, match="module 'isomatch' has no attribute 'morph'"):
        _ = isomatch.morph
    with pytest.raises(ImportError, match="nothing"):
        from isomatch.maps import nothing  # noqa: F401


def test_old_names_are_gone_in_the_version_that_was_announced():
    assert tuple(map(int, isomatch.__version__.split(".")[:2])) < tuple(map(int, REMOVED_IN.split(".")))
