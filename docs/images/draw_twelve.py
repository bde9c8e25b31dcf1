"""The maps of ``docs/twelve_maps.md``: six wrong ones, six right ones, what is said of each, and what the advice gives.

Run ``python docs/images/draw_twelve.py`` to match and draw them again and to print the table; it takes five minutes, and
needs the extra ``creatures``.
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from PIL import Image
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from isomatch import Config, MatchResult, Mesh, PointCloud, match
from isomatch.datasets import example_pair, ground_truth
from isomatch.evaluation import geodesic_errors
from isomatch.view import camera_of, position_colours, surface_image, to_screen
from isomatch_lab.damage import cut, merge, view
from isomatch_lab.procedural import creature, organ, organ_truth

HERE = Path(__file__).parent
N_POINTS = 300
WRONG = 10.0  # mean error in per cent of √area
GREY = 0.82
TIPS = np.array(
    [[0, 1, 0], [0, -1, 0.3], [1, 1, -1], [1, -1, -1], [-1, 1, -1.0]]
)  # nose, tail and three feet


class Case(NamedTuple):
    """Two surfaces, the truth (n,) or −1, how they are matched, and what was tried then."""

    source: Mesh
    target: Mesh
    truth: np.ndarray
    marks: np.ndarray  # true pairs, (5, 2)
    tried: Mapping[str, Mapping[str, Any]] = {}
    how: Mapping[str, Any] = {}
    as_points: bool = False

    def matched(self, **more: Any) -> MatchResult:
        """Match, with other arguments."""
        source = PointCloud(self.source.vertices) if self.as_points else self.source
        return match(source, self.target, **{**self.how, **more})

    def error(self, found: Any) -> float:
        """Mean geodesic error of a map where the truth is known, in per cent of √area."""
        rows = np.flatnonzero(found.matched & (self.truth >= 0))
        truth = np.column_stack([rows, self.truth[rows]])
        return 100 * float(np.nanmean(geodesic_errors(self.target, found, truth, n_points=N_POINTS, seed=0)))

    def after(self) -> dict[str, MatchResult]:
        """Do what the advice says."""
        lm = {f"{n} landmarks": {"landmarks": self.marks[:n]} for n in (3, 5)}
        return {words: self.matched(**{**lm.get(words, {}), **more}) for words, more in self.tried.items()}


ANY, POSE, GIVEN = (
    {"config": Config(**each)}
    for each in ({"orientation": "any"}, {"start": "pose"}, {"hypotheses": "given"})
)


def _spread(truth: np.ndarray) -> np.ndarray:
    rows = np.flatnonzero(truth >= 0)
    rows = rows[np.linspace(0, len(rows) - 1, 5).astype(int)]
    return np.column_stack([rows, truth[rows]])


def _tips(animal: Any, truth: np.ndarray) -> np.ndarray:
    rows = np.array([(animal.rest @ way).argmax() for way in TIPS])
    return np.column_stack([rows, truth[rows]])


def _mirrored(mesh: Mesh) -> Mesh:
    return Mesh(mesh.vertices * [-1, 1, 1], mesh.faces[:, ::-1])


def _symmetric(mirrored: bool = False, **more: Any) -> Case:
    a, b = (creature(2500, symmetric=True, pose=i, triangulation=i) for i in (1, 2))
    truth = ground_truth(a, b).vertices
    return Case(a.mesh, _mirrored(b.mesh) if mirrored else b.mesh, truth, _tips(a, truth), **more)


def _view(pose: int, seed: int, **more: Any) -> Case:
    whole, posed = (creature(2500, kind="biped", pose=p, triangulation=int(p > 0)) for p in (0, pose))
    seen = view(posed.mesh, seed=seed)
    truth = ground_truth(posed, whole).vertices[seen.original]
    return Case(seen.mesh, whole.mesh, truth, _spread(truth), **more)


def _two_cuts() -> Case:
    a, b = creature(2500, pose=1), creature(2500, pose=2, triangulation=1)
    one, other = cut(a.mesh, 0.4, seed=2), cut(b.mesh, 0.4, seed=12)
    inside = np.full(b.mesh.n_vertices, -1)
    inside[other.original] = np.arange(other.mesh.n_vertices)
    truth = inside[ground_truth(a, b).vertices[one.original]]
    return Case(
        one.mesh,
        other.mesh,
        truth,
        _spread(truth),
        {"start = pose": POSE, "3 landmarks": {}, "5 landmarks": {}},
    )


def _scaled(scale: Any, tried: Mapping[str, Any]) -> Case:
    a, b = creature(2500, pose=1), creature(2500, pose=1, triangulation=1)
    truth = ground_truth(a, b).vertices
    return Case(a.mesh, Mesh(b.mesh.vertices * scale, b.mesh.faces), truth, _tips(a, truth), tried)


def _reflected() -> Case:
    a, b = example_pair()
    truth = ground_truth(a, b).vertices
    return Case(a.mesh, _mirrored(b.mesh), truth, _spread(truth), {"orientation = any": ANY})


def _part() -> Case:
    a, b = creature(2500, pose=1), creature(2500, pose=2, triangulation=1)
    piece = cut(a.mesh, 0.7, seed=0)
    truth = ground_truth(a, b).vertices[piece.original]
    return Case(piece.mesh, b.mesh, truth, _spread(truth))


def _hand_on_hip() -> Case:
    pose = {"left_shoulder": [0, 80, 0], "left_elbow": [0, 50, 0], "right_shoulder": [0, -40, 0]}
    a, b = creature(2500, kind="biped"), creature(2500, kind="biped", triangulation=1, pose=pose)
    joined = merge(b.mesh, 3.0)
    inside = np.full(b.mesh.n_vertices, -1)
    inside[joined.original] = np.arange(joined.mesh.n_vertices)
    truth = inside[ground_truth(a, b).vertices]
    return Case(a.mesh, joined.mesh, truth, _spread(truth))


def _nodule() -> Case:
    a, b = (organ("nodule", 2000, pose=i) for i in (1, 2))
    truth = organ_truth(a, b).vertices
    return Case(a.mesh, b.mesh, truth, _spread(truth))


def _wrong_start() -> Case:
    a, b = example_pair()
    truth = ground_truth(a, b).vertices
    turned = Mesh(Rotation.from_euler("z", 180, degrees=True).apply(b.mesh.vertices.copy()), b.mesh.faces)
    near = cKDTree(turned.vertices).query(a.mesh.vertices)[1]
    return Case(a.mesh, turned, truth, _spread(truth), {"hypotheses = given": GIVEN}, {"initial_map": near})


LANDMARKS = {"3 landmarks": {}, "5 landmarks": {}}
CASES: dict[str, Callable[[], Case]] = {
    "1": _reflected,
    "2": lambda: _symmetric(tried={"5 landmarks": {}}, as_points=True),
    "3": _two_cuts,
    "4": lambda: _scaled([1, 4, 1], {**LANDMARKS, "start = pose": POSE}),
    "5": lambda: _symmetric(True, tried={"orientation = any": ANY, "5 landmarks": {}}),
    "6": lambda: _view(1, 1, tried={**LANDMARKS, "start = pose": POSE}),
    "7": lambda: _scaled(1000, {}),
    "8": _part,
    "9": _hand_on_hip,
    "10": _nodule,
    "11": lambda: _view(1, 2),
    "12": _wrong_start,
}  # fmt: skip


def drawn(case: Case, result: MatchResult) -> Image.Image:
    """Draw the source in the colours of its images beside the target."""
    colours = position_colours(case.target)
    paint = np.where(result.map.matched[:, None], result.map.pull_back(colours, fill=GREY), GREY)
    shown = (case.source, paint), (case.target, colours)
    images = [surface_image(mesh, values, to_screen, camera_of(mesh)) for mesh, values in shown]
    tiles = [Image.fromarray((255 * np.clip(each, 0, 1)).astype(np.uint8), "RGBA") for each in images]
    sheet = Image.new("RGB", (600, 300), "white")
    for i, tile in enumerate(tiles):
        tile.thumbnail((290, 290))
        sheet.paste(tile, (300 * i + (300 - tile.width) // 2, (300 - tile.height) // 2), tile)
    return sheet


if __name__ == "__main__":
    for name, made in CASES.items():
        case = made()
        result = case.matched()
        drawn(case, result).save(HERE / f"twelve_{name}.webp", quality=80)
        print(f"| {name} | {result.outcome.name} | {case.error(result.map):.1f} |", flush=True)
        for words, then in case.after().items():
            print(f"    {words}: {case.error(then.map):.1f}, {then.outcome.name}", flush=True)
