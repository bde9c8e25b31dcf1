"""Subjects of several surfaces: their structures stacked, the pose of each among the others, one told by the others."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from isomatch.correspondence import nearest_rotation
from isomatch.errors import InputError
from isomatch.statistics.completion import complete
from isomatch.statistics.observations import Observations, observed_vertices
from isomatch.statistics.procrustes import Scale, generalised_procrustes
from isomatch.statistics.shape_model import ShapeModel, Weighting
from isomatch.statistics.shapes import CorrespondedShapes, filled, slices_of
from isomatch.storage.texts import natural_order
from isomatch.values.arrays import BoolArray, FloatArray


def stacked(parts: Mapping[str, CorrespondedShapes]) -> CorrespondedShapes:
    """Take the structures of subjects for one shape each: their vertices one after the other.

    Parameters
    ----------
    parts : mapping of str to CorrespondedShapes
        Shapes of each structure, named like their subjects, in the coordinates of these.

    Returns
    -------
    CorrespondedShapes
        All subjects that have a structure. One that a subject lacks was not measured: it lies where it is in a subject
        that has it and most of the others, moved as these are.

    Raises
    ------
    InputError
        If no structure is given.

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
    if not parts:
        raise InputError("no structures; give at least one")
    names = sorted({name for part in parts.values() for name in part.names}, key=natural_order)
    structures = {structure: part.n_vertices for structure, part in parts.items()}
    n = sum(structures.values())
    vertices, measured = np.full((len(names), n, 3), np.nan), np.zeros((len(names), n), dtype=bool)
    row = {name: i for i, name in enumerate(names)}
    faces, left_out = [], []
    for (structure, part), where in zip(parts.items(), slices_of(structures).values()):
        rows = [row[name] for name in part.names]
        vertices[rows, where] = part.vertices
        measured[rows, where] = True if part.measured is None else part.measured
        faces.append(part.faces + where.start)
        left_out += [f"{structure} of {reason}" for reason in part.left_out]
    there = np.isfinite(vertices[:, :, 0])
    for where in slices_of(structures).values():
        having = np.flatnonzero(there[:, where.start])
        for i in np.flatnonzero(~there[:, where.start]):
            other = having[(there[having] & there[i]).sum(axis=1).argmax()]
            vertices[i, where] = _placed_as(vertices[other], vertices[i], there[other] & there[i], where)
    return CorrespondedShapes(
        tuple(names), vertices, np.concatenate(faces), tuple(left_out), measured, structures
    )


def _placed_as(other: FloatArray, own: FloatArray, shared: FloatArray, part: slice) -> FloatArray:
    """Place a part as it is in another shape, moved as the vertices of both are."""
    if not shared.any():
        return other[part]
    centres = other[shared].mean(axis=0), own[shared].mean(axis=0)
    turn = nearest_rotation((other[shared] - centres[0]).T @ (own[shared] - centres[1]))
    return np.asarray((other[part] - centres[0]) @ turn + centres[1])


def _seen(shapes: CorrespondedShapes) -> BoolArray:
    """(m, n) which vertices were measured."""
    return np.ones(shapes.vertices.shape[:2], dtype=bool) if shapes.measured is None else shapes.measured


@dataclass(frozen=True, eq=False)
class StructurePoses:
    """Subjects whose structures are aligned each by itself, and the poses that were taken away.

    Parameters
    ----------
    shapes : CorrespondedShapes
        The m subjects: each of their s structures lies where it is on average, so that only its shape varies.
    rotations, translations : (m, s, 3) array of float
        How each structure is turned (rotation vectors, radians) and shifted (of its centroid, in the units of the shapes)
        from there, among the other structures of its subject; nan where a subject lacks it.
    shares : (s,) array of float
        Which share of the variance of each structure is that of its pose.
    """

    shapes: CorrespondedShapes
    rotations: FloatArray
    translations: FloatArray
    shares: FloatArray


def aligned_structures(
    shapes: CorrespondedShapes, weights: Weighting = "area", scale: Scale = "keep"
) -> StructurePoses:
    """Align each structure by itself, so that the poses of structures among each other are no part of a model.

    Parameters
    ----------
    shapes : CorrespondedShapes
        Subjects of several structures, see `stacked`.
    weights, scale
        As for `ShapeModel.fit`; with "remove", the size of each structure is removed too.

    Returns
    -------
    StructurePoses
        A model of its ``shapes`` is one of shape alone. Poses are those after the alignment of whole subjects.

    Notes
    -----
    The time of `generalised_procrustes` for the subjects and for each structure. A joint alignment of the result changes
    nothing: products with the mean that are symmetric and not negative for each structure have such a sum.

    Examples
    --------
    >>> corner = np.array([[0, 0, 0], [3, 0, 0], [0, 2, 0], [0, 0, 1.0]])
    >>> faces = [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]]
    >>> fixed = CorrespondedShapes("abc", [corner] * 3, faces)
    >>> shifted = CorrespondedShapes("abc", [corner + [5, 0, x] for x in (0, 1, 2)], faces)
    >>> subjects = stacked({"fixed": fixed, "shifted": shifted})
    >>> ShapeModel.fit(subjects).n_modes, ShapeModel.fit(aligned_structures(subjects).shapes).n_modes
    (2, 0)
    """
    share = shapes.area_weights if weights == "area" else np.full(shapes.n_vertices, 1 / shapes.n_vertices)
    joint = generalised_procrustes(filled(shapes, share, scale).vertices, share, scale)
    shapes, seen = shapes.moved(joint.aligned), _seen(shapes)
    vertices, shares, poses = joint.aligned.copy(), [], []
    for name, part in slices_of(shapes.structures).items():
        own = share[part] / share[part].sum()
        alone = generalised_procrustes(
            filled(shapes.structure(name), own, scale).vertices, own, scale
        ).aligned
        vertices[:, part], before = alone, joint.aligned[:, part]
        variances = [np.einsum("i,mij->", own, (x - x.mean(axis=0)) ** 2) for x in (alone, before)]
        shares.append(1 - variances[0] / variances[1] if variances[1] > 0 else 0.0)
        shifts = np.einsum("i,mij->mj", own, before - alone)
        centred = [x - np.einsum("i,mij->mj", own, x)[:, None] for x in (alone, before)]
        turns = nearest_rotation(np.einsum("mij,i,mik->mjk", centred[1], own, centred[0]))
        pose = np.stack([np.asarray(Rotation.from_matrix(turns).as_rotvec()), shifts])
        poses.append(np.where(np.asarray(seen[:, part].any(axis=1))[:, None], pose, np.nan))
    rotations, translations = np.stack(poses, axis=2)
    return StructurePoses(shapes.moved(vertices), rotations, translations, np.array(shares))


class HiddenStructure(NamedTuple):
    """How well a hidden structure of a subject is told by its others; `hidden_structures` returns it.

    Parameters
    ----------
    name, structure : str
        The subject and the structure.
    error, mean_error : float
        Root mean square distance of the completed structure from the true one, and of that of the mean of the other
        subjects, placed by the structures that are known; in the units of the shapes.
    expected_error : float
        What the completion says of its error, a root mean square too.
    """

    name: str
    structure: str
    error: float
    mean_error: float
    expected_error: float


def hidden_structures(
    shapes: CorrespondedShapes, hidden: Collection[str], weights: Weighting = "area", scale: Scale = "keep"
) -> list[HiddenStructure]:
    """Complete structures of each subject from its others, with a model of all other subjects; compare with the truth.

    Parameters
    ----------
    shapes : CorrespondedShapes
        At least three subjects of several structures, see `stacked`.
    hidden : collection of str
        The structures that are hidden, all at once.
    weights, scale
        As for `ShapeModel.fit`.

    Returns
    -------
    list of HiddenStructure
        For each subject and each hidden structure that it has, if it has another one.

    Raises
    ------
    InputError
        If a name is no structure, none stays, or there are less than three subjects.

    Notes
    -----
    A model is fitted for each subject, and `complete` run twice: O(m) times as long as one model.

    Examples
    --------
    >>> corner = np.array([[0, 0, 0], [3, 0, 0], [0, 2, 0], [0, 0, 1.0]])
    >>> faces = [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]]
    >>> large = CorrespondedShapes("abcd", [corner * x for x in (1, 1.1, 1.3, 1.2)], faces)
    >>> small = CorrespondedShapes("abcd", [corner * x / 4 + 5 for x in (1, 1.1, 1.3, 1.2)], faces)
    >>> found = hidden_structures(stacked({"large": large, "small": small}), ["small"])
    >>> len(found), all(each.error < 0.2 * each.mean_error for each in found)
    (4, True)
    """
    parts = slices_of(shapes.structures)
    if strangers := sorted(set(hidden) - set(parts)):
        raise InputError(
            f"{', '.join(strangers)} cannot be hidden: no structure of the subjects; they have {', '.join(parts)}"
        )
    if not hidden or set(hidden) >= set(parts) or len(shapes) < 3:
        raise InputError(
            f"{', '.join(hidden) or 'nothing'} hidden of {len(shapes)} subjects: a structure has to stay, and two other "
            "subjects; hide fewer structures, or give more subjects"
        )
    seen = _seen(shapes)
    known = np.ones(shapes.n_vertices, dtype=bool)
    for name in hidden:
        known[parts[name]] = False
    found = []
    for i, subject in enumerate(shapes.names):
        there = {name: own for name in hidden if (own := seen[i, parts[name]]).any()}
        if not there or not (seen[i] & known).any():
            continue
        rest = np.delete(np.arange(len(shapes)), i)
        names = tuple(shapes.names[j] for j in rest)
        others = replace(shapes, names=names, vertices=shapes.vertices[rest], measured=seen[rest])
        model = ShapeModel.fit(others, scale, weights)
        told = observed_vertices(model, shapes.mesh(i), seen[i] & known)
        completed = complete(model, told)
        mean = _mean_at(model, told)
        for name, own in there.items():
            rows = np.flatnonzero(own) + parts[name].start
            share = model.weights[rows] / model.weights[rows].sum()
            apart = [shapes.vertices[i, rows] - where[rows] for where in (completed.mesh.vertices, mean)]
            error, of_mean = (float(np.sqrt(share @ (each**2).sum(axis=1))) for each in apart)
            expected = float(np.sqrt(share @ completed.expected_error[rows] ** 2))
            found.append(HiddenStructure(subject, name, error, of_mean, expected))
    return found


def _mean_at(model: ShapeModel, told: Observations) -> FloatArray:
    """Place the mean of a model where points of it were seen."""
    none = replace(model, modes=model.modes[:0], variances=model.variances[:0], scores=model.scores[:, :0])
    return complete(none, told).mesh.vertices
