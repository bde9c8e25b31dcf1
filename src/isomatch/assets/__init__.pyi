from isomatch.assets.appearance import as_written, looks_of, unread_files, with_looks_of, with_texture
from isomatch.assets.asset import Asset
from isomatch.assets.attribute import Attribute, Domain, Kind
from isomatch.assets.attribute_names import told_apart
from isomatch.assets.files import (
    files_beside,
    read_asset,
    read_mesh,
    read_point_cloud,
    write_asset,
    write_mesh,
)
from isomatch.assets.formats.gltf import with_key_weights_of
from isomatch.assets.formats.gltf_skins import animation_channels, is_posed, with_skin_of
from isomatch.assets.formats.registry import FORMATS, MeshFormat
from isomatch.assets.frame import Frame
from isomatch.assets.from_libraries import asset_from
from isomatch.assets.looks import Layer, Look, Looks, Picture
from isomatch.assets.parts import Part
from isomatch.assets.pictures import pixels_of, png_of, sampled, unread
from isomatch.assets.polygons import Polygons, Renumbering
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
    "Layer",
    "Look",
    "Looks",
    "MeshFormat",
    "Part",
    "Picture",
    "Polygons",
    "Renumbering",
    "SurfaceLike",
    "animation_channels",
    "as_written",
    "asset_from",
    "files_beside",
    "holds_values",
    "is_posed",
    "looks_of",
    "mesh_from",
    "pixels_of",
    "png_of",
    "read_asset",
    "read_attributes",
    "read_mesh",
    "read_point_cloud",
    "sampled",
    "surface_from",
    "to_meshio",
    "to_open3d",
    "to_pyvista",
    "to_trimesh",
    "told_apart",
    "unread",
    "unread_files",
    "with_key_weights_of",
    "with_looks_of",
    "with_skin_of",
    "with_texture",
    "write_asset",
    "write_attribute",
    "write_attributes",
    "write_mesh",
]
