"""Benchmark sets as lists of pairs with truth, in which equal indices do not reveal the correspondence."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias
from zlib import crc32

import numpy as np

from isomatch._core.arrays import IntArray
from isomatch._core.errors import MissingFileError, SettingError
from isomatch._core.settings import generator
from isomatch.datasets import Creature, example_pair, ground_truth
from isomatch.surfaces import Mesh
from isomatch_lab.procedural import PLANS, Organ, creature, organ, organ_truth
from isomatch_lab.sets.cross_species import CrossSpecies, cross_species
from isomatch_lab.sets.folder_set import FolderSet, own_set
from isomatch_lab.sets.published import faust, remeshed, scape, tosca
from isomatch_lab.sets.shape_set import BenchmarkPair, ShapeSet, relabelled
from isomatch_lab.sets.stored_set import StoredSet

Shapes: TypeAlias = ShapeSet | CrossSpecies | FolderSet | StoredSet
EXPECTED = "docs/dev/lab/benchmarks.md describes the layout of the folder and where to obtain the sets"


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
    files : tuple of Path
        All files of a set of one's own: when one changes, what was measured with it is out of date.
    """

    name: str
    pairs: tuple[tuple[str, str], ...]
    load: Callable[[str, str], BenchmarkPair] = field(repr=False)
    files: tuple[Path, ...] = field(default=(), repr=False)

    def chosen(self, count: int | None, seed: int = 0) -> BenchmarkSet:
        """Draw ``count`` pairs without replacement and keep their order; all if None."""
        if count is None or count >= len(self.pairs):
            return self
        keep = np.sort(generator(seed).choice(len(self.pairs), count, replace=False))
        return replace(self, pairs=tuple(self.pairs[i] for i in keep))

    def __iter__(self) -> Iterator[BenchmarkPair]:
        return (self.load(*pair) for pair in self.pairs)


OPENERS: dict[str, Callable[[Path], ShapeSet | CrossSpecies]] = {  # functions that open a set in a folder
    "faust_r": remeshed,
    "tosca_iso_r": remeshed,
    "scape_r": remeshed,
    "faust": faust,
    "scape": scape,
    "tosca": tosca,
    "cross": cross_species,
}


def benchmark_set(
    name: str, folder: str | Path | None = None, landmarks: str | Path | None = None
) -> BenchmarkSet:
    """Open a benchmark set: one of those known by name, or any folder of shapes with truth.

    Parameters
    ----------
    name : str
        One of faust_r, tosca_iso_r, scape_r, faust, scape, tosca, cross, creatures, organs, example; or the path of a
        folder, or its name in ``folder``, with a layout that `own_set` describes. The remeshed sets have their published
        test pairs. The others have every ordered pair of poses within a class, unless a ``test_pairs.txt`` lists others;
        `BenchmarkSet.chosen` draws some. "cross" has two pairs for each two classes whose correspondence is known.
    folder : path_like, optional
        Folder of the sets, each in a folder of its name, as archives or as published: see `tosca`, `scape`, `faust` and
        `remeshed`. "creatures", "organs", "example" and paths need none.
    landmarks : path_like, optional
        Folder of hand-picked landmarks, which then are the truth, see `ShapeSet.with_landmarks`.

    Raises
    ------
    SettingError
        If the set is unknown, needs a folder, or has no landmarks.
    MissingFileError
        If the set is not in the folder.
    FormatError
        If a folder has a layout that cannot be read.
    """
    if name in MADE:
        if landmarks is not None:
            raise SettingError(
                f"the set {name!r} has no hand-picked landmarks; leave them out, or choose from {', '.join(OPENERS)}"
            )
        return MADE[name]()
    own_folder = _own_folder(name, folder)
    if own_folder is not None:
        shapes: Shapes = own_set(own_folder)
    elif name not in OPENERS:
        raise SettingError(
            f"unknown benchmark set {name!r}; choose from {', '.join([*OPENERS, *MADE])}, or give a folder of your own"
        )
    elif folder is None:
        message = f"benchmark set {name!r} has to be read from a folder, but none was given; {EXPECTED}"
        raise SettingError(message)
    elif not (Path(folder) / name).is_dir():
        raise MissingFileError(f"benchmark set {name!r} not found in {folder}; {EXPECTED}")
    else:
        shapes = OPENERS[name](Path(folder) / name)
    if landmarks is not None:
        if not isinstance(shapes, ShapeSet):
            raise SettingError(
                f"the set {name!r} has no hand-picked landmarks; "
                + (
                    "leave them out"
                    if own_folder is None
                    else "put them into its folder, in a folder landmarks"
                )
            )
        shapes = shapes.with_landmarks(landmarks)
    label = name if own_folder is None else own_folder.resolve().name
    files = shapes.files if isinstance(shapes, FolderSet | StoredSet) else ()
    return BenchmarkSet(label, shapes.pairs, partial(_relabelled_pair, shapes), files)


def _own_folder(name: str, folder: str | Path | None = None) -> Path | None:
    """Folder of a set that is known by no name of its own: a path, or a name in the folder of the sets; else None."""
    if name in OPENERS:
        return None
    places = [Path(name)] if folder is None else [Path(folder) / name, Path(name)]
    return next((place for place in places if place.is_dir()), None)


def _relabelled_pair(shapes: Shapes, source: str, target: str) -> BenchmarkPair:
    """Read a pair; a target is relabelled and rotated unless the shapes were remeshed independently."""
    pair = shapes.pair(source, target)
    if isinstance(shapes, ShapeSet) and not shapes.shared:
        return pair
    return pair.relabelled(crc32(pair.name.encode()))


def _creatures() -> BenchmarkSet:
    """Make 40 pairs of creatures, half of them symmetric: two body plans, five styles, 5 000 to 20 000 vertices."""

    def load(source: str, target: str) -> BenchmarkPair:
        a, b = _creature(source), _creature(target)
        image = ground_truth(a, b).vertices
        other = ground_truth(a, b, mirrored=True).vertices if a.symmetric else None
        return _made_pair(source, target, (a.mesh, b.mesh), image, other)

    names = []
    for i in range(40):
        kind, sides = ("quadruped", "biped")[i % 2], ("asymmetric", "symmetric")[i // 2 % 2]
        sizes = np.random.default_rng(i).integers(5000, 20000, 2)
        names.append(
            tuple(f"{kind}_{sides}_{i // 4 % 5}_{2 * i + j + 1}_{size}" for j, size in enumerate(sizes))
        )
    return BenchmarkSet("creatures", tuple((a, b) for a, b in names), load)


def _organs() -> BenchmarkSet:
    """Make 40 pairs of eight kinds of organ: 24 without symmetry, 8 with a mirror image, 8 with half a turn."""

    def load(source: str, target: str) -> BenchmarkPair:
        a, b = _organ(source), _organ(target)
        image = organ_truth(a, b).vertices
        other = organ_truth(a, b, symmetric=True).vertices if a.symmetry != "none" else None
        return _made_pair(source, target, (a.mesh, b.mesh), image, other)

    variants = [*(("none", style) for style in range(3)), ("mirror", 3), ("turn", 4)]
    names = [
        tuple(f"{kind}_{symmetry}_{style}_{2 * style + j + 1}" for j in range(2))
        for kind in PLANS
        for symmetry, style in variants
    ]
    return BenchmarkSet("organs", tuple((a, b) for a, b in names), load)


def _made_pair(
    source: str, target: str, meshes: tuple[Mesh, Mesh], image: IntArray, other: IntArray | None
) -> BenchmarkPair:
    """Relabel the target of two made shapes, with the true image and the image of a symmetric truth."""
    mesh, new = relabelled(meshes[1], crc32(target.encode()))

    def rows(image: IntArray) -> IntArray:
        return np.column_stack([np.arange(len(image)), new[image]])

    mirrored = None if other is None else rows(other)
    return BenchmarkPair(f"{source}-{target}", meshes[0], mesh, rows(image), mirrored)


def _example() -> BenchmarkSet:
    """Make a set of the shipped pair, whose triangulations differ."""

    def load(source: str, target: str) -> BenchmarkPair:
        a, b = example_pair()
        truth = np.column_stack([np.arange(a.mesh.n_vertices), ground_truth(a, b).vertices])
        return BenchmarkPair(f"{source}-{target}", a.mesh, b.mesh, truth)

    return BenchmarkSet("example", (("standing", "running"),), load)


def _creature(name: str) -> Creature:
    """Make the creature of a name: kind, symmetry, style, pose (also the triangulation), number of vertices."""
    kind, sides, style, pose, size = name.split("_")
    options: dict[str, Any] = {"kind": kind, "style": int(style), "symmetric": sides == "symmetric"}
    return creature(int(size), pose=int(pose), triangulation=int(pose), **options)


def _organ(name: str) -> Organ:
    """Make the organ of a name: kind, symmetry, style, pose (also the triangulation)."""
    kind, symmetry, style, pose = name.split("_")
    options: dict[str, Any] = {"symmetry": symmetry, "style": int(style), "pose": int(pose)}
    return organ(kind, **options)


MADE = {"creatures": _creatures, "organs": _organs, "example": _example}
"""Sets that need no folder."""
