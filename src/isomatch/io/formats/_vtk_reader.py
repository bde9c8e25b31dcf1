"""The process that reads one VTK file, and writes its arrays to standard output, or an error.

It imports little, because it starts anew for each file.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from vtkmodules import vtkCommonCore, vtkCommonDataModel, vtkIOLegacy, vtkIOXML
from vtkmodules.util.numpy_support import vtk_to_numpy

from isomatch._core.arrays import AnyArray, IntArray

_READERS: dict[str, Any] = {  # reader of VTK for each suffix
    ".vtk": vtkIOLegacy.vtkGenericDataObjectReader,
    ".vtp": vtkIOXML.vtkXMLPolyDataReader,
    ".vtu": vtkIOXML.vtkXMLUnstructuredGridReader,
}
_VERTEX, _LINE, _TRIANGLE, _STRIP, _POLYGON, _QUAD = 1, 3, 5, 6, 7, 9  # codes of VTK for types of cells


def _main(path: Path, room: int) -> None:
    """Write the contents of a file, or exit with an error."""
    try:
        _limit_memory(room)
        file = BytesIO()
        np.savez(file, **_arrays(path))  # type: ignore[arg-type]
        sys.stdout.buffer.write(file.getvalue())
    except MemoryError:
        raise SystemExit(1) from None
    except Exception as error:
        raise SystemExit(f"{type(error).__name__}: {error}".partition("\n")[0]) from None


def _arrays(path: Path) -> dict[str, object]:
    messages = vtkCommonCore.vtkStringOutputWindow()
    vtkCommonCore.vtkOutputWindow.SetInstance(messages)
    reader = _READERS[path.suffix]()
    reader.SetFileName(str(path))
    reader.Update()
    problems = [problem for array in messages.GetOutput().split("\n\n") if (problem := _problem(array))]
    if problems:
        raise ValueError(problems[0])
    data = reader.GetOutput()
    if not isinstance(data, vtkCommonDataModel.vtkPolyData | vtkCommonDataModel.vtkUnstructuredGrid):
        raise ValueError(f"it holds a {type(data).__name__.removeprefix('vtk') or 'nothing'}")
    types, lists = _cells(data)
    corners = np.concatenate([_values(array.GetConnectivityArray()) for array in lists])
    sizes = np.concatenate([np.diff(_values(array.GetOffsetsArray())) for array in lists])
    if len(sizes) != len(types) or (sizes < 0).any() or sizes.sum() != len(corners):
        raise ValueError("its cells do not fit their declared number")
    is_polygon = np.isin(types, (_TRIANGLE, _POLYGON, _QUAD))
    # strips are read only from vtkPolyData, where they are the last cells
    is_strip = (types == _STRIP) & isinstance(data, vtkCommonDataModel.vtkPolyData)
    others, counts = np.unique(types[~is_polygon & ~is_strip], return_counts=True)
    names = [vtkCommonDataModel.vtkCellTypes.GetClassNameFromTypeId(int(kind)) for kind in others]
    points, held = data.GetPoints(), data.GetFieldData()
    fields = {array.GetName(): array for array in map(held.GetAbstractArray, range(held.GetNumberOfArrays()))}
    named_texts = [(name, array) for name, array in fields.items() if array.IsA("vtkStringArray")]
    texts = {name: "\n".join(_values(array).ravel()) for name, array in named_texts}
    return {
        "points": _values(points.GetData()) if points else np.zeros((0, 3)),
        "corners": corners[np.repeat(is_polygon, sizes)],
        "sizes": sizes[is_polygon],
        "rows": np.flatnonzero(is_polygon),
        "others": np.array([name.removeprefix("vtk").lower() for name in names], dtype=str),
        "counts": counts,
        "is_polygons": isinstance(data, vtkCommonDataModel.vtkPolyData),
        "strip_corners": corners[np.repeat(is_strip, sizes)],
        "strip_sizes": sizes[is_strip],
        "text_names": np.array(list(texts), dtype=str),
        "texts": np.array(list(texts.values()), dtype=str),
        **_numbered("point", data.GetPointData()),
        **_numbered("cell", data.GetCellData()),
        **_numbered("field", held),
    }


def _cells(data: Any) -> tuple[IntArray, list[Any]]:
    """Return the type of each cell, and the lists of their points."""
    if isinstance(data, vtkCommonDataModel.vtkUnstructuredGrid):
        types = _values(data.GetCellTypesArray()) if data.GetNumberOfCells() else np.zeros(0, int)
        return types, [data.GetCells()]
    lists = [data.GetVerts(), data.GetLines(), data.GetPolys(), data.GetStrips()]
    return np.repeat([_VERTEX, _LINE, _POLYGON, _STRIP], [cells.GetNumberOfCells() for cells in lists]), lists


def _problem(message: str) -> str:
    """Return the text of an error of VTK, nothing for a warning or for a range of nan."""
    head, _, text = message.strip().partition("\n")
    if "WARNING" in head.upper() or "InformationKey" in message:
        return ""
    return " ".join(re.sub(r"^\w+ \(\w+\): ", "", text).split()) or head


def _values(array: Any) -> AnyArray:
    if array.IsA("vtkStringArray"):
        texts = np.array([array.GetValue(i) for i in range(array.GetNumberOfValues())], dtype=str)
        return texts if array.GetNumberOfComponents() == 1 else texts.reshape(array.GetNumberOfTuples(), -1)
    if not array.IsA("vtkDataArray"):  # such as an array of variants, which is left out
        return np.zeros((array.GetNumberOfTuples(), 0))
    return np.asarray(vtk_to_numpy(array))


def _numbered(domain: str, held: Any) -> Mapping[str, object]:
    """Name arrays by numbers, because their own names may contain anything."""
    arrays = [held.GetAbstractArray(i) for i in range(held.GetNumberOfArrays())]
    names = [array.GetName() or f"Unnamed_{i}" for i, array in enumerate(arrays)]
    values = {f"{domain}_{i}": _values(array) for i, array in enumerate(arrays)}
    return {f"{domain}_names": np.array(names, dtype=str), **values}


def _limit_memory(room: int) -> None:
    """Let this process take only ``room`` bytes more, if the system can limit memory."""
    try:
        import resource

        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
    except (ImportError, OSError):
        return
    most = pages * resource.getpagesize() + room
    resource.setrlimit(resource.RLIMIT_AS, (most, most))


if __name__ == "__main__":
    _main(Path(sys.argv[1]), int(sys.argv[2]))
