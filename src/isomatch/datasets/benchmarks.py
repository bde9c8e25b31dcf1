"""Benchmark sets on the user's disk, as lists of pairs with truth that index identity cannot leak into."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np
from scipy.spatial.transform import Rotation

from isomatch._arrays import IntArray
from isomatch.datasets.creatures import Creature, creature, ground_truth
from isomatch.datasets.example import example_pair
from isomatch.datasets.published import faust, remeshed, scape, tosca
from isomatch.datasets.shape_set import BenchmarkPair, ShapeSet
from isomatch.errors import FormatError
from isomatch.surfaces import Mesh

EXPECTED = "see docs/benchmarks.md for the layout of the folder and where the sets come from"


@dataclass(frozen=True, eq=False)
class BenchmarkSet:
    """A named list of pairs, loaded one at a time.

    Parameters
    ----------
    name : str
        Name of the set.
    pairs : tuple of (str, str)
        Source and target names.
    load : callable
        Loads a pair by its two names.
    """

    name: str
    pairs: tuple[tuple[str, str], ...]
    load: Callable[[str, str], BenchmarkPair] = field(repr=False)

    def chosen(self, count: int | None, seed: int = 0) -> BenchmarkSet:
        """Keep ``count`` pairs drawn without replacement, in their order; all if None."""
        if count is None or count >= len(self.pairs):
            return self
        keep = np.sort(np.random.default_rng(seed).choice(len(self.pairs), count, replace=False))
        return BenchmarkSet(self.name, tuple(self.pairs[i] for i in keep), self.load)

    def __iter__(self) -> Iterator[BenchmarkPair]:
        return (self.load(*pair) for pair in self.pairs)


OPENERS: dict[str, Callable[[Path], ShapeSet]] = {
    "faust_r": remeshed,
    "tosca_iso_r": remeshed,
    "scape_r": remeshed,
    "faust": faust,
    "scape": scape,
    "tosca": tosca,
}


def benchmark_set(name: str, folder: str | Path | None = None) -> BenchmarkSet:
    """Open a benchmark set.

    Parameters
    ----------
    name : {"faust_r", "tosca_iso_r", "scape_r", "faust", "scape", "tosca", "creatures", "example"}
        Which set. Remeshed sets come with their published test pairs. The others hold every ordered pair of poses
        (within a class); draw some with `BenchmarkSet.chosen`. "creatures" needs no folder.
    folder : path, optional
        Where the sets lie, each in a folder of its name: as archives or as it was published, see `tosca` and its
        neighbours.

    Raises
    ------
    FormatError
        If the set is unknown or not in the folder.
    """
    if name == "creatures":
        return _creatures()
    if name == "example":
        return _example()
    if name not in OPENERS:
        raise FormatError(
            f"unknown benchmark set {name!r}; known are {', '.join([*OPENERS, 'creatures', 'example'])}"
        )
    if folder is None or not (Path(folder) / name).is_dir():
        raise FormatError(f"benchmark set {name} not found in {folder}; {EXPECTED}")
    shapes = OPENERS[name](Path(folder) / name)
    return BenchmarkSet(name, shapes.pairs, partial(_hidden, shapes))


def _hidden(shapes: ShapeSet, source: str, target: str) -> BenchmarkPair:
    """Read a pair; a target that shares its source's triangulation is relabelled and rotated."""
    pair = shapes.pair(source, target)
    if not shapes.shared:
        return pair
    mesh, new = relabelled(pair.target, crc32(pair.name.encode()))

    def moved(rows: IntArray) -> IntArray:
        return np.column_stack([rows[:, 0], new[rows[:, 1]]])

    mirrored = None if pair.mirrored is None else moved(pair.mirrored)
    return replace(pair, target=mesh, truth=moved(pair.truth), mirrored=mirrored)


def relabelled(mesh: Mesh, seed: int) -> tuple[Mesh, IntArray]:
    """Shuffle vertices and faces and rotate at random; also return the new vertex of each old one."""
    rng = np.random.default_rng(seed)
    new = rng.permutation(mesh.n_vertices)
    vertices = np.empty_like(mesh.vertices)
    vertices[new] = mesh.vertices @ Rotation.random(rng=rng).as_matrix().T
    return Mesh(vertices, new[mesh.faces][rng.permutation(mesh.n_faces)]), new


def _creatures() -> BenchmarkSet:
    """Draw 40 pairs of creatures, half of them symmetric: two body plans, five bodies, 5 000 to 20 000 vertices."""

    def load(source: str, target: str) -> BenchmarkPair:
        a, b = _creature(source), _creature(target)
        mesh, new = relabelled(b.mesh, crc32(target.encode()))
        rows = np.arange(a.mesh.n_vertices)
        truth, mirrored = (
            np.column_stack([rows, new[ground_truth(a, b, mirrored=side).vertices]])
            if a.symmetric or not side
            else None
            for side in (False, True)
        )
        if truth is None:
            raise FormatError("a creature without truth")
        return BenchmarkPair(f"{source}-{target}", a.mesh, mesh, truth, mirrored)

    names = []
    for i in range(40):
        kind, sides = ("quadruped", "biped")[i % 2], ("asymmetric", "symmetric")[i // 2 % 2]
        sizes = np.random.default_rng(i).integers(5000, 20000, 2)
        names.append(
            tuple(f"{kind}_{sides}_{i // 4 % 5}_{2 * i + j + 1}_{size}" for j, size in enumerate(sizes))
        )
    return BenchmarkSet("creatures", tuple((a, b) for a, b in names), load)


def _example() -> BenchmarkSet:
    """Take the shipped pair, whose triangulations differ."""

    def load(source: str, target: str) -> BenchmarkPair:
        a, b = example_pair()
        truth = np.column_stack([np.arange(a.mesh.n_vertices), ground_truth(a, b).vertices])
        return BenchmarkPair(f"{source}-{target}", a.mesh, b.mesh, truth)

    return BenchmarkSet("example", (("standing", "running"),), load)


def _creature(name: str) -> Creature:
    """Make the creature of a name: kind, sides, style, pose (also the triangulation), number of vertices."""
    kind, sides, style, pose, size = name.split("_")
    options: dict[str, Any] = {"kind": kind, "style": int(style), "symmetric": sides == "symmetric"}
    return creature(int(size), pose=int(pose), triangulation=int(pose), **options)
