"""Shapes of different kinds with known correspondence: two classes at a time, in every pose of either."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from isomatch._core.errors import FormatError, MissingFileError
from isomatch_lab.sets.published import scape, tosca
from isomatch_lab.sets.shape_files import arrays, stored_indices
from isomatch_lab.sets.shape_set import BenchmarkPair, ShapeSet

POSES_PER_DIRECTION = 2  # number of poses of each species of a pair; chosen


@dataclass(frozen=True, eq=False)
class CrossSpecies:
    """Classes of TOSCA and SCAPE, and maps between them."""

    truth: Path  # arrays "A|B": the vertex of class B of each vertex of class A, counted from 0
    # set of each class, and its poses in it
    classes: Mapping[str, tuple[ShapeSet, tuple[str, ...]]] = field(repr=False)

    @property
    def pairs(self) -> tuple[tuple[str, str], ...]:
        """Two pairs of poses for each direction: the first ones, and a later one of either."""

        def spread(name: str) -> list[str]:
            poses = self._poses(name)
            return [poses[k * len(poses) // POSES_PER_DIRECTION] for k in range(POSES_PER_DIRECTION)]

        directions = (key.split("|") for key in arrays(self.truth))
        return tuple(pair for a, b in directions for pair in zip(spread(a), spread(b)))

    def pair(self, source: str, target: str) -> BenchmarkPair:
        """Read two shapes and the truth between them, in the order of the files."""
        (source_class, a), (target_class, b) = self._class_of(source), self._class_of(target)
        key = f"{a}|{b}"
        if key not in arrays(self.truth):
            raise MissingFileError(f"{self.truth}: no array {key!r} with the truth of {source} and {target}")
        image = stored_indices(self.truth, key)
        mesh, onto = source_class.mesh(source), target_class.mesh(target)
        if len(image) != mesh.n_vertices or image.max(initial=-1) >= onto.n_vertices:
            raise FormatError(
                f"{self.truth}: {key!r} has {len(image)} entries up to {image.max(initial=-1)}, which do not map the "
                f"{mesh.n_vertices} vertices of {source} to the {onto.n_vertices} of {target}; take both from one source"
            )
        return BenchmarkPair(
            f"{source}-{target}", mesh, onto, np.column_stack([np.arange(len(image)), image])
        )

    def _poses(self, name: str) -> tuple[str, ...]:
        if name not in self.classes or not self.classes[name][1]:
            raise MissingFileError(f"{self.truth}: truth about {name!r}, of which there are no shapes")
        return self.classes[name][1]

    def _class_of(self, shape: str) -> tuple[ShapeSet, str]:
        for name, (shapes, poses) in self.classes.items():
            if shape in poses:
                return shapes, name
        message = f"{self.truth}: no shape {shape!r}; choose from {', '.join(self.classes)} by pose"
        raise MissingFileError(message)


def cross_species(root: str | Path) -> CrossSpecies:
    """Open the truth between classes; their shapes are read from the folders ``tosca`` and ``scape`` beside it."""
    root = Path(root)
    truth = root / "truth.npz"
    if not truth.exists():
        message = f"{truth}: no truth between classes; docs/dev/lab/benchmarks.md describes its contents"
        raise MissingFileError(message)
    named = {name for key in arrays(truth) for name in key.split("|")}
    classes: dict[str, tuple[ShapeSet, tuple[str, ...]]] = {}
    if "scape" in named:
        shapes = scape(root.parent / "scape")
        classes["scape"] = shapes, shapes.names
    if named - {"scape"}:
        shapes = tosca(root.parent / "tosca")
        for name in sorted(named - {"scape"}):
            classes[name] = shapes, tuple(pose for pose in shapes.names if pose.rstrip("0123456789") == name)
    return CrossSpecies(truth, classes)
