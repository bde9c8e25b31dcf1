"""Structures of subjects: stacked as one shape, their poses, and their prediction."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from isomatch._core.arrays import FloatArray
from isomatch._core.errors import InputError
from isomatch._core.texts import natural_order
from isomatch.cohort.shape_statistics.completion import complete, observed_vertices
from isomatch.cohort.shape_statistics.procrustes import Scale, aligned_to, generalised_procrustes
from isomatch.cohort.shape_statistics.shape_model import ShapeModel, Weighting
from isomatch.cohort.shape_statistics.shapes import CorrespondedShapes, filled, slices_of, structure_of
from isomatch.correspondence import nearest_rotation


def stacked(parts: Mapping[str, CorrespondedShapes]) -> CorrespondedShapes:
    """Stack the vertices of the structures of each subject as one shape.

    The result has all subjects that have a structure. A structure that a subject lacks was not
    measured: it is taken from a subject that has it and most of the others, moved as these are.

    Examples
    --------
    >>> triangle = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    >>> femur = CorrespondedShapes(["s1", "s2"], [triangle, triangle + 5], [[0, 1, 2]])
    >>> patella = CorrespondedShapes(["s1"], [triangle + 2], [[0, 1, 2]])
    >>> subjects = stacked({"femur": femur, "patella": patella})
    >>> subjects, dict(subjects.structures), subjects.measured[1].tolist()
    (CorrespondedShapes(2 shapes of 6 vertices), {'femur': 3, 'patella': 3}, [True, True, True, False, False, False])
    >>> subjects.vertices[1, 3].round(9).tolist()
    [7.0, 7.0, 7.0]
    """
    names = sorted({name for part in parts.values() for name in part.names}, key=natural_order)
    structures = {structure: part.n_vertices for structure, part in parts.items()}
    n = sum(structures.values())
    vertices, measured = np.full((len(names), n, 3), np.nan), np.zeros((len(names), n), dtype=bool)
    faces, left_out = [], []
    for (structure, part), where in zip(parts.items(), slices_of(structures).values()):
        rows = [names.index(name) for name in part.names]
        vertices[rows, where] = part.vertices
        measured[rows, where] = part.seen
        faces.append(part.faces + where.start)
        left_out += [f"{structure} of {reason}" for reason in part.left_out]
    has, known = np.isfinite(vertices[:, :, 0]), np.nan_to_num(vertices)
    for where in slices_of(structures).values():
        donors = np.flatnonzero(has[:, where.start])
        for i in np.flatnonzero(~has[:, where.start]):
            shared = has[donors] & has[i]
            k = int(shared.sum(axis=1).argmax())
            other, weights = known[donors[k]], shared[k].astype(float)
            placed = aligned_to(known[i], other, weights) if weights.any() else other
            vertices[i, where] = placed[where]
    joined = tuple(names), vertices, np.concatenate(faces)
    return CorrespondedShapes(*joined, tuple(left_out), measured, structures)


class StructurePoses(NamedTuple):
    """Subjects whose structures are each aligned by itself, and the poses that were removed.

    Poses of structures that a subject lacks are nan.
    """

    shapes: CorrespondedShapes
    rotations: FloatArray  # (m, s, 3) rotation vectors, in radians
    translations: FloatArray  # (m, s, 3) translations of centroids
    shares: FloatArray  # (s,) share of the pose in the variance of each structure


def aligned_structures(
    shapes: CorrespondedShapes, weights: Weighting = "area", scale: Scale = "keep"
) -> StructurePoses:
    """Align each structure of subjects by itself, so that poses are no part of a model.

    Poses are measured after the alignment of whole subjects, which does not change the result.
    """
    share = shapes.area_weights if weights == "area" else np.full(shapes.n_vertices, 1 / shapes.n_vertices)
    joint = generalised_procrustes(filled(shapes, share, scale).vertices, share, scale)
    shapes, seen = shapes.moved(joint.aligned), shapes.seen
    vertices, shares, poses = joint.aligned.copy(), [], []
    for part in slices_of(shapes.structures).values():
        part_weights = share[part] / share[part].sum()
        faces = structure_of(shapes.mesh(0), part).faces
        alone = CorrespondedShapes(shapes.names, shapes.vertices[:, part], faces, measured=seen[:, part])
        whole = filled(alone, part_weights, scale).vertices
        vertices[:, part] = generalised_procrustes(whole, part_weights, scale).aligned
        both = vertices[:, part], joint.aligned[:, part]
        variances = [np.einsum("i,mij->", part_weights, (x - x.mean(axis=0)) ** 2) for x in both]
        shares.append(1 - variances[0] / variances[1] if variances[1] > 0 else 0.0)
        centres = [np.einsum("i,mij->mj", part_weights, x)[:, None] for x in both]
        products = np.einsum("mij,i,mik->mjk", both[1] - centres[1], part_weights, both[0] - centres[0])
        turns = Rotation.from_matrix(nearest_rotation(products)).as_rotvec()
        pose = np.stack([np.asarray(turns), (centres[1] - centres[0])[:, 0]])
        poses.append(np.where(np.asarray(seen[:, part].any(axis=1))[:, None], pose, np.nan))
    rotations, translations = np.stack(poses, axis=2)
    return StructurePoses(shapes.moved(vertices), rotations, translations, np.array(shares))


def hidden_structures(
    shapes: CorrespondedShapes, hidden: Collection[str], weights: Weighting = "area", scale: Scale = "keep"
) -> list[dict[str, Any]]:
    """Complete hidden structures of each subject from its others, by a model of all other subjects.

    Returns a line for each subject and hidden structure: root mean square ``error`` of the
    completion, ``mean_error`` of the mean of the others placed by the known structures, and
    ``expected_error``, the estimate of the completion. `InputError` if a name is no structure, none
    stays, or there are less than three subjects.
    """
    parts = slices_of(shapes.structures)
    if not set(hidden) < set(parts) or len(shapes) < 3:
        reason = "name fewer of these than all, and give three subjects or more"
        raise InputError(f"{hidden} cannot be hidden of {len(shapes)} subjects of {[*parts]}; {reason}")
    seen = shapes.seen
    known = np.ones(shapes.n_vertices, dtype=bool)
    for name in hidden:
        known[parts[name]] = False
    found = []
    for i, subject in enumerate(shapes.names):
        if not (seen[i] & known).any():
            continue
        rest = np.delete(np.arange(len(shapes)), i)
        names = tuple(shapes.names[j] for j in rest)
        others = replace(shapes, names=names, vertices=shapes.vertices[rest], measured=seen[rest])
        model = ShapeModel.fit(others, scale, weights)
        scores = model.scores[:, :0]
        mean = replace(model, modes=model.modes[:0], variances=model.variances[:0], scores=scores)
        observed = observed_vertices(model, shapes.mesh(i), seen[i] & known)
        completed, of_mean = complete(model, observed), complete(mean, observed)
        for name in hidden:
            rows = np.flatnonzero(seen[i, parts[name]]) + parts[name].start
            if not len(rows):
                continue
            share = model.weights[rows] / model.weights[rows].sum()
            away = [x.mesh.vertices[rows] - shapes.vertices[i, rows] for x in (completed, of_mean)]
            squares = [*((x**2).sum(axis=1) for x in away), completed.expected_error[rows] ** 2]
            errors = (float(np.sqrt(share @ x)) for x in squares)
            named = dict(zip(("error", "mean_error", "expected_error"), errors))
            found.append({"name": subject, "structure": name, **named})
    return found
