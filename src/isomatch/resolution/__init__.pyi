from isomatch.resolution.decimation import Decimated, decimate, decimations, normalised
from isomatch.resolution.placed import PlacedMesh, VertexGroups
from isomatch.resolution.prolongation import Prolongation

__all__ = ["Decimated", "PlacedMesh", "Prolongation", "VertexGroups", "decimate", "decimations", "normalised"]
