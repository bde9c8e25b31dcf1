from isomatch.surfaces._coincident import first_equal, welded
from isomatch.surfaces._edges import (
    EdgeTable,
    Meetings,
    connected_regions,
    corner_links,
    edge_table,
    fans,
    joined,
    linked,
    meetings,
    root,
)
from isomatch.surfaces._faces import UnsoundFaces, unsound_faces, vertex_normals
from isomatch.surfaces._shared import surface_in_use
from isomatch.surfaces._spatial_order import in_spatial_order
from isomatch.surfaces.closest_point import nearest_on_surface
from isomatch.surfaces.graph import Graph
from isomatch.surfaces.mesh import Mesh
from isomatch.surfaces.point_cloud import PointCloud
from isomatch.surfaces.precise_points import PrecisePoints, nearest_in_triangle
from isomatch.surfaces.raster import Raster, rasterise
from isomatch.surfaces.surface import Surface, reflected

__all__ = [
    "EdgeTable",
    "Graph",
    "Meetings",
    "Mesh",
    "PointCloud",
    "PrecisePoints",
    "Raster",
    "Surface",
    "UnsoundFaces",
    "connected_regions",
    "corner_links",
    "edge_table",
    "fans",
    "first_equal",
    "in_spatial_order",
    "joined",
    "linked",
    "meetings",
    "nearest_in_triangle",
    "nearest_on_surface",
    "rasterise",
    "reflected",
    "root",
    "surface_in_use",
    "unsound_faces",
    "vertex_normals",
    "welded",
]
