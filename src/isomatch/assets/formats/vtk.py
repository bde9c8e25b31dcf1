"""VTK: legacy files, and XML files of polygons (VTP) and of unstructured grids (VTU), by PyVista and meshio."""

from __future__ import annotations

import re

from isomatch.assets.asset import Asset
from isomatch.assets.attribute import Attribute
from isomatch.assets.formats._reading import on_disk, reading
from isomatch.assets.formats._vtk_legacy import require_complete
from isomatch.assets.from_libraries import held_by
from isomatch.assets.to_libraries import to_meshio, to_pyvista
from isomatch.errors import FormatError, MeshError
from isomatch.loading.packages import package

_LEGACY_HEADER = 1024  # bytes, in which the kind of the data set is told


def read_vtk(data: bytes, name: str) -> Asset:
    """Read a legacy file: polygons by PyVista, unstructured grids by meshio."""
    require_complete(data, name)
    is_polygons = b"POLYDATA" in data[:_LEGACY_HEADER].upper()
    return _by_pyvista(data, name, ".vtk") if is_polygons else _by_meshio(data, name, "vtk")


def read_vtp(data: bytes, name: str) -> Asset:
    """Read an XML file of polygons."""
    return _by_pyvista(data, name, ".vtp")


def read_vtu(data: bytes, name: str) -> Asset:
    """Read an XML file of an unstructured grid."""
    return _by_meshio(data, name, "vtu")


def keeps(attribute: Attribute) -> bool:
    """Whether these formats have a place for an attribute: any array of numbers on points or faces."""
    return attribute.domain != "corner"


def write_vtp(asset: Asset, binary: bool = True) -> bytes:
    """Write an XML file of polygons."""
    return _saved(asset, ".vtp", binary)


def write_vtk(asset: Asset, binary: bool = True) -> bytes:
    """Write a legacy file of polygons."""
    return _saved(asset, ".vtk", binary)


def write_vtu(asset: Asset, binary: bool = True) -> bytes:
    """Write an XML file of an unstructured grid."""
    if not len(asset.points):
        raise MeshError("there are no points, and a VTU file without any cannot be read; write a .vtp file")
    mesh = to_meshio(asset)
    with on_disk(b"", ".vtu") as path:
        package("meshio.vtu", "io", "a .vtu file").write(path, mesh, binary=binary)
        return path.read_bytes()


def _saved(asset: Asset, suffix: str, binary: bool) -> bytes:
    mesh = to_pyvista(asset)
    with on_disk(b"", suffix) as path:
        mesh.save(path, binary=binary)
        return path.read_bytes()


def _by_pyvista(data: bytes, name: str, suffix: str) -> Asset:
    what = f"a {suffix} file of polygons"
    pyvista = package("pyvista", "vtk", what)
    with reading(name, what), on_disk(data, suffix) as path:
        with pyvista.vtk_verbosity("off"), pyvista.VtkErrorCatcher(send_to_logging=False) as caught:
            reader = pyvista.get_reader(path).reader
            reader.Update()  # pyvista.read only warns of errors
            mesh = pyvista.wrap(reader.GetOutput())
        # ranges of values that are nan cannot be read, and are of no use
        problems = [
            event.alert
            for event in caught.events
            if event.kind.upper() != "WARNING" and "InformationKey" not in event.alert
        ]
        found = mesh.GetNumberOfPolys()
        if suffix == ".vtp" and found != (declared := _declared_polygons(data)):
            problems.append(f"{found} polygons, {declared} declared")
        if problems:
            raise FormatError(
                f"{name}: expected {what}, found damaged contents ({problems[0]}); copy or export it again"
            )
        return held_by(mesh)


def _declared_polygons(data: bytes) -> int:
    """Return the number of polygons of all pieces of an XML file."""
    counts = re.findall(rb"""\sNumberOfPolys\s*=\s*["'](\d+)""", data.partition(b"<AppendedData")[0])
    return sum(map(int, counts))


def _by_meshio(data: bytes, name: str, kind: str) -> Asset:
    module = package(f"meshio.{kind}", "io", f"a .{kind} file")
    with (
        reading(name, f"a .{kind} file of triangles, quads or polygons"),
        on_disk(data, f".{kind}") as path,
    ):
        return held_by(module.read(path))
