"""
Carry a texture
===============

Files carry more than points and triangles: colours, labels, texture coordinates, skinning weights.
:func:`isomatch.read_asset` reads all of it, and :func:`isomatch.carry_attributes` writes it onto another shape.
Here a checker goes from one animal to another. ``isomatch transfer MAP SOURCE TARGET -o FILE`` does the same for
files.
"""

from pathlib import Path
from tempfile import mkdtemp

import numpy as np

from isomatch import Asset, Attribute, carry_attributes, match, read_asset, write_asset
from isomatch.visualization import arranged_panels, surface_image
from isomatch_lab.procedural import creature

folder = Path(mkdtemp())
painted, plain = creature(6000, pose=0), creature(6000, pose=2, triangulation=1)

# %%
# Paint the first animal, with a colour for each vertex and texture coordinates, and write both to files.

x, y, z = painted.rest.T
dark = (np.floor(y * 9) + np.floor(z * 9) + np.floor(x * 9)) % 2 == 0
colour = np.where(dark[:, None], [0.05, 0.35, 0.55], [0.95, 0.90, 0.75])
given = Asset.of_mesh(
    painted.mesh,
    [Attribute("color", "point", "colour", colour), Attribute("uv", "point", "uv", np.column_stack([y, z]))],
)
write_asset(folder / "painted.ply", given)
write_asset(folder / "plain.ply", Asset.of_mesh(plain.mesh))

# %%
# From here on, it is what you would do with your own files.

source, target = read_asset(folder / "plain.ply"), read_asset(folder / "painted.ply")
result = match(folder / "plain.ply", folder / "painted.ply")
carried = carry_attributes(result.map, source, target)
print(carried.asset)
left = write_asset(folder / "plain_painted.ply", carried.asset)
print("not kept by this format:", left or "nothing")

images = [
    surface_image(asset.mesh, asset.attribute("color").fractions[:, :3], lambda colours: colours)
    for asset in (carried.asset, target)
]
figure, _ = arranged_panels(images, ["carried", "given"], per_row=2)
figure.savefig("texture.png")
