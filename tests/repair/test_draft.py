"""Traces of vertices compose, and lead from what is matched back to what was given."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from isomatch import MeshError
from isomatch.repair import VertexTrace, check, prepare_for_matching, repair
from zoo import zoo


def some_trace(draw, n):
    """Vertices of n that are kept, and a copy of some of them at the end."""
    kept = VertexTrace.of_kept(np.array(draw(st.lists(st.booleans(), min_size=n, max_size=n)), dtype=bool))
    m = len(kept.given)
    copies = draw(st.lists(st.integers(0, m - 1), max_size=3)) if m else []
    return kept.then(VertexTrace(np.append(np.arange(m), copies).astype(np.int64), np.arange(m)))


@given(st.data())
def test_traces_compose(data):
    first = some_trace(data.draw, 7)
    second = some_trace(data.draw, len(first.given))
    third = some_trace(data.draw, len(second.given))
    values = np.arange(7.0)
    both = first.then(second)
    np.testing.assert_array_equal(values[both.given], values[first.given][second.given])
    one, other = both.then(third), first.then(second.then(third))
    np.testing.assert_array_equal(one.given, other.given)
    np.testing.assert_array_equal(one.current, other.current)
    kept = one.current >= 0
    np.testing.assert_array_equal(one.given[one.current[kept]], np.flatnonzero(kept))
    np.testing.assert_array_equal(VertexTrace.of_all(7).then(first).current, first.current)


@pytest.mark.parametrize("specimen", zoo(), ids=repr)
def test_what_is_matched_is_traced_to_what_was_given(specimen):
    if check(specimen.mesh).fatal:
        with pytest.raises(MeshError):
            prepare_for_matching(specimen.mesh, 0.1)
        return
    draft = prepare_for_matching(specimen.mesh, np.inf)
    mended = repair(specimen.mesh, unmerge=np.inf)
    np.testing.assert_array_equal(draft.mesh.vertices, specimen.mesh.vertices[draft.trace.given])
    np.testing.assert_array_equal(draft.mesh.faces, mended.mesh.faces)
    np.testing.assert_array_equal(draft.trace.current, mended.new_index)
    assert draft.notes[: len(mended.changes)] == mended.changes
