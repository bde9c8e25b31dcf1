from isomatch.decimation.decimation import Decimated, decimate, decimations, normalised
from isomatch.decimation.placed import PlacedMesh, VertexGroups
from isomatch.decimation.prolongation import Prolongation

__all__ = ["Decimated", "PlacedMesh", "Prolongation", "VertexGroups", "decimate", "decimations", "normalised"]
