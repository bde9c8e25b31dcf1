"""VTK: legacy files, and XML files of polygons (VTP) and of unstructured grids (VTU), by VTK and meshio."""

from __future__ import annotations

import re

from isomatch.assets.asset import Asset
from isomatch.assets.attribute import Attribute
from isomatch.assets.formats._reading import damaged, on_disk, reading
from isomatch.assets.formats._vtk_legacy import require_complete
from isomatch.assets.formats._vtk_process import grid_of, polygons_of
from isomatch.assets.from_libraries import held_by
from isomatch.assets.to_libraries import to_meshio, to_pyvista
from isomatch.errors import MeshError
from isomatch.loading.first_use import package

_LEGACY_HEADER = 1024  # bytes, in which the kind of the data set is told


def read_vtk(data: bytes, name: str) -> Asset:
    """Read a legacy file: polygons by VTK, unstructured grids by meshio."""
    require_complete(data, name)
    is_polygons = b"POLYDATA" in data[:_LEGACY_HEADER].upper()
    return _by_vtk(data, name, ".vtk") if is_polygons else _by_meshio(data, name, ".vtk")


def read_vtp(data: bytes, name: str) -> Asset:
    """Read an XML file of polygons."""
    if b"</VTKFile" not in data:
        raise damaged(name, "a .vtp file of polygons", "it has no end, and is cut short")
    return _by_vtk(data, name, ".vtp")


def read_vtu(data: bytes, name: str) -> Asset:
    """Read an XML file of an unstructured grid."""
    return _by_meshio(data, name, ".vtu")


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


def _by_vtk(data: bytes, name: str, suffix: str) -> Asset:
    found = polygons_of(data, name, suffix)
    if suffix == ".vtp" and found.n_polys != (declared := _declared_polygons(data)):
        raise damaged(name, "a .vtp file of polygons", f"{found.n_polys} polygons, {declared} declared")
    with reading(name, f"a {suffix} file of polygons"):
        return held_by(found)


def _declared_polygons(data: bytes) -> int:
    """Return the number of polygons of all pieces of an XML file."""
    counts = re.findall(rb"""\sNumberOfPolys\s*=\s*["'](\d+)""", data.partition(b"<AppendedData")[0])
    return sum(map(int, counts))


def _by_meshio(data: bytes, name: str, suffix: str) -> Asset:
    found = grid_of(data, name, suffix)
    with reading(name, f"a {suffix} file of triangles, quads or polygons"):
        return held_by(found)
