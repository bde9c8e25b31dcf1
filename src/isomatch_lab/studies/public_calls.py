"""Public calls on small shapes: relations, settings, hints, bases, formats, statistics; see ``recorded_calls.py``."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

import isomatch.matching
from isomatch import (
    Asset,
    Attribute,
    Config,
    Correspondence,
    Graph,
    Landmarks,
    Mesh,
    PointCloud,
    cohort,
    match,
)
from isomatch.cohort import shape_statistics
from isomatch.datasets import example_pair, ground_truth
from isomatch.decimation import decimate
from isomatch_lab.procedural import creature, organ


class Attempt(partial):
    """A call within what another returns, which may fail by itself."""


@dataclass(frozen=True)
class Folders:
    """Where calls find shapes and cases, and where they may write."""

    data: Path
    cases: Path
    scratch: Path

    def shapes(self, file: str, *names: str, coarsened: bool = True) -> list[Mesh]:
        """Return shapes of a file, each with about 2500 vertices and no two with equally many, or as they are."""
        with np.load(self.data / file, allow_pickle=False) as stored:
            faces = [own_faces if (own_faces := f"{name}_faces") in stored else "faces" for name in names]
            meshes = [Mesh(stored[name], stored[face]) for name, face in zip(names, faces)]
        return [coarse(mesh, 2500 + 100 * i) if coarsened else mesh for i, mesh in enumerate(meshes)]

    def remeshed(self, *files: str) -> list[Mesh]:
        """Return shapes that have a file each."""
        return [self.shapes(file, "vertices", coarsened=False)[0] for file in files]


CALLS: dict[str, Callable[[Folders], Any]] = {}  # recorded calls by name, see `call`


def call(*variants: str) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Register a function of the folders; with variants, a call for each, which the function is given too."""

    def register(function: Callable[..., Any]) -> Callable[..., Any]:
        name = function.__name__.strip("_").replace("_", " ")
        calls = {f"{name}: {variant}": partial(function, variant=variant) for variant in variants}
        CALLS.update(calls or {name: function})
        return function

    return register


# arguments of calls: the example shapes, the same with 400 vertices, their match, and its ground truth
shipped = cache(lambda: tuple(made.mesh for made in example_pair()))  # 2968 and 3242 vertices
tiny = cache(lambda: tuple(coarse(mesh, 400) for mesh in shipped()))
result = cache(lambda: match(*shipped()))
truth = cache(lambda: ground_truth(*example_pair()).vertices)


def coarse(mesh: Mesh, n_vertices: int) -> Mesh:
    """Decimate a mesh."""
    return decimate(mesh, n_vertices).mesh


def bodies(n: int, *poses: int, **options: Any) -> list[Mesh]:
    """Make creatures in some poses, each of a triangulation of its own."""
    return [creature(n, pose=pose, triangulation=pose, **options).mesh for pose in poses]


def together(first: Mesh, second: Mesh) -> Mesh:
    """Put two meshes side by side in one."""
    vertices = np.vstack([first.vertices, second.vertices + np.array([3.0, 0, 0])])
    return Mesh(vertices, np.vstack([first.faces, second.faces + first.n_vertices]))


def pierce(mesh: Mesh, n: int, at: int = 10) -> Mesh:
    """Take the n vertices that are nearest to one out of a mesh."""
    distance = np.linalg.norm(mesh.vertices - mesh.vertices[at], axis=1)
    return mesh.submesh(distance > np.sort(distance)[n - 1])[0]


def break_mesh(mesh: Mesh) -> Mesh:
    """Break a mesh: some points are there twice, one is unused; some faces are twice, turned over, or of two points."""
    twice, n = mesh.vertices[mesh.faces[:60].ravel()], mesh.n_vertices
    faces = np.vstack([np.arange(n, n + 180).reshape(60, 3), mesh.faces[60:]])
    faces[200:240] = faces[200:240, ::-1].copy()
    vertices = np.vstack([mesh.vertices, twice, [[9.0, 9, 9]]])
    return Mesh(vertices, np.vstack([faces, faces[100:120], [[1, 1, 2]]]))


def turn_over(mesh: Mesh, side: int) -> Mesh:
    """Turn all faces over; with −1 reflect the mesh too, so that its outside stays outside."""
    return Mesh(mesh.vertices * [side, 1, 1], mesh.faces[:, ::-1])


def points(mesh: Mesh) -> PointCloud:
    """Keep the vertices alone."""
    return PointCloud(mesh.vertices)


def graph(mesh: Mesh) -> Graph:
    """Keep the edges alone."""
    return Graph(mesh.n_vertices, mesh.edges, mesh.edge_lengths)


def add_attributes(mesh: Mesh) -> Asset:
    """Make an asset with an attribute of every kind."""
    unit = (mesh.vertices - mesh.vertices.min(axis=0)) / np.ptp(mesh.vertices, axis=0)
    corners, zone = unit[mesh.faces.ravel()], np.digitize(unit[:, 1], [0.3, 0.6])
    words: dict[str, Any] = {"names": dict(enumerate("abc")), "colors": {1: (1.0, 0.5, 0.0, 1.0)}}
    right = corners.reshape(-1, 3, 3).mean(axis=1)[:, 0] > 0.5
    attributes = (
        Attribute("color", "point", "colour", np.rint(255 * unit).astype(np.uint8)),
        Attribute("zone", "point", "label", zone, **words),
        Attribute("side", "face", "label", right.astype(np.int32)),
        Attribute("depth", "point", "scalar", np.sin(9 * unit[:, 2])),
        Attribute("flow", "point", "vector", np.cos(5 * mesh.vertices)),
        Attribute("normal", "point", "normal", mesh.vertex_normals),
        Attribute("uv", "corner", "uv", corners[:, 1:] / 2 + 0.5 * np.repeat(right, 3)[:, None]),
        Attribute("weights", "point", "weights", np.column_stack([unit[:, 0], 1 - unit[:, 0]])),
        Attribute("smile", "point", "key", 0.1 * mesh.vertex_normals),
    )
    return Asset.of_mesh(mesh, attributes)


PAIRS: dict[str, Callable[[Folders], Iterable[Any]]] = {  # pairs that `match` is called with
    "shipped": lambda at: shipped(),
    "tosca": lambda at: at.remeshed("tosca_iso_r/wolf0.npz", "tosca_iso_r/wolf1.npz"),
    "faust": lambda at: at.remeshed("faust_r/tr_reg_000.npz", "faust_r/tr_reg_011.npz"),
    "cats": lambda at: at.shapes("tosca/cat.npz", "cat0", "cat3"),
    "femurs": lambda at: at.shapes("knees/femur.npz", "S081", "S085"),
    "glasses": lambda at: at.shapes("shrec07/glasses.npz", "glasses43", "glasses55"),
    "symmetric": lambda at: bodies(1600, 1, 2, symmetric=True),
    "kidneys": lambda at: [organ("kidney", 1500, pose=i).mesh for i in (1, 2)],
    "faces": lambda at: [organ("face", 1500, pose=i).mesh for i in (1, 2)],
    "large": lambda at: bodies(18_000, 1, 2),
    "holes": lambda at: (pierce(shipped()[0], 150), shipped()[1]),
    "both with holes": lambda at: (pierce(shipped()[0], 200), pierce(shipped()[1], 200, at=900)),
    "cut": lambda at: at.shapes("shrec16_cuts/shapes.npz", "cuts_cat_shape_10", "null_cat"),
    "whole and cut": lambda at: at.shapes("shrec16_cuts/shapes.npz", "null_horse", "cuts_horse_shape_4"),
    "unsure cut": lambda at: at.shapes("shrec16_cuts/shapes.npz", "cuts_horse_shape_15", "null_horse"),
    "many holes": lambda at: at.shapes("shrec16_holes/shapes.npz", "holes_cat_shape_1", "null_cat"),
    "two parts": lambda at: at.shapes("shrec16_parts/shapes.npz", "cuts_cat_shape_4", "cuts_cat_shape_5"),
    "species": lambda at: at.shapes("smal/shapes.npz", "dog_02", "lion_02"),
    "parts of species": lambda at: at.shapes("psmal/shapes.npz", "cuts_0_cow_02", "cuts_22_dog_05"),
    "touching limbs": lambda at: at.shapes("topkids/shapes.npz", "kid01", "kid00"),
    "components": lambda at: map(together, shipped(), bodies(1500, 1, 2, kind="biped")),
    "damaged": lambda at: (break_mesh(shipped()[0]), shipped()[1]),
    "mirror image": lambda at: (turn_over(shipped()[0], -1), shipped()[1]),
    "inside out": lambda at: (turn_over(shipped()[0], 1), shipped()[1]),
    "points": lambda at: [points(coarse(mesh, 1500)) for mesh in shipped()],
    "graphs": lambda at: [graph(coarse(mesh, 1500)) for mesh in shipped()],
}
SETTINGS: dict[str, dict[str, Any]] = {  # settings that `match` is called with
    **{f"refinement {name}": {"refinement": name} for name in ("none", "laplace_icp", "joint", "smooth")},
    **{f"orientation {name}": {"orientation": name} for name in ("reverse", "any")},
    **{f"resolution {name}": {"resolution": name} for name in ("full", "fast")},
    **{f"engine {name}": {"engine": name} for name in ("exact", "heat", "dijkstra")},
    **{f"part {name}": {"part": name} for name in ("source", "target", "both", "none")},
    **{"start pose": {"start": "pose"}, "uniform weights": {"weights": "uniform"}},
    "low rank": {"n_columns": 60, "rank": 30, "n_functions": 100},
}
GIVEN = {  # folder of the case, map, receiver, giver
    "obj texture": ("11-obj-texture", "identity.txt", "template.obj", "scan.obj"),
    "glb texture": ("10-glb-texture-lookup", "identity.txt", "receiver.glb", "transform.glb"),
    "second uv": ("10-glb-texture-lookup", "identity.txt", "receiver.glb", "texcoord1.glb"),
    "picture": ("28-glb-mixed-pictures", "identity.txt", "receiver.glb", "png.glb"),
    "udim": ("46-bake-udim", "map.txt", "udim.obj", "two.ply"),
    "keys": ("13-morph-targets-tangents", "identity.txt", "plain.glb", "keys.glb"),
    "skin": ("14-skin-same-rig", "identity.txt", "bare.glb", "rigged.glb"),
    "other skin": ("14-skin-same-rig", "identity.txt", "other_names.glb", "rigged.glb"),
}
FORMATS = ".off .obj .stl .stl-text .ply .ply-text .glb .gltf .vtk .vtk-text .vtp .vtu .gii .pial"
MENDED_SUFFIXES = (".off", ".obj", ".ply", ".stl", ".glb", ".gltf", ".gii")  # of files that are repaired


@call(*PAIRS)
def _match(at: Folders, variant: str) -> Any:
    return match(*PAIRS[variant](at))


@call(*SETTINGS)
def _match_with(at: Folders, variant: str) -> Any:
    return match(*shipped(), config=Config(**SETTINGS[variant]))


@call("landmarks", "held", "wrong", "alone", "initial map", "descriptors", "functions", "starts")
def _match_hinted(at: Folders, variant: str) -> Any:
    rows = np.linspace(0, len(truth()) - 1, 6).astype(int)
    pairs, functions = np.column_stack([rows, truth()[rows]]), [np.sin(4 * a.rest) for a in example_pair()]
    options: dict[str, dict[str, Any]] = {
        "landmarks": {"landmarks": pairs},
        "held": {"landmarks": pairs, "config": Config(pin=0.0)},
        "wrong": {"landmarks": np.column_stack([rows, truth()[rows[::-1]]])},
        "alone": {"landmarks": pairs, "config": Config(hypotheses="given")},
        "initial map": {"initial_map": np.where(np.arange(len(truth())) % 3, truth(), -1)},
        "descriptors": {"initial_descriptors": functions},
        "functions": {"functions": functions},
        "starts": {"starts": [lambda pair: [pairs]]},
    }
    return match(*shipped(), **options[variant])


@call("Isometry", "Part", "Elastic", "TwoParts")
def _match_by_relation(at: Folders, variant: str) -> Any:
    return match(*shipped(), relation=getattr(isomatch.matching, variant))


@call("shipped", "cut", "components", "species")
def _match_both_and_wrap(at: Folders, variant: str) -> Any:
    source, target = PAIRS[variant](at)
    both = isomatch.match_both(source, target)
    return both, Attempt(isomatch.wrap, both.source_to_target.map, source, target)


@call()
def _result_used(at: Folders) -> Any:
    image, (source, target), files = (
        result().map,
        shipped(),
        [at.scratch / f"map{suffix}" for suffix in (".npz", ".txt")],
    )
    result().save(at.scratch / "result.npz")
    for file in files:
        image.save(file)
    loaded = [Correspondence.load(file, image.n_target) for file in files]
    back = image.reversed(source, target)
    pulled = image @ target.vertices, image.pull_back(np.arange(target.n_vertices))
    pushed = image.push_forward(source.vertices, source.vertex_areas, target.vertex_areas)
    composed = image.then(back), image.then(back, target, source), image.to_functional(source, target, 30)
    summary = result().to_dict(), result().overlap, isomatch.MatchResult.load(at.scratch / "result.npz")
    return loaded, back, image.reversed(), pulled, pushed, composed, image.T, summary


@call("shipped", "damaged", "components", "large", "points", "graphs", "cut")
def _prepare(at: Folders, variant: str) -> Any:
    shape, file = isomatch.prepare(next(iter(PAIRS[variant](at)))), at.scratch / "prepared.npz"
    shape.save(file)
    names = ("average_distance", "curvature", "signatures", "balls", "symmetries", "position_coefficients")
    return shape, {name: Attempt(getattr, shape, name) for name in names}, isomatch.PreparedShape.load(file)


@call("predicted", "nystrom", "fmds", "smds", "exact", "uniform", "tolerance", "points", "graph")
def _distance_basis(at: Folders, variant: str) -> Any:
    mesh = coarse(shipped()[0], 800)
    surface = {"points": points, "graph": graph}.get(variant, lambda mesh: mesh)(mesh)
    others: dict[str, Any] = {"uniform": {"weights": "uniform"}, "tolerance": {"tolerance": 0.01}}
    others |= {"points": {}, "graph": {}}
    basis = isomatch.distance_basis(surface, 30, 60, **others.get(variant, {"method": variant}))
    descriptor = isomatch.geodesic_distance_descriptor(basis)
    return basis, basis.error_estimates(), basis.row(7), basis.nearest(5, 0.2), descriptor, descriptor.inner()


@call()
def _laplace_basis(at: Folders) -> Any:
    surfaces = shipped()[0], pierce(shipped()[0], 200), points(tiny()[0])
    bases = [isomatch.laplace_basis(surface, 60) for surface in surfaces]
    return bases, isomatch.heat_kernel_signature(bases[0], 20), isomatch.wave_kernel_signature(bases[0], 20)


@call("nystrom", "exact", "fmds")
def _canonical_form(at: Folders, variant: str) -> Any:
    return isomatch.canonical_form(coarse(shipped()[0], 800), method=variant)


@call("fast_marching", "exact", "heat", "dijkstra")
def _geodesic_distances(at: Folders, variant: str) -> Any:
    mesh = shipped()[0]
    spaces = [mesh, points(mesh), graph(mesh)][: 3 if variant == "dijkstra" else 1]
    columns = [isomatch.geodesic_distances(space, [0, 500, 2900], variant) for space in spaces]
    inside = isomatch.PrecisePoints(mesh.faces[:20], np.full((20, 3), 1 / 3))
    between = isomatch.geodesic_distances(mesh, inside, variant, targets=[3, 1000])
    return columns, between, isomatch.farthest_point_sampling(isomatch.distance_engine(mesh, variant), 20, 0)


@call()
def _geodesic_path(at: Folders) -> Any:
    return [isomatch.geodesic_path(shipped()[0], i, j) for i, j in ((0, 2900), (5, 1500), (7, 7), (100, 101))]


@call("shipped", "holes", "components", "damaged", "inside out", "many holes", "touching limbs")
def _check_and_repair(at: Folders, variant: str) -> Any:
    mesh = next(iter(PAIRS[variant](at)))
    mended = isomatch.repair(mesh)
    return isomatch.check(mesh), mended, isomatch.repair(mesh, outer=True), decimate(mended.mesh, 300)


@call(*FORMATS.split())
def _file_format(at: Folders, variant: str) -> Any:
    suffix, _, text = variant.partition("-")
    file = at.scratch / f"written{suffix}"
    lost = isomatch.write_asset(file, add_attributes(tiny()[0]), **({"binary": False} if text else {}))
    read = isomatch.read_asset(file), isomatch.read_mesh(file)
    return file.read_bytes(), [feature.name for feature in lost], read


@call("source", "target", "majority", "values")
def _carry_attributes(at: Folders, variant: str) -> Any:
    options = {"majority": {"labels": variant}, "values": {"numbers_as": variant}}
    ends = match(*tiny()).map, *map(add_attributes, tiny())
    carried = isomatch.carry_attributes(*ends, **options.get(variant, {"to": variant}))
    isomatch.write_asset(at.scratch / "carried.glb", carried.asset)
    return carried, (at.scratch / "carried.glb").read_bytes()


@call(*GIVEN)
def _files_given(at: Folders, variant: str) -> Any:
    file, *ends = (at.cases / GIVEN[variant][0] / name for name in GIVEN[variant][1:])
    receiver, giver = map(isomatch.read_asset, ends)
    same, written = Correspondence.load(file, len(giver.points)), at.scratch / f"given{ends[0].suffix}"
    carried = isomatch.carry_attributes(same, receiver, giver)
    isomatch.write_asset(written, carried.asset)
    return carried, written.read_bytes(), Attempt(isomatch.bake_texture, same, receiver, giver, 64)


@call()
def _cases(at: Folders) -> Any:
    files = sorted(path for path in at.cases.rglob("*") if path.is_file())
    acts = {
        file: (isomatch.check, isomatch.repair) if file.suffix in MENDED_SUFFIXES else () for file in files
    }
    names = [str(file.relative_to(at.cases)) for file in files]
    read = [
        [Attempt(act, file) for act in (isomatch.read_asset, Landmarks.read, *acts[file])] for file in files
    ]
    return dict(zip(names, read))


@call()
def _landmarks(at: Folders) -> Any:
    (source, target), read = shipped(), []
    marks = Landmarks(source.vertices[::300], list("abcdefghij"), [("back", (0, 1, 2, 3), False)])
    for suffix in (".mrk.json", ".fcsv", ".pp", ".csv", ".tps"):
        file = at.scratch / f"marks{suffix}"
        lost = isomatch.write_landmarks(file, marks)
        read.append((lost, file.read_bytes(), Attempt(Landmarks.read, file, source)))
    carried = isomatch.carry_landmarks(result(), source, target, marks)
    nearest = isomatch.nearest_landmarks(source, target, marks.positions + 0.01, carried.positions)
    median = isomatch.median_landmarks([carried, Landmarks(carried.positions + 0.01, carried.names)], target)
    (at.scratch / "pairs.txt").write_text("0 5\n100 200\n300 400\n", encoding="utf-8")
    return read, carried, nearest, median, isomatch.read_landmarks(at.scratch / "pairs.txt", source, target)


@call("all", "star")
def _collection(at: Folders, variant: str) -> Any:
    folder = at.scratch / variant
    (folder / "shapes").mkdir(parents=True)
    for i, mesh in enumerate(bodies(1500, *range(8 if variant == "star" else 4))):
        isomatch.write_mesh(folder / f"shapes/s{i}.ply", mesh)
    collection = isomatch.Collection.create(folder, folder / "shapes", pairs=variant)
    for step in (isomatch.Collection.run, cohort.agree, cohort.finish):
        with ThreadPoolExecutor(1) as executor:
            list(step(collection, executor, 1))
    maps = [collection.maps(*pair) for pair in sorted(collection.rows().pairs)]
    shapes = shape_statistics.read_shapes(folder / "corresponded")
    model, x, mesh = shape_statistics.ShapeModel.fit(shapes), shapes.vertices, shapes.mesh(3)
    distances, observed = shape_statistics.procrustes_distances(x), np.arange(len(x[0])) % 5 == 0
    return {
        "maps": [(pair.forward, pair.backward, pair.forward_error, pair.backward_error) for pair in maps],
        "shapes": (
            shapes,
            shape_statistics.doubtful_shapes(shapes),
            shape_statistics.geodesic_distortions(shapes, n_samples=30),
        ),
        "models": (
            model,
            shape_statistics.ShapeModel.fit(shapes, scale="remove"),
            shape_statistics.compactness(model),
        ),
        "scores": (model.score(mesh), model.mode_mesh(1, 2.0)),
        "completed": shape_statistics.complete(
            model, shape_statistics.observed_vertices(model, mesh, observed)
        ),
        "quality": (
            shape_statistics.generalisation(model),
            shape_statistics.specificity(model, n_samples=50),
        ),
        "procrustes": (
            shape_statistics.generalised_procrustes(x),
            distances,
            shape_statistics.shape_tree(distances),
        ),
        "groups": shape_statistics.group_test(model.aligned, ["a", "b"] * (len(x) // 2), n_permutations=99),
        "regression": shape_statistics.shape_regression(model.aligned, np.arange(len(x)), n_permutations=99),
    }


@call()
def _asymmetry(at: Folders) -> Any:
    made, rng = creature(1500, symmetric=True), np.random.default_rng(0)
    meshes = {f"s{i}": made.mesh.moved(made.rest * (1 + 0.05 * rng.normal(size=3))) for i in range(4)}
    shapes = shape_statistics.CorrespondedShapes.of_meshes(meshes)
    sides, note = shape_statistics.left_right_of_shapes(shapes, made.rest_mesh)
    aligned = shape_statistics.align_sides(shapes.mirrored([sides] * 4), left_right=[sides] * 4)
    return sides, note, shape_statistics.asymmetry(*aligned, n_permutations=99)


@call()
def _pictures(at: Folders) -> Any:
    figures = result().plot(*shipped(), width=600), tiny()[0].plot(tiny()[0].vertices[:, 0], width=300)
    return [[image.get_array() for axes in figure.axes for image in axes.images] for figure in figures]
