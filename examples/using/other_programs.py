"""
In other people's programs
==========================

Meshes of trimesh, PyVista and meshio can be matched as they are, and what comes out is one line away from each.
"""

import numpy as np

from isomatch import Asset, match
from isomatch.datasets import example_pair
from isomatch.io import to_meshio, to_trimesh

source, target = (animal.mesh for animal in example_pair())
result = match(to_trimesh(Asset.of_mesh(source)), target)

# %%
# PyVista: the source, with its images and expected errors; ``.plot()`` opens a window.

surface = result.to_pyvista(source, target)
print(surface.point_data.keys())

# %%
# trimesh and meshio: the source bent onto the target, vertex for vertex.

bent = Asset.of_mesh(result.as_mesh(source, target))
to_trimesh(bent).export("bent.ply")
to_meshio(bent).write("bent.vtk")

# %%
# pandas: a row for each vertex; ``pandas.DataFrame(columns)`` makes a table of it.

columns = {"image": result.map.vertices, "expected_error": result.expected_error}
np.savetxt("map.csv", np.column_stack(list(columns.values())), delimiter=",", header=",".join(columns))
result.plot(source, target).savefig("map.png")
