"""
Your own matcher in forty lines
===============================

A match has stages: first maps are screened, the best are refined, measured and compared. Each stage can be called
alone, and three of them can be replaced: the starts, the refinement, and the model of what is claimed of the shapes.
"""

from dataclasses import replace

import numpy as np

from isomatch import match
from isomatch.datasets import example_pair, ground_truth
from isomatch.matching import (
    Isometry,
    Refinement,
    check_refinement,
    default_starts,
    prepare_pair,
)
from isomatch.visualization import draw_map


class Upsampling(Refinement):
    """ZoomOut: images and the functional map that fits them take turns, while it grows."""

    def __call__(self, problem, fit):
        """Refine one map."""
        spectra = problem.spectra
        return spectra.image(spectra.fit_and_upsample(fit.image, range(20, 101, 10)))


def axes_of_inertia(problem):
    """First maps to the nearest point in space once principal axes agree, with their four turns."""
    places = []
    for shape in (problem.source, problem.target):
        points = shape.body.vertices - shape.body.vertices.mean(axis=0)
        axes = np.linalg.svd(points, full_matrices=False)[2]
        axes[2] *= np.sign(np.linalg.det(axes))
        places.append(points @ axes.T)
    for turn in ([1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]):
        source = places[0][problem.source_vertices, None] * turn
        apart = np.linalg.norm(source - places[1][problem.target_vertices], axis=2)
        yield np.column_stack([problem.source_vertices, problem.target_vertices[apart.argmin(axis=1)]])


# %%
# Laws that every refinement must keep are checked on a small shape: the true map stays the true map, and neither the
# numbers of vertices nor of threads matter.

check_refinement(Upsampling())

# %%
# The stages one by one. Hypotheses are first maps of few vertices; candidates come with the evidence for them; fits map
# the vertices on which maps are refined.

source, target = example_pair()
prepared = prepare_pair(source.mesh, target.mesh)
problem = replace(prepared, refinement=Upsampling(), starts=[axes_of_inertia, *default_starts])
model = Isometry(problem)
hypotheses, _ = model.hypotheses()
candidates, _ = model.candidates(hypotheses)
fits = model.refine(model.begin(candidates[:3]))
for fit in fits:
    print(f"from {fit.origin}: score {model.cost(fit):.3f}")

# %%
# The map is read off in coordinates in which images are nearest points.

best = min(fits, key=model.cost)
embedding = model.embedding(best)
points = problem.target.index.points(embedding.target, embedding.source)
own = problem.source.correspondence(problem.target, points)
truth = ground_truth(source, target).vertices
off = np.linalg.norm(target.mesh.vertices[own.vertices] - target.mesh.vertices[truth], axis=1)
print(f"mean error {off.mean() / np.sqrt(target.mesh.area):.4f} √area")
draw_map(source.mesh, target.mesh, own, "own_matcher.png")

# %%
# Handed to :func:`isomatch.match`, the same stages take part in all that it does: model selection with alternatives, the
# verdict, and shapes that are cut or stretched.

result = match(source.mesh, target.mesh, refinement=Upsampling(), starts=problem.starts)
print(result.outcome.name, "from", result.origin)
