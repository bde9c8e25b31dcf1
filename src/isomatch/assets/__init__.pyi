from isomatch.assets.asset import Asset
from isomatch.assets.attribute import Attribute, Domain, Kind
from isomatch.assets.attribute_names import told_apart
from isomatch.assets.files import read_asset, read_mesh, read_point_cloud, write_asset, write_mesh
from isomatch.assets.formats.gltf_looks import base_colours, with_materials_of, with_skin_of, with_texture
from isomatch.assets.formats.registry import FORMATS, MeshFormat
from isomatch.assets.frame import Frame
from isomatch.assets.from_libraries import asset_from
from isomatch.assets.parts import Part
from isomatch.assets.pictures import pixels_of, png_of
from isomatch.assets.polygons import Polygons
from isomatch.assets.renumbering import Renumbering
from isomatch.assets.surface_from import SurfaceLike, mesh_from, surface_from
from isomatch.assets.to_libraries import to_meshio, to_open3d, to_pyvista, to_trimesh
from isomatch.assets.values import holds_values, read_attributes, write_attribute, write_attributes

__all__ = [
    "FORMATS",
    "Asset",
    "Attribute",
    "Domain",
    "Frame",
    "Kind",
    "MeshFormat",
    "Part",
    "Polygons",
    "Renumbering",
    "SurfaceLike",
    "asset_from",
    "base_colours",
    "holds_values",
    "mesh_from",
    "pixels_of",
    "png_of",
    "read_asset",
    "read_attributes",
    "read_mesh",
    "read_point_cloud",
    "surface_from",
    "to_meshio",
    "to_open3d",
    "to_pyvista",
    "to_trimesh",
    "told_apart",
    "with_materials_of",
    "with_skin_of",
    "with_texture",
    "write_asset",
    "write_attribute",
    "write_attributes",
    "write_mesh",
]
