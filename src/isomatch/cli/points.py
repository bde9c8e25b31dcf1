"""Points as they are written for a command: a vertex, such as 12, or a point in a face, such as f12:0.2,0.3,0.5."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

import isomatch
from isomatch.errors import FormatError, SettingError, some
from isomatch.storage.texts import is_whole_number, text_lines
from isomatch.surfaces import PrecisePoints
from isomatch.values.arrays import IntArray

_WEIGHT = r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_POINT = rf"f\d{{1,18}}:{_WEIGHT},{_WEIGHT},{_WEIGHT}|[+-]?\d{{1,18}}"
_WORD = re.compile(_POINT, re.ASCII)
_WORDS = re.compile(rf"(?:{_POINT})(?:(?:\s*,\s*|\s+)(?:{_POINT}))*", re.ASCII)
SUM = 0.01  # by which weights written with few digits may differ from 1 together
NOTATION = "a vertex, such as 12, or a point in a face, such as f12:0.2,0.3,0.5"


@dataclass
class AskedPoints:
    """Points that were asked for, by number: a vertex by its own, a point in a face by one after all vertices."""

    mesh: isomatch.Mesh
    corners: list[IntArray] = field(default_factory=list)
    weights: list[list[float]] = field(default_factory=list)

    def numbers(self, words: Sequence[str], what: str) -> IntArray:
        """Numbers of points; ``what`` they are is for the message about those that do not exist."""
        found = np.array(
            [self._number(word) if word[0] == "f" else int(word) for word in words], dtype=np.int64
        )
        n = self.mesh.n_vertices
        bad = np.array([v for v, word in zip(found, words) if word[0] != "f" and not 0 <= v < n])
        if len(bad):
            raise isomatch.MeshError(f"{what} {some(bad)} are outside 0…{n - 1}, the vertices of the surface")
        return found

    @property
    def precise(self) -> PrecisePoints | None:
        """The points in faces; None if there are none."""
        if not self.corners:
            return None
        return PrecisePoints(np.array(self.corners), np.array(self.weights))

    def at(self, numbers: IntArray) -> PrecisePoints:
        """Return points by their numbers."""
        n = self.mesh.n_vertices
        corners = [[v] * 3 if v < n else self.corners[v - n] for v in numbers]
        weights = [[1.0, 0.0, 0.0] if v < n else self.weights[v - n] for v in numbers]
        return PrecisePoints(np.array(corners).reshape(-1, 3), np.array(weights).reshape(-1, 3))

    def _number(self, word: str) -> int:
        face, _, weights = word[1:].partition(":")
        parts = np.array(weights.split(","), dtype=np.float64)
        if int(face) >= self.mesh.n_faces:
            raise isomatch.MeshError(f"{word}: there is no such face; faces are 0…{self.mesh.n_faces - 1}")
        if not abs(parts.sum() - 1) <= SUM:
            raise isomatch.MeshError(f"{word}: the weights add up to {parts.sum():g}, not to 1")
        self.corners.append(self.mesh.faces[int(face)])
        self.weights.append((parts / parts.sum()).tolist())
        return self.mesh.n_vertices + len(self.corners) - 1


def _words(line: str) -> list[str]:
    """Split a line into points; empty if it is anything else."""
    if ":" in line:
        return _WORD.findall(line) if _WORDS.fullmatch(line) else []
    words = line.replace(",", " ").split()
    return words if all(map(is_whole_number, words)) else []


def words_of(text: str, option: str) -> list[str]:
    """Split a list of points that are separated by commas."""
    if not _WORDS.fullmatch(text.strip()):
        raise SettingError(
            f"{option} {text!r} is not a list of points; write 0-based indices separated by commas, such as 0,12; "
            f"each is {NOTATION}"
        )
    return _WORD.findall(text)


def word_pairs(path: Path) -> list[tuple[str, str]]:
    """Read a pair of points from each line."""
    pairs = []
    for number, line in text_lines(path):
        words = _words(line)
        if len(words) != 2:
            raise FormatError(
                f"{path}:{number}: {line[:80]!r} is not a pair; write two 0-based vertex indices, separated by a comma "
                f"or blank; each is {NOTATION}"
            )
        pairs.append((words[0], words[1]))
    return pairs
