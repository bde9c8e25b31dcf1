"""Mesh files: one module for each format, with a function that reads bytes and one that writes them."""

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

__all__ = [
    "FORMATS",
    "MeshFormat",
    "base_colours",
    "read_attributes",
    "read_contents",
    "read_mesh",
    "read_point_cloud",
    "with_materials_of",
    "with_skin_of",
    "with_texture",
    "write_attribute",
    "write_contents",
    "write_mesh",
]
