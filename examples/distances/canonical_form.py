"""
A shape without its pose
========================

The canonical form of a surface lies in space so that straight distances approximate the geodesic ones. Poses of one
body have nearly the same form.
"""

from isomatch import Mesh, canonical_form
from isomatch.datasets import example_pair
from isomatch.visualization import arranged_panels, surface_image

shapes = [animal.mesh for animal in example_pair()]
forms = []
for mesh in shapes:
    form = canonical_form(mesh)
    print(f"stress {form.stress:.3f}")
    forms.append(Mesh(form.points, mesh.faces))

images = [
    surface_image(shape, mesh.vertex_normals, lambda normal: 0.4 + 0.12 * (normal + 1) * [2, 1.5, 1])
    for mesh, shape in zip(2 * shapes, shapes + forms)
]
figure, _ = arranged_panels(
    images, ["standing", "running", "its canonical form", "its canonical form"], per_row=2
)
figure.savefig("forms.png")
