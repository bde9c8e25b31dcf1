"""Numbers of regions are labels whatever their type: none that was not there before, and the user decides."""

import numpy as np
import pytest

from isomatch import Asset, Correspondence, carry_attributes
from isomatch._core.errors import SettingError
from isomatch.io import Attribute, Polygons
from shapes import icosphere

MESH = icosphere(2)
NUMBERS = np.array([39, 1000, 1010, 1020, 1030, 1040])
OCTANT = NUMBERS[(MESH.vertices > 0) @ [1, 2, 2]]
OF_FACE = OCTANT[MESH.faces[:, 0]]
CORNERS = MESH.faces.ravel()


def between():
    """A map whose images lie inside triangles, where interpolation mixes the regions of all three corners."""
    rng = np.random.default_rng(0)
    corners = MESH.faces[rng.integers(MESH.n_faces, size=MESH.n_vertices)]
    weights = rng.dirichlet(np.ones(3), MESH.n_vertices)
    first = corners[np.arange(len(corners)), weights.argmax(axis=1)]
    return Correspondence(first, MESH.n_vertices, corners, weights)


def carried(attribute, **options):
    giver = Asset.of_mesh(MESH, [attribute])
    return carry_attributes(between(), Asset.of_mesh(MESH), giver, **options)


@pytest.mark.parametrize("kind", ["f4", "f8", "i4", "u2"])
@pytest.mark.parametrize("labels", ["nearest", "majority"])
def test_regions_of_points(kind, labels):
    region = Attribute("region", "point", "label" if kind[0] in "iu" else "scalar", OCTANT.astype(kind))
    found = carried(region, labels=labels)
    values = found.asset.attribute("region").values
    assert set(np.unique(values)) <= set(NUMBERS)
    assert values.dtype == region.values.dtype
    assert found.taken_as_labels == ("region",)
    if labels == "nearest":
        np.testing.assert_array_equal(values, OCTANT[between().vertices])


@pytest.mark.parametrize(
    ("domain", "values"), [("face", OF_FACE), ("corner", np.repeat(OF_FACE, 3)), ("corner", OCTANT[CORNERS])]
)
def test_regions_of_faces_and_corners(domain, values):
    found = carried(Attribute("region", domain, "scalar", values.astype(float)))
    assert set(np.unique(found.asset.attribute("region", domain).values)) <= set(NUMBERS)


def test_they_are_chosen_with_the_labels():
    region = Attribute("region", "point", "scalar", OCTANT.astype(float))
    depth = Attribute("depth", "point", "scalar", MESH.vertices[:, 2])
    giver = Asset.of_mesh(MESH, [region, depth])
    for words, names in (("labels", ("region",)), ("scalars", ("region", "depth"))):
        assert carry_attributes(between(), Asset.of_mesh(MESH), giver, words).names == names


def test_two_atlases_in_one_array():
    both = np.stack([OCTANT, OCTANT // 7], axis=1).astype(np.float32)
    found = carried(Attribute("atlases", "point", "vector", both))
    rows = {tuple(row) for row in found.asset.attribute("atlases").values.tolist()}
    assert rows <= {tuple(row) for row in both.tolist()}


def test_nothing_known_stays_nothing():
    values = np.where(MESH.vertices[:, 2] > 0.8, np.nan, OCTANT)
    found = carried(Attribute("region", "point", "scalar", values))
    np.testing.assert_array_equal(found.asset.attribute("region").values, values[between().vertices])
    unmatched = between().vertices.copy()
    unmatched[:5] = -1
    some = Correspondence(unmatched, MESH.n_vertices)
    giver = Asset.of_mesh(MESH, [Attribute("region", "point", "scalar", OCTANT.astype(float))])
    for labels in ("nearest", "majority"):
        region = carry_attributes(some, Asset.of_mesh(MESH), giver, labels=labels).asset.attribute("region")
        assert np.isnan(region.values[:5]).any()
        assert set(region.values[~np.isnan(region.values)]) <= set(NUMBERS)


def test_measures_are_interpolated():
    height = Attribute("height", "point", "scalar", MESH.vertices[:, 2])
    counted = Attribute("index", "point", "scalar", np.arange(MESH.n_vertices, dtype=float))
    for attribute in (height, counted):
        found = carried(attribute)
        assert found.taken_as_labels == ()
        values = found.asset.attribute(attribute.name).values
        np.testing.assert_allclose(values, between().pull_back(attribute.values))


@pytest.mark.parametrize("kind", ["f8", "i4"])
def test_the_user_decides(kind):
    region = Attribute("region", "point", "label" if kind == "i4" else "scalar", OCTANT.astype(kind))
    values = carried(region, numbers_as="values").asset.attribute("region").values
    np.testing.assert_allclose(values, between().pull_back(OCTANT.astype(float)))
    depth = Attribute("depth", "point", "scalar", MESH.vertices[:, 2])
    found = carried(depth, numbers_as="labels")
    assert set(found.asset.attribute("depth").values) <= set(MESH.vertices[:, 2])
    assert found.taken_as_labels == ()
    with pytest.raises(SettingError, match="numbers_as"):
        carried(region, numbers_as="codes")


def test_names_and_words_are_labels_in_any_case():
    named = Attribute("region", "point", "label", OCTANT, names={39: "stem"})
    words = Attribute("side", "point", "label", np.where(MESH.vertices[:, 0] > 0, "left", "right"))
    for attribute in (named, words):
        found = carried(attribute, numbers_as="values")
        values = found.asset.attribute(attribute.name).values
        np.testing.assert_array_equal(values, attribute.values[between().vertices])
        assert carried(attribute).taken_as_labels == ()


def test_directions_are_no_labels():
    """The tangents of a flat part are few and whole."""
    tangent = Attribute("tangent", "point", "vector", np.tile([1.0, 0, 0, 1], (MESH.n_vertices, 1)))
    normal = Attribute("normal", "point", "normal", np.tile([1.0, 0, 0], (MESH.n_vertices, 1)))
    assert not tangent.seems_labels
    assert not normal.seems_labels


def test_quads_with_regions_as_floats():
    points = [[x, y, 0.0] for y in range(5) for x in range(5)]
    quads = [[i, i + 1, i + 6, i + 5] for i in range(20) if i % 5 < 4]
    polygons = Polygons(np.ravel(quads), [4] * 16)
    region = Attribute("region", "face", "scalar", np.repeat([1.0, 30.0], 8))
    shifted = Correspondence(np.roll(np.arange(25), 2), 25)
    found = carry_attributes(shifted, Asset(points, polygons), Asset(points, polygons, (region,)))
    assert set(found.asset.attribute("region").values) <= {1.0, 30.0}
