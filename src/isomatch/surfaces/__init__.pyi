from isomatch.surfaces._coincident import first_equal, welded
from isomatch.surfaces._content_hash import surface_in_use
from isomatch.surfaces._edges import EdgeTable
from isomatch.surfaces.attribute import Attribute, Domain, Kind
from isomatch.surfaces.caps import capped
from isomatch.surfaces.carrying import Transfer
from isomatch.surfaces.check import check
from isomatch.surfaces.contents import Contents, Part
from isomatch.surfaces.decimation import Decimated, decimate, normalised
from isomatch.surfaces.given import SurfaceLike, mesh_from, surface_from
from isomatch.surfaces.graph import Graph
from isomatch.surfaces.io import (
    FORMATS,
    MeshFormat,
    base_colours,
    read_attributes,
    read_contents,
    read_mesh,
    read_point_cloud,
    with_materials_of,
    with_skin_of,
    with_texture,
    write_attribute,
    write_contents,
    write_mesh,
)
from isomatch.surfaces.library_meshes import to_meshio, to_open3d, to_pyvista, to_trimesh
from isomatch.surfaces.mesh import Mesh, vertex_normals
from isomatch.surfaces.objects import contents_of
from isomatch.surfaces.picture import picture
from isomatch.surfaces.placed import PlacedMesh, VertexGroups
from isomatch.surfaces.point_cloud import PointCloud
from isomatch.surfaces.polygons import Polygons
from isomatch.surfaces.precise_points import PrecisePoints, nearest_in_triangle
from isomatch.surfaces.raster import Raster, rasterise
from isomatch.surfaces.repair import Repair, repair
from isomatch.surfaces.report import MeshReport
from isomatch.surfaces.sheets import Separation, separate_sheets
from isomatch.surfaces.surface import Surface

__all__ = [
    "FORMATS",
    "Attribute",
    "Contents",
    "Decimated",
    "Domain",
    "EdgeTable",
    "Graph",
    "Kind",
    "Mesh",
    "MeshFormat",
    "MeshReport",
    "Part",
    "PlacedMesh",
    "PointCloud",
    "Polygons",
    "PrecisePoints",
    "Raster",
    "Repair",
    "Separation",
    "Surface",
    "SurfaceLike",
    "Transfer",
    "VertexGroups",
    "base_colours",
    "capped",
    "check",
    "contents_of",
    "decimate",
    "first_equal",
    "mesh_from",
    "nearest_in_triangle",
    "normalised",
    "picture",
    "rasterise",
    "read_attributes",
    "read_contents",
    "read_mesh",
    "read_point_cloud",
    "repair",
    "separate_sheets",
    "surface_from",
    "surface_in_use",
    "to_meshio",
    "to_open3d",
    "to_pyvista",
    "to_trimesh",
    "vertex_normals",
    "welded",
    "with_materials_of",
    "with_skin_of",
    "with_texture",
    "write_attribute",
    "write_contents",
    "write_mesh",
]
