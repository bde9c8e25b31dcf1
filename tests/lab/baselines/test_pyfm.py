"""The adapter to pyFM: its maps go from source to target."""

import sys

import pytest

from isomatch import MissingDependencyError
from isomatch_lab.baselines.pyfm import pyfm_zoomout
from shapes import disguised, icosphere


@pytest.mark.long
def test_the_map_goes_from_source_to_target(example):
    source = example[0].mesh
    copy = disguised(source)
    found = pyfm_zoomout(source, copy.mesh)
    assert found.shape == (source.n_vertices, source.n_vertices)
    assert (found.vertices == copy.new_vertex).mean() > 0.9


def test_a_missing_package_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "pyFM.functional", None)
    with pytest.raises(MissingDependencyError, match=r"\.\[peers\]"):
        pyfm_zoomout(icosphere(1), icosphere(1))
