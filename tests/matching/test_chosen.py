"""An alternative of a result becomes the map, and the map an alternative."""

import gc
from dataclasses import replace
from weakref import ref

import numpy as np
import pytest

from isomatch import Correspondence, MapError, SettingError
from isomatch.matching import Alternative, continue_with, match
from served_pages import PAIRS, QUICK, bent


@pytest.fixture(scope="module")
def found():
    """A result with two alternatives: all vertices to one, and the map itself."""
    shape = bent()
    result = match(shape, shape, landmarks=PAIRS, config=QUICK)
    one = Correspondence(np.zeros(shape.n_vertices, dtype=int), shape.n_vertices)
    maps = {"a point": one, "the map before, itself": result.map}
    others = (Alternative(lambda found=found: found, 0.1, 0.5, name) for name, found in maps.items())
    return shape, replace(result, alternatives=tuple(others))


def test_what_was_chosen_is_the_map_and_the_map_before_the_first_alternative(found):
    shape, result = found
    chosen = continue_with(result, 2, shape, shape)
    assert chosen.origin == "itself"
    assert chosen.notes[0].startswith("alternative 2, from itself, was chosen and refined")
    assert [alternative.origin for alternative in chosen.alternatives] == [
        f"the map before, {result.origin}",
        "a point",
    ]
    assert chosen.alternatives[0].map is result.map
    assert chosen.alternatives[1].map is result.alternatives[0].map
    assert (chosen.config.hypotheses, chosen.seed) == ("given", result.seed)
    distance = np.linalg.norm(
        shape.vertices[chosen.map.vertices] - shape.vertices[result.map.vertices], axis=1
    )
    assert np.median(distance) < 0.05 * np.sqrt(shape.area)


@pytest.mark.long
def test_the_result_before_is_not_kept(found):
    shape, result = found
    before = replace(result)
    chosen, gone = continue_with(before, 2, shape, shape), ref(before)
    del before
    gc.collect()
    assert gone() is None
    assert chosen.alternatives[0].map is result.map


def test_what_cannot_be_chosen_is_refused(found):
    shape, result = found
    for number in (0, 3):
        with pytest.raises(SettingError, match="alternative"):
            continue_with(result, number, shape, shape)
    with pytest.raises(MapError, match="another source"):
        continue_with(result, 2, shape.moved(2 * shape.vertices), shape)
