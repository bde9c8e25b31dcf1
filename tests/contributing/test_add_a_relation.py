"""The recipe "Add a relation" of CONTRIBUTING.md, followed with an isometry scored by its spectral residual alone."""

from dataclasses import replace

import numpy as np
import pytest

from isomatch import Config, Outcome, SettingError, match
from isomatch.matching import Isometry, Refinement, prepare_pair

pytestmark = pytest.mark.usefixtures("prepared_once")


class BySpectralResidual(Isometry):
    """Distances along both shapes agree; the map that fits best wins, whatever its energy."""

    def cost(self, fit):
        return fit.spectral_residual


class Unchanged(Refinement):
    """Leaves maps as they are."""

    def __call__(self, problem, fit):
        return fit.image


@pytest.fixture
def animals(example):
    """Two poses."""
    return tuple(made.mesh for made in example)


@pytest.mark.long
def test_it_finds_the_right_map(animals, example_truth):
    source, target = animals
    found = match(source, target, relation=BySpectralResidual)
    assert found.outcome is Outcome.CONVERGED
    off = np.linalg.norm(target.vertices[found.map.vertices] - target.vertices[example_truth], axis=1)
    assert off.mean() < 0.02 * np.sqrt(target.area)


@pytest.mark.long
def test_the_hook_scores_every_map(animals):
    problem = replace(prepare_pair(*animals), refinement=Unchanged())
    for relation in (BySpectralResidual, Isometry):
        model = relation(problem)
        candidates, _ = model.candidates(*model.hypotheses())
        fits = model.refine(model.begin(candidates[:3]))
        assert len(fits) == 3
        assert [fit.score == fit.spectral_residual for fit in fits] == 3 * [relation is BySpectralResidual]


class Weighted(Isometry):
    """One that is not built from a problem alone."""

    def __init__(self, problem, exponent):
        super().__init__(problem)
        self.exponent = exponent

    def cost(self, fit):
        return super().cost(fit) ** self.exponent


@pytest.mark.long
def test_a_function_builds_the_relation(animals, example_truth):
    """It is the only one, also of a map that is not sure."""
    source, target = animals
    config = Config()
    unsure = replace(config, outcome=replace(config.outcome, poor_spectral_residual=1e-3))
    directions = []

    def weighted(problem):
        directions.append(problem.source.surface.n_vertices)
        return Weighted(problem, 0.5)

    found = match(source, target, config=unsure, relation=weighted)
    assert directions == [source.n_vertices]
    off = np.linalg.norm(target.vertices[found.map.vertices] - target.vertices[example_truth], axis=1)
    assert off.mean() < 0.02 * np.sqrt(target.area)


def test_an_object_is_refused_and_so_is_what_builds_no_model(animals):
    for relation in ("isometry", Isometry(prepare_pair(*animals))):
        with pytest.raises(SettingError, match=f"type {type(relation).__name__}; .*relation=Isometry"):
            match(*animals, relation=relation)

    def nothing(problem):
        return None

    with pytest.raises(SettingError, match="relation = nothing makes an object of type NoneType"):
        match(*animals, relation=nothing)
