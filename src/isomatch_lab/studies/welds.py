"""What do limbs that touch and are fused do to maps? Pairs in which one shape, or both, have such limbs.

    python -m isomatch_lab.studies.welds --data DIR -o OUT

writes ``welds.csv``, one row for each map, and ``welds_table.csv``. Every pair is matched as it is, welded (vertices
within a gap merged in pairs), stitched (welded, and where both sheets have the same face, both removed: a tube
between limbs) and remeshed (one watertight surface around voxels, which fuses what is nearer than one), without priors
and with five true landmarks. Of other pairs, vertices of the source are merged by distance.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from typing import Any, cast

import numpy as np
from scipy.ndimage import distance_transform_edt, gaussian_filter
from scipy.spatial import KDTree
from skimage.measure import marching_cubes

import isomatch
from isomatch import Mesh
from isomatch_lab.damage import Damaged, DamagedPair, damaged_pair, decimate, merge, weld
from isomatch_lab.evaluation import true_landmarks
from isomatch_lab.sets import benchmark_set
from isomatch_lab.studies.shared import (
    error_after,
    in_parallel,
    parse_arguments,
    summarise,
    write_rows,
    write_table,
)

PAIRS = (  # set, source, target, gap / √area, shapes whose limbs are fused
    ("faust_r", "tr_reg_010", "tr_reg_016", 0.02, "target"),
    ("faust_r", "tr_reg_000", "tr_reg_017", 0.02, "target"),
    ("faust_r", "tr_reg_021", "tr_reg_027", 0.04, "target"),
    ("faust_r", "tr_reg_020", "tr_reg_006", 0.02, "target"),
    ("faust_r", "tr_reg_007", "tr_reg_001", 0.02, "source"),
    ("faust_r", "tr_reg_037", "tr_reg_024", 0.04, "source"),
    ("faust_r", "tr_reg_041", "tr_reg_042", 0.04, "target"),
    ("faust_r", "tr_reg_017", "tr_reg_027", 0.02, "both"),
    ("tosca_iso_r", "victoria0", "victoria7", 0.02, "target"),
    ("tosca_iso_r", "victoria1", "victoria25", 0.02, "target"),
    ("tosca_iso_r", "victoria12", "victoria21", 0.02, "target"),
    ("tosca_iso_r", "victoria0", "victoria23", 0.02, "target"),
    ("tosca_iso_r", "victoria12", "victoria17", 0.04, "target"),
    ("tosca_iso_r", "victoria10", "victoria24", 0.02, "target"),
    ("tosca_iso_r", "victoria4", "victoria0", 0.02, "source"),
    ("tosca_iso_r", "victoria1", "victoria12", 0.04, "source"),
    ("tosca_iso_r", "victoria21", "victoria2", 0.02, "both"),
    ("tosca_iso_r", "david1", "david12", 0.04, "target"),
    ("tosca_iso_r", "david0", "david13", 0.04, "source"),
    ("tosca_iso_r", "david10", "david11", 0.02, "target"),
    ("tosca_iso_r", "cat0", "cat7", 0.02, "target"),
    ("tosca_iso_r", "cat3", "cat2", 0.05, "target"),
    ("tosca_iso_r", "cat6", "cat1", 0.04, "source"),
    ("tosca_iso_r", "centaur0", "centaur2", 0.04, "target"),
    ("creatures", "quadruped_asymmetric_0_1_3000", "quadruped_asymmetric_0_3_3000", 0.08, "target"),
    ("creatures", "quadruped_asymmetric_1_3_3000", "quadruped_asymmetric_1_1_3000", 0.08, "source"),
)
MERGED = (  # set, source, target, distance / mean edge length, shape whose vertices are merged
    *(
        ("faust_r", f"tr_reg_{source:03}", f"tr_reg_{target:03}", distance, "source")
        for source, target, distance in (
            (6, 3, 1.5),
            (6, 8, 0.7),
            (7, 1, 1.0),
            (16, 12, 2.0),
            (17, 11, 1.0),
            (22, 24, 2.0),
            (23, 21, 1.5),
            (26, 28, 1.5),
            (27, 21, 2.0),
            (27, 28, 0.7),
            (33, 31, 1.0),
            (36, 30, 1.5),
            (37, 34, 2.0),
            (37, 31, 0.7),
            (43, 40, 2.0),
            (44, 41, 1.5),
            (46, 41, 1.0),
            (47, 49, 2.0),
        )
    ),
    *(
        ("tosca_iso_r", source, target, distance, "source")
        for source, target, distance in (
            ("victoria1", "victoria0", 1.5),
            ("victoria17", "victoria10", 1.0),
            ("victoria2", "victoria12", 2.0),
            ("victoria21", "victoria12", 0.7),
            ("victoria21", "victoria10", 1.5),
            ("victoria23", "victoria1", 1.0),
            ("victoria24", "victoria12", 1.5),
            ("victoria7", "victoria0", 1.0),
            ("cat6", "cat0", 1.5),
            ("cat7", "cat1", 1.0),
            ("david12", "david0", 2.0),
            ("centaur2", "centaur0", 2.0),
        )
    ),
)
KINDS = ("none", "weld", "stitched", "remesh", "merge")
VOXEL = 0.01  # √area
SEED = 0
COLUMNS = ("pair", "side", "gap", "kind", "landmarks", "error", "outcome", "notes")
Job = tuple[str, str, bool, tuple[str, str, str, float, str]]  # folder of the sets, kind, landmarks, pair


def jobs(data: str) -> Iterator[Job]:
    """List every pair with each kind of damage, without and with landmarks."""
    for landmarks in (False, True):
        for kind in KINDS:
            for pair in MERGED if kind == "merge" else PAIRS:
                yield data, kind, landmarks, pair


def measure(job: Job) -> dict[str, Any]:
    """Match one pair, and measure the error on the whole target."""
    data, kind, landmarks, (name, source, target, gap, side) = job
    damaged = fused_pair(data, kind, name, source, target, gap, side)
    priors = true_landmarks(damaged.given) if landmarks else None
    result = isomatch.match(damaged.given.source, damaged.given.target, priors)
    return {
        "pair": f"{source}-{target}",
        "side": side,
        "gap": gap,
        "kind": kind,
        "landmarks": 5 * landmarks,
        "error": error_after(damaged, result.map),
        "outcome": result.outcome.name,
        "notes": "; ".join(result.notes),
        "quality": result.quality,
    }


@functools.lru_cache(maxsize=1)
def fused_pair(
    data: str, kind: str, name: str, source: str, target: str, gap: float, side: str
) -> DamagedPair:
    """Load a pair and fuse limbs of one shape, or of both."""
    whole = benchmark_set(name, data).load(source, target)
    if kind == "none":
        return damaged_pair(whole)
    ways: dict[str, Callable[..., Damaged]] = {
        "weld": weld,
        "stitched": stitch,
        "remesh": remesh,
        "merge": merge,
    }
    fuse = ways[kind]
    sides = ("source", "target") if side == "both" else (side,)
    return damaged_pair(
        whole, **{shape_name: fuse(getattr(whole, shape_name), gap, seed=SEED) for shape_name in sides}
    )


def stitch(mesh: Mesh, gap: float, seed: int) -> Damaged:
    """Weld a mesh, and remove the faces that two sheets have in common."""
    glued = weld(mesh, gap, seed=seed)
    _, name, count = np.unique(
        np.sort(glued.mesh.faces, axis=1), axis=0, return_inverse=True, return_counts=True
    )
    kept = count[name.ravel()] == 1
    used = np.unique(glued.mesh.faces[kept])
    number = np.zeros(glued.mesh.n_vertices, dtype=np.int64)
    number[used] = np.arange(len(used))
    assert glued.twin is not None
    tube = Mesh(glued.mesh.vertices[used], number[glued.mesh.faces[kept]])
    return Damaged(mesh, tube, glued.original[used], glued.twin[used])


def remesh(mesh: Mesh, gap: float, seed: int) -> Damaged:
    """Make one watertight surface around a closed mesh, as of its voxels; that fuses what is nearer than one."""
    step = VOXEL * np.sqrt(mesh.area)
    origin = mesh.vertices.min(axis=0) - 4 * step
    shape = np.ceil((mesh.vertices.max(axis=0) - origin) / step).astype(int) + 4
    inside = _inside((mesh.vertices - origin) / step, mesh.faces, tuple(shape))
    depth = distance_transform_edt(inside) - distance_transform_edt(~inside)
    field = gaussian_filter(depth, 0.8).astype(np.float32)
    vertices, faces, _, _ = cast(Any, marching_cubes)(field, 0.0, gradient_direction="ascent")
    skin = isomatch.repair(Mesh(origin + vertices * step, faces.astype(np.int64))).mesh
    skin = skin.submesh(skin.components == np.bincount(skin.components).argmax())[0]
    skin = decimate(skin, 5000 / skin.n_vertices, seed=seed).mesh
    original, _ = _counterpart(skin, mesh)
    stand_in, away = _counterpart(mesh, skin)
    stand_in[away > 2 * step] = -1
    return Damaged(mesh, skin, original, stand_in=stand_in)


def _inside(vertices: Any, faces: Any, shape: tuple[int, ...]) -> Any:
    """Which points (x, y, z) of the integer grid a closed mesh encloses: signed crossings along each line in z."""
    crossings = np.zeros((shape[0], shape[1], shape[2] + 1), dtype=np.int32)
    shift = np.array([1e-4, 2.3e-4, 0.0])  # a shift after which no grid line meets a vertex
    for a, b, c in (vertices + shift)[faces]:
        low, high = np.ceil(np.min([a, b, c], axis=0)[:2]), np.floor(np.max([a, b, c], axis=0)[:2])
        x, y = np.mgrid[low[0] : high[0] + 1, low[1] : high[1] + 1].reshape(2, -1)
        area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        if not len(x) or area == 0:
            continue
        u = ((x - a[0]) * (c[1] - a[1]) - (y - a[1]) * (c[0] - a[0])) / area
        v = ((b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])) / area
        hit = (u >= 0) & (v >= 0) & (u + v <= 1)
        z = np.ceil(a[2] + u[hit] * (b[2] - a[2]) + v[hit] * (c[2] - a[2])).astype(int)
        np.add.at(crossings, (x[hit].astype(int), y[hit].astype(int), z), -1 if area > 0 else 1)
    return crossings.cumsum(axis=2)[:, :, :-1] > 0


def _counterpart(mesh: Mesh, other: Mesh) -> tuple[Any, Any]:
    """Nearest vertex of the other mesh with a normal less than 60° off, and its distance, for each vertex."""
    distances, near = KDTree(other.vertices).query(mesh.vertices, k=30)
    alike = np.einsum("nj,nkj->nk", mesh.vertex_normals, other.vertex_normals[near]) > 0.5
    first = alike.argmax(axis=1)
    rows = np.arange(len(near))
    return near[rows, first], np.where(alike.any(axis=1), distances[rows, first], np.inf)


def table(rows: list[dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """For each kind: mean, median and worst error, wrong maps, those called right, and their largest error."""
    for landmarks in (0, 5):
        for kind in KINDS:
            group = [row for row in rows if (row["landmarks"], row["kind"]) == (landmarks, kind)]
            if group:
                yield {"limbs fused by": kind, "landmarks": landmarks, **summarise(group)}


if __name__ == "__main__":
    asked = parse_arguments(__doc__, "welds.csv")
    rows = write_rows(asked.output / "welds.csv", COLUMNS, in_parallel(measure, jobs(asked.data)))
    write_table(asked.output / "welds_table.csv", list(table(rows)))
