"""What is matched: the mesh, its files, its defects and their repair."""

from isomatch.surfaces.io import read_mesh, write_mesh
from isomatch.surfaces.mesh import Mesh

__all__ = ["Mesh", "read_mesh", "write_mesh"]
