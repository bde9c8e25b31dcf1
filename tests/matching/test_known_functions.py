"""Functions that are known on both shapes take part in search and refinement."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import cKDTree

from isomatch import match, match_both, prepare
from isomatch._core.errors import DescriptorError
from isomatch.matching import prepare_pair
from isomatch.matching.priors import known_functions
from isomatch_lab.damage import cut
from isomatch_lab.procedural import creature
from shapes import box, disguised
from zoo import specimen
from zoo.made import cut_along, moved, together


@pytest.fixture(scope="module")
def brick():
    return box(8, 16, 24)


def mean_error(result, old_vertex, mesh):
    """Of a map from a mesh to a disguise of it, in √area."""
    distance = np.linalg.norm(mesh.vertices[old_vertex[result.map.vertices]] - mesh.vertices, axis=1)
    return distance.mean() / np.sqrt(mesh.area)


@pytest.mark.long
def test_a_marked_corner_tells_the_turns_of_a_brick_apart(brick):
    """Four turns fit alike; a spot that is known on both brings the right one, wherever the numbering starts."""
    corner = np.exp(-((np.linalg.norm(brick.vertices - brick.vertices.max(axis=0), axis=1) / 4) ** 2))
    errors, clearness = [], []
    for seed in range(4):
        target = disguised(brick, seed)
        old_vertex = np.argsort(target.new_vertex)
        result = match(brick, target.mesh, functions=(corner, corner[old_vertex]))
        errors.append(mean_error(result, old_vertex, brick))
        clearness.append(result.quality.runner_up)
    assert max(errors) < 0.02
    assert min(clearness) > match(brick, target.mesh).quality.runner_up


@pytest.mark.long
def test_a_part_is_found_by_what_is_known_of_it():
    """A function marks the same spot on the left leg of a symmetric body and of one half of it."""
    body = creature(2500, pose=1, symmetric=True)
    other = creature(2500, pose=2, symmetric=True, triangulation=1)
    known = body.rest[:, 0], other.rest[:, 0]
    part = cut(body.mesh, 0.25, seed=3)
    kept = part.original
    functions = known[0][kept], known[1]
    forward, backward = match_both(part.mesh, other.mesh, functions=functions)
    side = np.sign(other.rest[forward.map.vertices, 0]) == np.sign(functions[0])
    assert side[np.abs(functions[0]) > 0.05].mean() > 0.98
    assert np.isfinite(backward.quality.spectral_residual)


def test_values_are_compared_as_they_are_on_both(brick):
    """An offset of all values of one shape is a difference; unknown ones come from their neighbours."""
    problem = prepare_pair(brick, brick)
    values = np.arange(brick.n_vertices, dtype=float)

    def known(*functions):
        return known_functions(problem.source, problem.target, functions, problem.config)

    same = replace(problem, functions=known(values, values)).known
    assert np.array_equal(same.source, same.target)
    assert np.sqrt((same.source**2).mean()) == pytest.approx(problem.config.refining.function_weight)
    shifted = replace(problem, functions=known(values, values + 10)).known
    assert (shifted.target > shifted.source).all()
    holed = values.copy()
    holed[7] = np.nan
    assert np.isfinite(replace(problem, functions=known(holed, values)).known.source).all()
    assert known_functions(problem.source, problem.target, None, problem.config) is None


def test_unknown_values_come_from_the_nearest_vertex_of_the_surface(brick):
    """Across a seam of repeated vertices too; a component without any has the mean."""
    n = brick.n_vertices
    beyond = brick.vertices[brick.faces].mean(axis=1)[:, 0] > brick.vertices[:, 0].max() - 1e-9
    opened = cut_along(brick, beyond)
    seam = cKDTree(brick.vertices).query(opened.vertices[n:])[1]
    shape = prepare(together(opened, moved(specimen("tetrahedron").mesh, 99)))
    values = np.full(shape.surface.n_vertices, np.nan)
    values[:n] = np.random.default_rng(0).normal(size=n)
    known = known_functions(shape, shape, (values, values), shape.config).source[:, 0]
    np.testing.assert_array_equal(known[n : n + len(seam)], known[seam])
    np.testing.assert_array_equal(known[-4:], 0)


@pytest.mark.long
@pytest.mark.parametrize(
    "functions",
    [
        lambda n: (np.zeros(n - 1), np.zeros(n)),
        lambda n: (np.zeros((n, 2)), np.zeros(n)),
        lambda n: (np.full(n, np.nan), np.zeros(n)),
        lambda n: (np.full(n, np.inf), np.zeros(n)),
        lambda n: (np.array(["a"] * n), np.zeros(n)),
        lambda n: (np.zeros(n),),
        lambda n: (np.zeros(n), np.zeros(n), np.zeros(n)),
        lambda n: (1.0, 2.0),
        lambda n: ([], []),
    ],
)
def test_functions_that_do_not_fit_are_refused(brick, functions):
    with pytest.raises(DescriptorError):
        match(brick, brick, functions=functions(brick.n_vertices))
