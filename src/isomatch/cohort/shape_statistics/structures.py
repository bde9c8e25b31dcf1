"""Subjects of several surfaces: their structures stacked, the pose of each among the others, one told by the others."""

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
    """Take structures of subjects, named like these, for one shape each: their vertices one after the other.

    The result has all subjects that have a structure. One that a subject lacks was not measured: it lies where it is in a
    subject that has it and most of the others, moved as these are.

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
    there, known = np.isfinite(vertices[:, :, 0]), np.nan_to_num(vertices)
    for where in slices_of(structures).values():
        having = np.flatnonzero(there[:, where.start])
        for i in np.flatnonzero(~there[:, where.start]):
            shared = there[having] & there[i]
            k = int(shared.sum(axis=1).argmax())
            other, weights = known[having[k]], shared[k].astype(float)
            placed = aligned_to(known[i], other, weights) if weights.any() else other
            vertices[i, where] = placed[where]
    joined = tuple(names), vertices, np.concatenate(faces)
    return CorrespondedShapes(*joined, tuple(left_out), measured, structures)


class StructurePoses(NamedTuple):
    """Subjects, ``shapes``, whose structures are aligned each by itself, and the poses that were taken away.

    That are rotation vectors (m, s, 3), in radians, and translations of centroids, nan where a subject lacks a structure;
    ``shares`` (s,) is what part of the variance of each structure is that of its pose.
    """

    shapes: CorrespondedShapes
    rotations: FloatArray
    translations: FloatArray
    shares: FloatArray


def aligned_structures(
    shapes: CorrespondedShapes, weights: Weighting = "area", scale: Scale = "keep"
) -> StructurePoses:
    """Align each structure of subjects by itself, so that poses among each other are no part of a model.

    Poses are those after the alignment of whole subjects, which would change nothing of the result.
    """
    share = shapes.area_weights if weights == "area" else np.full(shapes.n_vertices, 1 / shapes.n_vertices)
    joint = generalised_procrustes(filled(shapes, share, scale).vertices, share, scale)
    shapes, seen = shapes.moved(joint.aligned), shapes.seen
    vertices, shares, poses = joint.aligned.copy(), [], []
    for part in slices_of(shapes.structures).values():
        own = share[part] / share[part].sum()
        faces = structure_of(shapes.mesh(0), part).faces
        alone = CorrespondedShapes(shapes.names, shapes.vertices[:, part], faces, measured=seen[:, part])
        whole = filled(alone, own, scale).vertices
        vertices[:, part] = generalised_procrustes(whole, own, scale).aligned
        both = vertices[:, part], joint.aligned[:, part]
        variances = [np.einsum("i,mij->", own, (x - x.mean(axis=0)) ** 2) for x in both]
        shares.append(1 - variances[0] / variances[1] if variances[1] > 0 else 0.0)
        centres = [np.einsum("i,mij->mj", own, x)[:, None] for x in both]
        products = np.einsum("mij,i,mik->mjk", both[1] - centres[1], own, both[0] - centres[0])
        turns = Rotation.from_matrix(nearest_rotation(products)).as_rotvec()
        pose = np.stack([np.asarray(turns), (centres[1] - centres[0])[:, 0]])
        poses.append(np.where(np.asarray(seen[:, part].any(axis=1))[:, None], pose, np.nan))
    rotations, translations = np.stack(poses, axis=2)
    return StructurePoses(shapes.moved(vertices), rotations, translations, np.array(shares))


def hidden_structures(
    shapes: CorrespondedShapes, hidden: Collection[str], weights: Weighting = "area", scale: Scale = "keep"
) -> list[dict[str, Any]]:
    """Complete structures of each subject, all at once, from its others, by a model of all other subjects.

    Returns a line for each subject and hidden structure: root mean square ``error`` from the true one, ``mean_error`` of
    the mean of the others, placed by what is known, and what the completion says, ``expected_error``. `InputError` if a
    name is no structure, none stays, or there are less than three subjects.
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
        there = {name: own for name in hidden if (own := seen[i, parts[name]]).any()}
        if not (seen[i] & known).any():
            continue
        rest = np.delete(np.arange(len(shapes)), i)
        names = tuple(shapes.names[j] for j in rest)
        others = replace(shapes, names=names, vertices=shapes.vertices[rest], measured=seen[rest])
        model = ShapeModel.fit(others, scale, weights)
        none, scores = slice(0), model.scores[:, :0]
        mean = replace(model, modes=model.modes[none], variances=model.variances[none], scores=scores)
        told = observed_vertices(model, shapes.mesh(i), seen[i] & known)
        completed, of_mean = complete(model, told), complete(mean, told)
        for name, own in there.items():
            rows = np.flatnonzero(own) + parts[name].start
            share = model.weights[rows] / model.weights[rows].sum()
            apart = [each.mesh.vertices[rows] - shapes.vertices[i, rows] for each in (completed, of_mean)]
            squares = [*((each**2).sum(axis=1) for each in apart), completed.expected_error[rows] ** 2]
            errors = (float(np.sqrt(share @ each)) for each in squares)
            named = dict(zip(("error", "mean_error", "expected_error"), errors))
            found.append({"name": subject, "structure": name, **named})
    return found
