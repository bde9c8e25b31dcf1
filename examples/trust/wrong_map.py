"""
A wrong map, and how it is told
===============================

A single view shows half of a body. Such scans are mostly matched wrongly, and reported so. An outcome is not a
proof, but no other than ``CONVERGED`` and ``PARTIAL`` should be used without looking.
"""

from isomatch import match
from isomatch.datasets import creature, view
from isomatch.view import draw_map

whole = creature(3000, pose=0).mesh
half = view(creature(3000, pose=2, triangulation=1).mesh, seed=1).mesh
result = match(half, whole)
print(f"{result.outcome.name}: {result.outcome.advice}")
print(*result.notes, sep="\n")
draw_map(half, whole, result.map, "view.png", titles=("one view", "whole"))
