"""What notebooks show: a picture of a mesh, of a map whose meshes are in use, and of a result."""

import base64
import re
from io import BytesIO

import numpy as np
import pytest
from matplotlib.image import imread

from isomatch import Correspondence, Mesh, match
from shapes import icosphere
from zoo import zoo


def pictures(html):
    return [
        imread(BytesIO(base64.b64decode(data)))
        for data in re.findall(r'src="data:image/png;base64,([^"]+)"', html)
    ]


def test_a_mesh_is_drawn():
    (image,) = pictures(icosphere(2)._repr_html_())
    assert image.shape == (240, 240, 4)
    assert abs((image[..., 3] > 0).mean() - np.pi / 4) < 0.05


def test_a_triangle_is_not_mirrored():
    """Of three corners in the plane, the wide end is below, and the corner at the right is red."""
    mesh = Mesh([[0, 0, 0], [2, 0, 0], [0, 3, 0]], [[0, 1, 2]])
    _, image = pictures(
        Correspondence([0, 1, 2], 3, None, None, mesh.content_hash, mesh.content_hash)._repr_html_()
    )
    opaque = image[..., 3] > 0
    assert opaque[-10].sum() > opaque[10].sum()
    row = np.flatnonzero(opaque[-10])
    assert row[0] <= 2
    assert image[-10, row[-5], 0] > image[-10, row[5], 0] + 0.2


def test_every_mesh_has_something_to_show():
    for specimen in zoo():
        assert "Mesh(" in specimen.mesh._repr_html_()


def test_a_map_is_drawn_while_its_meshes_are_in_use():
    sphere = icosphere(1)
    f = Correspondence(np.arange(42), 42, None, None, sphere.content_hash, sphere.content_hash)
    shown = pictures(f._repr_html_())
    assert len(shown) == 2
    np.testing.assert_array_equal(*shown)
    assert Mesh(sphere.vertices, sphere.faces).content_hash == f.source_hash, "a copy that is soon gone"
    assert len(pictures(f._repr_html_())) == 2
    del sphere
    assert f._repr_html_() == "<p>Correspondence(source 42 → target 42)</p>"
    assert pictures(Correspondence([0, -1], 2)._repr_html_()) == []


@pytest.mark.long
def test_a_result_shows_outcome_quality_and_map(prepared_example):
    result = match(*prepared_example)
    html = result._repr_html_()
    assert all(word in html for word in (result.outcome.name, "coverage", "misfit"))
    assert "nan" not in html
    assert len(pictures(html)) == 2
