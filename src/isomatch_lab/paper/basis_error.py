"""Figure 1: how well a basis of given rank approximates all geodesic distances."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from isomatch import Mesh, distance_basis, geodesic_distances, laplace_basis
from isomatch._core.arrays import FloatArray
from isomatch_lab.paper.item import Item, Reproduction, Setting, Verdict

RANKS = tuple(range(5, 51, 5))  # ranks of bases that are compared; chosen
FIRST_ZOOMED_RANK = 20  # lowest rank in the enlarged part of the figure; chosen
CLOSE_RATIO = 1.4  # largest error over the optimum at which an approximation is called close; chosen
COLUMNS = {  # CSV column: label, style
    "laplace": ("Laplace–Beltrami basis", {"color": "#0072B2", "marker": "s", "linestyle": ":"}),
    "nystrom": (
        "GDB, approximate: Nyström, 2 k columns",
        {"color": "#D55E00", "marker": "v", "linestyle": "-."},
    ),
    "predicted": (
        "GDB, approximate: predicted columns, 2 k",
        {"color": "#E69F00", "marker": "o", "linestyle": "--"},
    ),
    "exact": ("GDB, exact: the optimum", {"color": "black", "marker": ".", "linestyle": "-"}),
}


def relative_error(approximate: FloatArray, distances: FloatArray, weights: FloatArray) -> float:
    """‖A^½ (D̂ − D) A^½‖ / ‖A^½ D A^½‖ in the Frobenius norm, A the diagonal (n,) of weights."""
    root = np.sqrt(weights)
    difference, whole = ((matrix * root).T * root for matrix in (approximate - distances, distances))
    return float(np.linalg.norm(difference) / np.linalg.norm(whole))


def project_distances(vectors: FloatArray, distances: FloatArray, weights: FloatArray) -> FloatArray:
    """Weighted least squares approximation of the columns of D in the span of functions (n, k)."""
    root = np.sqrt(weights)[:, None]
    span = np.linalg.qr(root * vectors)[0]
    nearest: FloatArray = span @ (span.T @ (root * distances)) / root
    return nearest


def errors_by_rank(mesh: Mesh, ranks: tuple[int, ...], seed: int = 0) -> list[dict[str, float]]:
    """One row for each rank with the relative error of each basis, with uniform weights as in the paper."""
    everywhere, weights = np.arange(mesh.n_vertices), np.ones(mesh.n_vertices)
    distances = geodesic_distances(mesh, everywhere)
    distances = (distances + distances.T) / 2
    smooth = laplace_basis(mesh, max(ranks), seed).vectors
    optimum = distance_basis(distances, max(ranks), max(ranks), "exact", "uniform", seed, held_out=0)
    rows = []
    for k in ranks:
        approximations = {
            "laplace": project_distances(smooth[:, :k], distances, weights),
            "nystrom": distance_basis(mesh, k, 2 * k, "nystrom", "uniform", seed, held_out=0).row(everywhere),
            "predicted": distance_basis(mesh, k, 2 * k, "predicted", "uniform", seed, held_out=0).row(
                everywhere
            ),
            "exact": optimum.truncated(k).row(everywhere),
        }
        rows.append(
            {"k": k} | {name: relative_error(d, distances, weights) for name, d in approximations.items()}
        )
    return rows


def draw(rows: list[dict[str, float]], name: str) -> Figure:
    """Draw all ranks, and the larger ones again at the scale of the geodesic bases."""
    figure = Figure((8.5, 3.8), layout="constrained")
    whole, zoom = figure.subplots(1, 2)
    for axes, shown in ((whole, rows), (zoom, [row for row in rows if row["k"] >= FIRST_ZOOMED_RANK])):
        ranks = [row["k"] for row in shown]
        for column, (label, style) in COLUMNS.items():
            axes.plot(ranks, [row[column] for row in shown], label=label, markersize=4, **style)
        axes.set(xlabel="rank k", ylabel="‖D − D̂‖ / ‖D‖, Frobenius", ylim=(0, None))
    bound = [(row["k"], CLOSE_RATIO * row["exact"]) for row in rows if row["k"] >= FIRST_ZOOMED_RANK]
    zoom.plot(*zip(*bound), color="0.6", lw=1, label=f"{CLOSE_RATIO} × the optimum")
    zoom.set(
        title="zoom", ylim=(0, 1.15 * max(row["nystrom"] for row in rows if row["k"] >= FIRST_ZOOMED_RANK))
    )
    whole.set_title(name)
    whole.legend(fontsize="small")
    zoom.legend(*([part[-1:] for part in zoom.get_legend_handles_labels()]), fontsize="small")
    return figure


def make(setting: Setting) -> Reproduction:
    """Measure the bases of the wolf."""
    name, mesh = setting.shape("wolf0")
    rows = errors_by_rank(mesh, RANKS[::3] if setting.quick else RANKS, setting.seed)
    facts = {"shape": name, "vertices": mesh.n_vertices, "weights": "uniform", "columns": "2 k"}
    return Reproduction(
        draw(rows, f"{name}, {mesh.n_vertices} vertices"), list(rows), verdicts_on(rows), facts
    )


def verdicts_on(rows: list[dict[str, float]]) -> list[Verdict]:
    """Compare the approximate bases, the paper's and ours, with the optimum, and ours with the Laplace–Beltrami basis."""
    first, last = rows[0]["k"], rows[-1]["k"]
    verdicts = []
    for column, method in (
        ("nystrom", "Nyström, the paper's method"),
        ("predicted", "predicted columns, ours"),
    ):
        ratios = [row[column] / row["exact"] for row in rows]
        verdicts.append(
            Verdict(
                f"the approximate basis ({method}) is close to the exact one: within {CLOSE_RATIO} × the optimum for "
                f"k = {first} … {last}",
                f"{min(ratios):.2f} to {max(ratios):.2f} × the optimum; {rows[-1][column]:.4f} against "
                f"{rows[-1]['exact']:.4f} at k = {last}",
                max(ratios) <= CLOSE_RATIO,
            )
        )
    gains = {column: min(row["laplace"] / row[column] for row in rows) for column in ("nystrom", "predicted")}
    verdicts.append(
        Verdict(
            "both are better than the Laplace–Beltrami basis of the same rank",
            f"the error of the Laplace–Beltrami basis is at least {gains['nystrom']:.2f} × that of Nyström and "
            f"{gains['predicted']:.2f} × that of predicted columns; {rows[-1]['laplace']:.4f} against "
            f"{rows[-1]['nystrom']:.4f} and {rows[-1]['predicted']:.4f} at k = {last}",
            min(gains.values()) > 1.0,
        )
    )
    return verdicts


ITEM = Item("figure 1", "Error of the distance matrix against the rank of the basis", make)
