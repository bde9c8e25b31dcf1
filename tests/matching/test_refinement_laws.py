"""Refinements of isomatch keep the laws, and an error explains each kind of broken refinement."""

import os

import numpy as np
import pytest

from isomatch import SettingError
from isomatch.correspondence import Embedding
from isomatch.matching import REFINEMENTS, Refinement, check_refinement
from later import some_later


@pytest.mark.parametrize("name", some_later(REFINEMENTS, lambda name: name == "joint"))
def test_those_of_isomatch_keep_the_laws(name):
    check_refinement(REFINEMENTS[name], seed=1)


class Changed(Refinement):
    """Changes the images by a function of the problem and the images."""

    def __init__(self, change):
        self.change = change

    def __call__(self, problem, fit):
        return self.change(problem, fit.image)


def unchanged(problem, image):
    return image


def shuffled(problem, image):
    return np.random.default_rng(0).permutation(image)


def numbered(problem, image):
    """Take the neighbour of the lowest number, which is not far away."""
    lowest = np.arange(problem.target.body.n_vertices)
    for i, j in (*problem.target.body.edges, *problem.target.body.edges[:, ::-1]):
        lowest[i] = min(lowest[i], j)
    return lowest[image]


def test_a_refinement_that_does_nothing_keeps_them():
    check_refinement(Changed(unchanged))


@pytest.mark.long
@pytest.mark.parametrize(
    ("change", "message"),
    [
        (shuffled, r'Changed breaks the law "truth": .* mean error of 0\.\d+ .*look at __call__'),
        (numbered, r'"relabelling": \d+% of the images .* look at what uses the number of a vertex'),
        (lambda problem, image: image[:5], r"refinement Changed gave images of shape \(5,\)"),
        (lambda problem, image: image / 1.0, "type float64; expected"),
        (lambda problem, image: image + 9000, r"images from 9000 to \d+; expected \(500,\) vertices of"),
    ],
)
def test_what_is_broken_is_named(change, message):
    with pytest.raises(SettingError, match=message):
        check_refinement(Changed(change))


class ByThreads(Changed):
    def __call__(self, problem, fit):
        image = super().__call__(problem, fit)
        return image if os.environ["ISOMATCH_NUM_THREADS"] == "1" else image[::-1]


class Exchanged(Changed):
    def everywhere(self, problem, fit, coordinates):
        source, target = coordinates()
        return Embedding(source, target[::-1])


class Short(Changed):
    def everywhere(self, problem, fit, coordinates):
        source, target = coordinates()
        return Embedding(source[:-1], target)


RANDOM = np.random.default_rng()


@pytest.mark.parametrize(
    ("refinement", "message"),
    [
        (Changed(lambda problem, image: RANDOM.permutation(image)), "repeatable"),
        (ByThreads(unchanged), "repeatable"),
        (Exchanged(unchanged), "everywhere"),
        (Short(unchanged), "coordinates"),
    ],
    ids=["random", "by threads", "exchanged everywhere", "too few coordinates"],
)
def test_what_is_not_repeatable_or_wrong_everywhere_is_named(refinement, message):
    with pytest.raises(SettingError, match=message):
        check_refinement(refinement)


@pytest.mark.long
def test_the_number_of_threads_is_as_before(monkeypatch):
    monkeypatch.setenv("ISOMATCH_NUM_THREADS", "2")
    check_refinement(Changed(unchanged))
    assert os.environ["ISOMATCH_NUM_THREADS"] == "2"
    monkeypatch.delenv("ISOMATCH_NUM_THREADS")
    check_refinement(Changed(unchanged))
    assert "ISOMATCH_NUM_THREADS" not in os.environ
