"""VTK: legacy files, and XML files of polygons (VTP) and of unstructured grids (VTU), by PyVista and meshio."""

from __future__ import annotations

from isomatch._packages import package
from isomatch.assets.attribute import Attribute
from isomatch.assets.contents import Contents
from isomatch.assets.formats._reading import on_disk, reading
from isomatch.assets.library_meshes import to_meshio, to_pyvista
from isomatch.assets.objects import contents_of

_LEGACY_HEADER = 1024  # bytes, in which the kind of the data set is told


def read_vtk(data: bytes, name: str) -> Contents:
    """Read a legacy file: polygons by PyVista, unstructured grids by meshio."""
    is_polygons = b"POLYDATA" in data[:_LEGACY_HEADER].upper()
    return _by_pyvista(data, name, ".vtk") if is_polygons else _by_meshio(data, name, "vtk")


def read_vtp(data: bytes, name: str) -> Contents:
    """Read an XML file of polygons."""
    return _by_pyvista(data, name, ".vtp")


def read_vtu(data: bytes, name: str) -> Contents:
    """Read an XML file of an unstructured grid."""
    return _by_meshio(data, name, "vtu")


def keeps(attribute: Attribute) -> bool:
    """Whether these formats have a place for an attribute: any array of numbers on points or faces."""
    return attribute.domain != "corner"


def write_vtp(contents: Contents, binary: bool = True) -> bytes:
    """Write an XML file of polygons."""
    return _saved(contents, ".vtp", binary)


def write_vtk(contents: Contents, binary: bool = True) -> bytes:
    """Write a legacy file of polygons."""
    return _saved(contents, ".vtk", binary)


def write_vtu(contents: Contents, binary: bool = True) -> bytes:
    """Write an XML file of an unstructured grid."""
    mesh = to_meshio(contents)
    with on_disk(b"", ".vtu") as path:
        package("meshio.vtu", "io", "a .vtu file").write(path, mesh, binary=binary)
        return path.read_bytes()


def _saved(contents: Contents, suffix: str, binary: bool) -> bytes:
    mesh = to_pyvista(contents)
    with on_disk(b"", suffix) as path:
        mesh.save(path, binary=binary)
        return path.read_bytes()


def _by_pyvista(data: bytes, name: str, suffix: str) -> Contents:
    pyvista = package("pyvista", "vtk", f"a {suffix} file of polygons")
    with reading(name, f"a {suffix} file of polygons"), on_disk(data, suffix) as path:
        with pyvista.vtk_verbosity("off"), pyvista.VtkErrorCatcher(raise_errors=True, send_to_logging=False):
            mesh = pyvista.read(path)
        return contents_of(mesh)


def _by_meshio(data: bytes, name: str, kind: str) -> Contents:
    module = package(f"meshio.{kind}", "io", f"a .{kind} file")
    with (
        reading(name, f"a .{kind} file of triangles, quads or polygons"),
        on_disk(data, f".{kind}") as path,
    ):
        return contents_of(module.read(path))
