"""
One shape against many
======================

About half of the time of a match is spent on what depends on one shape alone. :func:`isomatch.prepare` does that once. A
prepared shape takes the place of the surface, any number of times, and can be saved to a file.
"""

import time
from tempfile import TemporaryDirectory

from isomatch import PreparedShape, match, prepare
from isomatch_lab.procedural import creature

template = prepare(creature(2500, pose=0).mesh)
for pose in range(1, 4):
    scan = creature(2500, pose=pose, triangulation=pose).mesh
    started = time.perf_counter()
    result = match(template, scan)
    print(f"pose {pose}: {result.outcome.value} after {time.perf_counter() - started:.1f} s")

# %%
# Matches with a loaded shape are the same to the last bit.

with TemporaryDirectory() as folder:
    template.save(f"{folder}/template.npz")
    loaded = PreparedShape.load(f"{folder}/template.npz")
again = match(loaded, scan)
print("same map:", (again.map.vertices == result.map.vertices).all())
