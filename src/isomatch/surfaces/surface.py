"""`Surface`: everything that can be matched."""

from typing import TypeAlias

from isomatch.surfaces.graph import Graph
from isomatch.surfaces.mesh import Mesh
from isomatch.surfaces.point_cloud import PointCloud

Surface: TypeAlias = Mesh | PointCloud | Graph
"""Any of the three: a space with geodesic distances that can be matched."""
