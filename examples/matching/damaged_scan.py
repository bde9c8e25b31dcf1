"""
A scan with holes and noise
===========================

Scans have holes, and their points are not where they should be. :func:`isomatch.check` says what is wrong with a
mesh; matching needs no repair here. Defects that would spoil a map are mended internally, and named in the notes.
"""

from isomatch import check, match
from isomatch.datasets import ground_truth
from isomatch.visualization import ValuePanel, draw_map
from isomatch_lab.damage import holes, noise
from isomatch_lab.procedural import creature

clean = creature(2500, pose=1)
model = creature(2500, pose=2, triangulation=1)
pierced = holes(noise(clean.mesh, 0.1, seed=1).mesh, 0.05, seed=1)
scan = pierced.mesh

report = check(scan)
print(f"{report.n_boundary_loops} holes; fatal defects: {report.fatal or 'none'}")
result = match(scan, model.mesh)
print(f"{result.outcome.name}; {result.quality.matched:.0%} of the vertices have an image")

# %%
# A damaged mesh knows which vertices of the whole it has kept, so the true image of each is known. The third
# panel shows how far the images are from there, straight through space.

truth = ground_truth(clean, model).vertices[pierced.original]
error = model.mesh.vertices[result.map.vertices] - model.mesh.vertices[truth]
share = (error**2).sum(axis=1) ** 0.5 / model.mesh.area**0.5
draw_map(scan, model.mesh, result.map, "scan.png", values=ValuePanel(share, "error / √area", highest=0.1))
