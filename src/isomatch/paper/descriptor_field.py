"""Figure 4: the distance from one vertex, geodesic and of descriptors, on the surface."""

from __future__ import annotations

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from scipy.stats import spearmanr

from isomatch import geodesic_distances
from isomatch._arrays import FloatArray
from isomatch.geodesics import distance_engine, peripheral_vertex
from isomatch.paper import surface_panels
from isomatch.paper.descriptor_distance import CLEARLY, embeddings
from isomatch.paper.item import Item, Reproduction, Setting, Verdict
from isomatch.view import surface_image

BANDS = 20
COLOUR_MAP = "viridis"
DOT = 0.02  # radius of the dot at the vertex, in √area
DOT_COLOUR = (0.84, 0.15, 0.0)
N_LISTED = 500  # vertices in the CSV


def make(setting: Setting) -> Reproduction:
    """Draw them on the cat, from the end of a limb."""
    name, mesh = setting.shape("cat0")
    vertex = peripheral_vertex(mesh, distance_engine(mesh), setting.seed)
    geodesic = geodesic_distances(mesh, [vertex])[0] / np.sqrt(mesh.area)
    fields = {"geodesic": geodesic}
    for kind, x in embeddings(mesh, setting.seed).items():
        fields[kind] = np.linalg.norm(x - x[vertex], axis=1)
    ranks = {kind: float(spearmanr(geodesic, field).statistic) for kind, field in fields.items()}
    share = {kind: field / field.max() for kind, field in fields.items()}
    listed = np.random.default_rng(setting.seed).choice(mesh.n_vertices, N_LISTED, replace=False)
    rows = [
        {"vertex": int(i)} | {kind: float(field[i]) for kind, field in share.items()} for i in np.sort(listed)
    ]
    verdict = Verdict(
        "seen from one vertex, the distance of geodesic distance descriptors follows the geodesic distance; that of "
        "Laplace–Beltrami eigenfunctions does not",
        f"rank correlation with the geodesic distance over all vertices {ranks['gdd']:.3f} against {ranks['lbo']:.3f}",
        ranks["gdd"] - ranks["lbo"] >= CLEARLY,
    )
    titles = {
        "geodesic": "geodesic distance",
        "gdd": f"descriptors (GDD), rank correlation {ranks['gdd']:.3f}",
        "lbo": f"Laplace–Beltrami, rank correlation {ranks['lbo']:.3f}",
    }
    images = [
        surface_image(mesh, np.column_stack([field, geodesic]), _with_dot, resolution=420)
        for field in share.values()
    ]
    figure, grid = surface_panels.arranged(images, [titles[kind] for kind in share], per_row=3)
    scale = ScalarMappable(Normalize(0, 1), COLOUR_MAP)
    bar = figure.colorbar(scale, ax=grid, shrink=0.8, label="distance from the dot / the largest")
    bar.ax.tick_params(labelsize=7)
    facts = {"shape": name, "vertices": mesh.n_vertices, "vertex": vertex}
    return Reproduction(figure, rows, [verdict], facts)


def _with_dot(values: FloatArray) -> FloatArray:
    """Colour bands of the first column; a dot where the second is small."""
    banded = surface_panels.colours(COLOUR_MAP, 0.0, 1.0, BANDS)(values[:, :1])
    return np.where(values[:, 1:] < DOT, DOT_COLOUR, banded)


ITEM = Item(
    "figure 4", "Distance from one vertex: geodesic, of descriptors, of Laplace–Beltrami eigenfunctions", make
)
