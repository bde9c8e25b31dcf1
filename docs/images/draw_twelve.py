"""The pictures of ``docs/when_not.md``: twelve maps with a known truth, and what came out after following the advice.

Run ``python docs/images/draw_twelve.py`` to draw them again; it takes three minutes, and prints the numbers of the page.
"""

import io
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from PIL import Image

from isomatch import Config, Correspondence, Mesh, match
from isomatch.datasets import example_pair, ground_truth
from isomatch.evaluation import geodesic_errors
from isomatch.geodesics import distance_engine, farthest_point_sampling
from isomatch.matching import MatchResult, continue_with
from isomatch.visualization import ValuePanel, draw_map
from isomatch_lab.damage import view
from isomatch_lab.procedural import creature, organ, organ_truth

HERE = Path(__file__).parent
WRONG = 9.0  # mean error in % of √area: a map with one limb at the wrong place has 9.6
N = 2500


class Answer(NamedTuple):
    """What came out, and how far the images are from the truth on average, in % of √area."""

    outcome: str
    error: float


@dataclass
class Case:
    """Two shapes, the true image of each source vertex on the whole target, and what is done when the map is wrong."""

    source: Mesh
    target: Mesh
    truth: np.ndarray
    options: dict[str, Any] = field(default_factory=dict)
    then: dict[str, Callable[["Case", MatchResult], MatchResult]] = field(default_factory=dict)
    whole: Mesh | None = None
    seen: np.ndarray | None = None  # vertex of the whole that each target vertex was

    def matched(self, **options):
        """Match the two shapes."""
        return match(self.source, self.target, **options)

    def errors(self, result):
        """Geodesic error of each vertex that is judged, in % of √area of the whole; nan elsewhere."""
        whole = self.whole or self.target
        seen = np.arange(whole.n_vertices) if self.seen is None else self.seen
        image = np.append(seen, -1)[result.map.vertices]
        rows = np.flatnonzero(image >= 0)
        judged = np.column_stack([rows, self.truth[rows]])
        errors = np.full(len(image), np.nan)
        errors[rows] = 100 * geodesic_errors(whole, Correspondence(image, whole.n_vertices), judged)
        return errors

    def answer(self, result):
        """Outcome and mean error."""
        return Answer(result.outcome.name, float(np.nanmean(self.errors(result))))

    def marks(self, n=5):
        """Right landmarks at n points far from each other, of those that the target has."""
        start = int(self.source.vertices[:, 1].argmax())
        far = farthest_point_sampling(distance_engine(self.source), 8 * n, start).vertices
        image = self.truth[far]
        if self.seen is not None:
            there = np.full(self.whole.n_vertices, -1)
            there[self.seen] = np.arange(len(self.seen))
            image = there[image]
        return np.column_stack([far, image])[image >= 0][:n]


def landmarks(case, result):
    """Give five landmarks that are right."""
    return case.matched(landmarks=case.marks())


def chosen(case, result):
    """Choose the first alternative."""
    return continue_with(result, 1, case.source, case.target)


def by(**options):
    """Match again with other settings."""
    return lambda case, result: case.matched(config=Config(**options))


def animals(symmetric=False):
    """Two poses of an animal, and the truth."""
    a, b = (creature(N, symmetric=symmetric, pose=p, triangulation=p - 1) for p in (1, 2))
    return a, b, ground_truth(a, b).vertices


def pose():
    """Another pose."""
    a, b, truth = animals()
    return Case(a.mesh, b.mesh, truth)


def part():
    """One view of a biped, and the whole."""
    whole, posed = creature(N, kind="biped"), creature(N, kind="biped", pose=2, triangulation=1)
    scan = view(posed.mesh, seed=1)
    return Case(scan.mesh, whole.mesh, ground_truth(posed, whole).vertices[scan.original])


def turned(kind="liver"):
    """A body that half a turn carries onto itself."""
    a, b = (organ(kind, N, symmetry="turn", pose=pose) for pose in (1, 2))
    return Case(a.mesh, b.mesh, organ_truth(a, b).vertices)


def stretched():
    """The same animal, three times as long."""
    a, b, truth = animals()
    return Case(a.mesh, b.mesh.moved(b.mesh.vertices * [1, 3, 1]), truth, then={"five landmarks": landmarks})


def bad_landmarks():
    """Five landmarks of which each has the place of the next."""
    case = pose()
    marks = case.marks()
    case.options["landmarks"] = np.column_stack([marks[:, 0], np.roll(marks[:, 1], 1)])
    case.then["without them"] = by()
    return case


def exchanged(forelegs=True):
    """A map of another tool that exchanges the sides of the forelegs, or of all."""
    a, b, truth = animals(symmetric=True)
    mirrored = ground_truth(a, b, mirrored=True).vertices
    leg = (a.rest[:, 2] < 0.35 * a.rest[:, 2].max()) & (a.rest[:, 1] > 0)
    image = np.where(leg, mirrored, truth) if forelegs else mirrored
    return Case(a.mesh, b.mesh, truth, {"initial_map": image})


def sides():
    """A map of another tool that exchanges left and right."""
    case = exchanged(forelegs=False)
    case.then = {"alternative 1": chosen, "five landmarks": landmarks, "without it": by()}
    return case


def mirror():
    """An animal whose file was mirrored."""
    a, b = example_pair()
    then = {"--orientation any": by(orientation="any")}
    mirrored = Mesh(b.mesh.vertices * [-1, 1, 1], b.mesh.faces[:, ::-1])
    return Case(a.mesh, mirrored, ground_truth(a, b).vertices, then=then)


def kidney():
    """As `turned`; both lie alike in space."""
    case = turned("kidney")
    case.then = {
        "--start pose": by(start="pose"),
        "alternative 1": chosen,
        "five landmarks": landmarks,
    }
    return case


def single_view():
    """One view of an animal, and another pose."""
    a, b, truth = animals()
    scan = view(a.mesh, seed=3)
    return Case(scan.mesh, b.mesh, truth[scan.original], then={"five landmarks": landmarks})


def two_views(via=False):
    """One view of each of two poses."""
    a, b, truth = animals()
    here, there = view(a.mesh, seed=1), view(b.mesh, seed=6)
    case = Case(here.mesh, there.mesh, truth[here.original], whole=b.mesh, seen=there.original)
    case.then["five landmarks"] = landmarks
    if via:
        case.options["via"] = b.mesh
    return case


CASES = {
    "another pose": pose,
    "a part": part,
    "half a turn": turned,
    "stretched": stretched,
    "wrong landmarks": bad_landmarks,
    "forelegs exchanged": exchanged,
    "sides exchanged": sides,
    "mirrored": mirror,
    "turned": kidney,
    "one view": single_view,
    "two views": two_views,
    "two views by a whole": lambda: two_views(via=True),
}


def answers(case):
    """What a match answers, and what after each advice; with the result of the match."""
    result = case.matched(**case.options)
    return result, {"": case.answer(result)} | {k: case.answer(f(case, result)) for k, f in case.then.items()}


if __name__ == "__main__":
    for i, (name, make) in enumerate(CASES.items(), 1):
        case = make()
        result, found = answers(case)
        for after, (outcome, error) in found.items():
            print(f"| {i} | {name} {after} | `{outcome}` | {error:.1f} |", flush=True)
        held = io.BytesIO()
        where = ValuePanel(case.errors(result), "error, % of √area", highest=50.0)
        draw_map(case.source, case.target, result.map, held, values=where, width=900)
        Image.open(held).convert("RGB").save(HERE / f"twelve_{i:02}.webp", quality=72)
