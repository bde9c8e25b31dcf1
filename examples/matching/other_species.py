"""
Shapes of two kinds
===================

A quadruped and a biped have no map that keeps distances. A map is found anyway, in which limbs stretch. The two
look different around most points and their images, so it is reported with low confidence: look at it.
"""

from isomatch import match
from isomatch.visualization import draw_map
from isomatch_lab.procedural import creature

quadruped = creature(2000, pose=0).mesh
biped = creature(2000, kind="biped", pose=0, triangulation=1).mesh
result = match(quadruped, biped)
print(f"{result.outcome.name}: {result.outcome.advice}")
print(*result.notes, sep="\n")
draw_map(quadruped, biped, result.map, "kinds.png", titles=("quadruped", "biped"))
