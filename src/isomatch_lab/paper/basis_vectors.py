"""Figure 2: the first vectors of the geodesic distance basis."""

from __future__ import annotations

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize

from isomatch import DistanceBasis, distance_basis, laplace_basis
from isomatch.visualization import arranged_panels, camera_of, colour_scale, surface_image
from isomatch_lab.paper.item import UP_AXIS, Item, Reproduction, Setting, Verdict

N_VECTORS = 10  # number of basis vectors that are drawn; chosen
N_SMOOTH = 50  # number of Laplace–Beltrami eigenfunctions whose span counts as smooth; chosen
MAX_SHOWN_VALUE = 2.5  # ends of the colour scale, ±, of functions with mean square 1; chosen
COLOUR_MAP = "PuOr"  # colour map for values of both signs
# largest error of vectors that give "most of the distances", and smallest share of "smooth" ones in the span
MAX_ERROR, MIN_SMOOTH_SHARE = 0.05, 0.95


def make(setting: Setting) -> Reproduction:
    """Compute and draw the vectors on the cat."""
    name, mesh = setting.shape("cat0")
    basis = distance_basis(mesh, N_VECTORS, 2 * N_VECTORS, seed=setting.seed)
    area = mesh.area
    errors = basis.error_estimates()
    coefficients = laplace_basis(mesh, N_SMOOTH, setting.seed).coefficients(basis.vectors)
    smooth = (coefficients**2).sum(axis=0)  # share of each vector's squared norm, which is 1
    rows = [
        {
            "vector": i + 1,
            "eigenvalue_over_area_three_halves": float(basis.values[i] / area**1.5),
            "smooth_share": float(smooth[i]),
            "relative_error_so_far": float(errors[i]),
        }
        for i in range(N_VECTORS)
    ]
    gram = basis.vectors.T @ (basis.weights[:, None] * basis.vectors)
    skew = float(np.abs(gram - np.eye(N_VECTORS)).max())
    verdicts = [
        Verdict(
            "ten orthonormal vectors hold most of the distances",
            f"relative error {errors[-1]:.3f} with {N_VECTORS} (estimated on columns held out from the fit; at most "
            f"{MAX_ERROR} counts as most); QᵀAQ is within {skew:.0e} of the identity",
            bool(errors[-1] <= MAX_ERROR and skew < 1e-8),
        ),
        Verdict(
            "they are smooth functions on the surface",
            f"the first {N_SMOOTH} Laplace–Beltrami functions hold at least {smooth.min():.1%} of the square of each "
            f"({MIN_SMOOTH_SHARE:.0%} counts as smooth)",
            bool(smooth.min() >= MIN_SMOOTH_SHARE),
        ),
    ]
    values = basis.vectors * np.sqrt(area)
    camera = camera_of(mesh, UP_AXIS)
    paint = colour_scale(COLOUR_MAP, -MAX_SHOWN_VALUE, MAX_SHOWN_VALUE)
    images = [surface_image(mesh, column, paint, camera, 220) for column in values.T]
    figure, grid = arranged_panels(images, _titles(basis), per_row=5)
    scale = ScalarMappable(Normalize(-MAX_SHOWN_VALUE, MAX_SHOWN_VALUE), COLOUR_MAP)
    figure.colorbar(scale, ax=grid, shrink=0.6, extend="both", label="q · √area").ax.tick_params(labelsize=7)
    facts = {"shape": name, "vertices": mesh.n_vertices, "weights": "area", "columns": 2 * N_VECTORS}
    return Reproduction(figure, rows, verdicts, facts)


def _titles(basis: DistanceBasis) -> list[str]:
    share = basis.values / np.abs(basis.values[0])
    return [f"{i + 1}: λ / λ₁ = {value:+.4f}".replace("-", "−") for i, value in enumerate(share)]


ITEM = Item("figure 2", "The first ten basis vectors, with eigenvalues as shares of the first", make)
