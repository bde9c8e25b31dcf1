from isomatch.statistics.asymmetry import Asymmetry, asymmetry
from isomatch.statistics.charts import (
    PictureFormat,
    draw_embedding,
    draw_quality,
    draw_regression,
    draw_scores,
    draw_tree,
)
from isomatch.statistics.completion import Completion, complete
from isomatch.statistics.doubts import Doubt, doubtful_positions, doubtful_shapes
from isomatch.statistics.exports import write_shapeworks, write_statismo
from isomatch.statistics.group_test import GroupTest, group_test
from isomatch.statistics.left_right import left_right_map, left_right_of_shapes
from isomatch.statistics.missing import filled, measured_variances
from isomatch.statistics.model_quality import ModelCurve, compactness, generalisation, specificity
from isomatch.statistics.observations import (
    Observations,
    model_noise,
    observed_landmarks,
    observed_part,
    observed_vertices,
    read_observations,
)
from isomatch.statistics.pictures import draw_modes, draw_values
from isomatch.statistics.procrustes import (
    ProcrustesAlignment,
    generalised_procrustes,
    procrustes_distances,
)
from isomatch.statistics.regression import ShapeRegression, shape_regression
from isomatch.statistics.shape_distances import classical_scaling, geodesic_distortions, shape_tree
from isomatch.statistics.shape_model import ScoredShape, ShapeModel
from isomatch.statistics.shapes import MEASURED, CorrespondedShapes, read_measured, read_shapes
from isomatch.statistics.sizes import centroid_sizes
from isomatch.statistics.units import METRES, likely_units, size_factors, told_factor

__all__ = [
    "MEASURED",
    "METRES",
    "Asymmetry",
    "Completion",
    "CorrespondedShapes",
    "Doubt",
    "GroupTest",
    "ModelCurve",
    "Observations",
    "PictureFormat",
    "ProcrustesAlignment",
    "ScoredShape",
    "ShapeModel",
    "ShapeRegression",
    "asymmetry",
    "centroid_sizes",
    "classical_scaling",
    "compactness",
    "complete",
    "doubtful_positions",
    "doubtful_shapes",
    "draw_embedding",
    "draw_modes",
    "draw_quality",
    "draw_regression",
    "draw_scores",
    "draw_tree",
    "draw_values",
    "filled",
    "generalisation",
    "generalised_procrustes",
    "geodesic_distortions",
    "group_test",
    "left_right_map",
    "left_right_of_shapes",
    "likely_units",
    "measured_variances",
    "model_noise",
    "observed_landmarks",
    "observed_part",
    "observed_vertices",
    "procrustes_distances",
    "read_measured",
    "read_observations",
    "read_shapes",
    "shape_regression",
    "shape_tree",
    "size_factors",
    "specificity",
    "told_factor",
    "write_shapeworks",
    "write_statismo",
]
