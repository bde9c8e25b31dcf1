"""
One topology, and the shapes between
====================================

:meth:`isomatch.MatchResult.as_mesh` gives the target's surface with the vertices and faces of the source. Then
vertex i of one is vertex i of the other, as shape keys, blend shapes and statistics need it.
"""

from isomatch import Mesh, match, wrap
from isomatch.visualization import arranged_panels, surface_image
from isomatch_lab.procedural import organ

source, target = organ("kidney", 2500, pose=1).mesh, organ("kidney", 2500, style=2, pose=2).mesh
result = match(source, target)
shared = result.as_mesh(source, target)
print(shared, "has the faces of the source:", (shared.faces == source.faces).all())

# %%
# :func:`isomatch.wrap` bends the source onto the target, and also says how good the surface is.

wrapped = wrap(result.map, source, target)
print(wrapped.quality)

# %%
# Now vertices can be interpolated. The source is moved onto the target first, so that the shapes between do not
# shrink.

from isomatch.cohort.shape_statistics import CorrespondedShapes, generalised_procrustes

pair = CorrespondedShapes.of_meshes({"source": source, "target": shared})
aligned = generalised_procrustes(pair.vertices).aligned
steps = [Mesh((1 - t) * aligned[0] + t * aligned[1], source.faces) for t in (0, 0.25, 0.5, 0.75, 1)]
images = [
    surface_image(step, step.vertex_normals, lambda n: 0.35 + 0.1 * (n + 1) * [3, 2, 1]) for step in steps
]
figure, _ = arranged_panels(images, ["source", "¼", "½", "¾", "target"], per_row=5)
figure.savefig("between.png")
