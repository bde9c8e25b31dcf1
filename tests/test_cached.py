"""What objects keep goes with them, without waiting for the garbage collector."""

import gc
from weakref import ref

import numpy as np
import pytest

from isomatch import match, match_both, prepare
from isomatch._core.cached import cached_method
from isomatch_lab.evaluation import BenchmarkRun
from isomatch_lab.evaluation.methods import METHODS
from isomatch_lab.evaluation.subject import Subject
from isomatch_lab.procedural import creature


@pytest.fixture(autouse=True)
def without_collector():
    gc.collect()
    gc.disable()
    yield
    gc.enable()


def test_a_method_is_computed_once_for_each_object_and_arguments():
    class Counted:
        def __init__(self, factor):
            self.factor, self.calls = factor, 0

        @cached_method
        def times(self, number, plus=0):
            self.calls += 1
            return self.factor * number + plus

    two, three = Counted(2), Counted(3)
    assert [two.times(5), two.times(5), two.times(5, plus=1), three.times(5), two.times(6)] == [
        10,
        10,
        11,
        15,
        12,
    ]
    assert (two.calls, three.calls) == (3, 1)
    gone = ref(two)
    del two
    assert gone() is None


def shapes_of(share):
    """Two prepared poses, the second one cut to a share of its vertices."""
    pair = [creature(1500, pose=pose, triangulation=pose).mesh for pose in (1, 2)]
    order = np.argsort(pair[1].vertices[:, 0])
    kept = np.zeros(pair[1].n_vertices, bool)
    kept[order[: int(share * len(order))]] = True
    pair[1] = pair[1].submesh(kept)[0]
    return [prepare(mesh) for mesh in pair]


@pytest.mark.long
@pytest.mark.parametrize(
    ("function", "share"), [(match, 1.0), (match_both, 1.0), *((each, 0.6) for each in (match, match_both))]
)
def test_a_match_keeps_no_shape(function, share):
    shapes = shapes_of(share)
    function(*shapes)
    gc.collect()  # what the first call compiled
    found = function(*shapes)
    gone = [ref(shape) for shape in shapes]
    del shapes, found
    assert [each() for each in gone] == [None, None]


@pytest.mark.long
def test_a_pair_of_a_benchmark_goes_when_the_next_one_comes():
    method, pair = METHODS["isomatch_5pt"], BenchmarkRun("example").chosen_pairs()[0]
    Subject(BenchmarkRun("example"), pair).match(method)
    gc.collect()  # what the first call compiled
    subject = Subject(BenchmarkRun("example"), pair)
    subject.match(method)
    gone = [ref(shape) for shape in subject._prepared(method.preparation)[0]]
    assert all(each() is not None for each in gone), "they are kept for the next method"
    del subject
    assert [each() for each in gone] == [None, None]
