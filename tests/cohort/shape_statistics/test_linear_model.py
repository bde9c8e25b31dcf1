"""Models of shape: formulas, sums of squares by another route, tests that are right by chance, and classification."""

import numpy as np
import pytest
from scipy.stats import f_oneway, kstest
from sklearn.discriminant_analysis import LinearDiscriminantAnalysis

from isomatch import InputError, SettingError
from isomatch.cohort.shape_statistics import (
    CorrespondedShapes,
    ShapeDesign,
    ShapeModel,
    classify,
    generalised_procrustes,
    group_test,
    procrustes_distances,
    shape_anova,
)

RNG = np.random.default_rng(11)
M = 30
TABLE = {
    "age": RNG.uniform(1, 9, M),
    "sex": [*"fm"] * (M // 2),
    "site": ["north", "east", "south"] * (M // 3),
    "code": [1, 2, 10] * (M // 3),
}
SHAPES = RNG.normal(size=(M, 5, 3)) + np.outer(TABLE["age"], RNG.normal(size=15)).reshape(M, 5, 3)


def modelled(formula, shapes=SHAPES, **how):
    return shape_anova(
        shapes, ShapeDesign.of(formula, TABLE), n_permutations=how.pop("n_permutations", 19), **how
    )


@pytest.mark.parametrize(
    ("formula", "names"),
    [
        ("age", ["age"]),
        ("coords ~ age * sex + site", ["age", "sex", "site", "age:sex"]),  # as in R, single variables first
        ("age*sex*site", ["age", "sex", "site", "age:sex", "age:site", "sex:site", "age:sex:site"]),
        ("sex:age + age + sex:age", ["age", "sex:age"]),
        ("log(age) + factor( code )", ["log(age)", "code"]),
    ],
)
def test_formulas(formula, names):
    design = ShapeDesign.of(formula, TABLE)
    assert design.names == names
    assert design.levels.get("code") == (("1", "2", "10") if "code" in names else None)


def test_sequential_squares_are_those_of_least_squares():
    """Of each term, by how much the residuals fall; their sum and that of the residuals is the total."""
    weights = RNG.uniform(size=5)
    found = modelled("age * sex + site", weights=weights)
    flat = (SHAPES * np.sqrt(weights / weights.sum())[:, None]).reshape(M, -1)
    age, sex = TABLE["age"], np.array([each == "m" for each in TABLE["sex"]], dtype=float)
    site = np.array([[each == level for level in ("north", "south")] for each in TABLE["site"]], dtype=float)
    columns = [np.ones((M, 1)), age[:, None], sex[:, None], site, (age * sex)[:, None]]
    left = []
    for i in range(1, len(columns) + 1):
        design = np.hstack(columns[:i])
        left.append(float(((flat - design @ np.linalg.lstsq(design, flat, rcond=None)[0]) ** 2).sum()))
    squares = [row.squares for row in found.rows]
    np.testing.assert_allclose(squares, [*-np.diff(left), left[-1], left[0]], rtol=1e-9)
    assert [row.degrees for row in found.rows] == [1, 1, 2, 1, M - 6, M - 1]
    first, residuals = found.rows[0], found.rows[-2]
    assert first.f == pytest.approx(first.mean_square / residuals.mean_square)


def test_f_of_one_number_is_that_of_the_usual_analysis():
    shapes = np.zeros((M, 1, 3))
    shapes[:, 0, 0] = RNG.normal(size=M)
    groups = [
        shapes[[i for i, each in enumerate(TABLE["site"]) if each == level], 0, 0]
        for level in set(TABLE["site"])
    ]
    assert modelled("site", shapes).rows[0].f == pytest.approx(f_oneway(*groups).statistic)


@pytest.mark.long
def test_p_values_of_chance_are_uniform_beside_a_strong_term():
    """Of the second term, whose variable means nothing, beside a first that describes nearly all."""
    p_values = []
    for seed in range(150):
        rng = np.random.default_rng(seed)
        age = rng.uniform(size=12)
        shapes = 5 * age[:, None, None] + rng.normal(size=(12, 2, 3))
        design = ShapeDesign.of("age + noise", {"age": age, "noise": rng.normal(size=12)})
        p_values.append(shape_anova(shapes, design, n_permutations=99, seed=seed).rows[1].p_value)
    assert kstest(p_values, "uniform").pvalue > 0.01


def test_pairs_of_groups():
    """Distances are those of the means; p is adjusted by Holm; a group far away is found."""
    shapes = SHAPES.copy()
    shapes[[i for i, each in enumerate(TABLE["site"]) if each == "south"]] += 20
    found = modelled("site", shapes, n_permutations=199)
    means = {
        level: shapes[[each == level for each in TABLE["site"]]].mean(axis=0) for level in set(TABLE["site"])
    }
    for pair in found.pairs:
        apart = np.sqrt(((means[pair.first] - means[pair.second]) ** 2).sum() / 5)
        assert pair.distance == pytest.approx(apart)
        assert (pair.p_value == 0.005) == ("south" in (pair.first, pair.second))
        assert np.isnan(pair.angle)
    ordered = sorted(found.pairs, key=lambda pair: pair.p_value)
    assert [pair.adjusted_p for pair in ordered] == pytest.approx([0.015, 0.015, ordered[2].p_value])


def test_means_are_compared_at_the_mean_of_other_variables():
    """Groups that differ in age alone have equal means beside age, and one slope; other slopes are found."""
    age = np.concatenate([RNG.uniform(0, 1, 15), RNG.uniform(2, 3, 15)])
    table = {"age": age, "group": ["a"] * 15 + ["b"] * 15}
    direction = RNG.normal(size=(4, 3))
    shapes = age[:, None, None] * direction
    found = shape_anova(shapes, ShapeDesign.of("age * group", table), n_permutations=9)
    assert [(pair.of, round(pair.distance, 9)) for pair in found.pairs] == [
        ("group", 0.0),
        ("age:group", 0.0),
    ]
    slope = np.where(np.arange(30) < 15, 1.0, 3.0)
    found = shape_anova(
        shapes * slope[:, None, None], ShapeDesign.of("age * group", table), n_permutations=99
    )
    own = found.pairs[1]
    assert own.distance == pytest.approx(2 * np.sqrt((direction**2).sum() / 4))
    assert (own.angle, own.p_value) == (pytest.approx(0, abs=1e-4), 0.01)


@pytest.mark.parametrize(
    ("formula", "message"),
    [
        ("age + weight", "there is no variable 'weight'; the table has age, sex, site, code"),
        ("age +", "a variable is missing"),
        ("log(sex)", "sex has words, as 'f'"),
        ("log(low)", "not above 0"),
        ("same", "same does not vary"),
        ("one", "one has one group, 'x'"),
        ("single", "single 'b' has one shape; give two or more"),
        ("holes", "holes has no value of 2 of the shapes"),
        ("age + twice", "twice does not vary, or depends on the variables before it"),
        ("factor(id)", "has one shape"),
    ],
)
def test_what_cannot_be_modelled(formula, message):
    odd = {"low": [0, *[1] * (M - 1)], "same": [2] * M, "one": ["x"] * M, "single": ["b", *["a"] * (M - 1)]}
    odd |= {"holes": ["NA", "", *map(str, range(M - 2))], "twice": 2 * TABLE["age"], "id": [*range(M)]}
    with pytest.raises(InputError, match=message) as error:
        shape_anova(SHAPES, ShapeDesign.of(formula, TABLE | (odd if formula != "age + weight" else {})))
    assert "\n" not in str(error.value)


def test_too_little():
    with pytest.raises(InputError, match="too few"):
        shape_anova(SHAPES[:2], ShapeDesign.of("age", {"age": [1, 2]}))
    with pytest.raises(InputError, match="too few for 'age \\* sex'"):
        shape_anova(SHAPES[:4], ShapeDesign.of("age * sex", {"age": [1, 2, 3, 5], "sex": [*"fmfm"]}))
    with pytest.raises(InputError, match="not of 30 shapes"):
        shape_anova(SHAPES, ShapeDesign.of("age", {"age": [1, 2]}))
    with pytest.raises(SettingError, match="n_permutations"):
        modelled("age", n_permutations=0)


def test_shapes_left_out_are_classified_by_the_others():
    """As by a loop; groups of noise are guessed, and groups apart are told."""
    scores = RNG.normal(size=(24, 4)) * [4, 3, 2, 1]
    groups = ["a", "b", "c"] * 8
    scores[[group == "b" for group in groups], 1] += 40
    found = classify(scores, groups)
    assert (found.groups, found.n_modes, found.variates.shape) == (("a", "b", "c"), 2, (24, 2))
    names = np.array(groups)
    for i in range(24):
        others = np.arange(24) != i
        model = LinearDiscriminantAnalysis(priors=[1 / 3] * 3).fit(scores[others, :2], names[others])
        assert model.predict(scores[[i], :2])[0] == found.predicted[i]
    assert found.counts.sum() == 24
    assert found.counts[1].tolist() == [0, 8, 0]
    within = sum(np.cov(found.variates[names == group].T) * 7 for group in "abc") / 21
    np.testing.assert_allclose(within, np.eye(2), atol=1e-9)
    with pytest.raises(InputError, match="'c' of 1"):
        classify(scores[:5], [*"aabbc"])


def test_configurations_without_faces_and_in_the_plane():
    """Landmarks need no mesh; in the plane, one is never mirrored, as it would be by a turn in space."""
    flat = RNG.normal(size=(6, 2))
    turn = np.array([[0.6, -0.8], [0.8, 0.6]])
    shapes = np.array([flat, 2 * flat @ turn.T + 5, flat * [-1, 1]])
    distances = procrustes_distances(shapes, scale="remove")
    assert distances[0, 1] < 1e-7  # the square root of rounding errors
    assert distances[0, 2] > 0.1
    assert procrustes_distances(shapes, scale="remove", mirrored=True)[0, 2] < 1e-7
    found = generalised_procrustes(shapes, scale="remove")
    np.testing.assert_allclose(np.linalg.det(found.rotations), 1)
    np.testing.assert_allclose(
        np.einsum("sij,snj->sni", found.rotations, shapes) * found.scales[:, None, None]
        + found.translations[:, None],
        found.aligned,
    )
    model = ShapeModel.fit(CorrespondedShapes([*"abc"], shapes), "remove")
    np.testing.assert_allclose(model.aligned, found.aligned, atol=1e-12)
    many = RNG.normal(size=(20, 4, 2))
    many[10:, 2] += 4
    assert group_test(many, ["a"] * 10 + ["b"] * 10).significant().tolist() == [False, False, True, False]


def test_shapes_in_tangent_space_differ_from_the_mean_across_it():
    shapes = 0.1 * RNG.normal(size=(4, 6, 3)) + RNG.normal(size=(6, 3))
    found = generalised_procrustes(shapes, scale="remove", tangent=True)
    plain = generalised_procrustes(shapes, scale="remove")
    centre = plain.mean.mean(axis=0)
    mean = (plain.mean - centre) / np.linalg.norm(plain.mean - centre)
    along = np.einsum("sij,ij->s", found.aligned - centre, mean)
    np.testing.assert_allclose(along, found.size * np.sqrt(6))
    across = (found.aligned - plain.aligned) - np.einsum(
        "s,ij->sij", along - np.einsum("sij,ij->s", plain.aligned - centre, mean), mean
    )
    np.testing.assert_allclose(across, 0, atol=1e-12)
    with pytest.raises(SettingError, match="tangent"):
        generalised_procrustes(shapes, tangent=True)
