"""Pictures of models: what is drawn is there, and differs where the shapes do."""

import numpy as np
from matplotlib.image import imread

from corresponded import ellipsoids, random_shapes
from isomatch.statistics import (
    ShapeModel,
    classical_scaling,
    compactness,
    draw_embedding,
    draw_modes,
    draw_quality,
    draw_tree,
    draw_values,
    generalisation,
    procrustes_distances,
    specificity,
)


def columns(path):
    """How many columns of a picture are not white, from the left third, the middle and the right one."""
    seen = (imread(path)[..., :3] < 0.9).any(axis=2)[60:]  # below the titles
    third = int(0.27 * seen.shape[1])
    return [int(seen[:, i * third : (i + 1) * third].any(axis=0).sum()) for i in range(3)]


def test_modes_are_drawn_at_one_scale(tmp_path):
    tall = ellipsoids([0.6, 1.0, 1.4])
    swelling = tall.moved(tall.vertices[1] * np.array([0.7, 1.0, 1.3])[:, None, None])
    draw_modes(tmp_path / "modes.png", ShapeModel.fit(swelling), 1)
    smallest, middle, largest = columns(tmp_path / "modes.png")
    assert smallest < 0.8 * middle < 0.8 * 0.9 * largest


def test_a_model_without_modes_has_a_picture(tmp_path):
    draw_modes(tmp_path / "modes.png", ShapeModel.fit(ellipsoids([1.0])))
    assert (imread(tmp_path / "modes.png")[..., 0] < 0.9).any()


def test_the_others_are_drawn_for_few_shapes_and_many(tmp_path):
    for count in (1, 2, 12):
        shapes = random_shapes(count)
        shapes = type(shapes)([f"${name}_{{" for name in shapes.names], shapes.vertices, shapes.faces)
        model = ShapeModel.fit(shapes)
        distances = procrustes_distances(shapes.vertices)
        draw_quality(
            tmp_path / f"quality{count}.png", compactness(model), generalisation(model), specificity(model)
        )
        draw_values(tmp_path / f"values{count}.png", model.mesh(), model.vertex_variances, "variance")
        groups = ["a", "b"] * (count // 2) or None
        draw_embedding(
            tmp_path / f"places{count}.png", classical_scaling(distances), shapes.names, "x", groups
        )
        if count > 1:
            draw_tree(tmp_path / f"tree{count}.png", distances, shapes.names, "x")
    assert len(list(tmp_path.iterdir())) == 11
