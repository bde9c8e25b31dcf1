"""Every input ends in a map with quality, a partial map that marks what is unmatched, or a named error."""

import numpy as np
import pytest

from isomatch import (
    Config,
    DescriptorError,
    IsomatchError,
    LandmarkError,
    MapError,
    MatchResult,
    Mesh,
    MeshError,
    Outcome,
    match,
    prepare,
)
from isomatch_lab.procedural import creature
from shapes import flat_grid, icosphere
from zoo import grid, mobius, zoo
from zoo.made import moved, together, with_vertices

pytestmark = pytest.mark.usefixtures("prepared_once")
GIVEN = Config(hypotheses="given")


@pytest.fixture(scope="module")
def animal():
    return creature(1500)


@pytest.fixture(scope="module")
def shape(animal):
    return prepare(animal.mesh)


def defective(mesh, defect):
    vertices, faces = mesh.vertices.copy(), mesh.faces.copy()
    if defect == "nan":
        vertices[7, 1] = np.nan
    elif defect == "infinite":
        vertices[7] = np.inf
    elif defect == "out of range":
        faces[3, 0] = mesh.n_vertices
    elif defect == "negative":
        faces[3, 0] = -1
    elif defect == "empty":
        vertices, faces = np.zeros((0, 3)), np.zeros((0, 3), dtype=int)
    elif defect == "points only":
        faces = np.zeros((0, 3), dtype=int)
    elif defect == "one point":
        vertices[:] = vertices[0]
    return Mesh(vertices, faces)


@pytest.mark.parametrize("side", ["source", "target"])
@pytest.mark.parametrize(
    ("defect", "message"),
    [
        ("nan", "finite"),
        ("infinite", "finite"),
        ("out of range", r"out of range \(number 3\).*repair\(mesh\)"),
        ("negative", r"out of range \(number 3\)"),
        ("empty", "no (vertices|faces)"),
        ("points only", "no faces"),
        ("one point", "area"),
    ],
)
def test_meshes_without_distances(animal, shape, side, defect, message):
    bad = defective(animal.mesh, defect)
    with pytest.raises(MeshError, match=message):
        match(*((bad, shape) if side == "source" else (shape, bad)))


@pytest.mark.long
def test_unused_vertex_is_unmatched_and_noted(animal, shape):
    n = animal.mesh.n_vertices
    pairs = np.column_stack([shape.column_vertices[:5]] * 2)
    found = match(with_vertices(animal.mesh, [[9, 9, 9]]), shape, landmarks=pairs, config=GIVEN)
    assert found.map.vertices[n] == -1
    np.testing.assert_array_equal(found.map.vertices[:n], np.arange(n))
    assert any(note.startswith("source: ") and "no face used" in note for note in found.notes), found.notes
    assert found.outcome is Outcome.CONVERGED
    assert found.quality.matched == pytest.approx(n / (n + 1))


@pytest.mark.long
def test_unused_vertex_is_never_an_image(animal, shape):
    """Put first, so that every index of the target moves by one."""
    pairs = np.column_stack([shape.column_vertices[:5], shape.column_vertices[:5] + 1])
    mesh = Mesh(np.vstack([[[9, 9, 9]], animal.mesh.vertices]), animal.mesh.faces + 1)
    found = match(shape, mesh, landmarks=pairs, config=GIVEN)
    np.testing.assert_array_equal(found.map.vertices, np.arange(animal.mesh.n_vertices) + 1)
    assert any(note.startswith("target: ") for note in found.notes)


@pytest.mark.long
@pytest.mark.parametrize(
    ("radius", "level", "outcome"),
    [(0.05, 1, Outcome.CONVERGED), (0.05, 2, Outcome.PARTIAL), (0.5, 1, Outcome.PARTIAL)],
    ids=["small and coarse", "small but a tenth of the vertices", "large"],
)
def test_two_components_give_a_partial_map(animal, shape, radius, level, outcome):
    n = animal.mesh.n_vertices
    ball = icosphere(level)
    size = np.sqrt(animal.mesh.area / (4 * np.pi))  # of a sphere of equal area
    mesh = together(animal.mesh, moved(ball, [50, 0, 0], radius * size))
    pairs = np.column_stack([shape.column_vertices[:5]] * 2)
    found = match(mesh, shape, landmarks=pairs, config=GIVEN)
    assert (found.map.vertices[n:] == -1).all()
    np.testing.assert_array_equal(found.map.vertices[:n], np.arange(n))
    assert any("component" in note and "unmatched" in note for note in found.notes)
    assert found.outcome is outcome


@pytest.mark.parametrize(
    ("landmarks", "message"),
    [
        ([0, 1, 2, 3], r"landmarks have shape \(4,\) .*one row \(source vertex, target vertex\)"),
        ([[0, 1, 2]] * 4, r"landmarks have shape \(4, 3\)"),
        (np.eye(4, 2), "type float64; expected one row"),
        ([["nose", "nose"]] * 5, "expected one row"),
        ([[0, 0], [9, 9]], "2 landmarks do not fix an alignment; give at least 3, better 5"),
        (np.zeros((0, 2), dtype=int), "0 landmarks do not fix an alignment"),
        ([[0, 0], [10**6, 1], [2, 2]], "landmarks name source vertices 1000000, outside 0…"),
        ([[0, 0], [1, 1], [2, -1]], "landmarks name target vertices -1, outside 0…"),
        ([[0, 0], [1, 1], [1, 2], [3, 3]], "landmarks use source vertices 1 more than once"),
        ([[0, 7], [1, 1], [2, 7], [3, 3]], "landmarks use target vertices 7 more than once"),
    ],
)
def test_bad_landmarks(shape, landmarks, message):
    with pytest.raises(LandmarkError, match=message):
        match(shape, shape, landmarks=landmarks)


def test_landmarks_off_the_main_component(animal, shape):
    n = animal.mesh.n_vertices
    mesh = together(animal.mesh, moved(icosphere(1), [50, 0, 0], 0.1))
    pairs = [[n, 0], [n + 1, 100], [n + 2, 200], [3, 3], [900, 900]]
    with pytest.raises(LandmarkError, match="only 2 landmarks"):
        match(mesh, shape, landmarks=pairs)


@pytest.mark.parametrize(
    ("initial_map", "message"),
    [
        (lambda n: np.zeros(n - 1, dtype=int), "initial map has shape .* expected one integer target vertex"),
        (lambda n: np.zeros(n), "type float64; expected one integer"),
        (
            lambda n: np.arange(n) + 1,
            r"sends source vertices \d+ outside the target's vertices .*other direction",
        ),
        (lambda n: np.arange(n) - 2, "sends source vertices 0 outside"),
        (lambda n: np.full(n, -1), "the initial map joins only 0 vertices"),
    ],
    ids=["too short", "floats", "beyond the end", "below -1", "nothing"],
)
def test_bad_initial_map(shape, initial_map, message):
    with pytest.raises(MapError, match=message):
        match(shape, shape, initial_map=initial_map(shape.surface.n_vertices))


@pytest.mark.parametrize(
    ("descriptors", "message"),
    [
        (lambda n: (np.ones((n, 2)),), "initial descriptors are 1 arrays"),
        (lambda n: (np.ones((n, 2)), np.ones((n, 3))), "initial descriptors have shapes"),
        (lambda n: (np.ones(n), np.ones(n)), "initial descriptors have shapes"),
        (
            lambda n: (np.ones((n, 2)), np.ones((n - 1, 2))),
            r"initial descriptors of the target have \d+ rows for",
        ),
        (
            lambda n: (np.full((n, 2), np.nan), np.ones((n, 2))),
            "source descriptors hold values .* not finite",
        ),
    ],
    ids=["one array", "other counts", "vectors", "too short", "nan"],
)
def test_bad_descriptors(shape, descriptors, message):
    with pytest.raises(DescriptorError, match=message):
        match(shape, shape, initial_descriptors=descriptors(shape.surface.n_vertices))


@pytest.mark.parametrize("specimen", zoo(), ids=str)
def test_every_specimen_of_the_zoo_is_refused_by_name(shape, specimen):
    """All are far too small to be matched."""
    with pytest.raises(IsomatchError):
        match(shape, specimen.mesh)


@pytest.mark.parametrize(
    "specimen", zoo("fatal", "non_finite_vertex") + zoo("fatal", "out_of_range_face"), ids=str
)
def test_fatal_specimens_among_many_vertices_are_refused_by_name(shape, specimen):
    """The same defects where the rest of the mesh is large enough."""
    with pytest.raises(MeshError):
        match(shape, together(grid(9, 9), specimen.mesh))


@pytest.mark.long
@pytest.mark.parametrize(
    "mesh",
    [flat_grid(2, 60), mobius(60), moved(flat_grid(12, 12), scale=[1, 1e-7, 1])],
    ids=["line", "mobius", "needles"],
)
def test_shapes_without_features_end_in_a_result_or_a_named_error(mesh):
    try:
        found = match(mesh, mesh)
    except IsomatchError:
        return  # by name, which is all that is asked of shapes whose parts all look alike
    assert isinstance(found, MatchResult)
    assert found.map.vertices.min() >= -1
    assert np.isfinite(found.quality.spectral_residual)
