"""The pictures of ``docs/understand.md``: maps that end in each outcome.

Run ``python docs/images/draw_outcomes.py`` to draw them again; it takes a minute.
"""

from pathlib import Path

import numpy as np

from isomatch import Mesh, match
from isomatch.datasets import example_pair
from isomatch.visualization import ValuePanel, draw_map, summary_of
from isomatch_lab.procedural import creature

HERE = Path(__file__).parent


def drawn(name, source, target, where=False):
    """Match, draw the map, perhaps beside the error that is expected of it, and print how it ended."""
    result = match(source, target)
    values = (
        ValuePanel(100 * result.expected_error, "expected error, % of √area", highest=20.0) if where else None
    )
    draw_map(source, target, result.map, HERE / f"{name}.png", values=values, width=1100)
    print(f"{name}: {result.outcome.name}\n{summary_of(result)}\n", flush=True)


def swollen():
    """The neck and the head of one animal swell to a ball."""
    here, there = (creature(2000, pose=pose, triangulation=pose) for pose in (0, 1))
    vertices = there.mesh.vertices.copy()
    head = there.rest[:, 1] > np.quantile(there.rest[:, 1], 0.93)
    middle = vertices[head].mean(axis=0)
    away = vertices[head] - middle
    vertices[head] = middle + 0.25 * away / np.linalg.norm(away, axis=1, keepdims=True)
    drawn("outcome_doubtful", here.mesh, Mesh(vertices, there.mesh.faces), where=True)


def cut():
    """The hind half of an animal, and a piece of a leg that was cut off."""
    target, source = (animal.mesh for animal in example_pair())
    along = source.vertices[source.faces].mean(axis=1)[:, 1]
    faces = source.faces[along < np.quantile(along, 0.55)]
    used, renumbered = np.unique(faces, return_inverse=True)
    drawn("outcome_partial", Mesh(source.vertices[used], renumbered.reshape(faces.shape)), target)


def mirrored():
    """An animal whose lumps are on the other side."""
    source, target = (animal.mesh for animal in example_pair())
    drawn("outcome_mirror", source, Mesh(target.vertices * [-1, 1, 1], target.faces[:, ::-1]))


if __name__ == "__main__":
    for each in (swollen, cut, mirrored):
        each()
