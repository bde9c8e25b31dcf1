from isomatch.assets.appearance import as_written, looks_of, unread_files, with_looks_of, with_texture
from isomatch.assets.asset import TURN, Asset, Axes, Frame, Part
from isomatch.assets.attribute import Attribute, Domain, Kind, told_apart
from isomatch.assets.files import (
    SurfaceLike,
    files_beside,
    mesh_from,
    read_asset,
    read_mesh,
    read_point_cloud,
    surface_from,
    write_asset,
    write_mesh,
)
from isomatch.assets.formats.gltf import with_key_weights_of
from isomatch.assets.formats.gltf_carried import animation_channels, is_posed, with_skin_of
from isomatch.assets.formats.registry import FORMATS, MeshFormat
from isomatch.assets.libraries import asset_from, to_meshio, to_open3d, to_pyvista, to_trimesh
from isomatch.assets.materials import Layer, Look, Looks, Picture, pixels_of, png_of, sampled, unread
from isomatch.assets.polygons import Polygons, Renumbering
from isomatch.assets.values import holds_values, read_attributes, write_attribute, write_attributes

__all__ = [
    "FORMATS",
    "TURN",
    "Asset",
    "Attribute",
    "Axes",
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
