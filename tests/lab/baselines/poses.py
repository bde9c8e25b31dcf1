"""Two poses with a known map, landmarks on it, and the error of a map: what the baselines are tested with."""

from functools import cache

import numpy as np

from isomatch import geodesic_distances, prepare
from isomatch.datasets import ground_truth
from isomatch_lab.procedural import creature
from shapes import disguised


@cache
def two_poses():
    """A creature and another pose of it in disguise, prepared, and the truth between them."""
    source, target = creature(1500), creature(1500, pose=1)
    other = disguised(target.mesh, seed=1)
    return prepare(source.mesh), prepare(other.mesh), other.new_vertex[ground_truth(source, target).vertices]


def landmarks_of(shape, truth):
    vertices = shape.user_vertex[shape.column_vertices[:5]]
    return np.column_stack([vertices, truth[vertices]])


def error(image, truth, target):
    """Mean distance on the target between images and truths / √(target area), at some vertices."""
    rows = np.arange(0, len(truth), 20)
    columns = geodesic_distances(target, truth[rows])
    return columns[np.arange(len(rows)), image[rows]].mean() / np.sqrt(target.area)
