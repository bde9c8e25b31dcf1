"""Figure 4: geodesic distance and distance of descriptors from one vertex, drawn on the surface."""

from __future__ import annotations

import statistics

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from scipy.stats import spearmanr

from isomatch._core.arrays import FloatArray
from isomatch.geodesics import distance_engine, farthest_point_sampling, peripheral_vertex
from isomatch.visualization import arranged_panels, camera_of, colour_scale, surface_image
from isomatch_lab.paper.descriptor_distance import CLEAR_DIFFERENCE, embeddings
from isomatch_lab.paper.item import UP_AXIS, Item, Reproduction, Setting, Verdict

BANDS = 20  # number of colours, whose borders are level lines; chosen
COLOUR_MAP = "viridis"
N_ENDS = 8  # number of extremities that are compared; chosen
DOT_RADIUS = 0.03  # radius of the dot at the vertex, in √area; chosen
DOT_COLOUR = (0.84, 0.15, 0.0)
N_LISTED = 500  # number of vertices in the CSV file; chosen


def make(setting: Setting) -> Reproduction:
    """Draw them on the cat, from that one of a few farthest points whose rank correlation is the median."""
    name, mesh = setting.shape("cat0")
    engine = distance_engine(mesh)
    ends = farthest_point_sampling(engine, N_ENDS, peripheral_vertex(mesh, engine, setting.seed))
    columns = ends.columns / np.sqrt(mesh.area)
    fields = {
        kind: np.array([np.linalg.norm(x - x[vertex], axis=1) for vertex in ends.vertices])
        for kind, x in embeddings(mesh, setting.seed).items()
    }  # (ends, n) for each descriptor
    ranks = {
        kind: [float(spearmanr(column, e).statistic) for column, e in zip(columns, field)]
        for kind, field in fields.items()
    }
    shown = int(np.argsort(ranks["gdd"])[N_ENDS // 2])
    vertex, geodesic = int(ends.vertices[shown]), columns[shown]
    share = {"geodesic": geodesic / geodesic.max()}
    share |= {kind: field[shown] / field[shown].max() for kind, field in fields.items()}
    listed = np.sort(np.random.default_rng(setting.seed).choice(mesh.n_vertices, N_LISTED, replace=False))
    rows = [{"vertex": int(i)} | {kind: float(field[i]) for kind, field in share.items()} for i in listed]
    lowest, typical, highest = (
        {kind: pick(of) for kind, of in ranks.items()} for pick in (min, statistics.median, max)
    )
    verdict = Verdict(
        "seen from one vertex, the distance of geodesic distance descriptors follows the geodesic distance; that of "
        "Laplace–Beltrami eigenfunctions does not",
        f"rank correlation with the geodesic distance, median of {N_ENDS} vertices at ends of the shape: "
        f"{typical['gdd']:.3f} ({lowest['gdd']:.3f} … {highest['gdd']:.3f}) against {typical['lbo']:.3f} "
        f"({lowest['lbo']:.3f} … {highest['lbo']:.3f})",
        typical["gdd"] - typical["lbo"] >= CLEAR_DIFFERENCE,
    )
    titles = {
        "geodesic": "geodesic distance",
        "gdd": f"descriptors (GDD), rank correlation {ranks['gdd'][shown]:.3f}",
        "lbo": f"Laplace–Beltrami, rank correlation {ranks['lbo'][shown]:.3f}",
    }
    camera = camera_of(mesh, UP_AXIS)
    images = [
        surface_image(mesh, np.column_stack([field, geodesic]), _with_dot, camera, 420)
        for field in share.values()
    ]
    figure, grid = arranged_panels(images, [titles[kind] for kind in share], per_row=3)
    scale = ScalarMappable(Normalize(0, 1), COLOUR_MAP)
    bar = figure.colorbar(scale, ax=grid, label="distance / the largest")
    bar.ax.tick_params(labelsize=7)
    facts = {"shape": name, "vertices": mesh.n_vertices, "vertex": vertex}
    return Reproduction(figure, rows, [verdict], facts)


def _with_dot(values: FloatArray) -> FloatArray:
    """Colour the first column in bands; draw a dot where the second is small."""
    banded = colour_scale(COLOUR_MAP, 0.0, 1.0, BANDS)(values[:, :1])
    return np.where(values[:, 1:] < DOT_RADIUS, DOT_COLOUR, banded)


ITEM = Item(
    "figure 4", "Distance from one vertex: geodesic, of descriptors, of Laplace–Beltrami eigenfunctions", make
)
