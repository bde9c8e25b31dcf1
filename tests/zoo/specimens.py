"""A zoo of tiny meshes, sound and defective; tests loop over it, choosing by tag.

Tags: ``sound`` (nothing to report), ``extreme`` (sound, but squares of its lengths leave float64), ``fatal``
(distances undefined), ``closed``, ``boundary``, ``one_sided``, ``two_components``, and one for each defect,
named as in `MeshReport` but in the singular.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from isomatch.surfaces import Mesh


@dataclass(frozen=True)
class Specimen:
    """One mesh of the zoo, the tags it carries, and its Euler number."""

    name: str
    mesh: Mesh
    tags: frozenset[str]
    euler: int

    def __repr__(self) -> str:
        return self.name


def zoo(*tags: str) -> list[Specimen]:
    """All specimens that carry all the given tags."""
    return [specimen for specimen in _ZOO if specimen.tags.issuperset(tags)]


def specimen(name: str) -> Specimen:
    """The specimen of that name."""
    return next(specimen for specimen in _ZOO if specimen.name == name)


@st.composite
def any_mesh(draw) -> Mesh:
    """A hypothesis strategy: arrays of the right shape that may hold anything."""
    number = st.floats() | st.sampled_from([0.0, 1.0, np.nan, np.inf, 1e308, -1e308, 5e-324])
    index = st.integers(-2, 6) | st.integers(-(2**63), 2**63 - 1)
    vertices = draw(arrays(np.float64, (draw(st.integers(0, 6)), 3), elements=number))
    return Mesh(vertices, draw(arrays(np.int64, (draw(st.integers(0, 8)), 3), elements=index)))


def grid(rows: int, columns: int) -> Mesh:
    """An open, slightly curved sheet of ``rows × columns`` vertices."""
    y, x = np.divmod(np.arange(rows * columns), columns)
    corner = np.flatnonzero((x < columns - 1) & (y < rows - 1))
    below, above = corner, corner + columns
    faces = np.stack([below, below + 1, above, below + 1, above + 1, above], axis=1).reshape(-1, 3)
    return Mesh(np.column_stack([x, y, 0.1 * x * y]), faces)


def torus(n: int = 8, m: int = 6, large: float = 3.0, small: float = 1.0) -> Mesh:
    """A closed torus of ``n × m`` vertices and two radii, faces outward, enclosing a positive volume."""
    i, j = np.divmod(np.arange(n * m), m)
    u, v = 2 * np.pi * i / n, 2 * np.pi * j / m
    a, b = i * m + j, (i + 1) % n * m + j
    c, d = i * m + (j + 1) % m, (i + 1) % n * m + (j + 1) % m
    ring = large + small * np.cos(v)
    vertices = np.column_stack([ring * np.cos(u), ring * np.sin(u), small * np.sin(v)])
    return Mesh(vertices, np.vstack([np.column_stack([a, b, c]), np.column_stack([b, d, c])]))


def mobius(n: int = 12) -> Mesh:
    """A Möbius strip, two vertices wide."""
    i = np.arange(n)
    u = 2 * np.pi * i / n
    w = np.array([[-0.5], [0.5]])  # one row for each rim
    r = 2 + w * np.cos(u / 2)
    vertices = np.stack([r * np.cos(u), r * np.sin(u), w * np.sin(u / 2)], axis=-1).reshape(-1, 3)
    j = (i + 1) % n
    twist = i == n - 1  # the last quad joins each rim to the other one
    a, b = i, i + n
    c, d = np.where(twist, j + n, j), np.where(twist, j, j + n)
    return Mesh(vertices, np.vstack([np.column_stack([a, c, b]), np.column_stack([c, d, b])]))


_CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
_OUTWARD = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])


def _with_vertex(mesh: Mesh, vertex: int, position: list[float]) -> Mesh:
    vertices = mesh.vertices.copy()
    vertices[vertex] = position
    return Mesh(vertices, mesh.faces)


def _plus(mesh: Mesh, vertices: object = (), faces: object = ()) -> Mesh:
    """The mesh with further vertices and faces after its own."""
    more = np.asarray(vertices, dtype=float).reshape(-1, 3)
    return Mesh(
        np.vstack([mesh.vertices, more]), np.vstack([mesh.faces, np.asarray(faces, dtype=int).reshape(-1, 3)])
    )


def _build() -> list[Specimen]:
    tetrahedron = Mesh(_CORNERS, _OUTWARD)
    sheet = grid(3, 4)
    aside = _CORNERS + np.array([5, 0, 0])
    more = [[0, 4, 5], [0, 6, 4], [4, 6, 5], [0, 5, 6]]
    fan = [[0, 1, 2], [0, 2, 3], [2, 1, 3]]
    pages = [[0, 1, 2], [0, 1, 3], [0, 1, 4]]
    around = [[0, 0, 0], [0, 0, 1], [1, 0, 0], [0, 1, 0], [-1, 0, 0]]
    big = 2**62
    cut = np.vstack([sheet.vertices, sheet.vertices[[2, 6, 10]]])  # column 2 of 4 doubled
    right = np.isin(sheet.faces, [3, 7, 11]).any(axis=1)
    copies = np.select([sheet.faces == v for v in (2, 6, 10)], [12, 13, 14], sheet.faces)
    seam = np.where(right[:, None], copies, sheet.faces)
    rows: list[tuple[str, Mesh, str, int]] = [
        ("triangle", Mesh(_CORNERS[:3], [[0, 1, 2]]), "sound boundary", 1),
        ("tetrahedron", tetrahedron, "sound closed", 2),
        ("torus", torus(), "sound closed", 0),
        ("sheet", sheet, "sound boundary", 1),
        ("annulus", Mesh(*_annulus()), "sound boundary", 0),
        ("huge", Mesh(_CORNERS * 1e300, _OUTWARD), "extreme closed", 2),
        ("minute", Mesh(_CORNERS * 1e-300, _OUTWARD), "extreme closed", 2),
        ("mobius", mobius(), "boundary one_sided inconsistent_edge", 0),
        ("projective_plane", _projective_plane(), "closed one_sided inconsistent_edge", 1),
        ("two_tetrahedra", _plus(tetrahedron, aside, _OUTWARD + 4), "closed two_components", 4),
        ("touching_tetrahedra", _plus(tetrahedron, -_CORNERS[1:], more), "closed non_manifold_vertex", 3),
        ("book", Mesh(around, pages), "boundary non_manifold_edge", 1),
        ("rewound_face", Mesh(_CORNERS, [[0, 1, 2], *_OUTWARD[1:]]), "closed inconsistent_edge", 2),
        ("inward", Mesh(_CORNERS, _OUTWARD[:, ::-1]), "closed inward_component", 2),
        ("unused_vertex", _plus(sheet, [[9, 9, 9]]), "boundary unused_vertex", 1),
        ("seam", Mesh(cut, seam), "boundary coincident_vertex two_components", 2),
        ("needle", Mesh([[0, 0, 0], [1, 0, 0], [0.5, 1e-5, 0], [0.5, 1, 0]], fan), "boundary sliver_face", 1),
        ("flat_face", Mesh([[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0]], fan), "boundary zero_area_face", 1),
        ("repeated_index", _plus(sheet, [], [[0, 0, 1]]), "boundary repeated_index_face", 1),
        ("duplicate", _plus(tetrahedron, [], [[2, 3, 1]]), "closed duplicate_face", 2),
        ("nan", _with_vertex(sheet, 0, [np.nan, 0, 0]), "fatal boundary non_finite_vertex", 1),
        ("infinite", _with_vertex(sheet, 0, [0, np.inf, 0]), "fatal boundary non_finite_vertex", 1),
        ("out_of_range", _plus(sheet, [], [[0, 1, 12]]), "fatal boundary out_of_range_face", 1),
        ("wild", _plus(sheet, [], [[-big, big, 0], [-1, 0, 1]]), "fatal boundary out_of_range_face", 1),
        ("no_faces", Mesh(_CORNERS, []), "fatal unused_vertex", 0),
        ("empty", Mesh(np.zeros((0, 3)), []), "fatal", 0),
        ("faces_without_vertices", Mesh(np.zeros((0, 3)), [[0, 1, 2]]), "fatal out_of_range_face", 0),
        ("point", Mesh(np.zeros((3, 3)), [[0, 1, 2]]), "fatal boundary coincident_vertex zero_area_face", 1),
    ]  # fmt: skip
    return [Specimen(name, mesh, frozenset(tags.split()), euler) for name, mesh, tags, euler in rows]


def _projective_plane() -> Mesh:
    """The projective plane on six vertices, a closed one-sided surface that crosses itself."""
    faces = ["014", "015", "023", "025", "034", "123", "124", "135", "245", "345"]
    vertices = [[0, 0, 0], [3, 0, 0], [0, 4, 0], [0, 0, 5], [1, 2, 3], [-2, 1, 1]]
    return Mesh(vertices, [[int(digit) for digit in face] for face in faces])


def _annulus() -> tuple[np.ndarray, np.ndarray]:
    """Two loops of boundary: a 4 × 4 sheet without its middle square."""
    sheet = grid(4, 4)
    middle = np.isin(sheet.faces, [5, 6, 9, 10]).all(axis=1)
    return sheet.vertices, sheet.faces[~middle]


_ZOO = _build()
