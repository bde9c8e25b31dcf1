"""Asymmetry: what all shapes have in common and what is of each alone, where it is, p-values that are those of chance."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.stats import kstest

from corresponded import moved
from isomatch import Correspondence, InputError, Outcome, SettingError
from isomatch.cohort.shape_statistics import (
    CorrespondedShapes,
    align_sides,
    asymmetry,
    left_right_map,
    left_right_of_pairs,
    paired_sides,
    symmetry_dimensions,
    symmetry_plane,
)
from isomatch_lab.procedural import creature
from shapes import icosphere

SPHERE = icosphere(3)
X, Y, Z = SPHERE.vertices.T
OTHER = np.abs(SPHERE.vertices[:, None] * [-1, 1, 1] - SPHERE.vertices).sum(axis=2).argmin(axis=1)
SIDES = Correspondence(OTHER, len(OTHER))
# odd in x, so that they differ from side to side; harmonics of degree 2 and 3 neither move nor turn a sphere
ODD = np.array([X * Y, X * Z, X * Y * Z, X * (5 * Z**2 - 1)])
EVEN = np.array([Y * Z, Y * (5 * Z**2 - 1)])


def balls(radius):
    """Spheres (m,) of other radii (m, n)."""
    names = [f"h{i}" for i in range(len(radius))]
    return CorrespondedShapes(names, radius[:, :, None] * SPHERE.vertices, SPHERE.faces)


def measured(shapes, sides=SIDES, **options):
    weights, maps = shapes.area_weights, [sides] * len(shapes)
    return asymmetry(*align_sides(shapes.mirrored(maps), weights, "keep", maps), weights, **options)


def outward(found):
    """(m, n) components along the normals, of spheres."""
    axes = found.symmetric - found.symmetric.mean(axis=0)
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    return np.einsum("mij,ij->mi", found.components, axes)


def test_symmetric_shapes_have_none():
    found = measured(moved(balls(2 + 0.1 * np.random.default_rng(0).normal(size=(3, 2)) @ EVEN)))
    np.testing.assert_allclose(found.amounts, 0, atol=1e-9)
    np.testing.assert_allclose(found.directional, 0, atol=1e-9)


def test_a_bump_on_one_side_is_half_there_and_half_opposite():
    """A bump f of height h on one side: s = (f + f mirrored) / 2, a = ±h / 2 at both places.

    Laying the mirror image onto the shape shifts it by what the bump shifts the centroid, of the order of the share of
    its area, and turns nothing.
    """
    height, at = 0.2, np.array([0.8, 0.6, 0.0])
    bump = height * np.exp(-((SPHERE.vertices - at) ** 2).sum(axis=1) / 0.02)
    found = measured(moved(balls(2 + bump[None])))
    tip = int(bump.argmax())
    expected = (bump - bump[OTHER]) / 2
    shift = 3 * SPHERE.vertices @ (SPHERE.vertices.T @ (SPHERE.vertex_areas / SPHERE.area * expected))
    np.testing.assert_allclose(outward(found)[0], expected - shift, atol=0.02 * height)
    np.testing.assert_allclose(outward(found)[0][[tip, OTHER[tip]]], expected[[tip, OTHER[tip]]], rtol=0.04)
    assert np.isnan(found.p_value)


def test_directional_and_fluctuating_parts_are_recovered():
    """Radii 2 + δ o₀ + Σ cₖ oₖ + Σ dₖ eₖ, cₖ ~ N(0, σ²), dₖ ~ N(0, τ²), of odd oₖ and even eₖ."""
    rng, m, delta, sigma, tau = np.random.default_rng(1), 60, 0.05, 0.02, 0.04
    radius = 2 + delta * ODD[0] + sigma * rng.normal(size=(m, 4)) @ ODD + tau * rng.normal(size=(m, 2)) @ EVEN
    found = measured(moved(balls(radius)), seed=4)
    share = SPHERE.vertex_areas / SPHERE.area
    rows = {row.source: row for row in found.anova}
    directional, odd, even = delta**2 * share @ ODD[0] ** 2, (ODD**2 @ share).sum(), (EVEN**2 @ share).sum()
    fluctuating = sigma**2 * odd
    # of k harmonics and m shapes, a mean square has k (m − 1) degrees of freedom: 13 % and 18 % of standard error
    assert rows["individuals × sides"].mean_square / 2 == pytest.approx(fluctuating, rel=0.3)
    assert rows["individuals"].mean_square / 2 == pytest.approx(tau**2 * even, rel=0.45)
    assert rows["sides"].squares / (2 * m) == pytest.approx(directional + fluctuating / m, rel=0.2)
    assert rows["sides"].f == pytest.approx(rows["sides"].squares / rows["individuals × sides"].mean_square)
    assert sum(row.share for row in found.anova) == pytest.approx(1)
    assert (found.p_value, found.n_permutations, found.seed) == (1 / 5000, 4999, 4)
    assert np.corrcoef(outward(found).mean(axis=0), ODD[0])[0, 1] > 0.98


def test_repeated_measurements_tell_the_error():
    """Two scans of each with an error of ε in the odd harmonics, ε / 2 in the mean of both."""
    rng, m, sigma, epsilon = np.random.default_rng(3), 30, 0.03, 0.02
    own = np.repeat(sigma * rng.normal(size=(m, 4)), 2, axis=0)
    names = np.repeat(np.arange(m), 2).astype(str).tolist()
    found = measured(balls(2 + (own + epsilon * rng.normal(size=(2 * m, 4))) @ ODD), individuals=names)
    rows = {row.source: row for row in found.anova}
    odd = (ODD**2 @ (SPHERE.vertex_areas / SPHERE.area)).sum()
    # there is no error in even harmonics, and half of the degrees of freedom
    assert rows["error"].mean_square == pytest.approx(epsilon**2 * odd, rel=0.3)
    expected = (2 * sigma**2 + epsilon**2) * odd
    assert rows["individuals × sides"].mean_square / 2 == pytest.approx(expected, rel=0.3)
    assert [row.degrees for row in found.anova] == [m - 1, 1, m - 1, 2 * m]
    assert sum(row.share for row in found.anova) == pytest.approx(1)
    assert found.p_value > 0.01


def test_places_and_labels_change_nothing():
    rng = np.random.default_rng(5)
    shapes = balls(2 + 0.03 * rng.normal(size=(6, 4)) @ ODD + 0.02 * ODD[2])
    one, order = measured(shapes), rng.permutation(len(OTHER))
    back = np.argsort(order)
    relabelled = CorrespondedShapes(shapes.names, shapes.vertices[:, order], back[SPHERE.faces])
    other = measured(moved(relabelled, seed=3), Correspondence(back[OTHER[order]], len(OTHER)))
    np.testing.assert_allclose(other.amounts, one.amounts, atol=1e-9)
    np.testing.assert_allclose(outward(other), outward(one)[:, order], atol=1e-8)
    assert (other.p_value, other.n_permutations) == (one.p_value, 64)


def test_the_mirror_image_of_all_exchanges_left_and_right_alone():
    shapes = balls(2 + 0.03 * np.random.default_rng(6).normal(size=(6, 4)) @ ODD + 0.02 * ODD[2])
    one, other = measured(shapes), measured(shapes.moved(shapes.vertices * [-1, 1, 1]))
    np.testing.assert_allclose(outward(other), outward(one), atol=1e-9)  # vertices are on the other side now
    np.testing.assert_allclose([row.squares for row in other.anova], [row.squares for row in one.anova])
    exchanged = measured(shapes.moved(shapes.vertices[:, OTHER] * [-1, 1, 1]))
    np.testing.assert_allclose(outward(exchanged), -outward(one), atol=1e-9)
    assert exchanged.p_value == one.p_value


@pytest.mark.parametrize("m", [6, 15])
def test_p_values_of_chance_are_uniform(m):
    rng, p_values = np.random.default_rng(2), []
    for i in range(200):
        half = rng.normal(size=(m, 3, 3))
        found = asymmetry(half, -half, n_permutations=99, seed=i)
        p_values.append(found.p_value)
    assert found.n_permutations == (64 if m == 6 else 99)
    # of 2⁶ ways every two are alike: p is a multiple of 1 / 32
    smooth = np.array(p_values) - rng.uniform(0, 1 / 32 if m == 6 else 0.01, 200)
    assert kstest(smooth, "uniform").pvalue > 0.01


def test_errors_of_own_maps_are_no_directional_asymmetry():
    """Maps that are wrong by a vertex at random: of one for all, the asymmetry of symmetric shapes is directional."""
    rng, m, weights = np.random.default_rng(8), 8, SPHERE.vertex_areas
    shapes = balls(2 + 0.3 * EVEN[1] + 0.02 * rng.normal(size=(m, 2)) @ EVEN)
    neighbours = [SPHERE.faces[(SPHERE.faces == i).any(axis=1)].ravel() for i in range(len(OTHER))]
    wrong = [Correspondence([rng.choice(neighbours[i]) for i in OTHER], len(OTHER)) for _ in range(m)]
    one, own = (
        asymmetry(*align_sides(shapes.mirrored(maps), weights, "keep", maps), weights)
        for maps in ([wrong[0]] * m, wrong)
    )
    assert one.share > 0.9
    assert own.share < 2 / m


@pytest.mark.parametrize("turned", [False, True])
def test_paired_organs(turned):
    """Right ones are larger by ODD[0] than the reflected left ones, whether those are reflected already or not."""
    rng, m = np.random.default_rng(7), 8
    lumpy = 2 + 0.3 * np.exp(-((SPHERE.vertices - [0.6, 0.64, 0.48]) ** 2).sum(axis=1) / 0.3)
    right = balls(lumpy + 0.02 * rng.normal(size=(m, 4)) @ ODD + 0.03 * ODD[0])
    left = balls(lumpy + 0.02 * rng.normal(size=(m, 4)) @ ODD - 0.03 * ODD[0])
    vertices = np.concatenate([right.vertices, left.vertices * [-1 if turned else 1, 1, 1]])
    names = [f"right{i}" for i in range(m)] + [f"left{i}" for i in range(m)]
    shapes = moved(CorrespondedShapes(names, vertices, SPHERE.faces))
    pairs = [(f"left{i}", f"right{i}") for i in range(m)]
    both = paired_sides(shapes, pairs)
    assert (*both.names[:2], both.names[m]) == ("right0", "right1", "left0_mirrored" if turned else "left0")
    found = asymmetry(*align_sides(both), shapes.area_weights)
    assert found.share > 0.5
    assert found.p_value == 2 / 2**m
    assert np.corrcoef(outward(found).mean(axis=0), ODD[0])[0, 1] > 0.9


def test_what_was_measured_on_one_side_alone_adds_nothing():
    shapes = balls(2 + 0.1 * ODD[:3])
    seen = np.ones((3, len(OTHER)), dtype=bool)
    seen[1, X > 0.2] = False
    lacking = CorrespondedShapes(shapes.names, shapes.vertices, shapes.faces, measured=seen)
    one, image = align_sides(lacking.mirrored([SIDES] * 3), shapes.area_weights)
    np.testing.assert_allclose(one[1, np.abs(X) > 0.2001], image[1, np.abs(X) > 0.2001], atol=1e-4)


@pytest.mark.parametrize("normal", [[1, 0, 0], [0.6, -0.64, 0.48]])
def test_the_plane_of_symmetry(normal):
    turn = Rotation.align_vectors([normal], [[1, 0, 0]])[0].as_matrix()
    points = (2 + 0.3 * EVEN[1])[:, None] * SPHERE.vertices * [1, 1.5, 2] @ turn.T + [5, 6, 7]
    found, offset = symmetry_plane(points, SIDES)
    sign = np.sign(normal[np.abs(normal).argmax()])
    np.testing.assert_allclose(found, sign * np.array(normal), atol=1e-9)
    assert offset == pytest.approx(sign * np.dot(normal, [5, 6, 7]))


@pytest.mark.long
def test_a_made_animal_is_symmetric_but_for_its_bump():
    """Found by matching it with its mirror image: within the sampling error, and a bump as half on each side.

    Laying the mirror image onto the body takes up to a fifth of the bump.
    """
    mesh, height = creature(2000, symmetric=True).rest_mesh, 0.06
    at = int(np.abs(mesh.vertices - [0.1, 0.1, 0.9]).sum(axis=1).argmin())
    bump = height * np.exp(-((mesh.vertices - mesh.vertices[at]) ** 2).sum(axis=1) / 0.02)
    signed = []
    for body in (mesh, mesh.moved(mesh.vertices + bump[:, None] * mesh.vertex_normals)):
        result = left_right_map(body)
        assert result.outcome is Outcome.CONVERGED
        found = measured(CorrespondedShapes.of_meshes({"a": body}), result.map)
        signed.append(np.einsum("ij,ij->i", found.components[0], mesh.vertex_normals))
    assert np.sqrt(mesh.vertex_areas @ signed[0] ** 2) < 1e-3 * mesh.area
    ends = signed[1][[at, result.map.vertices[at]]] / (height / 2)
    np.testing.assert_allclose(ends, [0.8, -0.8], atol=0.15)
    assert np.linalg.norm(mesh.vertices[signed[1].argmax()] - mesh.vertices[at]) < 0.05


@pytest.mark.parametrize(
    ("shapes", "images", "options", "error", "message"),
    [
        (3, 2, {}, InputError, "not shapes and as many mirror images"),
        (0, 0, {}, InputError, "not shapes and as many mirror images"),
        (3, 3, {"individuals": ["a"]}, InputError, "1 individuals for 3 shapes"),
        (3, 3, {"n_permutations": 0}, SettingError, "n_permutations = 0"),
    ],
)
def test_what_cannot_be_compared_is_refused(shapes, images, options, error, message):
    with pytest.raises(error, match=message):
        asymmetry(np.zeros((shapes, 4, 3)), np.zeros((images, 4, 3)), **options)


@pytest.mark.parametrize(("pairs", "message"), [([("h0", "x")], "none named x"), ([], "no pairs")])
def test_pairs_of_shapes_that_are_not_there(pairs, message):
    with pytest.raises(InputError, match=message):
        paired_sides(balls(np.full((2, len(X)), 2.0)), pairs)


@pytest.mark.parametrize("dim", [2, 3])
def test_dimensions_are_the_ranks_of_components(dim):
    """Of many configurations about a symmetric one, as many components vary symmetrically, and asymmetrically."""
    rng = np.random.default_rng(0)
    sides = left_right_of_pairs(7, [(0, 3), (1, 4), (2, 5)])
    mean = rng.normal(size=(7, dim))
    mean = (mean + mean[sides.vertices] * [-1, *[1] * (dim - 1)]) / 2
    shapes = CorrespondedShapes([str(i) for i in range(60)], mean + 1e-4 * rng.normal(size=(60, 7, dim)))
    aligned, mirrored = align_sides(shapes.mirrored([sides] * 60))
    ranks = []
    for part in (aligned + mirrored, aligned - mirrored):
        values = np.linalg.svd((part - part.mean(axis=0)).reshape(60, -1), compute_uv=False)
        ranks.append(int((values > 1e-3 * values[0]).sum()))
    assert tuple(ranks) == symmetry_dimensions(7, dim, sides)
    assert symmetry_dimensions(7, dim) == (7 * dim - {2: 4, 3: 7}[dim],) * 2
    assert sum(symmetry_dimensions(7, dim, sides, scale="keep")) == 7 * dim - {2: 3, 3: 6}[dim]


def test_fluctuating_asymmetry_is_tested_against_the_error():
    """Of errors alone, p is uniform; individuals that are each asymmetric in their own way are told."""
    rng, p_values = np.random.default_rng(4), []
    of = [str(i // 2) for i in range(12)]
    for seed in range(60):
        shapes = rng.normal(size=(12, 3, 3)), rng.normal(size=(12, 3, 3))
        p_values.append(asymmetry(*shapes, individuals=of, n_permutations=99, seed=seed).anova[2].p_value)
    assert kstest(p_values, "uniform").pvalue > 0.01
    own = np.repeat(rng.normal(size=(6, 3, 3)), 2, axis=0)
    noise = 0.05 * rng.normal(size=(2, 12, 3, 3))
    found = asymmetry(own + noise[0], -own + noise[1], individuals=of)
    assert found.anova[2].p_value == 0.0002
    by_hand = np.sqrt(
        ((own[::2] + (noise[0] - noise[1]).reshape(6, 2, 3, 3).mean(axis=1) / 2) ** 2).sum(axis=(1, 2)) / 3
    )
    np.testing.assert_allclose([each.asymmetry for each in found.individuals], by_hand)
    scores = np.array([each.asymmetric_scores for each in found.individuals])
    assert scores.shape == (6, 5)
    np.testing.assert_allclose((scores**2).sum(), sum(each.fluctuating**2 for each in found.individuals))


def test_bad_pairs_of_landmarks():
    with pytest.raises(InputError, match="landmark 2 is in two pairs"):
        left_right_of_pairs(4, [(0, 1), (1, 2)])
    with pytest.raises(InputError, match="landmark 5 is in two pairs, or is none of the 4"):
        left_right_of_pairs(4, [(0, 4)])
