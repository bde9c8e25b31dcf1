"""
Your own matcher in forty lines
===============================

A match has stages: first maps are screened, the best are refined, measured and compared. Each stage can be called
alone, and three of them can be replaced: the starts, the refinement, and the relation that is claimed of the shapes.
"""

import numpy as np

from isomatch import match
from isomatch.datasets import example_pair, ground_truth
from isomatch.matching import (
    Isometry,
    Priors,
    Refinement,
    Stages,
    check_refinement,
    default_starts,
    prepare_pair,
)
from isomatch.visualization import draw_map


class Upsampling(Refinement):
    """ZoomOut: images and the functional map that fits them take turns, while it grows."""

    def __call__(self, relation, fit):
        """Refine one map."""
        spectra = relation.spectra
        functional_map = spectra.grown(fit.image, range(20, 101, 10))
        return relation.measured(fit, spectra.image(functional_map))


def axes_of_inertia(pair):
    """First maps to the nearest point in space once principal axes agree, with their four turns."""
    places = []
    for shape in (pair.source, pair.target):
        points = shape.body.vertices - shape.body.vertices.mean(axis=0)
        axes = np.linalg.svd(points, full_matrices=False)[2]
        axes[2] *= np.sign(np.linalg.det(axes))
        places.append(points @ axes.T)
    for turn in ([1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]):
        apart = np.linalg.norm(
            places[0][pair.source_vertices, None] * turn - places[1][pair.target_vertices], axis=2
        )
        yield np.column_stack([pair.source_vertices, pair.target_vertices[apart.argmin(axis=1)]])


# %%
# Laws that every refinement must keep are checked on a small shape: the true map stays the true map, and neither the
# numbers of vertices nor of threads matter.

check_refinement(Upsampling())

# %%
# The stages one by one. Hypotheses are first maps of few vertices; candidates come with the evidence for them; fits map
# the vertices on which maps are refined.

source, target = example_pair()
pair = prepare_pair(source.mesh, target.mesh)
stages = Stages(Upsampling(), starts=[axes_of_inertia, *default_starts])
relation = Isometry().on(pair, Priors.of(pair, None, None, None), stages)
hypotheses, _ = relation.hypotheses()
candidates, _ = relation.candidates(hypotheses)
fits = relation.refine_and_select(relation.begun(candidates[:3]))
for fit in fits:
    print(f"from {fit.candidate.hypothesis.origin}: score {relation.score(fit):.3f}")

# %%
# The map is read off in coordinates in which images are nearest points.

best = min(fits, key=relation.score)
embedding = relation.embedding(best)
points = pair.target.index.points(embedding.target, embedding.source)
own = pair.source.correspondence(pair.target, points)
truth = ground_truth(source, target).vertices
off = np.linalg.norm(target.mesh.vertices[own.vertices] - target.mesh.vertices[truth], axis=1)
print(f"mean error {off.mean() / np.sqrt(target.mesh.area):.4f} √area")
draw_map(source.mesh, target.mesh, own, "own_matcher.png")

# %%
# Handed to :func:`isomatch.match`, the same stages take part in all that it does: model selection with alternatives, the
# verdict, and shapes that are cut or stretched.

result = match(source.mesh, target.mesh, refinement=Upsampling(), starts=stages.starts)
print(result.outcome.name, "from", result.origin)
