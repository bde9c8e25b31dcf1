"""Where the coordinates of a file are: the space that they belong to, and the way to another."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from isomatch.values.arrays import FloatArray

UNKNOWN, SCANNER = "unknown", "scanner_anat"
_AXES = np.array(
    [[-1.0, 0, 0], [0, 0, 1], [0, -1, 0]]
)  # right, anterior, superior of FreeSurfer's voxel axes
_REAL = [2, 1, 20]  # marks of a footer whose surface is in coordinates of the scanner
_CLOSE = 1e-4  # millimetres: GIFTI stores six decimals


@dataclass(frozen=True, eq=False)
class Frame:
    """The space of coordinates, as files of brains tell it.

    Parameters
    ----------
    space : str
        Space of the coordinates: ``"unknown"``, ``"scanner_anat"``, ``"aligned_anat"``, ``"talairach"``, ``"mni_152"`` or
        ``"template_other"``, as in NIfTI.
    to : str
        Space that the matrix leads to.
    matrix : (4, 4) array of float
        It is multiplied by columns x, y, z, 1.
    volume : mapping, optional
        The volume of which FreeSurfer made the surface, in the words of nibabel.
    words : tuple of str
        Lines in which the file tells its unit or space, such as comments of PLY.
    details : object, optional
        What else the format says about the coordinates, for writing the same format again.
    """

    space: str = UNKNOWN
    to: str = UNKNOWN
    matrix: FloatArray = field(default_factory=lambda: np.eye(4))
    volume: Mapping[str, Any] | None = None
    words: tuple[str, ...] = ()
    details: object = None

    @classmethod
    def of_volume(cls, volume: Mapping[str, Any]) -> Frame:
        """Make the frame of a FreeSurfer surface, whose origin is the centre of its volume."""
        if not str(volume.get("valid", "")).startswith("1"):
            return cls(volume=volume)
        if list(volume.get("head", ())) == _REAL:
            return cls(SCANNER, SCANNER, volume=volume)
        matrix = np.eye(4)
        directions = np.stack([volume[key] for key in ("xras", "yras", "zras")], axis=1)
        matrix[:3, :3] = directions @ np.linalg.inv(_AXES)
        matrix[:3, 3] = volume["cras"]
        return cls(UNKNOWN, SCANNER, matrix, volume)

    @property
    def is_told(self) -> bool:
        """Whether it says anything."""
        return self.has_space or bool(self.words)

    @property
    def has_space(self) -> bool:
        """Whether it names a space or has a matrix."""
        return self.space != UNKNOWN or self.to != UNKNOWN or not self._is_identity

    @property
    def in_volume(self) -> Mapping[str, Any] | None:
        """A volume of FreeSurfer whose centre is the origin of these coordinates; None if there can be none."""
        if self.volume is not None:
            own = Frame.of_volume(self.volume)
            if not self.has_space or ((own.space, own.to) == (self.space, self.to) and self._is_like(own)):
                return self.volume
        matrix = self.matrix if self.to == SCANNER else np.eye(4)
        turn = matrix[:3, :3]
        if SCANNER not in (self.space, self.to) or not np.allclose(turn @ turn.T, np.eye(3), atol=_CLOSE):
            return None
        return {
            "head": np.array([2, 0, 20], dtype=np.int32),
            "valid": "1  # volume info valid",
            "filename": "none",
            "volume": np.full(3, 256),
            "voxelsize": np.ones(3),
            **dict(zip(("xras", "yras", "zras"), (turn @ _AXES).T)),
            "cras": matrix[:3, 3],
        }

    @property
    def is_in_volume(self) -> bool:
        """Whether a volume of FreeSurfer tells all of it."""
        if self.words:
            return False
        return not self.has_space or (self.to in (UNKNOWN, SCANNER) and self.in_volume is not None)

    def __str__(self) -> str:
        if self.words:
            return ", ".join(self.words)
        if self._is_identity:
            return f"in {self.to if self.space == UNKNOWN else self.space}"
        if np.allclose(self.matrix[:3, :3], np.eye(3), atol=_CLOSE):
            offset = " ".join(f"{number:g}" for number in self.matrix[:3, 3])
            return f"c_ras {offset}, the offset to {self.to}"
        return f"matrix to {self.to}"

    @property
    def _is_identity(self) -> bool:
        return self._is_like(Frame())

    def _is_like(self, other: Frame) -> bool:
        return bool(np.allclose(self.matrix, other.matrix, rtol=0, atol=_CLOSE))
