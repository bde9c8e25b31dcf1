"""The pictures of ``docs/when_not.md`` and ``docs/priors.md``: maps that are wrong, with how they ended.

Run ``python docs/images/draw_failures.py`` to draw them again; it takes a minute.
"""

from pathlib import Path

import numpy as np

from isomatch import PointCloud, match
from isomatch.datasets import ground_truth
from isomatch.visualization import (
    ValuePanel,
    arranged_panels,
    camera_of,
    draw_map,
    position_colours,
    surface_image,
    to_screen,
)
from isomatch_lab.procedural import creature, organ, organ_truth

HERE = Path(__file__).parent


def drawn(name, source, target, result, truth, highest=0.5):
    """Draw a map beside the distances of its images from the truth, and print how it ended."""
    image = result.map.vertices
    error = np.linalg.norm(target.vertices[image] - target.vertices[truth], axis=1) / target.area**0.5
    error[~result.map.matched] = np.nan
    values = ValuePanel(error, "error / √area", highest=highest)
    draw_map(source, target, result.map, HERE / f"{name}.png", values=values, width=1200)
    print(f"{name}: {result.outcome.name}, mean error {np.nanmean(error):.3f} √area", flush=True)


def without_faces():
    """A symmetric body as points: left and right cannot be told apart."""
    source, target = (creature(3000, symmetric=True, pose=p, triangulation=p) for p in (1, 2))
    result = match(PointCloud(source.mesh.vertices), target.mesh)
    drawn("failure_points", source.mesh, target.mesh, result, ground_truth(source, target).vertices)


def round_shape():
    """A nodule: few features, so that images slide."""
    source, target = organ("nodule", 2500, pose=1), organ("nodule", 2500, pose=2)
    truth = organ_truth(source, target).vertices
    drawn("failure_round", source.mesh, target.mesh, match(source.mesh, target.mesh), truth, highest=0.1)


def turned():
    """A body with half a turn: the map returned, and its alternative."""
    source, target = (organ("liver", 2500, symmetry="turn", pose=pose).mesh for pose in (1, 2))
    result = match(source, target)
    colours = position_colours(target)
    maps = {"one map": result.map, "another, as good": result.alternatives[0].map}
    shown = [(target, colours), *((source, found.pull_back(colours)) for found in maps.values())]
    images = [surface_image(mesh, paint, to_screen, camera_of(target)) for mesh, paint in shown]
    arranged_panels(images, ["target", *maps], per_row=3)[0].savefig(HERE / "symmetry.png")
    print("turned:", result.outcome.name)


if __name__ == "__main__":
    for each in (without_faces, round_shape, turned):
        each()
