"""Other methods behind the door of `match`: laws on relabelled copies, bounds on the shipped pair, named errors."""

import inspect
import json
import re
from dataclasses import replace

import numpy as np
import pytest
from poses import error, landmarks_of

from isomatch import (
    Config,
    InputError,
    MapError,
    Mesh,
    MeshError,
    Outcome,
    PointCloud,
    SettingError,
    match,
    prepare,
)
from isomatch_lab.baselines import (
    BASELINES,
    FunctionalMapsConfig,
    GmdsConfig,
    GradientFieldsConfig,
    GromovWassersteinConfig,
    LaplaceConfig,
    SpectralGmdsConfig,
    ZoomOutConfig,
    functional_maps,
    gdd,
    gdd_post,
    gmds,
    gromov_wasserstein,
    laplace_nearest_neighbours,
    spectral_gmds,
    spectral_gradient_fields,
    zoomout,
)
from isomatch_lab.procedural import creature
from later import some_later
from shapes import disguised
from zoo.made import together

pytestmark = pytest.mark.usefixtures("prepared_once")
REGISTERED = {each.function: each for each in BASELINES.values() if each.preparation is not None}
CONFIG = {method: each.config for method, each in REGISTERED.items()} | {  # smaller problems, for speed
    functional_maps: FunctionalMapsConfig(n_functions=30),
    zoomout: ZoomOutConfig(n_functions=30, last=100),
    spectral_gmds: SpectralGmdsConfig(sizes=(15, 30)),
    spectral_gradient_fields: GradientFieldsConfig(n_functions=30),
}
ALL = list(REGISTERED)
BY_AREA = [method for method, each in REGISTERED.items() if each.preparation.weights == "area"]


@pytest.fixture(scope="module")
def animal():
    return creature(1500).mesh


@pytest.fixture(scope="module")
def copies(animal):
    """The animal and its relabelled copy, prepared by area and as the methods of the paper ask for; the truth."""
    other = disguised(animal, seed=1)
    as_published = BASELINES["gdd"].preparation
    by_weights = [
        tuple(prepare(m, config) for m in (animal, other.mesh)) for config in (Config(), as_published)
    ]
    return *by_weights, other.new_vertex


@pytest.mark.parametrize("method", ALL)
def test_signature_is_that_of_match(method):
    """But for the progress, and the stages, which are those of the matcher."""
    parameters = inspect.signature(match).parameters.values()
    expected = [p.name for p in parameters if p.kind is not p.KEYWORD_ONLY and p.name != "progress"]
    assert list(inspect.signature(method).parameters) == expected


@pytest.mark.parametrize(
    "method", some_later(ALL, lambda method: method not in (gmds, gromov_wasserstein, gdd, gdd_post))
)
def test_relabelled_copy_gives_the_relabelling(copies, method):
    area, uniform, truth = copies
    shapes = area if method in BY_AREA else uniform
    landmarks = landmarks_of(shapes[0], truth)
    found = method(*shapes, landmarks=landmarks, config=CONFIG[method])
    assert (found.map.vertices == truth).mean() > 0.95
    assert error(found.map.vertices, truth, shapes[1].surface) < 1e-3
    assert found.quality.landmark_error < 1e-3
    assert found.quality.residual < 0.01
    assert found.outcome is Outcome.CONVERGED


@pytest.mark.parametrize("method", some_later(BY_AREA, lambda method: method is laplace_nearest_neighbours))
def test_true_initial_map_is_not_left(copies, method):
    shapes, _, truth = copies
    found = method(*shapes, initial_map=truth, config=CONFIG[method])
    assert (found.map.vertices == truth).mean() > 0.99
    assert found.origin == ("functional map" if method is functional_maps else "initial map")


@pytest.mark.long
def test_copy_without_priors(copies):
    """The animal is asymmetric."""
    shapes, _, truth = copies
    for method in (functional_maps, zoomout, spectral_gmds, spectral_gradient_fields):
        image = method(*shapes, config=CONFIG[method]).map.vertices
        assert (image == truth).mean() > 0.95


@pytest.mark.long
@pytest.mark.parametrize("method", [zoomout, spectral_gradient_fields])
def test_mirror_image_needs_the_other_orientation(animal, method):
    mirrored = Mesh(animal.vertices * [-1, 1, 1], animal.faces[:, ::-1])
    shapes, truth = (prepare(animal), prepare(mirrored)), np.arange(animal.n_vertices)
    found = {
        side: method(*shapes, config=replace(CONFIG[method], orientation=side))
        for side in ("preserve", "reverse")
    }
    assert error(found["reverse"].map.vertices, truth, mirrored) < 1e-3
    assert found["reverse"].quality.orientation < -0.9
    assert error(found["preserve"].map.vertices, truth, mirrored) > 0.1


@pytest.mark.parametrize(
    ("method", "bound"),
    some_later(
        [
            (functional_maps, 0.03),
            (zoomout, 0.02),
            (laplace_nearest_neighbours, 0.04),
            (gmds, 0.03),
            (gromov_wasserstein, 0.03),
            (spectral_gmds, 0.02),
            (spectral_gradient_fields, 0.02),
            (gdd, 0.04),
            (gdd_post, 0.03),
        ],
        lambda case: case[0] in (laplace_nearest_neighbours, gromov_wasserstein, spectral_gradient_fields),
    ),
)
def test_example_pair_with_landmarks(example, example_truth, prepared_example, method, bound):
    shapes = prepared_example if method in BY_AREA else [made.mesh for made in example]
    landmarks = landmarks_of(prepared_example[0], example_truth)
    found = method(*shapes, landmarks=landmarks)
    assert error(found.map.vertices, example_truth, example[1].mesh) < bound
    assert found.quality.landmark_error < 0.06


@pytest.mark.long
@pytest.mark.parametrize("signatures", ["heat", "both"])
def test_heat_kernel_signatures_serve_as_well(example, example_truth, prepared_example, signatures):
    landmarks = landmarks_of(prepared_example[0], example_truth)
    config = FunctionalMapsConfig(30, signatures=signatures)
    found = functional_maps(*prepared_example, landmarks=landmarks, config=config)
    wave = functional_maps(*prepared_example, landmarks=landmarks, config=replace(config, signatures="wave"))
    assert error(found.map.vertices, example_truth, example[1].mesh) < 0.03
    assert (found.map.vertices != wave.map.vertices).any()


@pytest.mark.long
def test_gdd_improves_another_map(example, example_truth, prepared_example):
    start = functional_maps(*prepared_example, config=FunctionalMapsConfig(20, refinement="none"))
    found = gdd(*(made.mesh for made in example), initial_map=start.map)
    before, after = (error(x.map.vertices, example_truth, example[1].mesh) for x in (start, found))
    assert after < before
    assert found.origin == "initial map"


@pytest.mark.long
def test_descriptors_are_used(example, example_truth, prepared_example):
    values = np.sin(example[1].rest @ np.random.default_rng(0).normal(size=(3, 12)))
    prior = values[example_truth], values
    config = FunctionalMapsConfig(30, product_weight=0.0, orientation="any", refinement="none")
    plain, with_priors = (
        functional_maps(*prepared_example, initial_descriptors=d, config=config).map.vertices
        for d in (None, prior)
    )
    errors = [error(image, example_truth, example[1].mesh) for image in (with_priors, plain)]
    assert errors[0] < 0.03 < errors[1]


def test_laplace_basis_from_descriptors(copies):
    shapes, _, truth = copies
    values = np.sin(3 * shapes[1].surface.vertices @ np.random.default_rng(0).normal(size=(3, 30)))
    found = laplace_nearest_neighbours(*shapes, initial_descriptors=(values[truth], values))
    assert found.origin == "descriptors"
    assert (found.map.vertices == truth).mean() > 0.95


def test_what_a_result_tells(copies):
    found = laplace_nearest_neighbours(*copies[0], initial_map=copies[2], seed=3)
    record = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert record["quality"]["spectral_residual"] is None
    assert record["quality"]["runner_up"] is None
    assert record["quality"]["stretch"] == pytest.approx(1, abs=0.01)
    assert record["config"] == {"n_functions": 50, "steps": 15, "orientation": "any"}
    assert record["seed"] == 3
    assert {"prepare", "refinement", "points", "quality", "total"} <= set(record["timings"])
    assert "a baseline tries no other map" in record["notes"][-1]


@pytest.mark.long
@pytest.mark.parametrize("method", [functional_maps, spectral_gmds, spectral_gradient_fields])
def test_points_have_no_orientation(animal, method):
    cloud = PointCloud(animal.vertices)
    found = method(cloud, cloud, config=CONFIG[method])
    assert (found.map.vertices == np.arange(animal.n_vertices)).mean() > 0.95
    assert np.isnan(found.quality.orientation)


@pytest.mark.long
def test_vertices_off_the_body_are_unmatched(animal):
    mesh = together(animal, Mesh(animal.vertices.max(axis=0) + 0.01 * np.eye(3), [[0, 1, 2]]))
    truth = np.append(np.arange(animal.n_vertices), [-1, -1, -1])
    found = zoomout(mesh, animal, initial_map=truth, config=CONFIG[zoomout])
    assert (found.map.vertices[-3:] == -1).all()
    assert (found.map.vertices == truth).mean() > 0.95


@pytest.mark.parametrize("method", ALL)
def test_priors_that_do_not_fit(copies, method):
    shapes = copies[0] if method in BY_AREA else copies[1]
    for prior, told in (
        ({"landmarks": [[0, 1], [2, 3]]}, "2 landmarks do not fix"),
        ({"landmarks": [[0, 1], [2, 3], [4, 10**6]]}, "target vertices 1000000, outside"),
        ({"initial_map": [0, 1]}, "initial map has shape"),
        ({"initial_descriptors": ([[1.0]], [[1.0]])}, "initial descriptors of the source have 1 rows"),
    ):
        with pytest.raises(InputError, match=told):
            method(*shapes, **prior, config=CONFIG[method])


def test_surfaces_that_cannot_be_used(copies):
    flat = Mesh(np.zeros((3, 3)), [[0, 1, 2]])
    with pytest.raises(MeshError, match=r"^target: "):
        functional_maps(copies[0][0], flat)
    with pytest.raises(SettingError, match="prepared"):
        zoomout(copies[0][0], copies[1][1])


def test_methods_that_need_a_prior(copies):
    with pytest.raises(SettingError, match="landmarks"):
        laplace_nearest_neighbours(*copies[0])
    with pytest.raises(SettingError, match="descriptors"):
        gdd(*copies[1], config=CONFIG[gdd])
    with pytest.raises(MapError, match="components"):
        zoomout(*copies[0], initial_map=np.full(len(copies[2]), -1))


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        (lambda: FunctionalMapsConfig(n_functions=1), "n_functions = 1 is not an integer of at least 2"),
        (
            lambda: FunctionalMapsConfig(product_weight=-1.0),
            "product_weight = -1.0 is not a number of at least 0",
        ),
        (lambda: FunctionalMapsConfig(signatures="sound"), "signatures = 'sound' is not one of 'wave'"),
        (lambda: FunctionalMapsConfig(orientation="left"), "orientation = 'left' is not one of 'preserve'"),
        (lambda: ZoomOutConfig(last=30), "last = 30 is not at least 50"),
        (lambda: ZoomOutConfig(step=0), "step = 0 is not an integer of at least 1"),
        (lambda: GmdsConfig(levels=(50, 10)), "levels = (50, 10) are not increasing numbers of points"),
        (lambda: GmdsConfig(n_sweeps=0), "n_sweeps = 0 is not an integer of at least 1"),
        (lambda: GmdsConfig(orientation="left"), "orientation = 'left' is not one of 'preserve'"),
        (lambda: GromovWassersteinConfig(n_samples=80), "n_samples = 80 is not at least 100"),
        (lambda: GromovWassersteinConfig(distance_weight=0.0), "distance_weight = 0.0 is not above 0"),
        (
            lambda: GromovWassersteinConfig(orientation="left"),
            "orientation = 'left' is not one of 'preserve'",
        ),
        (lambda: LaplaceConfig(steps=0), "steps = 0 is not an integer of at least 1"),
        (lambda: SpectralGmdsConfig(sizes=(20, 20)), "do not grow from at least 3"),
        (lambda: SpectralGmdsConfig(icp_steps=0), "icp_steps = 0 is not an integer of at least 1"),
        (lambda: SpectralGmdsConfig(data_weight=-1.0), "data_weight = -1.0 is not a number of at least 0"),
        (
            lambda: GradientFieldsConfig(n_matched=20),
            "n_matched = 20 is not an integer of at least 2 and at most 14",
        ),
        (lambda: GradientFieldsConfig(n_functions=10), "n_functions = 10 is not at least 13"),
        (lambda: GradientFieldsConfig(orientation="left"), "orientation = 'left' is not one of 'preserve'"),
    ],
)
def test_settings_that_make_no_sense(settings, told):
    with pytest.raises(SettingError, match=re.escape(told)):
        settings()
