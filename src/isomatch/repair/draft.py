"""The draft of a repaired mesh: its present state, where its vertices and faces come from, notes."""

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
    """The given vertex of each vertex, and the vertex that each given one has become."""

    given: IntArray  # the vertex of the given mesh that each vertex comes from, (n,)
    current: IntArray  # the present vertex of each given vertex, (n_given,); −1 if it is removed

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
    """A mesh between two steps of a repair, with its origin and what was changed."""

    mesh: Mesh
    trace: VertexTrace
    notes: tuple[str, ...]  # sentences on what each step changed, in order
    asset: Asset | None  # the given asset with inserted points; None for a bare mesh
    faces: IntArray  # for each face (m,): its triangle of the asset, or of the mesh with inserted points
    given_face: IntArray  # the triangle of the given asset for each triangle of ``asset``
    rewound: BoolArray  # whether each face (m,) is wound unlike its given face
    contacts: tuple[IntArray, ...] = ()  # for each place where limbs were parted, its given vertices

    @classmethod
    def of(cls, mesh: Mesh, asset: Asset | None = None, trace: VertexTrace | None = None) -> Draft:
        """Begin with a mesh, whose trace may lead back to another one."""
        faces = np.arange(mesh.n_faces)
        rewound = np.zeros(mesh.n_faces, dtype=bool)
        return cls(mesh, trace or VertexTrace.of_all(mesh.n_vertices), (), asset, faces, faces, rewound)

    def then(self, later: Draft) -> Draft:
        """Continue with a draft that began with this mesh; its faces refer to this mesh."""
        contacts = (*self.contacts, *(self.trace.given[rows] for rows in later.contacts))
        trace, notes = self.trace.then(later.trace), (*self.notes, *later.notes)
        return replace(later, trace=trace, notes=notes, contacts=contacts)

    def made_into(self, mesh: Mesh, trace: VertexTrace) -> Draft:
        """Replace the mesh by one with the same faces between other vertices."""
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
        trace, draft = VertexTrace.of_kept(~gone), self.counted(note, noun, gone) if note else self
        return draft.made_into(Mesh(self.mesh.vertices[~gone], trace.current[self.mesh.faces]), trace)


Step: TypeAlias = Callable[[Draft], Draft]  # a step of a repair


def run(draft: Draft, *steps: Step) -> Draft:
    """Take one step after another."""
    for step in steps:
        draft = step(draft)
    return draft


def count(number: int, noun: str) -> str:
    """Write a number of things."""
    several = noun.replace("vertex", "vertices") if noun.endswith("vertex") else f"{noun}s"
    return f"{number} {noun if number == 1 else several}"


def describe_places(places: tuple[IntArray, ...], noun: str) -> str:
    """Describe where something was found, given the vertices of each place."""
    largest, n = max(places, key=len), sum(map(len, places))
    return (
        f"at {count(n, 'vertex')}, in {count(len(places), noun)}; the largest has {len(largest)}, one of them vertex "
        f"{largest[len(largest) // 2]}"
    )
