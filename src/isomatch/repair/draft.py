"""The draft of a mended mesh: what it is now, how its vertices and faces came from the given ones, and what to note."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from isomatch._core.arrays import BoolArray, IntArray
from isomatch.io import Asset
from isomatch.surfaces import Mesh


@dataclass(frozen=True, eq=False)
class VertexTrace:
    """Where the vertices of a mesh come from, and what the vertices of the given mesh have become."""

    given: IntArray  # (n,) vertex of the given mesh that each vertex comes from
    current: IntArray  # (n_given,) vertex that each vertex of the given mesh has become; −1 where it is gone

    @classmethod
    def of_all(cls, n: int) -> VertexTrace:
        """Trace vertices that stay as they are."""
        return cls(np.arange(n), np.arange(n))

    @classmethod
    def of_kept(cls, kept: BoolArray) -> VertexTrace:
        """Trace the vertices (n_given,) that are kept, in their order; the others are gone."""
        return cls(np.flatnonzero(kept), np.where(kept, np.cumsum(kept) - 1, -1))

    def then(self, later: VertexTrace) -> VertexTrace:
        """Compose with the trace of a mesh that is made from this one."""
        return VertexTrace(self.given[later.given], np.append(later.current, -1)[self.current])


@dataclass(frozen=True, eq=False)
class Draft:
    """A mesh between two steps of a repair, how it came from the given surface, and what was changed."""

    mesh: Mesh
    trace: VertexTrace
    notes: tuple[str, ...]  # in the order in which they are told
    asset: Asset | None  # the given one with points inserted into its sides; None if a bare mesh is mended
    faces: IntArray  # (m,) triangle of this asset, or of the mesh with points inserted, of each face
    given_face: IntArray  # given triangle of each of these triangles
    rewound: BoolArray  # (m,) faces that are wound otherwise than they were given
    contacts: tuple[IntArray, ...] = ()  # given vertices at which limbs were parted, of each place

    @classmethod
    def of(cls, mesh: Mesh, asset: Asset | None = None, trace: VertexTrace | None = None) -> Draft:
        """Begin with a mesh, whose trace may lead back to another one."""
        faces = np.arange(mesh.n_faces)
        rewound = np.zeros(mesh.n_faces, dtype=bool)
        return cls(mesh, trace or VertexTrace.of_all(mesh.n_vertices), (), asset, faces, faces, rewound)

    def then(self, later: Draft) -> Draft:
        """Go on with a draft that began with this mesh; faces are told from those of this mesh."""
        contacts = (*self.contacts, *(self.trace.given[rows] for rows in later.contacts))
        trace, notes = self.trace.then(later.trace), (*self.notes, *later.notes)
        return replace(later, trace=trace, notes=notes, contacts=contacts)

    def made_into(self, mesh: Mesh, trace: VertexTrace) -> Draft:
        """Put a mesh with the same faces between other vertices in the place of this one."""
        return replace(self, mesh=mesh, trace=self.trace.then(trace))

    def noted(self, *notes: str) -> Draft:
        """Add notes."""
        return replace(self, notes=(*self.notes, *notes))

    def counted(self, note: str, noun: str, changed: BoolArray) -> Draft:
        """Add a note with the number of changed things, if there are any."""
        return self.noted(note.format(count(int(changed.sum()), noun))) if changed.any() else self

    def without_faces(self, gone: BoolArray) -> Draft:
        """Remove faces (m,)."""
        if not gone.any():
            return self
        mesh = Mesh(self.mesh.vertices, self.mesh.faces[~gone])
        return replace(self, mesh=mesh, faces=self.faces[~gone], rewound=self.rewound[~gone])

    def without_vertices(self, gone: BoolArray, note: str = "", noun: str = "vertex") -> Draft:
        """Remove vertices (n,) that no face uses, and note how many."""
        if not gone.any():
            return self
        trace, told = VertexTrace.of_kept(~gone), self.counted(note, noun, gone) if note else self
        return told.made_into(Mesh(self.mesh.vertices[~gone], trace.current[self.mesh.faces]), trace)


Step: TypeAlias = Callable[[Draft], Draft]


def run(draft: Draft, *steps: Step) -> Draft:
    """Take one step after another."""
    for step in steps:
        draft = step(draft)
    return draft


def count(number: int, noun: str) -> str:
    """Write a number of things."""
    several = noun.replace("vertex", "vertices") if noun.endswith("vertex") else f"{noun}s"
    return f"{number} {noun if number == 1 else several}"


def placed(places: tuple[IntArray, ...], noun: str) -> str:
    """Write where something was found, given the vertices of each place."""
    largest, n = max(places, key=len), sum(map(len, places))
    return (
        f"at {count(n, 'vertex')}, in {count(len(places), noun)}; the largest has {len(largest)}, one of them vertex "
        f"{largest[len(largest) // 2]}"
    )
