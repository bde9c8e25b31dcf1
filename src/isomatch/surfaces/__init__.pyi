from isomatch.surfaces._coincident import first_equal, weld_points
from isomatch.surfaces._edges import (
    EdgeTable,
    Meetings,
    connected_regions,
    corner_links,
    count_fans,
    edge_table,
    find_root,
    join_trees,
    label_components,
    meetings,
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
    "count_fans",
    "edge_table",
    "find_root",
    "first_equal",
    "in_spatial_order",
    "join_trees",
    "label_components",
    "meetings",
    "nearest_in_triangle",
    "nearest_on_surface",
    "rasterise",
    "reflected",
    "surface_in_use",
    "unsound_faces",
    "vertex_normals",
    "weld_points",
]
