"""The larger shapes of the zoo."""

from __future__ import annotations

import numpy as np

from isomatch import Mesh
from shapes import cylinder, icosphere
from zoo.made import *
from zoo.specimens import torus

rng = np.random.default_rng
B = blob
OUT = flipped


def far_apart(mesh):  # two vertices that are no neighbours and have a common one
    e = {frozenset(x) for x in mesh.edges.tolist()}
    n0 = [j for i, j in mesh.edges.tolist() if i == 100] + [i for i, j in mesh.edges.tolist() if j == 100]
    for a in n0:
        for b in n0:
            if a != b and frozenset((a, b)) not in e:
                return a, b


def disk(rings=9):
    pts = [[0, 0, 0]]
    for r in range(1, rings):
        for k in range(6 * r):
            t = 2 * np.pi * k / (6 * r)
            pts.append([r * np.cos(t), r * np.sin(t), 0])
    pts = np.array(pts) / rings
    from scipy.spatial import Delaunay

    return Mesh(pts, Delaunay(pts[:, :2]).simplices)


def filament(n=100, r=0.01):
    return glued(sheet(5, n, lambda u, v: (r * np.cos(2 * np.pi * u), r * np.sin(2 * np.pi * u), v)))


b = blob()
F = b.faces
nan = np.nan
CASES = {
    "body": b,
    "body far from the origin": moved(b, (1e8, 0, 0)),
    "body very far from the origin": moved(b, (1e15, 0, 0)),
    "huge body": moved(b, scale=1e150),
    "hugest body": moved(b, scale=1e307),
    "minute body": moved(b, scale=1e-200),
    "most minute body": moved(b, scale=1e-320),
    "sphere": icosphere(2),
    "cube": boxes(block(5, 5, 5)),
    "brick": boxes(
        block(3, 6, 9),
    ),
    "torus": torus(24, 12),
    "double torus": boxes([c for c in block(9, 5, 2) if c[:2] not in ((2, 2), (6, 2))]),
    "mobius": mobius_strip(),
    "klein": klein_bottle(),
    "open cylinder": cylinder(16, 20),
    "disk": disk(),
    "annulus": sheet(1 + 1, 1 + 1)
    and glued(
        sheet(41, 6, lambda u, v: ((1 + v) * np.cos(2 * np.pi * u), (1 + v) * np.sin(2 * np.pi * u), 0))
    ),
    "square": sheet(15, 15),
    "strip": sheet(2, 60),
    "hemisphere": Mesh(
        icosphere(3).vertices,
        icosphere(3).faces[(icosphere(3).vertices[icosphere(3).faces][:, :, 2] > -0.05).all(1)],
    ),
    "filament": filament(),
    "thin plate": boxes(block(9, 14, 1), (1, 1, 1e-4)),
    "pancake": moved(b, scale=(1, 1, 0)),
    "needles": moved(b, scale=(1, 1, 1e-7)),
    "two-sided": with_faces(b, b.faces[:, ::-1]),
    "doubled vertices two-sided": together(b, flipped(b)),
    "nan": placed(b, {7: [nan, 0, 0]}),
    "inf": placed(b, {7: [np.inf, 0, 0]}),
    "all nan": moved(b, scale=nan),
    "nan unused": with_vertices(b, [[nan, 0, 0]]),
    "out of range": with_faces(b, [[0, 1, 300]]),
    "negative index": with_faces(b, [[0, 1, -1]]),
    "wild index": with_faces(b, [[0, 1, 2**62]]),
    "zero area face": with_faces(
        Mesh(np.vstack([b.vertices, (b.vertices[F[0, 0]] + b.vertices[F[0, 1]]) / 2]), b.faces),
        [[F[0, 0], F[0, 1], 300]],
    ),
    "zero area fin": with_faces(
        Mesh(np.vstack([b.vertices, b.vertices[F[0, 0]] * 2 - b.vertices[F[0, 1]]]), b.faces),
        [[F[0, 0], F[0, 1], 300]],
    ),
    "collapsed patch": placed(
        b, {v: b.vertices[150] for v in np.argsort(np.linalg.norm(b.vertices - b.vertices[150], axis=1))[:20]}
    ),
    "collapsed half": placed(b, {v: b.vertices[150] for v in np.flatnonzero(b.vertices[:, 2] > 0.2)}),
    "flattened half": Mesh(np.where(b.vertices[:, 2:] > 0, [0, 0, 1], 1) * b.vertices, F),
    "repeated indices": with_faces(b, [[0, 0, 1], [5, 5, 5]]),
    "only repeated indices": Mesh(b.vertices, np.repeat(np.arange(300)[:, None], 3, 1)),
    "isolated edge face": Mesh(
        np.vstack([b.vertices, [[9, 9, 9], [9, 9, 8]]]), np.vstack([F, [[300, 300, 301]]])
    ),
    "no faces": Mesh(b.vertices, []),
    "nothing": Mesh(np.zeros((0, 3)), []),
    "faces without vertices": Mesh(np.zeros((0, 3)), [[0, 1, 2]]),
    "one vertex": Mesh(np.zeros((1, 3)), []),
    "two vertices": Mesh([[0, 0, 0], [1, 0, 0]], []),
    "two vertices face": Mesh([[0, 0, 0], [1, 0, 0]], [[0, 1, 1]]),
    "one triangle": Mesh(np.eye(3), [[0, 1, 2]]),
    "two triangles": Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], [[0, 1, 2], [1, 3, 2]]),
    "collinear": sheet(12, 12, lambda u, v: (u * 12 + v, 0 * u, 0 * u)),
    "collinear points": Mesh(np.column_stack([np.arange(60.0), np.zeros(60), np.zeros(60)]), []),
    "coplanar irregular": Mesh(
        random_points(200) * [1, 1, 0],
        __import__("scipy.spatial").spatial.Delaunay(random_points(200)[:, :2]).simplices,
    ),
    "all coincident": moved(b, scale=0),
    "coincident pair": coincident(b, *far_apart(b)),
    "coincident neighbours": coincident(b, *F[0, :2]),
    "duplicated faces": with_faces(b, F),
    "some duplicated": with_faces(b, F[:5]),
    "isolated vertices": with_vertices(b, random_points(40) * 5),
    "mostly isolated": with_vertices(b, random_points(400) * 5),
    "isolated coincident": with_vertices(b, np.zeros((40, 3))),
    "book": glued(
        together(*[sheet(9, 9, lambda u, v, t=t: (u * np.cos(t), u * np.sin(t), v)) for t in (0, 2, 4.5)])
    ),
    "bow-tie": boxes(
        [*[(i, j, k) for i, j, k in block(4, 4, 4)], *[(i + 4, j + 4, k + 4) for i, j, k in block(3, 4, 5)]]
    ),
    "edge joined": boxes(
        [*[(i, j, k) for i, j, k in block(4, 4, 4)], *[(i + 4, j + 4, k) for i, j, k in block(3, 5, 4)]]
    ),
    "inconsistent": flipped(b, rng(0).random(len(F)) < 0.4),
    "inside out": flipped(b),
    "inside out coincident": coincident(flipped(b), *far_apart(b)),
    "inside out coincident random": coincident(flipped(b), 20, 250),
    "inside out seam": cut_along(flipped(b), b.vertices[F].mean(1)[:, 0] > 0),
    "inside out missing": without_faces(flipped(b), [5]),
    "inside out doubled": with_faces(flipped(b), F[[7]]),
    "inside out few flipped": flipped(flipped(b), [1, 50, 300]),
    "soup": soup(b),
    "jittered soup": Mesh(soup(b).vertices * (1 + 1e-9 * random_points(F.size)), soup(b).faces),
    "two equal": together(b, moved(b, (9, 0, 0))),
    "three bodies": together(b, moved(blob(200), (9, 0, 0)), moved(blob(100), (20, 0, 0), 0.1)),
    "dust": together(b, *[moved(Mesh(np.eye(3), [[0, 1, 2]]), 5 * p, 0.01) for p in random_points(60)]),
    "many tetrahedra": together(
        *[
            moved(
                Mesh(np.vstack([np.zeros(3), np.eye(3)]), [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]), 9 * p
            )
            for p in random_points(100)
        ]
    ),
    "nonuniform": Mesh(b.vertices * 1.0, F),
    "self intersecting": moved(b, scale=1.0)
    and Mesh(b.vertices * np.where(b.vertices[:, :1] > 1, [-1, 1, 1], 1), F),
    "inner walls": boxes(block(4, 4, 6), inner=True),
    "half the faces": without_faces(b, rng(1).permutation(len(F))[: len(F) // 2]),
    "few holes": without_faces(b, rng(1).permutation(len(F))[:12]),
    "zero component": together(b, Mesh(np.array([[9, 0, 0], [10, 0, 0], [11, 0, 0.0]]), [[0, 1, 2]])),
    "star": Mesh(
        np.vstack(
            [
                [0, 0, 1],
                np.column_stack(
                    [
                        np.cos(np.arange(100) * 2 * np.pi / 100),
                        np.sin(np.arange(100) * 2 * np.pi / 100),
                        np.zeros(100),
                    ]
                ),
            ]
        ),
        [[0, 1 + k, 1 + (k + 1) % 100] for k in range(100)],
    ),
    "spike": placed(b, {40: [1e150, 0, 0]}),
    "long spike": placed(b, {40: [1e5, 0, 0]}),
    "noise": Mesh(random_points(300), F),
    "random faces": Mesh(random_points(100), rng(2).integers(0, 100, (300, 3))),
    "near coincident": placed(b, {F[0, 1]: b.vertices[F[0, 0]] + 1e-14}),
    "tiny and huge": together(moved(b, scale=1e-200), moved(b, (0, 0, 0), 1e100)),
}
