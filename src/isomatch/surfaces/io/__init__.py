"""Mesh files: one module per format, each turning bytes into a mesh and a mesh into bytes."""

from isomatch.surfaces.io._by_suffix import FORMATS, MeshFormat, read_mesh, read_point_cloud, write_mesh

__all__ = ["FORMATS", "MeshFormat", "read_mesh", "read_point_cloud", "write_mesh"]
