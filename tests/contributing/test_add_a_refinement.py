"""The recipe "Add a refinement" of CONTRIBUTING.md, followed with spectral upsampling."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from isomatch import Config, Outcome, SettingError, match
from isomatch.matching import (
    Elastic,
    Isometry,
    Part,
    Refinement,
    check_refinement,
    prepare_pair,
    search_under,
)
from isomatch_lab.damage import cut

pytestmark = pytest.mark.usefixtures("prepared_once")


class Upsampling(Refinement):
    """ZoomOut: images and the functional map that fits them take turns, while it grows."""

    def __call__(self, problem, fit):
        spectra = problem.spectra
        return spectra.image(spectra.fit_and_upsample(fit.image, (20, 40, 60, 80, 100)))


@pytest.fixture
def animals(example, example_truth):
    """Two poses, and the true image of each vertex of the first."""
    return *(made.mesh for made in example), example_truth


def mean_error(found, mesh, truth):
    """Mean distance of images from the true ones, where there are some, in √area."""
    known = found.matched & (truth >= 0)
    off = mesh.vertices[found.vertices[known]] - mesh.vertices[truth[known]]
    return np.linalg.norm(off, axis=1).mean() / np.sqrt(mesh.area)


def test_it_keeps_the_laws():
    check_refinement(Upsampling())


@pytest.mark.long
def test_it_finds_the_right_map(animals):
    source, target, truth = animals
    found = match(source, target, refinement=Upsampling())
    assert found.outcome is Outcome.CONVERGED
    assert mean_error(found.map, target, truth) < 0.02


@pytest.mark.long
@pytest.mark.parametrize("side", ["source", "target"])
def test_it_refines_the_map_of_a_part(animals, side):
    source, target, truth = animals
    part = cut(source, 0.2, seed=1)
    shapes, known = (part.mesh, target), truth[part.original]
    if side == "target":
        back = np.full(target.n_vertices, -1)
        back[known] = np.arange(len(known))
        shapes, known = shapes[::-1], back
    found = match(
        *shapes,
        initial_map=known,
        config=Config(hypotheses="given"),
        relation=partial(Part, side=side),
        refinement=Upsampling(),
    )
    assert found.outcome is Outcome.PARTIAL
    assert mean_error(found.map, shapes[1], known) < 0.02


@pytest.mark.long
def test_it_refines_an_elastic_map(animals):
    source, target, truth = animals
    everywhere = np.column_stack([np.arange(len(truth)), truth])
    prepared = prepare_pair(source, target)
    model = Elastic(replace(prepared, refinement=Upsampling(), starts=[lambda problem: [everywhere[::5]]]))
    best = search_under(model).ranking.best
    assert best.image.shape == model.vertices.shape
    assert model.target.mean_distance(best.image, truth[model.vertices]) < 0.04


@pytest.mark.long
@pytest.mark.parametrize("relation", [Isometry, Part])
@pytest.mark.parametrize("sizes", [{"final_sizes": ()}, {"final_sizes": (), "sizes_with_positions": ()}])
def test_maps_are_measured_by_the_last_step_there_is(animals, relation, sizes):
    source, target, truth = animals
    refining = replace(Config().refining, **sizes)
    given = Config(hypotheses="given", search_runners_up=False, refining=refining)
    for refinement in (Upsampling(), None):
        found = match(
            source, target, initial_map=truth, config=given, relation=relation, refinement=refinement
        )
        assert found.quality.spectral_residual < 0.5
        assert mean_error(found.map, target, truth) < 0.03


@pytest.mark.long
def test_what_is_no_map_is_refused(animals):
    class Whole(Upsampling):
        def __call__(self, problem, fit):
            return fit

    with pytest.raises(SettingError, match="Whole gave images of shape"):
        match(*animals[:2], refinement=Whole())
