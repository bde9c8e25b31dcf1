"""Numbers of geomorph 4.0.8 for made configurations, and ours: to 10⁻⁸, or to what geomorph states where it iterates.

As a program, it prints a line for each number or array: asked, measured, and the largest difference.
"""

import json
import sys
from collections.abc import Iterator
from functools import cache
from typing import NamedTuple

import numpy as np
import pytest

from data import real_file
from isomatch import Mesh
from isomatch.cohort.shape_statistics import (
    CorrespondedShapes,
    ShapeDesign,
    ShapeModel,
    align_sides,
    asymmetry,
    centroid_sizes,
    generalised_procrustes,
    left_right_of_pairs,
    paired_sides,
    procrustes_distances,
    shape_anova,
    shape_regression,
    slid_semilandmarks,
)
from isomatch.cohort.shape_statistics.sliding import BendingEnergy
from isomatch.landmarks import Curve

EXACT = 1e-8
EARLY = 1e-5  # gpagen stops after four iterations, or when the sum of squares changes by less than 1e-4
DRAWN = 0.25  # standard deviates of 4999 draws differ by so much between two seeds
LETTERS = "abcdefghij"


class Compared(NamedTuple):
    name: str
    asked: np.ndarray
    measured: np.ndarray
    tolerance: float

    @property
    def difference(self):
        return float(np.abs(np.subtract(self.asked, self.measured)).max())


@cache
def values():
    return json.loads(real_file("geomorph/values.json").read_text())


def unit(shapes):
    centred = shapes - shapes.mean(axis=1, keepdims=True)
    return centred / np.linalg.norm(centred, axis=(1, 2))[:, None, None]


def turned(shapes, onto):
    """Shapes after the one rotation by which all of them together lie on others."""
    u, _, vt = np.linalg.svd(np.einsum("sni,snj->ij", shapes, onto))
    return shapes @ u @ np.diag([1, 1, np.linalg.det(u @ vt)]) @ vt


def anova(name, asked, rows, scale, tolerance=EXACT, f_right=True) -> Iterator[Compared]:
    """Compare rows of an analysis of variance: degrees, squares, shares, and F as far as geomorph's is right."""
    for (term, row), own in zip(asked.items(), rows):
        r_squared = getattr(own, "r_squared", getattr(own, "share", 0.0))
        yield Compared(f"{name}, {term}: Df", row["Df"], own.degrees, 0)
        yield Compared(f"{name}, {term}: SS", row["SS"], own.squares / scale, tolerance)
        if row["MS"] is not None:
            yield Compared(f"{name}, {term}: MS", row["MS"], own.mean_square / scale, tolerance)
        if row["Rsq"] is not None:
            yield Compared(f"{name}, {term}: R²", row["Rsq"], r_squared, tolerance)
        if row["F"] is not None and f_right:
            yield Compared(f"{name}, {term}: F", 1, own.f / row["F"], max(tolerance, 1e-7))
        if row["p"] is not None and hasattr(own, "z"):
            yield Compared(f"{name}, {term}: Z", row["Z"], own.z, DRAWN)
            noise = 4 * np.sqrt(row["p"] * (1 - row["p"]) / 2500) + 0.0005
            yield Compared(f"{name}, {term}: p", row["p"], own.p_value, noise)


def of_landmarks() -> Iterator[Compared]:
    given = values()["landmarks"]
    asked, shapes = given["geomorph"], np.array(given["coordinates"])
    m, n, _ = shapes.shape
    sizes = centroid_sizes(shapes)
    yield Compared("centroid sizes", asked["centroid_sizes"], sizes, EXACT)
    found = generalised_procrustes(shapes, scale="remove")
    to_unit = found.size * np.sqrt(n)
    own = (found.aligned - found.mean.mean(axis=0)) / to_unit
    aligned = np.array(asked["aligned"])
    yield Compared("aligned coordinates", aligned, turned(own, aligned), EXACT)
    table = {"cs": np.log(sizes), "gr": [LETTERS[i] for i in given["group"]], "cov": given["covariate"]}
    formulas = {"size": "cs", "group": "gr", "covariate": "cov", "size_group": "cs + gr"}
    for tangent, end, tolerance in ((False, "", EXACT), (True, "_default", EARLY)):
        named = CorrespondedShapes([str(i) for i in range(m)], shapes)
        model = ShapeModel.fit(named, "remove", tangent=tangent)
        scale = model.size**2
        yield Compared(f"variances{end}", asked[f"pca_variances{end}"], model.variances / scale, tolerance)
        if not tangent:
            five = np.abs(model.scores[:, :5]) / model.size
            yield Compared("scores", asked["absolute_pca_scores_first_5"], five, EXACT)
        at = generalised_procrustes(shapes, scale="remove", tangent=tangent).aligned
        for key, formula in formulas.items():
            tested = shape_anova(at, ShapeDesign.of(formula, table))
            # R² and F of projected shapes differ by what the early stop leaves
            yield from anova(
                f"procD.lm{end} {formula}", asked[f"procD_lm{end}"][key], tested.rows, scale, tolerance
            )
            if key == "group" and not tangent:
                (pair,), of_pair = tested.pairs, asked["distance_of_group_means"]
                yield Compared("distance of group means", of_pair["d"], pair.distance / model.size, EXACT)
                yield Compared("distance of group means: p", of_pair["p"], pair.p_value, 0.03)
    regression = shape_regression(found.aligned, np.log(sizes), n_permutations=1)
    coefficients = np.array([asked["coefficients_of_log_size"]])
    own = turned(
        np.concatenate([own, regression.coefficients / to_unit]), np.concatenate([aligned, coefficients])
    )
    yield Compared("coefficients of log size", coefficients[0], own[-1], EXACT)
    scores = regression.scores[:, 0] / found.size
    yield Compared("regression scores", asked["regression_scores_of_log_size"], scores, EXACT)
    first, of_two = shapes[:2], given["shapes_procdist_of_first_two"]
    partial = procrustes_distances(unit(first))[0, 1] * np.sqrt(n)
    angle = 2 * np.arcsin(partial / 2)
    distances = {"partial": partial, "full": np.sin(angle), "riemann": angle}
    distances["sizeandshape"] = procrustes_distances(first)[0, 1] * np.sqrt(n)
    for name, distance in distances.items():
        yield Compared(f"{name} Procrustes distance", of_two[name], distance, EXACT)


def of_object() -> Iterator[Compared]:
    given = values()["object"]
    shapes = np.array(given["coordinates"])
    sides = left_right_of_pairs(shapes.shape[1], [tuple(pair) for pair in given["pairs"]])
    for key, kept in (("replicates", (0, 1)), ("without", (0,))):
        rows = [i for i, replicate in enumerate(given["replicate"]) if replicate in kept]
        both = CorrespondedShapes([str(i) for i in rows], shapes[rows]).mirrored([sides] * len(rows))
        size = generalised_procrustes(both.vertices, scale="remove").size
        of = [LETTERS[given["individual"][i]] for i in rows]
        found = asymmetry(*align_sides(both, left_right=[sides] * len(rows)), individuals=of)
        for end, tolerance in (("_converged", EXACT), ("", 1e-2)):
            yield from anova(
                f"object {key}{end}", given["geomorph"][key + end], found.anova, size**2, tolerance
            )


def of_matching() -> Iterator[Compared]:
    given = values()["matching"]
    columns = given["individual"], given["side"], given["replicate"]
    names = [f"{LETTERS[i]} {side} {replicate}" for i, side, replicate in zip(*columns)]
    shapes = CorrespondedShapes(names, np.array(given["coordinates"]))
    for key, kept in (("replicates", (0, 1)), ("without", (0,))):
        pairs = [(f"{i} left {r}", f"{i} right {r}") for i in LETTERS for r in kept]
        both = paired_sides(shapes, pairs)
        size = generalised_procrustes(both.vertices, scale="remove").size
        of = [left[0] for left, _ in pairs]
        found = asymmetry(*align_sides(both), individuals=of)
        for end, tolerance in (("_converged", EXACT), ("", 1e-2)):
            yield from anova(
                f"matching {key}{end}", given["geomorph"][key + end], found.anova, size**2, tolerance
            )
        if key == "replicates":
            right, left = np.split(centroid_sizes(both.vertices)[:, None, None], 2)
            rows = asymmetry(right, left, individuals=of).anova
            # geomorph compares all with the error; individuals and sides are to be compared with their interaction
            yield from anova("sizes", given["geomorph_size_anova"], rows, 1.0, 2e-8, f_right=False)
            asked = [row["F"] for row in given["geomorph_size_anova"].values()][:3]
            error = rows[3].mean_square
            yield Compared(
                "sizes: F by the error", asked, [row.mean_square / error for row in rows[:3]], EXACT
            )


def of_sliding() -> Iterator[Compared]:
    given = values()["sliding"]
    asked, shapes = given["geomorph"], np.array(given["coordinates"])
    curves, patch = [Curve(str(i), tuple(rows)) for i, rows in enumerate(given["curves"])], given["surfaces"]
    meshes = [Mesh(vertices, given["mesh_faces"]) for vertices in given["mesh_vertices"]]
    start = generalised_procrustes(shapes, scale="remove")
    before = np.array(asked["aligned_before"])
    yield Compared("aligned before sliding", before, turned(unit(start.aligned), before), EXACT)
    bending = BendingEnergy(start.mean)
    yield Compared("bending energy", asked["energy_before"], bending.of_each(unit(start.aligned)), EXACT)
    rows = (bending @ np.eye(len(start.mean)))[:3]
    first = np.array(asked["first_rows_of_bending_matrix"])
    yield Compared("bending matrix, over its largest", first / first.max(), rows / first.max(), EXACT)
    for surfaces, where in ((None, "without meshes"), (meshes, "on meshes")):
        for criterion, key in (("bending", "single_exact_step"), ("distance", "single_step_least_distance")):
            how = {"criterion": criterion, "most_rounds": 1, "enough": 1e-12}
            found = slid_semilandmarks(shapes, surfaces, curves, patch, **how)
            placed = np.einsum("sij,snj->sni", start.rotations, found.positions) * start.scales[:, None, None]
            placed += start.translations[:, None] - start.mean.mean(axis=0)
            placed /= start.size * np.sqrt(shapes.shape[1])
            step = np.array(asked[key]["coordinates"])
            yield Compared(f"{key}, {where}", step, turned(placed, step), EXACT)
            yield Compared(f"{key}: energy, {where}", asked[key]["energy"], found.energy_after, EXACT)
    for criterion, key, tolerance in (
        ("bending", "gpagen_bending", 1e-3),
        ("bending", "gpagen_bending_converged", 2e-4),
        ("distance", "gpagen_least_distance", 5e-3),
    ):
        found = slid_semilandmarks(
            shapes, None, curves, patch, criterion=criterion, most_rounds=6, enough=1e-9
        )
        there = unit(np.array(asked[key]["coordinates"]))
        own = unit(generalised_procrustes(found.positions, scale="remove").aligned)
        yield Compared(key, there, turned(own, there), tolerance)
        yield Compared(f"{key}: energy", asked[key]["energy"], found.energy_after, tolerance)
    settled = np.array(asked["gpagen_bending_converged"]["coordinates"])
    further = slid_semilandmarks(settled, None, curves, patch, most_rounds=1, enough=1e-12).positions
    own = unit(generalised_procrustes(further, scale="remove").aligned)
    yield Compared(
        "gpagen_bending_converged: after a round here", unit(settled), turned(own, unit(settled)), EARLY
    )


SETS = (of_landmarks, of_object, of_matching, of_sliding)


@pytest.mark.parametrize(
    "of",
    [
        of_object,
        of_matching,
        *(pytest.param(of, marks=pytest.mark.long) for of in (of_landmarks, of_sliding)),
    ],
)
def test_numbers_are_those_of_geomorph(of):
    wrong = [each for each in of() if not each.difference <= each.tolerance]
    assert not wrong, [(each.name, each.difference, each.tolerance) for each in wrong]


if __name__ == "__main__":
    for compared in (each for of in SETS for each in of()):
        asked, measured = (np.asarray(each) for each in (compared.asked, compared.measured))
        shown = [f"{float(each):.10g}" if each.ndim == 0 else str(each.shape) for each in (asked, measured)]
        sys.stdout.write(" | ".join([compared.name, *shown, f"{compared.difference:.1e}"]) + "\n")
