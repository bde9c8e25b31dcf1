"""Models and shapes as files of other tools for statistical shape models."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from isomatch._core.arrays import FloatArray
from isomatch._core.errors import InputError
from isomatch._core.files import replaced, write_text
from isomatch._core.first_use import package
from isomatch.cohort.shape_statistics.shape_model import ShapeModel
from isomatch.cohort.shape_statistics.shapes import CorrespondedShapes
from isomatch.io import write_mesh


def write_shapeworks(folder: str | Path, shapes: CorrespondedShapes, aligned: FloatArray) -> None:
    """Write a project of ShapeWorks, whose particles are the vertices, local as they are and world as aligned, (m, n, 3).

    An existing folder gets ``project.swproj``, which ShapeWorks Studio opens, and a mesh and two ``.particles`` files of
    each shape: text with x y z on each line.
    """
    folder = Path(folder)
    subjects = []
    for i, name in enumerate(shapes.names):
        files = {
            "shape_1": f"{name}.ply",
            "groomed_1": f"{name}.ply",
            "local_particles_1": f"{name}_local.particles",
            "world_particles_1": f"{name}_world.particles",
        }
        write_mesh(folder / files["shape_1"], shapes.mesh(i))
        write_text(folder / files["local_particles_1"], _lines(shapes.vertices[i]))
        write_text(folder / files["world_particles_1"], _lines(aligned[i]))
        subjects.append({"name": name, **files})
    write_text(folder / "project.swproj", json.dumps({"data": subjects}, indent=4) + "\n")


def _lines(points: FloatArray) -> str:
    return "".join(f"{x:.9g} {y:.9g} {z:.9g}\n" for x, y, z in points.tolist())


def write_statismo(path: str | Path, model: ShapeModel) -> None:
    """Write a model as the HDF5 file, ``.h5``, that Scalismo and Statismo read; needs the extra ``statistics``.

    The model must have a mode. Version 0.9 of the format, in single precision. Its modes are orthonormal without
    weights, so they differ from those of a model with area weights; the distribution of shapes is the same.
    """
    if not model.n_modes:
        problem = "the model has no mode of variation, which the format needs"
        raise InputError(f"{problem}; give shapes that differ")
    h5py = package("h5py", "statistics", "writing HDF5 files")
    spread = (model.modes * model.deviations[:, None, None]).reshape(model.n_modes, -1)
    _, values, modes = np.linalg.svd(spread, full_matrices=False)
    points = model.mean.astype(np.float32)
    with replaced(Path(path)) as stream, h5py.File(stream, "w") as file:
        for name, values_of in {
            "model/mean": points.ravel(),
            "model/pcaBasis": modes.T.astype(np.float32),
            "model/pcaVariance": (values**2).astype(np.float32),
            "model/noiseVariance": np.zeros(1, np.float32),
            "representer/points": points.T,
            "representer/cells": model.faces.T.astype(np.int32),
            "version/majorVersion": np.array(0, np.int32),
            "version/minorVersion": np.array(9, np.int32),
        }.items():
            file[name] = values_of
        file.create_group("modelinfo")
        for name, text in {
            "name": "itkStandardMeshRepresenter",
            "datasetType": "POLYGON_MESH",
            "version/majorVersion": "0",
            "version/minorVersion": "9",
        }.items():
            file["representer"].attrs[name] = text
