"""
A part and a whole
==================

A part of a body, cut off somewhere, is matched to a whole one in another pose.
"""

from isomatch import match
from isomatch.visualization import draw_map
from isomatch_lab.damage import cut
from isomatch_lab.procedural import creature

whole = creature(1800, pose=0).mesh
part = cut(creature(1800, pose=1, triangulation=1).mesh, share=0.3, seed=3).mesh

result = match(part, whole)
print(f"{result.outcome.name}: {result.outcome.advice}")
print(*result.notes, sep="\n")
draw_map(part, whole, result.map, "part_to_whole.png", titles=("part", "whole"))

# %%
# It works in the other direction, too. What the part lacks has image −1, and is drawn grey.

back = match(whole, part)
print(f"{back.quality.matched:.0%} of the vertices of the whole have an image")
draw_map(whole, part, back.map, "whole_to_part.png", titles=("whole", "part"))
