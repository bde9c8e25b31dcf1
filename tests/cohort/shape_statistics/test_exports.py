"""Files of other tools, read the way that those tools read them."""

import json
import sys

import numpy as np
import pytest

from corresponded import ellipsoids, random_shapes
from isomatch import read_mesh
from isomatch._core.errors import InputError, MissingDependencyError
from isomatch.cohort.shape_statistics import ShapeModel, write_shapeworks, write_statismo


def test_shapeworks(tmp_path):
    shapes = random_shapes(3)
    model = ShapeModel.fit(shapes)
    write_shapeworks(tmp_path, shapes, model.aligned)
    subjects = json.loads((tmp_path / "project.swproj").read_text())["data"]
    assert [subject["name"] for subject in subjects] == list(shapes.names)
    for i, subject in enumerate(subjects):
        np.testing.assert_allclose(
            np.loadtxt(tmp_path / subject["local_particles_1"]), shapes.vertices[i], rtol=1e-8
        )
        np.testing.assert_allclose(
            np.loadtxt(tmp_path / subject["world_particles_1"]), model.aligned[i], atol=1e-8
        )
        np.testing.assert_array_equal(read_mesh(tmp_path / subject["groomed_1"]).faces, shapes.faces)


def test_statismo(tmp_path):
    h5py = pytest.importorskip("h5py", reason="needs the extra 'statistics'")
    model = ShapeModel.fit(random_shapes(5))
    write_statismo(tmp_path / "model.h5", model)
    with h5py.File(tmp_path / "model.h5") as file:
        mean, basis, variance = (file[f"model/{name}"][()] for name in ("mean", "pcaBasis", "pcaVariance"))
        points, cells = (file[f"representer/{name}"][()] for name in ("points", "cells"))
        assert file["representer"].attrs["datasetType"] == "POLYGON_MESH"
        assert (file["version/majorVersion"][()], file["version/minorVersion"][()]) == (0, 9)
        assert {each.dtype for each in (mean, basis, variance, points)} == {np.dtype("f4")}
    np.testing.assert_allclose(mean.reshape(-1, 3), model.mean, rtol=1e-6)
    np.testing.assert_array_equal(points.T, mean.reshape(-1, 3))
    np.testing.assert_array_equal(cells.T, model.faces)
    np.testing.assert_allclose(basis.T @ basis, np.eye(4), atol=1e-5)
    flat = (model.aligned - model.mean).reshape(5, -1)
    covariance = flat.T @ flat / 4
    np.testing.assert_allclose((basis * variance) @ basis.T, covariance, atol=1e-6 * covariance.max())


def test_statismo_needs_its_package_and_a_mode(tmp_path, monkeypatch):
    with pytest.raises(InputError, match="the model has no mode"):
        write_statismo(tmp_path / "model.h5", ShapeModel.fit(ellipsoids([1.0])))
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(MissingDependencyError, match=r"pip install '\.\[statistics\]'"):
        write_statismo(tmp_path / "model.h5", ShapeModel.fit(random_shapes(3)))
    assert not list(tmp_path.iterdir())
