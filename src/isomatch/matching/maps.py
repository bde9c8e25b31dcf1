"""Maps during a match: candidates, which are first maps, and fits, which are refined."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from isomatch._core.arrays import BodyVertices, Int, SearchRows
from isomatch.correspondence import Alignment


@dataclass(frozen=True, eq=False)
class Candidate:
    """A first map of the search vertices after closest points, with measures once screened.

    Parameters
    ----------
    alignment : Alignment
        Target row of each source row, rotation and residual.
    origin : str
        "extremities", "poses", "anchors", "landmarks", "initial map", "descriptors", "pose", "flip", "symmetry", or the
        name of a user's start.
    upsampled : (m_s,) array of int, optional
        The map after upsampling; None before it is screened.
    energy : float
        Descriptor residual × curvature difference², from the descriptor columns of the search.
    orientation : float
        Mean cosine between normals: near 1 for a true map, near −1 for a mirror image; 0 without normals.
    landmark_error : float
        Mean distance of images of landmarks from their targets, in √area; 0 without landmarks.
    prior_error : float
        The largest distance of an image of a landmark from its target, or the mean distance from the images of the
        initial map if that is larger. With neither, the mean distance from the nearest points in space, if the shapes
        are aligned. 0 without priors; in √area.
    """

    alignment: Alignment
    origin: str
    upsampled: Int[SearchRows, "m_s"] | None = None
    energy: float = np.nan
    orientation: float = 0.0
    landmark_error: float = 0.0
    prior_error: float = 0.0

    @classmethod
    def of_rows(cls, target_row: Int[SearchRows, "m_s"], origin: str) -> Self:
        """Make a candidate of a map that was not aligned by closest points."""
        return cls(Alignment(target_row, np.eye(1), 0.0), origin)

    @property
    def target_row(self) -> Int[SearchRows, "m_s"]:
        """Target row of each source row."""
        return SearchRows(self.alignment.target_row if self.upsampled is None else self.upsampled)


@dataclass(frozen=True, eq=False)
class Fit:
    """A map of the vertices of a model, with its measures.

    Parameters
    ----------
    image : (r,) array of int
        Vertex of the target's body for each of ``model.vertices``.
    spectral_residual : float
        Mean distance between these vertices and their images in the coordinates of the model.
    score : float
        The cost of the map; lower is better. nan until the model has measured it.
    orientation : float
        Mean cosine between normals: 1 preserves the orientation of the faces, −1 reverses it.
    prior_error, landmark_error, origin
        As in a `Candidate`.
    candidate : Candidate, optional
        The candidate from which it was refined.
    """

    image: Int[BodyVertices, "r"]
    spectral_residual: float = np.inf
    score: float = np.nan
    orientation: float = 1.0
    prior_error: float = 0.0
    landmark_error: float = 0.0
    candidate: Candidate | None = None
    origin: str = ""

    @property
    def side(self) -> float:
        """1 if the map preserves the orientation of the faces, −1 if it reverses it."""
        return 1.0 if self.orientation >= 0 else -1.0

    @property
    def residual(self) -> float:
        """Descriptor residual of the candidate; 0 without one."""
        return self.candidate.alignment.residual if self.candidate else 0.0

    def with_candidate_of(self, other: Self) -> Self:
        """Return this map as if it had been refined from the candidate of another fit."""
        of_candidate = "candidate", "origin", "orientation", "prior_error", "landmark_error"
        return replace(self, **{name: getattr(other, name) for name in of_candidate})
