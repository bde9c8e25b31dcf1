from isomatch.shapes.body import body_of
from isomatch.shapes.prepare import prepare
from isomatch.shapes.prepared_shape import N_BALLS, PreparedShape
from isomatch.shapes.smooth_shape import CURVATURE_WEIGHT, WAVE_WEIGHT, SmoothShape, orientation_of
from isomatch.shapes.symmetries import EXACTLY, SAME_SYMMETRY, Symmetry, describe_symmetries, farthest_rows
from isomatch.shapes.variants import (
    capped_shape,
    components_of,
    creased_shape,
    cut_shape,
    mirror_image,
    opened_shape,
    region_of,
    turned_over,
)

__all__ = [
    "CURVATURE_WEIGHT",
    "EXACTLY",
    "N_BALLS",
    "SAME_SYMMETRY",
    "WAVE_WEIGHT",
    "PreparedShape",
    "SmoothShape",
    "Symmetry",
    "body_of",
    "capped_shape",
    "components_of",
    "creased_shape",
    "cut_shape",
    "describe_symmetries",
    "farthest_rows",
    "mirror_image",
    "opened_shape",
    "orientation_of",
    "prepare",
    "region_of",
    "turned_over",
]
