"""What is matched: the mesh, its files, its defects and their repair."""

from isomatch.surfaces.check import check
from isomatch.surfaces.io import read_mesh, write_mesh
from isomatch.surfaces.mesh import Mesh
from isomatch.surfaces.repair import Repair, repair
from isomatch.surfaces.report import MeshReport

__all__ = ["Mesh", "MeshReport", "Repair", "check", "read_mesh", "repair", "write_mesh"]
