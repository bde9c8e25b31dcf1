"""Some eighty shapes, each of one kind of oddness, and what every command must make of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial import Delaunay

from isomatch import Mesh
from shapes import cylinder, icosphere, two_spheres
from zoo.made import (
    blob,
    block,
    boxes,
    coincident,
    cut_along,
    flipped,
    glued,
    klein_bottle,
    mobius_strip,
    moved,
    placed,
    random_points,
    sheet,
    soup,
    together,
    with_faces,
    with_vertices,
    without_faces,
)
from zoo.specimens import torus

BODY = blob(200)
N, M = BODY.n_vertices, BODY.n_faces

NOT_FINITE = "not finite"
NO_FACES = "no faces"
NO_AREA = "no area"
COMPONENTS = "components"
TOO_FEW = "too few"
SMALL = "at least 50 are needed"
NO_SOUND_FACE = "no sound face of positive area"


@dataclass(frozen=True)
class Case:
    """One shape and what must come of it.

    Parameters
    ----------
    name : str
    make : callable
        Makes the mesh.
    distance, basis, match : str
        Words of the error by which that command refuses the mesh; empty if it must succeed.
    outcome : str
        How the match with a relabelled, rotated copy must end.
    symmetric : bool
        Whether a map onto itself other than the identity fits as well, so that the match must not be called converged.
    """

    name: str
    make: Callable[[], Mesh]
    distance: str
    basis: str
    match: str
    outcome: str
    symmetric: bool

    def __repr__(self) -> str:
        return self.name


CASES: list[Case] = []


def case(
    *,
    distance: str = "",
    basis: str = "",
    match: str = "",
    outcome: str = "CONVERGED",
    symmetric: bool = False,
) -> Callable[[Callable[[], Mesh]], Callable[[], Mesh]]:
    """Enter the function that makes a shape into `CASES`."""

    def enter(make: Callable[[], Mesh]) -> Callable[[], Mesh]:
        CASES.append(Case(make.__name__, make, distance, basis, match, outcome, symmetric))
        return make

    return enter


# Sound bodies of any size, anywhere


@case()
def body():
    return BODY


@case()
def far_from_the_origin():
    return moved(BODY, (1e8, 0, 0))


@case(basis=NO_AREA)
def huge():
    return moved(BODY, scale=1e150)


@case(basis=NO_AREA)
def minute():
    return moved(BODY, scale=1e-200)


# Surfaces of every topology


@case(symmetric=True)
def sphere():
    return icosphere(2)


@case(symmetric=True)
def cube():
    return boxes(block(5, 5, 5))


@case(symmetric=True)
def brick():
    return boxes(block(3, 6, 9))


@case(symmetric=True)
def ring():
    return torus(24, 12)


@case(symmetric=True)
def double_torus():
    return boxes([cell for cell in block(9, 5, 2) if cell[:2] not in ((2, 2), (6, 2))])


@case(symmetric=True)
def mobius():
    return mobius_strip()


@case(symmetric=True)
def klein():
    return klein_bottle()


@case(symmetric=True)
def open_cylinder():
    return cylinder(16, 20)


@case(symmetric=True)
def disk():
    rings = [np.linspace(0, 2 * np.pi, max(6 * r, 1), endpoint=False) + 0j for r in range(9)]
    points = np.concatenate([r * np.exp(1j * angle.real) for r, angle in enumerate(rings)])
    flat = np.column_stack([points.real, points.imag])
    return Mesh(np.pad(flat, ((0, 0), (0, 1))), Delaunay(flat).simplices)


@case(symmetric=True)
def annulus():
    return glued(
        sheet(41, 6, lambda u, v: ((1 + v) * np.cos(2 * np.pi * u), (1 + v) * np.sin(2 * np.pi * u), 0))
    )


@case(symmetric=True)
def square():
    return sheet(15, 15)


@case(symmetric=True)
def strip_of_triangles():
    return sheet(2, 60)


@case(symmetric=True)
def hemisphere():
    ball = icosphere(3)
    upper = ball.vertices[:, 2] > -0.05
    return ball.submesh(upper)[0]


@case(symmetric=True)
def cone_with_one_tip():
    angle = 2 * np.pi * np.arange(100) / 100
    rim = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(100)])
    around = np.arange(100)
    return Mesh(
        np.vstack([rim, [[0, 0, 1]]]), np.column_stack([around, (around + 1) % 100, 0 * around + 100])
    )


@case(symmetric=True)
def filament():
    return glued(sheet(5, 40, lambda u, v: (0.01 * np.cos(2 * np.pi * u), 0.01 * np.sin(2 * np.pi * u), v)))


@case(symmetric=True)
def thin_plate():
    return boxes(block(9, 14, 1), (1, 1, 1e-4))


# Bodies out of shape


@case()
def pancake():
    """Closed, but all in a plane, so that its back lies on its front."""
    return moved(BODY, scale=(1, 1, 0))


@case()
def needles():
    return moved(BODY, scale=(1, 1, 1e-7))


@case()
def spike():
    return placed(BODY, {40: [1e5, 0, 0]})


@case()
def self_intersecting():
    return moved(BODY, scale=np.where(BODY.vertices[:, :1] > 1, [-1, 1, 1], 1))


@case()
def noise():
    return Mesh(random_points(N), BODY.faces)


@case()
def uneven_sampling():
    """A flat patch whose triangles differ in area by a factor of 10⁸."""
    flat = np.sign(random_points(250)[:, :2]) * np.abs(random_points(250)[:, :2]) ** 3 + [0, 0.1]
    return Mesh(np.column_stack([flat, 0.5 * np.exp(flat @ [1.0, 0.4])]), Delaunay(flat).simplices)


# Numbers that are none


@case(distance=NOT_FINITE, basis=NOT_FINITE, match="NaN")
def nan_vertex():
    return placed(BODY, {7: [np.nan, 0, 0]})


@case(distance=NOT_FINITE, basis=NOT_FINITE, match="infinite")
def infinite_vertex():
    return placed(BODY, {7: [0, -np.inf, 0]})


@case(distance=NOT_FINITE, basis=NOT_FINITE, match="NaN")
def only_nan():
    return moved(BODY, scale=np.nan)


@case(distance=NOT_FINITE, basis=NOT_FINITE, match="NaN")
def nan_vertex_without_faces():
    return with_vertices(BODY, [[np.nan, 0, 0]])


@case(distance="outside", basis="outside", match="out of range")
def index_too_large():
    return with_faces(BODY, [[0, 1, N]])


@case(distance="outside", basis="outside", match="out of range")
def index_below_zero():
    return with_faces(BODY, [[0, 1, -1]])


@case(distance="outside", basis="outside", match="out of range")
def faces_without_vertices():
    return Mesh(np.zeros((0, 3)), [[0, 1, 2]])


# Too little


@case(basis=NO_AREA, match=NO_FACES)
def points_without_faces():
    return Mesh(BODY.vertices, [])


@case(distance="at least 4", basis=TOO_FEW, match=NO_FACES)
def nothing():
    return Mesh(np.zeros((0, 3)), [])


@case(distance="at least 4", basis=TOO_FEW, match=NO_FACES)
def one_vertex():
    return Mesh(np.zeros((1, 3)), [])


@case(basis=TOO_FEW, match=NO_SOUND_FACE)
def two_vertices():
    return Mesh([[0, 0, 0], [1, 0, 0]], [[0, 1, 1]])


@case(basis=TOO_FEW, match=SMALL)
def one_triangle():
    return Mesh(np.eye(3), [[0, 1, 2]])


@case(basis=NO_AREA, match=NO_SOUND_FACE)
def collinear():
    return sheet(12, 12, lambda u, v: (u * 12 + v, 0, 0))


@case(basis=NO_AREA, match=NO_FACES)
def collinear_points():
    return Mesh(np.pad(np.arange(120.0)[:, None], ((0, 0), (0, 2))), [])


@case(basis=TOO_FEW, match=NO_SOUND_FACE)
def all_at_one_point():
    return moved(BODY, scale=0)


@case(basis=NO_AREA, match=NO_SOUND_FACE)
def only_repeated_indices():
    return Mesh(BODY.vertices, np.repeat(np.arange(N)[:, None], 3, axis=1))


# Faces that are none


@case()
def coplanar():
    flat = random_points(200)[:, :2]
    return Mesh(np.pad(flat, ((0, 0), (0, 1))), Delaunay(flat).simplices)


@case()
def repeated_indices():
    return with_faces(BODY, [[0, 0, 1], [5, 5, 5], [7, 8, 7]])


@case(basis=NO_AREA)
def lone_edge():
    return with_faces(with_vertices(BODY, [[9, 9, 9], [9, 9, 8]]), [[N, N, N + 1]])


@case()
def fin_of_zero_area():
    """A face on one edge, whose third corner is at an end of that edge."""
    a, b = BODY.faces[0, :2]
    return with_faces(with_vertices(BODY, [BODY.vertices[a]]), [[a, b, N]])


@case()
def split_edge():
    """A face of zero area closes the gap between a face and the two halves of its neighbour."""
    a, b, c = BODY.faces[0]
    halved = with_vertices(BODY, [BODY.vertices[[a, b]].mean(axis=0)])
    return with_faces(without_faces(halved, [0]), [[a, N, c], [N, b, c], [a, b, N]])


@case(basis=NO_AREA)
def flattened_half():
    """Half of the body on a line."""
    return moved(BODY, scale=np.where(BODY.vertices[:, 2:] > 0, [0, 0, 1], 1))


@case()
def collapsed_patch():
    near = np.linalg.norm(BODY.vertices - BODY.vertices[150], axis=1).argsort()[:20]
    return placed(BODY, dict.fromkeys(near, BODY.vertices[150]))


@case()
def duplicated_faces():
    return with_faces(BODY, BODY.faces)


@case()
def two_sided_faces():
    return with_faces(BODY, BODY.faces[:, ::-1])


@case()
def random_faces():
    return Mesh(random_points(100), np.random.default_rng(2).integers(0, 100, (300, 3)))


# Vertices too many


@case()
def coincident_vertices():
    return coincident(BODY, 20, 150)


@case()
def coincident_neighbours():
    return coincident(BODY, *BODY.faces[0, :2])


@case()
def nearly_coincident_neighbours():
    a, b = BODY.faces[0, :2]
    return placed(BODY, {b: BODY.vertices[a] + 1e-14})


@case(basis=NO_AREA)
def isolated_vertices():
    return with_vertices(BODY, 5 * random_points(40))


@case(basis=NO_AREA)
def more_isolated_vertices_than_others():
    return with_vertices(BODY, 5 * random_points(2 * N))


@case(basis=TOO_FEW)
def triangle_soup():
    return soup(blob(90))


@case(basis=COMPONENTS, match=SMALL)
def soup_that_cannot_be_welded():
    torn = soup(blob(90))
    return Mesh(torn.vertices + 1e-9 * random_points(torn.n_vertices), torn.faces)


@case()
def seam():
    return cut_along(BODY, BODY.vertices[BODY.faces].mean(axis=1)[:, 0] > 0)


@case()
def body_within_its_copy():
    return together(BODY, flipped(BODY))


# Not a manifold


@case()
def book_of_three_pages():
    pages = [sheet(9, 9, lambda u, v, t=t: (u * np.cos(t), u * np.sin(t), v)) for t in (0, 2, 4.5)]
    return glued(together(*pages))


@case(symmetric=True)
def blocks_joined_at_a_corner():
    """The cube may turn about the corner, through which all paths between the blocks lead."""
    return boxes([*block(4, 4, 4), *((i + 4, j + 4, k + 4) for i, j, k in block(3, 4, 5))])


@case()
def blocks_joined_at_an_edge():
    return boxes([*block(4, 4, 4), *((i + 4, j + 4, k) for i, j, k in block(3, 5, 4))])


@case(outcome="LOW_CONFIDENCE")
def inner_walls():
    """The walls have one side, and the one that their faces show differs along each axis: the map is unique.

    Parted from the walls, the rooms have holes.
    """
    return boxes(block(4, 4, 6), inner=True)


# Winding: each of these is the body again once it is repaired


@case()
def inconsistent_winding():
    return flipped(BODY, np.random.default_rng(0).random(M) < 0.4)


@case()
def inside_out():
    return flipped(BODY)


@case()
def inside_out_with_coincident_vertices():
    return coincident(flipped(BODY), 20, 150)


@case()
def inside_out_with_coincident_vertices_around_one():
    """Two vertices that are no neighbours, but have a common one: once welded, an edge has four faces."""
    around = np.setdiff1d(BODY.edges[(BODY.edges == 100).any(axis=1)], 100)
    joined = {(int(i), int(j)) for i, j in BODY.edges}
    a, b = next((i, j) for i in around for j in around if i < j and (int(i), int(j)) not in joined)
    return coincident(flipped(BODY), a, b)


@case()
def inside_out_with_a_seam():
    return flipped(seam())


@case()
def inside_out_with_a_pinch():
    """Two bodies that share a vertex."""
    small = moved(blob(120), scale=0.4)
    top, bottom = BODY.vertices[BODY.vertices[:, 2].argmax()], small.vertices[small.vertices[:, 2].argmin()]
    return glued(together(flipped(BODY), flipped(moved(small, top - bottom))))


@case()
def inside_out_with_a_missing_face():
    return without_faces(flipped(BODY), [5])


@case()
def inside_out_with_a_doubled_face():
    return with_faces(flipped(BODY), BODY.faces[[7]])


@case()
def inside_out_with_some_flipped_faces():
    return flipped(flipped(BODY), [1, 50, 300])


@case()
def inside_out_with_a_dozen_holes():
    return without_faces(flipped(BODY), np.arange(0, M, 50))


# Several parts, or not all of one


@case(basis=COMPONENTS)
def two_bodies():
    return together(BODY, moved(BODY, (9, 0, 0), 0.9))


@case(basis=COMPONENTS, outcome="SYMMETRY_AMBIGUOUS")
def body_with_a_dense_pearl():
    return together(BODY, moved(icosphere(2), (5, 0, 0), 0.05))


@case(basis=COMPONENTS)
def body_in_dust():
    speck = Mesh(np.eye(3), [[0, 1, 2]])
    return together(BODY, *(moved(speck, 5 * at, 0.01) for at in random_points(60)))


@case(basis=COMPONENTS, match=SMALL)
def only_dust():
    speck = Mesh(np.vstack([np.zeros(3), np.eye(3)]), [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    return together(*(moved(speck, 9 * at) for at in random_points(100)))


@case(basis=COMPONENTS, outcome="PARTIAL", symmetric=True)
def two_balls():
    return two_spheres(2, 0.8)


@case(basis=NO_AREA)
def component_without_area():
    return together(BODY, Mesh([[9, 0, 0], [10, 0, 0], [11, 0, 0]], [[0, 1, 2]]))


@case(basis=NO_AREA)
def half_of_the_faces():
    return without_faces(BODY, np.random.default_rng(1).permutation(M)[: M // 2])


@case()
def a_dozen_holes():
    return without_faces(BODY, np.arange(0, M, 50))
