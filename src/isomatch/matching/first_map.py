"""The best hypothesis, unrefined: what a method that needs a first map can start from."""

from __future__ import annotations

from isomatch.matching.candidates import Judge, extended
from isomatch.matching.hints import Hints
from isomatch.matching.pair import ShapePair
from isomatch.matching.search import hypotheses_from_hints, search
from isomatch.matching.select import ranked
from isomatch.settings import Orientation
from isomatch.values.arrays import IntArray


def first_map(
    pair: ShapePair, hints: Hints, source_vertex: IntArray, orientation: Orientation
) -> tuple[IntArray, str]:
    """Map some source vertices (q,) by the best hypothesis, from hints if there are any, else automatic.

    Returns
    -------
    target_vertex : (q,) array of int
        Vertices of the target's body.
    origin : str
        Where the hypothesis came from.
    """
    found = hypotheses_from_hints(pair, hints) if hints.any else search(pair, [])
    order = ranked(Judge(pair, hints)(found), orientation, pair.config.selection, bool(len(hints.landmarks)))
    return extended(pair, order[0].target_row, source_vertex), order[0].hypothesis.origin
