"""Meshes of other libraries: recognised by their attributes, and made with the imported library."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from isomatch._core.arrays import AnyArray, IntArray
from isomatch._core.errors import MeshError
from isomatch._core.first_use import package
from isomatch.io.appearance import prepare_one_texture, with_texture
from isomatch.io.asset import Asset, Frame
from isomatch.io.attribute import Attribute, Domain, Kind, guess_kind, number_equal_names
from isomatch.io.materials import png_of, texture_of
from isomatch.io.polygons import Polygons, split_at_seams, triangles_of_strips

# names that libraries give to attributes without a name: in lower case, without blanks and a final s
_STANDARD_NAMES = ("normal", "rgb", "rgba", "color", "colour", "texturecoordinate", "uv", "obj:vn")


@dataclass(frozen=True)
class Geometry:
    """The points and polygons of an object, which may also have other cells."""

    points: AnyArray
    polygons: Polygons  # without positions, so that concave ones might be cut wrongly
    rows: IntArray  # (p,) number of each polygon among all cells
    left_out: Mapping[str, int] = field(default_factory=dict)  # number of cells of other kinds, by kind

    @property
    def notes(self) -> tuple[str, ...]:
        """A note on other cells; the vertices of a point cloud do not count."""
        is_cloud = not len(self.polygons)
        counts = {kind: n for kind, n in self.left_out.items() if n and not (is_cloud and kind == "vertex")}
        listed = ", ".join(f"{n} {kind}" for kind, n in counts.items())
        return (f"cells that are no polygons are left out: {listed}",) if listed else ()


def asset_from(given: object, *, sound: bool = True) -> Asset:
    """Make an asset of a mesh of another library, with its attributes, and its texture if it has just one.

    The space comes from texts of ``metadata`` (trimesh), ``field_data`` (PyVista) or ``info`` (meshio),
    such as SPACE: LPS. The mesh is a ``trimesh.Trimesh``, ``pyvista.PolyData``, ``meshio.Mesh``, a
    ``TriangleMesh`` of Open3D, or a ``PointCloud`` of trimesh or Open3D. Unless ``sound``, polygons may
    refer to missing points, which `repair` removes. `MeshError` for anything else, or for cells without
    polygons.
    """
    geometry, attributes = read_geometry(given)
    values = number_equal_names(attributes(given, geometry))
    frame = Frame.of_named(_texts_of(given))
    asset = Asset(geometry.points, geometry.polygons, values, notes=geometry.notes, frame=frame)
    if sound:
        asset.require_points()
    asset, texture = asset.with_note_of_uncut, texture_of(given)
    if texture is None or not asset.of_kind("uv"):
        return asset
    picture, tint = texture
    return with_texture(asset, png_of(picture), tint)


def _texts_of(mesh: object) -> dict[str, str]:
    """Collect the named texts of a mesh."""
    texts = dict[str, str]()
    for place in ("metadata", "field_data", "info"):
        named: Any = getattr(mesh, place, None) or {}
        for name, text in named.items():
            words = [text] if isinstance(text, str) else np.asarray(text).ravel().tolist()[:1]
            texts |= {str(name): word for word in words if isinstance(word, str)}
    units = getattr(mesh, "units", None)  # only trimesh has this property
    return texts | ({"units": units} if isinstance(units, str) else {})


def _triangles(mesh: object, points: Any, faces: Any) -> Geometry:
    array = np.asarray(faces)
    array = array if array.ndim == 2 else array.reshape(-1, 3)
    return Geometry(np.asarray(points), Polygons.of_triangles(array), np.arange(len(array)))


def _polydata(mesh: Any, points: Any, faces: Any) -> Geometry:
    """Read faces stored one after another, each as the number of its corners and the corners."""
    flat = np.asarray(faces, dtype=np.int64)
    if flat.ndim == 2:
        return _triangles(mesh, points, flat)
    corners, sizes = _unpad(flat)
    others = {"vertex": getattr(mesh, "n_verts", 0), "line": getattr(mesh, "n_lines", 0)}
    rows = sum(others.values()) + np.arange(len(sizes))
    strips = _unpad(np.asarray(mesh.strips, dtype=np.int64)) if getattr(mesh, "n_strips", 0) else None
    return polygons_of(points, corners, sizes, rows, others, strips)


def _unpad(flat: IntArray) -> tuple[IntArray, IntArray]:
    """Split faces stored as numbers of corners, each followed by the corners, into corners and numbers."""
    starts = np.arange(0, flat.size, flat[0] + 1) if flat.size else flat
    if flat.size and (flat.size % (flat[0] + 1) or (flat[starts] != flat[0]).any()):
        sizes, starts_found = flat.tolist(), [0]
        while starts_found[-1] + sizes[starts_found[-1]] + 1 < len(sizes):
            starts_found.append(starts_found[-1] + sizes[starts_found[-1]] + 1)
        starts = np.array(starts_found)
    corners = np.ones(flat.size, dtype=bool)
    corners[starts] = False
    return flat[corners], flat[starts]


def _blocks(mesh: Any, points: Any, cells: Any) -> Geometry:
    """Read blocks of cells of one type."""
    start, (corners, sizes, rows) = 0, ([np.zeros(0, dtype=np.int64)] for _ in range(3))
    others: Counter[str] = Counter()
    for block in cells:
        if block.type in ("triangle", "quad", "polygon"):
            data = np.asarray(block.data, dtype=np.int64)
            corners.append(data.ravel())
            sizes.append(np.full(len(data), data.shape[1]))
            rows.append(start + np.arange(len(data)))
        else:
            others[block.type] += len(block.data)
        start += len(block.data)
    return polygons_of(points, np.concatenate(corners), np.concatenate(sizes), np.concatenate(rows), others)


def polygons_of(
    points: AnyArray,
    corners: IntArray,
    sizes: IntArray,
    rows: IntArray,
    others: Mapping[str, int],
    strips: tuple[IntArray, IntArray] | None = None,  # corners and sizes of cells that come after all others
) -> Geometry:
    """Leave out cells with fewer than three corners; `MeshError` if there are only cells such as tetrahedra."""
    if strips:
        triangles, strip = triangles_of_strips(*strips)
        corners, sizes = np.append(corners, triangles), np.append(sizes, np.full(len(triangles), 3))
        rows = np.append(rows, strip + len(rows) + sum(others.values()))
    kept = sizes >= 3
    others = {**others, "of fewer than three corners": int((~kept).sum())}
    if not len(sizes) and {kind for kind, n in others.items() if n} - {"vertex", "line"}:
        kinds = ", ".join(sorted(kind for kind, n in others.items() if n))
        raise MeshError(f"there are no triangles, quads or polygons but {kinds}; extract the surface first")
    polygons = Polygons(corners[np.repeat(kept, sizes)], sizes[kept])
    return Geometry(np.asarray(points), polygons, rows[kept], others)


def _trimesh_attributes(mesh: Any, geometry: Geometry) -> Iterator[Attribute]:
    visual: Any = getattr(mesh, "visual", None)
    kind = getattr(visual, "kind", None)
    if kind == "vertex":
        yield Attribute("color", "point", "colour", visual.vertex_colors)
    elif kind == "face":
        yield Attribute("color", "face", "colour", visual.face_colors)
    elif kind == "texture" and getattr(visual, "uv", None) is not None:
        yield Attribute("uv", "point", "uv", visual.uv)
    yield from attributes_of(getattr(mesh, "vertex_attributes", {}), "point")
    yield from attributes_of(getattr(mesh, "face_attributes", {}), "face")


def _data_attributes(mesh: Any, geometry: Geometry) -> Iterator[Attribute]:
    yield from attributes_of(getattr(mesh, "point_data", {}), "point")
    cells = getattr(mesh, "cell_data", {})
    if _has(mesh, "cells") and not _has(mesh, "faces"):  # a list of values for each block of cells
        cells = {name: np.concatenate(blocks) for name, blocks in cells.items()}
    yield from attributes_of(cells, "face", geometry.rows)


def _open3d_attributes(mesh: Any, geometry: Geometry) -> Iterator[Attribute]:
    places: tuple[tuple[str, str, Domain, Kind], ...] = (
        ("vertex_normals", "normal", "point", "normal"),
        ("vertex_colors", "color", "point", "colour"),
        ("triangle_normals", "normal", "face", "normal"),
        ("triangle_uvs", "uv", "corner", "uv"),
        ("normals", "normal", "point", "normal"),  # point clouds of Open3D have this name and the next
        ("colors", "color", "point", "colour"),
    )
    for source, name, domain, kind in places:
        values = np.asarray(getattr(mesh, source, ()))
        if values.size:
            yield Attribute(name, domain, kind, values)


def attributes_of(
    arrays: Mapping[str, Any], domain: Domain, rows: IntArray | None = None
) -> Iterator[Attribute]:
    """Make attributes of arrays by guessing their kind, without arrays that can be none."""
    return (attribute for _, attribute in named_attributes(arrays, domain, rows))


def named_attributes(
    arrays: Mapping[str, Any], domain: Domain, rows: IntArray | None = None
) -> Iterator[tuple[str, Attribute]]:
    """Make attributes as `attributes_of`, each with the name of its array."""
    for title, values in arrays.items():
        name, array = str(title), np.asarray(values) if rows is None else np.asarray(values)[rows]
        if not is_attribute(array):
            continue
        if array.ndim == 2 and array.shape[1] == 1:
            array = array[:, 0]
        kind = guess_kind(name, array)
        standard = {"normal": "normal", "uv": "uv", "colour": "color"}.get(kind, name)
        is_standard = name.lower().rstrip("s").replace(" ", "") in (*_STANDARD_NAMES, standard)
        yield name, Attribute(standard if is_standard else name, domain, kind, array)


def is_attribute(array: AnyArray) -> bool:
    """Whether an array can be an attribute: numbers in one or more columns, or one text per row."""
    if array.ndim not in (1, 2) or array.dtype.kind not in "biufU":
        return False
    return array.ndim == 1 or array.shape[1] == 1 or (array.dtype.kind != "U" and array.shape[1] > 0)


@dataclass(frozen=True)
class ArrayDocument:
    """The original names of the arrays of attributes, and the arrays that belong to no points or cells."""

    names: Mapping[tuple[str, Domain], str] = field(default_factory=dict)
    fields: Mapping[str, AnyArray] = field(default_factory=dict)


Attributes = Callable[[Any, Geometry], Iterator[Attribute]]  # takes a mesh and its geometry
_LIBRARIES: dict[tuple[str, str], tuple[Callable[[Any, Any, Any], Geometry], Attributes]] = {
    ("vertices", "faces"): (_triangles, _trimesh_attributes),
    ("vertices", "triangles"): (_triangles, _open3d_attributes),
    ("points", "faces"): (_polydata, _data_attributes),
    ("points", "cells"): (_blocks, _data_attributes),
}
"""Functions that read the geometry and the attributes of a mesh of trimesh, Open3D, PyVista and meshio, by the names
of its arrays of points and cells."""

_REMEDIES = ("extract_surface", "to_geometry")  # methods of PyVista and trimesh that return a mesh


def read_geometry(mesh: object) -> tuple[Geometry, Attributes]:
    """Read a mesh of trimesh, PyVista, meshio or Open3D; return also the reader of its attributes."""
    if type(mesh).__name__ == "PointCloud":
        for name in ("vertices", "points"):  # names in trimesh and in Open3D
            if _has(mesh, name):
                none = np.zeros((0, 3), dtype=np.int64)
                return _triangles(mesh, getattr(mesh, name), none), _open3d_attributes
    for names, (geometry, attributes) in _LIBRARIES.items():
        if all(_has(mesh, name) for name in names):
            points, cells = (getattr(mesh, name) for name in names)
            if names[1] != "cells" or all(hasattr(block, "type") for block in cells):
                return geometry(mesh, points, cells), attributes
    remedy = next((f"; its {name}() is one" for name in _REMEDIES if hasattr(mesh, name)), "")
    raise MeshError(
        f"a {type(mesh).__module__}.{type(mesh).__qualname__} is no mesh{remedy}; give a Mesh, the path of a mesh "
        "file, a tuple (vertices, faces), or a mesh of trimesh, PyVista (PolyData), meshio or Open3D (TriangleMesh); "
        "where points will do, PointCloud(points)"
    )


def _has(mesh: object, name: str) -> bool:
    value = getattr(mesh, name, None)
    return value is not None and not callable(value)


def to_trimesh(asset: Asset) -> Any:
    """Make a ``trimesh.Trimesh`` of triangles; points are split where texture coordinates have seams.

    `MissingDependencyError` if the package is not installed, here and of the other conversions.
    """
    trimesh = package("trimesh", "io", "a mesh of trimesh")
    shown, texture = prepare_one_texture(asset)
    split = _split_to_points(shown)
    mesh = trimesh.Trimesh(split.points, split.polygons.triangles, process=False)
    mesh.metadata.update(_space_of(asset))
    of_triangle = split.polygons.of_triangle
    # a mesh of trimesh has no colours if it has texture coordinates
    has_uv = any(uv.domain == "point" for uv in split.of_kind("uv"))
    for attribute in split.attributes:
        of_points = attribute.domain == "point"
        values = attribute.plain if of_points else attribute.plain[of_triangle]
        if attribute.kind == "uv" and of_points:
            material = None
            if texture is not None:
                image = package("PIL.Image", None, "a texture").fromarray(texture)
                # The picture has the tint, so the material is white, not trimesh's dark grey.
                material = trimesh.visual.material.SimpleMaterial(image=image, diffuse=(255, 255, 255))
            mesh.visual = trimesh.visual.TextureVisuals(uv=np.nan_to_num(values[:, :2]), material=material)
        elif attribute.kind == "colour" and not has_uv:
            if values.dtype.kind == "f":
                values = np.nan_to_num(values, nan=attribute.full)  # nan becomes white
            name = "vertex_colors" if of_points else "face_colors"
            setattr(mesh.visual, name, trimesh.visual.to_rgba(values))
        else:
            held = mesh.vertex_attributes if of_points else mesh.face_attributes
            held[attribute.name] = values
    return mesh


def to_pyvista(asset: Asset) -> Any:
    """Make a ``pyvista.PolyData`` with all polygons; points are split where values of corners differ."""
    pyvista = package("pyvista", "vtk", "a mesh of PyVista")
    split = _split_to_points(asset)
    cells = np.insert(split.polygons.corners, split.polygons.starts, split.polygons.sizes)
    mesh = pyvista.PolyData(split.points, cells if len(cells) else None)
    document = asset.document if isinstance(asset.document, ArrayDocument) else ArrayDocument()
    texts = {key: np.array([text]) for key, text in _space_of(asset).items()}
    for name, values in {**document.fields, **texts}.items():
        _set_array(mesh.field_data, name, values)
    taken = {a.name for a in split.attributes if (a.name, a.domain) not in document.names}
    for attribute in split.attributes:
        data = mesh.point_data if attribute.domain == "point" else mesh.cell_data
        if not len(attribute):  # pyvista refuses arrays without rows
            continue
        name = document.names.get((attribute.name, attribute.domain), attribute.name)
        name = attribute.name if name in taken else name
        _set_array(data, name, attribute.values if attribute.values.dtype.kind == "U" else attribute.plain)
        if attribute.kind == "uv" and attribute.domain == "point":
            data.active_texture_coordinates_name = name
        if attribute.kind == "normal":
            data.active_normals_name = name
    return mesh


def _set_array(data: Any, name: str, values: AnyArray) -> None:
    """Add an array to the data of a mesh of PyVista, which itself takes only ASCII texts."""
    if values.dtype.kind != "U":
        data[name] = values
        return
    texts = package("vtkmodules.vtkCommonCore", "vtk", "an array of texts").vtkStringArray()
    texts.SetName(name)
    texts.SetNumberOfComponents(values.shape[1] if values.ndim == 2 else 1)
    for text in values.ravel().tolist():
        texts.InsertNextValue(text.encode(errors="backslashreplace").decode())
    data.VTKObject.AddArray(texts)


def to_meshio(asset: Asset) -> Any:
    """Make a ``meshio.Mesh`` with all polygons; points are split where values of corners differ.

    Consecutive polygons with the same number of corners form a block.
    """
    meshio = package("meshio", "io", "a mesh of meshio")
    split = _split_to_points(asset)
    polygons = split.polygons
    first = np.flatnonzero(np.diff(polygons.sizes, prepend=0))
    corners = np.split(polygons.corners, polygons.starts[first[1:]])
    kinds, sizes = {3: "triangle", 4: "quad"}, polygons.sizes[first].tolist()
    blocks = [(kinds.get(n, "polygon"), cells.reshape(-1, n)) for cells, n in zip(corners, sizes)]
    if not blocks:  # meshio cannot read a file without cells
        blocks = [("vertex", np.arange(len(split.points))[:, None])]
    at_points = {a.name: a.plain for a in split.attributes if a.domain == "point"}
    on_faces = [a for a in split.attributes if a.domain == "face" and len(polygons)]
    of_blocks = {a.name: np.split(a.plain, first[1:]) for a in on_faces}
    return meshio.Mesh(split.points, blocks, point_data=at_points, cell_data=of_blocks, info=_space_of(asset))


def to_open3d(asset: Asset) -> Any:
    """Make an ``open3d.geometry.TriangleMesh`` with its colours, normals and texture coordinates."""
    open3d = package("open3d", None, "a mesh of Open3D")
    shown, texture = prepare_one_texture(asset)
    asset = shown.placed

    def vector(values: AnyArray) -> Any:
        kind = open3d.utility.Vector3dVector if values.shape[1] == 3 else open3d.utility.Vector2dVector
        return kind(np.array(values, dtype=np.float64))  # a writable copy

    polygons = asset.polygons
    index = open3d.utility.Vector3iVector(np.array(polygons.triangles, dtype=np.int32))
    mesh = open3d.geometry.TriangleMesh(vector(asset.points), index)
    for attribute in asset.attributes:
        values = attribute.values
        match attribute.kind, attribute.domain:
            case "normal", "point":
                mesh.vertex_normals = vector(values)
            case "normal", "face":
                mesh.triangle_normals = vector(values[polygons.of_triangle])
            case "colour", "point":
                mesh.vertex_colors = vector(attribute.fractions[:, :3])
            case "uv", "point":
                mesh.triangle_uvs = vector(values[polygons.triangles.ravel(), :2])
            case "uv", "corner":
                mesh.triangle_uvs = vector(values[polygons.corner_of_triangle.ravel(), :2])
    if texture is not None:  # in Open3D, row 0 of a picture is at its bottom
        mesh.textures = [open3d.geometry.Image(np.ascontiguousarray(texture[::-1]))]
        mesh.triangle_material_ids = open3d.utility.IntVector(np.zeros(len(mesh.triangles), dtype=np.int32))
    return mesh


def _space_of(asset: Asset) -> dict[str, str]:
    return asset.frame.named if asset.frame else {}


def _split_to_points(asset: Asset) -> Asset:
    """Move values of corners to points, which are split at seams, and number equal names."""
    asset = asset.placed
    if any(attribute.domain == "corner" for attribute in asset.attributes):
        asset.require_points()
    split = split_at_seams(asset.polygons, len(asset.points), asset.attributes)
    polygons = asset.polygons.between(split.corners)
    return Asset(asset.points[split.source], polygons, number_equal_names(split.attributes))
