"""Figure 3: the distance between two descriptors against the geodesic distance between their points."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from scipy.spatial.distance import pdist, squareform
from scipy.stats import spearmanr

from isomatch import Mesh, distance_basis, geodesic_distance_descriptor, geodesic_distances, laplace_basis
from isomatch._core.arrays import FloatArray
from isomatch_lab.paper.item import Item, Reproduction, Setting, Verdict

RANK = 50  # number of descriptors and of eigenfunctions; chosen
N_POINTS, QUICK_POINTS = 1000, 300  # number of drawn points, and of points in a quick run
BINS = 40  # number of intervals of the geodesic distance; chosen
CLEAR_DIFFERENCE = 0.1  # smallest difference of two rank correlations that counts as clear (chosen)
LABELS = {"gdd": "geodesic distance descriptors", "lbo": "Laplace–Beltrami eigenfunctions"}


def embeddings(mesh: Mesh, seed: int = 0, rank: int = RANK) -> dict[str, FloatArray]:
    """Dimensionless descriptors (n, rank): geodesic distance descriptors, and Laplace–Beltrami eigenfunctions."""
    descriptor = geodesic_distance_descriptor(distance_basis(mesh, rank, 2 * rank, seed=seed))
    return {
        "gdd": descriptor.coordinates / mesh.area**0.25,
        "lbo": laplace_basis(mesh, rank + 1, seed).vectors[:, 1:] * np.sqrt(mesh.area),
    }


def compare_descriptors(mesh: Mesh, n_points: int, seed: int = 0) -> tuple[FloatArray, dict[str, FloatArray]]:
    """Geodesic distances / √area between all pairs of random vertices, and the distances of their descriptors."""
    drawn = np.random.default_rng(seed).choice(mesh.n_vertices, n_points, replace=False)
    distances = geodesic_distances(mesh, drawn)[:, drawn] / np.sqrt(mesh.area)
    between = squareform((distances + distances.T) / 2, checks=False)
    return between, {name: pdist(x[drawn]) for name, x in embeddings(mesh, seed).items()}


def quantiles(geodesic: FloatArray, between: FloatArray) -> FloatArray:
    """Middle of each bin of geodesic distance, and the 5, 50 and 95 % quantiles in the bin: (bins, 4)."""
    edges = np.linspace(0.0, geodesic.max(), BINS + 1)
    bins = np.minimum(np.digitize(geodesic, edges) - 1, BINS - 1)
    full = [i for i in range(BINS) if (bins == i).sum() >= 20]
    return np.array(
        [[(edges[i] + edges[i + 1]) / 2, *np.quantile(between[bins == i], (0.05, 0.5, 0.95))] for i in full]
    )


def make(setting: Setting) -> Reproduction:
    """Compare both descriptors on the cat."""
    name, mesh = setting.shape("cat0")
    geodesic, between = compare_descriptors(mesh, QUICK_POINTS if setting.quick else N_POINTS, setting.seed)
    ranks = {kind: float(spearmanr(geodesic, e).statistic) for kind, e in between.items()}
    lines = {kind: quantiles(geodesic, e) for kind, e in between.items()}
    rows: list[dict[str, Any]] = [
        {"descriptor": kind, "distance": d, "q05": low, "median": middle, "q95": high}
        for kind, line in lines.items()
        for d, low, middle, high in line.tolist()
    ]
    rising = {kind: bool((np.diff(line[:, 2]) > 0).all()) for kind, line in lines.items()}
    verdict = Verdict(
        "the distance of geodesic distance descriptors grows with the geodesic distance; that of Laplace–Beltrami "
        "eigenfunctions does not",
        f"Spearman's rank correlation {ranks['gdd']:.3f} against {ranks['lbo']:.3f}; the median rises throughout: "
        + ", ".join(f"{kind.upper()} {'yes' if rising[kind] else 'no'}" for kind in rising),
        ranks["gdd"] - ranks["lbo"] >= CLEAR_DIFFERENCE,
    )
    figure = Figure((8.5, 4.0), layout="constrained")
    for axes, (kind, e) in zip(figure.subplots(1, 2), between.items()):
        density = axes.hexbin(geodesic, e, gridsize=90, bins="log", cmap="cividis", mincnt=1, rasterized=True)
        axes.plot(lines[kind][:, 0], lines[kind][:, 2], color="#D55E00", lw=1.8, label="median")
        axes.set(
            title=f"{LABELS[kind]}\nrank correlation {ranks[kind]:.3f}",
            xlabel="geodesic distance D / √area",
            ylabel="‖x − y‖ / area^¼" if kind == "gdd" else "‖φ(x) − φ(y)‖ · √area",
            xlim=(0, None),
            ylim=(0, None),
        )
        axes.legend(loc="lower right")
        figure.colorbar(density, ax=axes, label="pairs of points")
    facts = {"shape": name, "vertices": mesh.n_vertices, "rank": RANK, "pairs of points": len(geodesic)}
    return Reproduction(figure, rows, [verdict], facts)


ITEM = Item("figure 3", "Distance of descriptors against geodesic distance, all pairs of drawn points", make)
