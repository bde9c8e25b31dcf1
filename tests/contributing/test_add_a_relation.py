"""The recipe "Add a relation" of CONTRIBUTING.md, followed with an isometry scored by its spectral residual alone."""

import numpy as np
import pytest

from isomatch import Outcome, SettingError, match
from isomatch.matching import Isometry, Part, Priors, Refinement, Stages, prepare_pair

pytestmark = pytest.mark.usefixtures("prepared_once")


class BySpectralResidual(Isometry):
    """Distances along both shapes agree; the map that fits best wins, whatever its energy."""

    def score(self, fit):
        return fit.spectral_residual


class Unchanged(Refinement):
    """Measures maps as they are."""

    def __call__(self, relation, fit):
        return relation.measured(fit, fit.image)


@pytest.fixture
def animals(example):
    """Two poses."""
    return tuple(made.mesh for made in example)


@pytest.mark.long
def test_it_finds_the_right_map(animals, example_truth):
    source, target = animals
    found = match(source, target, relation=BySpectralResidual())
    assert found.outcome is Outcome.CONVERGED
    off = np.linalg.norm(target.vertices[found.map.vertices] - target.vertices[example_truth], axis=1)
    assert off.mean() < 0.02 * np.sqrt(target.area)


@pytest.mark.long
def test_the_hook_scores_every_map(animals):
    pair = prepare_pair(*animals)
    for relation in (BySpectralResidual(), Isometry()):
        bound = relation.on(pair, Priors.of(pair, None, None, None), Stages(Unchanged()))
        candidates, _ = bound.candidates(*bound.hypotheses())
        fits = bound.refine_and_select(bound.begun(candidates[:3]))
        assert len(fits) == 3
        assert [fit.score == fit.spectral_residual for fit in fits] == 3 * [
            isinstance(relation, BySpectralResidual)
        ]


@pytest.mark.long
def test_a_bound_relation_can_be_bound_again(animals):
    """What was computed for one pair is not used for another."""
    there, back = prepare_pair(*animals), prepare_pair(*animals[::-1])
    priors = Priors.of(there, None, None, None)
    bound = Part("target").on(there, priors)
    assert bound.spectra.target is not bound.on(back, priors).spectra.target


def test_a_class_is_not_a_relation(animals):
    with pytest.raises(SettingError, match="Relation"):
        match(*animals, relation=BySpectralResidual)
