"""Results made by hand, to be looked at."""

from dataclasses import replace

import numpy as np

from isomatch import Config, Correspondence, Outcome, Quality
from isomatch.matching import MatchResult

QUALITY = Quality(0.3, 1.0, 1.0, 0.1, 1.0, 0.9, 0.01, 0.02, 1.0, 1.0, np.nan, np.nan)


def map_of(surface, image=None):
    """A map of a surface onto itself, by default the identity."""
    image = np.arange(surface.n_vertices) if image is None else image
    return Correspondence(image, surface.n_vertices, None, None, surface.content_hash, surface.content_hash)


def result_of(surface, **changes):
    """A doubtful result whose map is the identity."""
    made = MatchResult(
        map=map_of(surface),
        outcome=Outcome.LOW_CONFIDENCE,
        quality=QUALITY,
        expected_error=np.linspace(0, 0.1, surface.n_vertices),
        alternatives=(),
        timings={"total": 1.0},
        notes=("<b>a note</b> & more",),
        engine="fast_marching",
        origin="extremities",
        reason="least spectral residual",
        config=Config(rank=40),
        seed=0,
    )
    return replace(made, **changes)
