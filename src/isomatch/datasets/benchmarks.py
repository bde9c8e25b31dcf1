"""Benchmark sets on the user's disk, as lists of pairs with truth that index identity cannot leak into."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np
from scipy.spatial.transform import Rotation

from isomatch._arrays import AnyArray, IntArray
from isomatch.datasets.creatures import Creature, creature, ground_truth
from isomatch.errors import FormatError
from isomatch.surfaces import Mesh

TOSCA_CLASSES = ("cat", "centaur", "david", "horse", "victoria", "wolf")
EXPECTED = "see docs/benchmarks.md for the layout of the folder and where the sets come from"


@dataclass(frozen=True, eq=False)
class BenchmarkPair:
    """Two shapes and where some source vertices truly go.

    Parameters
    ----------
    name : str
        "source-target".
    source, target : Mesh
        The surfaces. A target that shares its source's triangulation has been relabelled and rotated.
    truth : (q, 2) array of int
        Rows (source vertex, target vertex).
    mirrored : (q, 2) array of int, optional
        The symmetric truth, for shapes that are truly symmetric.
    """

    name: str
    source: Mesh
    target: Mesh
    truth: IntArray
    mirrored: IntArray | None = None


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


def benchmark_set(name: str, folder: str | Path | None = None) -> BenchmarkSet:
    """Open a benchmark set.

    Parameters
    ----------
    name : {"faust_r", "tosca_iso_r", "scape", "tosca", "creatures"}
        Which set. Remeshed sets come with their published test pairs. "scape" and "tosca" hold every ordered pair of
        poses (within a class); draw some with `BenchmarkSet.chosen`. "creatures" needs no folder.
    folder : path, optional
        Where the sets lie.

    Raises
    ------
    FormatError
        If the set is unknown or not in the folder.
    """
    openers: dict[str, Callable[[Path], BenchmarkSet]] = {
        "faust_r": lambda root: _remeshed(root, "faust_r"),
        "tosca_iso_r": lambda root: _remeshed(root, "tosca_iso_r"),
        "scape": lambda root: _shared(root, "scape", ("scape",)),
        "tosca": lambda root: _shared(root, "tosca", TOSCA_CLASSES),
    }
    if name == "creatures":
        return _creatures()
    if name not in openers:
        raise FormatError(f"unknown benchmark set {name!r}; known are {', '.join([*openers, 'creatures'])}")
    if folder is None or not (Path(folder) / name).is_dir():
        raise FormatError(f"benchmark set {name} not found in {folder}; {EXPECTED}")
    return openers[name](Path(folder))


def relabelled(mesh: Mesh, seed: int) -> tuple[Mesh, IntArray]:
    """Shuffle vertices and faces and rotate at random; also return the new vertex of each old one."""
    rng = np.random.default_rng(seed)
    new = rng.permutation(mesh.n_vertices)
    vertices = np.empty_like(mesh.vertices)
    vertices[new] = mesh.vertices @ Rotation.random(rng=rng).as_matrix().T
    return Mesh(vertices, new[mesh.faces][rng.permutation(mesh.n_faces)]), new


@lru_cache(maxsize=64)
def _arrays(path: Path) -> dict[str, AnyArray]:
    try:
        with np.load(path, allow_pickle=False) as data:
            return dict(data)
    except OSError as error:
        raise FormatError(f"{path}: cannot be read ({error}); {EXPECTED}") from error


def _remeshed(root: Path, name: str) -> BenchmarkSet:
    """Open shapes remeshed independently, with truth through a table of vertices that is common to all."""

    def load(source: str, target: str) -> BenchmarkPair:
        a, b = (_arrays(root / name / f"{shape}.npz") for shape in (source, target))
        mesh_a, mesh_b = (Mesh(shape["vertices"], shape["faces"]) for shape in (a, b))
        truth = np.column_stack([a["vts"], b["vts"]]).astype(np.int64)
        return BenchmarkPair(f"{source}-{target}", mesh_a, mesh_b, truth)

    lines = (root / name / "test_pairs.txt").read_text(encoding="utf-8").splitlines()
    pairs = [tuple(line.replace(",", " ").split()[:2]) for line in lines if line.strip() and line[0] != "#"]
    return BenchmarkSet(name, tuple((a, b) for a, b in pairs), load)


def _shared(root: Path, name: str, classes: tuple[str, ...]) -> BenchmarkSet:
    """Open poses that share a triangulation: every target is relabelled and rotated."""
    owner: dict[str, Path] = {}
    for group in classes:
        path = root / name / f"{group}.npz"
        owner |= {pose: path for pose in _arrays(path) if pose != "faces"}

    def load(source: str, target: str) -> BenchmarkPair:
        data = _arrays(owner[source])
        mesh, new = relabelled(
            Mesh(_arrays(owner[target])[target], data["faces"]), crc32(f"{source}-{target}".encode())
        )
        truth = np.column_stack([np.arange(len(new)), new])
        return BenchmarkPair(f"{source}-{target}", Mesh(data[source], data["faces"]), mesh, truth)

    pairs = tuple((a, b) for a in owner for b in owner if a != b and owner[a] == owner[b])
    return BenchmarkSet(name, pairs, load)


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


def _creature(name: str) -> Creature:
    """Make the creature of a name: kind, sides, style, pose (also the triangulation), number of vertices."""
    kind, sides, style, pose, size = name.split("_")
    options: dict[str, Any] = {"kind": kind, "style": int(style), "symmetric": sides == "symmetric"}
    return creature(int(size), pose=int(pose), triangulation=int(pose), **options)
