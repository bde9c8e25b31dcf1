"""Figure 6: Voronoi regions of one shape, mapped to other poses."""

from __future__ import annotations

from typing import Any

import numpy as np

from isomatch import Correspondence, match, prepare
from isomatch._core.arrays import FloatArray, IntArray
from isomatch.evaluation import counted, geodesic_errors
from isomatch.geodesics import distance_engine, farthest_point_sampling, peripheral_vertex
from isomatch.visualization import arranged_panels, camera_of, surface_image, turn_to_target
from isomatch_lab.paper.item import UP_AXIS, Item, Reproduction, Setting, Verdict
from isomatch_lab.paper.region_colours import region_colours
from isomatch_lab.sets import BenchmarkPair, BenchmarkSet, benchmark_set, tosca

CLASS = "cat"  # class of TOSCA whose poses are shown
N_REGIONS, N_POSES = 20, 4  # number of regions, and of poses
BORDER_HALF_WIDTH = 0.006  # half the width of a border, in √area; chosen
DOT_RADIUS = 0.018  # radius of a centre, in √area; chosen
BORDER_GREY = 0.12  # red, green and blue, from 0 to 1, of borders and centres; chosen
MIN_RIGHT_SHARE = 0.9  # a pose is right if at least this share of its area lies in its true region; chosen
RESOLUTION = 330  # pixels per √area; chosen


def make(setting: Setting) -> Reproduction:
    """Match each pose to the first without landmarks, and transfer the regions."""
    chosen = benchmark_set("example" if setting.quick else "tosca", setting.folder)
    poses = poses_of(chosen, setting)
    reference = chosen.load(*poses[0]).source
    engine = distance_engine(reference)
    centres = farthest_point_sampling(engine, N_REGIONS, peripheral_vertex(reference, engine, setting.seed))
    distances = centres.columns.T / np.sqrt(reference.area)  # (n, regions)
    palette = region_colours(distances, reference.faces)
    prepared = prepare(reference, seed=setting.seed)
    camera = camera_of(reference, UP_AXIS)

    def paint(seen: FloatArray) -> FloatArray:
        return paint_regions(seen, palette)

    images, titles = [surface_image(reference, distances, paint, camera, RESOLUTION)], [poses[0][0]]
    rows: list[dict[str, Any]] = []
    for names in poses:
        setting.progress(f"voronoi: {'-'.join(names)}")
        pair = chosen.load(*names)
        result = match(pair.target, prepared, seed=setting.seed)
        transferred = result.map.pull_back(distances)
        best = measure_regions(pair, result.map, transferred, distances, setting)
        rows.append({"reference": names[0], "pose": names[1], "outcome": result.outcome.value} | best)
        turned = camera @ turn_to_target(pair.target, reference, result.map)
        images.append(surface_image(pair.target, transferred, paint, turned, RESOLUTION))
        titles.append(f"{names[1]}: {best['right_share']:.1%} of the area right")
    figure, _ = arranged_panels(images, titles, per_row=3 if len(images) > 2 else 2)
    shares, errors = ([row[key] for row in rows] for key in ("right_share", "mean_error"))
    verdict = Verdict(
        "the regions lie on corresponding parts of all poses, up to an intrinsic symmetry",
        f"{np.mean(shares):.1%} of the area is in its true region, {min(shares):.1%} in the worst of {len(rows)} poses "
        f"(from {MIN_RIGHT_SHARE:.0%} a pose counts as right); mean error {100 * np.mean(errors):.2f} % of √area",
        min(shares) >= MIN_RIGHT_SHARE,
    )
    facts = {"reference": poses[0][0], "poses": [pose for _, pose in poses], "regions": N_REGIONS}
    return Reproduction(figure, rows, [verdict], facts)


def poses_of(chosen: BenchmarkSet, setting: Setting) -> list[tuple[str, str]]:
    """Draw pairs of the first shape of the class and another one."""
    pairs = chosen.pairs
    if setting.data is not None and not setting.quick:
        first, *others = (name for name in tosca(setting.data / "tosca").names if name.startswith(CLASS))
        pairs = tuple((first, other) for other in others)
    return list(BenchmarkSet(chosen.name, pairs, chosen.load).chosen(N_POSES, setting.seed).pairs)


def measure_regions(
    pair: BenchmarkPair,
    image: Correspondence,
    transferred: FloatArray,
    distances: FloatArray,
    setting: Setting,
) -> dict[str, Any]:
    """Share of the pose's area in its true region, and mean error; against the better of direct and mirrored truth."""

    def against(truth: IntArray) -> dict[str, Any]:
        right = distances[truth[:, 0]].argmin(axis=1) == transferred[truth[:, 1]].argmin(axis=1)
        errors = geodesic_errors(pair.source, image, truth[:, ::-1], setting.n_points, setting.seed)
        return {
            "right_share": float(np.average(right, weights=pair.target.vertex_areas[truth[:, 1]])),
            "mean_error": float(counted(errors).mean()),
        }

    sides = {"direct": pair.truth} | ({} if pair.mirrored is None else {"mirrored": pair.mirrored})
    results = [{"side": side} | against(truth) for side, truth in sides.items()]
    return max(results, key=lambda result: float(result["right_share"]))


def paint_regions(seen: FloatArray, palette: FloatArray) -> FloatArray:
    """Colours of the nearest centre; dark at borders and centres."""
    nearest = np.partition(seen, 1, axis=1)
    dark = (nearest[:, 1] - nearest[:, 0] < 2 * BORDER_HALF_WIDTH) | (nearest[:, 0] < DOT_RADIUS)
    return np.where(dark[:, None], BORDER_GREY, palette[seen.argmin(axis=1)])


ITEM = Item(
    "figure 6", "Voronoi regions of 20 points, transferred to other poses by automatic matching", make
)
