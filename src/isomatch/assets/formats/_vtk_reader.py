"""The process that reads one VTK file: arrays that VTK or meshio find go into a file, or what is wrong.

It imports little, as it is started anew for each file.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from isomatch.loading.first_use import package
from isomatch.values.arrays import AnyArray

ARRAYS, PROBLEM = "arrays.npz", "problem.txt"
"""Files that it leaves beside the one that it reads."""
DISK = 74
"""Exit code, that of sysexits for input and output, where they cannot be written."""
ENDED = "the reader came to an end over it, as where more is declared than the file holds"


def _main(reader: str, path: Path, room: int) -> None:
    """Read a file; write beside it the arrays that it holds, or what is wrong with it."""
    try:
        arrays = (_by_vtk if reader == "vtk" else _by_meshio)(path, room)
        with _disk():
            np.savez(path.with_name(ARRAYS), **arrays)  # type: ignore[arg-type]
    except MemoryError:
        problem = ENDED
    except Exception as error:
        problem = f"{type(error).__name__}: {error}".partition("\n")[0]
    else:
        return
    with _disk():
        path.with_name(PROBLEM).write_text(problem, encoding="utf-8")


@contextmanager
def _disk() -> Iterator[None]:
    """End the process where something cannot be written: that is no fault of the file that is read."""
    try:
        yield
    except OSError:
        raise SystemExit(DISK) from None


def _by_vtk(path: Path, room: int) -> dict[str, object]:
    is_xml = path.suffix == ".vtp"
    readers = package(f"vtkmodules.vtkIO{'XML' if is_xml else 'Legacy'}", "vtk", "a VTK file")
    core = package("vtkmodules.vtkCommonCore", "vtk", "a VTK file")
    package("vtkmodules.util.numpy_support", "vtk", "a VTK file")
    _limit_memory(room)
    told = core.vtkStringOutputWindow()
    core.vtkOutputWindow.SetInstance(told)
    reader = readers.vtkXMLPolyDataReader() if is_xml else readers.vtkPolyDataReader()
    reader.SetFileName(str(path))
    reader.Update()
    problems = [problem for each in told.GetOutput().split("\n\n") if (problem := _problem(each))]
    if problems:
        raise ValueError(problems[0])
    found = reader.GetOutput()
    points = found.GetPoints()
    return {
        "points": _values(points.GetData()) if points else np.zeros((0, 3)),
        "faces": _values(found.GetPolys().GetData()),
        **{
            f"n_{kind.lower()}": getattr(found, f"GetNumberOf{kind}")()
            for kind in ("Verts", "Lines", "Strips", "Polys")
        },
        **_numbered("point", _held(found.GetPointData())),
        **_numbered("cell", _held(found.GetCellData())),
    }


def _problem(message: str) -> str:
    """Return what an error of VTK says, nothing for a warning; ranges of nan cannot be read and are of no use."""
    head, _, text = message.strip().partition("\n")
    if "WARNING" in head.upper() or "InformationKey" in message:
        return ""
    return " ".join(re.sub(r"^\w+ \(\w+\): ", "", text).split()) or head


def _held(held: Any) -> dict[str, AnyArray]:
    arrays = [held.GetAbstractArray(i) for i in range(held.GetNumberOfArrays())]
    return {array.GetName() or f"Unnamed_{i}": _values(array) for i, array in enumerate(arrays)}


def _values(array: Any) -> AnyArray:
    if array.IsA("vtkStringArray"):
        return np.array([array.GetValue(i) for i in range(array.GetNumberOfValues())], dtype=str)
    support = package("vtkmodules.util.numpy_support", "vtk", "a VTK file")
    return np.asarray(support.vtk_to_numpy(array))


def _by_meshio(path: Path, room: int) -> dict[str, object]:
    module = package(f"meshio.{path.suffix[1:]}", "io", "a VTK file")
    _limit_memory(room)
    mesh = module.read(path)
    blocks = [(block.type, np.asarray(block.data)) for block in mesh.cells]
    cells = [np.zeros((len(each), 0)) if each.dtype.hasobject else each for _, each in blocks]  # polyhedra
    of_cells = {name: np.concatenate(values) for name, values in mesh.cell_data.items()}
    return {
        "points": mesh.points,
        "types": np.array([kind for kind, _ in blocks], dtype=str),
        **{f"cells_{i}": each for i, each in enumerate(cells)},
        **_numbered("point", mesh.point_data),
        **_numbered("cell", of_cells),
    }


def _numbered(domain: str, arrays: Mapping[str, AnyArray]) -> dict[str, object]:
    """Name arrays by numbers, as their own names may be anything; those that hold no numbers or words are left out."""
    kept = {name: array for name, array in arrays.items() if array.dtype.kind in "biufU"}
    return {
        f"{domain}_names": np.array([*kept], dtype=str),
        **{f"{domain}_{i}": array for i, array in enumerate(kept.values())},
    }


def _limit_memory(room: int) -> None:
    """Let this process take so many bytes more, where the system limits them and tells what is taken."""
    try:
        import resource

        pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
    except (ImportError, OSError):
        return
    most = pages * resource.getpagesize() + room
    resource.setrlimit(resource.RLIMIT_AS, (most, most))


if __name__ == "__main__":
    _main(sys.argv[1], Path(sys.argv[2]), int(sys.argv[3]))
