"""Pictures of models: what is drawn is there, and differs where the shapes do."""

import numpy as np
import pytest
from matplotlib.image import imread

from corresponded import ellipsoids, random_shapes
from isomatch import SettingError
from isomatch.cohort import shape_statistics
from isomatch.cohort.shape_statistics import (
    ShapeModel,
    classical_scaling,
    compactness,
    generalisation,
    procrustes_distances,
    shape_regression,
    specificity,
)

pytestmark = pytest.mark.usefixtures("coarse_pictures")


@pytest.mark.long
def test_the_others_are_drawn_for_few_shapes_and_many(tmp_path):
    for count in (1, 2, 12):
        shapes = random_shapes(count)
        shapes = type(shapes)([f"${name}_{{" for name in shapes.names], shapes.vertices, shapes.faces)
        model = ShapeModel.fit(shapes)
        distances = procrustes_distances(shapes.vertices)
        shape_statistics.draw_quality(
            tmp_path / f"quality{count}.png", compactness(model), generalisation(model), specificity(model)
        )
        shape_statistics.draw_values(
            tmp_path / f"values{count}.png", model.mesh(), model.vertex_variances, "variance"
        )
        groups = ["a", "b"] * (count // 2) or None
        shape_statistics.draw_embedding(
            tmp_path / f"places{count}.png", classical_scaling(distances), shapes.names, "x", groups
        )
        if count > 1:
            shape_statistics.draw_tree(tmp_path / f"tree{count}.png", distances, shapes.names, "x")
            shape_statistics.draw_scores(tmp_path / f"scores{count}.png", model, groups)
    assert len(list(tmp_path.iterdir())) == 13


def test_pictures_are_for_print(tmp_path, monkeypatch):
    """300 dots per inch, 6.5 inches wide; and a label that is wider than its bar is not cut off."""
    monkeypatch.undo()  # dots as coarse as in other tests
    assert shape_statistics.charts.DPI == 300
    flat = random_shapes(1).mesh(0)
    flat = flat.moved(flat.vertices * [5.0, 0.3, 0.3])
    shape_statistics.draw_values(
        tmp_path / "values.png",
        flat,
        np.arange(42.0),
        "a label that is much longer than the bar above it: " + "x" * 40,
    )
    seen = (imread(tmp_path / "values.png")[..., :3] < 0.9).any(axis=2)
    assert 1700 < seen.shape[1] < 2100
    assert not seen[[0, -1]].any()
    assert not seen[:, [0, -1]].any()


def test_vertices_without_a_value_are_grey(tmp_path):
    mesh = random_shapes(1).mesh(0)
    shape_statistics.draw_values(
        tmp_path / "values.png", mesh, np.where(np.arange(42) < 30, np.nan, 1.0), "x"
    )
    seen = imread(tmp_path / "values.png")[..., :3]
    grey = (np.ptp(seen, axis=2) < 0.02) & (seen.mean(axis=2) < 0.9)
    colour = np.ptp(seen, axis=2) > 0.3
    assert grey.sum() > 500
    assert colour.sum() > 500


@pytest.mark.long
def test_a_name_that_would_cover_another_is_left_out(tmp_path):
    apart = np.array([[0.0, 0.0], [1.0, 1.0]])
    close = np.concatenate([apart, apart[:1] + 1e-3])
    shape_statistics.draw_embedding(tmp_path / "places.svg", close, ["one", "two", "three"], "distance")
    text = (tmp_path / "places.svg").read_text()
    assert [f"<!-- {name} -->" in text for name in ("one", "two", "three")] == [True, True, False]
    grid = np.array([[x, y] for x in range(4) for y in range(3)]) * 1e-3
    shape_statistics.draw_embedding(
        tmp_path / "places.svg", grid, [f"h{i:02}" for i in range(12)], "distance"
    )
    text = (tmp_path / "places.svg").read_text()
    assert all(f"<!-- h{i:02} -->" in text for i in range(12))


@pytest.mark.long
def test_hulls_are_drawn_around_groups(tmp_path):
    """In the colours of the groups; not around two points, nor around three on a line."""
    model = ShapeModel.fit(random_shapes(9))
    areas = []
    for groups in (["a"] * 9, ["a", "a", *[""] * 7], None):
        shape_statistics.draw_scores(tmp_path / "scores.png", model, groups)
        seen = imread(tmp_path / "scores.png")[..., :3]
        areas.append(int((np.abs(seen - [0.88, 0.93, 0.98]).max(axis=2) < 0.03).sum()))
    assert areas[0] > 20 * max(areas[1:])
    shape_statistics.draw_scores(
        tmp_path / "line.png", ShapeModel.fit(ellipsoids([1.0, 1.1, 1.3])), ["a"] * 3
    )


def test_one_mode_is_drawn_alone_and_none_is_refused(tmp_path):
    with pytest.raises(SettingError, match="not among the 0 modes"):
        shape_statistics.draw_scores(tmp_path / "scores.png", ShapeModel.fit(ellipsoids([1.0, 1.0])))
    with pytest.raises(SettingError, match=r"modes \(0, 5\)"):
        shape_statistics.draw_scores(tmp_path / "scores.png", ShapeModel.fit(random_shapes(4)), modes=(0, 5))


@pytest.mark.long
@pytest.mark.parametrize("kind", ["png", "pdf", "svg"])
def test_formats_and_that_a_picture_is_the_same_again(tmp_path, kind):
    shapes = random_shapes(6)
    size = np.arange(6.0)
    found = shape_regression(shapes.vertices, size, n_permutations=9)
    drawn = []
    for word in "ab":
        path = tmp_path / f"{word}.{kind}"
        shape_statistics.draw_regression(
            path, found, size, [f"$name_{i}" for i in range(6)], "size", ["x", "y", ""] * 2
        )
        drawn.append(path.read_bytes())
    assert drawn[0] == drawn[1]
    assert drawn[0].startswith({"png": b"\x89PNG", "pdf": b"%PDF", "svg": b"<?xml"}[kind])


def test_other_formats_are_refused(tmp_path):
    with pytest.raises(SettingError, match="png"):
        shape_statistics.draw_scores(tmp_path / "scores.gif", ShapeModel.fit(random_shapes(4)))


def test_landmarks_are_drawn_with_their_lines_over_the_mean(tmp_path, monkeypatch):
    """A square whose corner is moved: blue where it is now, lines along it, grey where it was."""
    square = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    moved, links = square * [[1], [1], [1.6], [1]], np.array([[0, 1], [1, 2], [2, 3]])
    monkeypatch.setattr(shape_statistics.charts, "DPI", 150)
    blue, grey = np.array([0x3F, 0x90, 0xDA]) / 255, np.array([0xC4, 0xC7, 0xCB]) / 255
    counts = []
    for lines in (links, links[:0]):
        shape_statistics.draw_landmarks(tmp_path / "l.png", {"moved": moved}, square, lines)
        seen = imread(tmp_path / "l.png")[..., :3]
        counts.append([int((np.abs(seen - colour).max(axis=2) < 0.05).sum()) for colour in (blue, grey)])
    assert min(*counts[0]) > 2 * max(1, min(*counts[1]))
    assert min(*counts[1]) > 0
