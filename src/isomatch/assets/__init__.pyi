from isomatch.assets.asset import Asset
from isomatch.assets.attribute import Attribute, Domain, Kind
from isomatch.assets.contents import Contents, Part
from isomatch.assets.files import read_asset, write_asset
from isomatch.assets.formats._by_suffix import (
    FORMATS,
    MeshFormat,
    read_contents,
    read_mesh,
    read_point_cloud,
    write_contents,
    write_mesh,
)
from isomatch.assets.formats.gltf_looks import base_colours, with_materials_of, with_skin_of, with_texture
from isomatch.assets.formats.values import read_attributes, write_attribute
from isomatch.assets.given import SurfaceLike, mesh_from, surface_from
from isomatch.assets.library_meshes import to_meshio, to_open3d, to_pyvista, to_trimesh
from isomatch.assets.objects import contents_of
from isomatch.assets.polygons import Polygons

__all__ = [
    "FORMATS",
    "Asset",
    "Attribute",
    "Contents",
    "Domain",
    "Kind",
    "MeshFormat",
    "Part",
    "Polygons",
    "SurfaceLike",
    "base_colours",
    "contents_of",
    "mesh_from",
    "read_asset",
    "read_attributes",
    "read_contents",
    "read_mesh",
    "read_point_cloud",
    "surface_from",
    "to_meshio",
    "to_open3d",
    "to_pyvista",
    "to_trimesh",
    "with_materials_of",
    "with_skin_of",
    "with_texture",
    "write_asset",
    "write_attribute",
    "write_contents",
    "write_mesh",
]
