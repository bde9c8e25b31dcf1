"""The answer: a map from the vertices of one surface to another, as an operator."""

from __future__ import annotations

import zipfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from isomatch._arrays import FloatArray, IntArray
from isomatch.errors import FormatError, MapError, some

UNMATCHED = -1


@dataclass(frozen=True, eq=False, repr=False)
class Correspondence:
    """A map source → target.

    Parameters
    ----------
    vertices : (n_source,) array of int
        Target vertex of each source vertex; −1 where unmatched.
    n_target : int
        Number of target vertices.
    faces : (n_source, 3) array of int, optional
        Target vertices of the triangle that holds the precise image; −1 where unmatched. By default the vertex
        itself, three times.
    barycentric : (n_source, 3) array of float, optional
        Weights of the three; not negative, sum 1. By default (1, 0, 0).

    Examples
    --------
    >>> f = Correspondence([2, 0, -1], n_target=3)
    >>> f
    Correspondence(source 3 → target 3, 1 unmatched)
    >>> f.pull_back([10.0, 20.0, 30.0])
    array([30., 10., nan])
    >>> f.reversed().vertices
    array([ 1, -1,  0])
    """

    vertices: IntArray
    n_target: int
    faces: IntArray
    barycentric: FloatArray

    def __init__(
        self,
        vertices: ArrayLike,
        n_target: int,
        faces: ArrayLike | None = None,
        barycentric: ArrayLike | None = None,
    ) -> None:
        given = np.asarray(vertices)
        if given.ndim != 1 or (given.size and given.dtype.kind not in "iu"):
            raise MapError(
                f"a map needs one integer target vertex for each source vertex, not {given.dtype} of shape "
                f"{given.shape}"
            )
        image = np.array(given, dtype=np.int64)
        bad = np.flatnonzero((image < UNMATCHED) | (image >= n_target))
        if len(bad):
            raise MapError(
                f"source vertices {some(bad)} are mapped outside the target's vertices 0…{n_target - 1}; "
                "indices count from 0, and −1 means unmatched"
            )
        if (faces is None) != (barycentric is None):
            raise MapError("faces and barycentric describe the precise image together; give both or neither")
        if faces is None or barycentric is None:
            corners = np.repeat(image[:, None], 3, axis=1)
            weights = np.tile([1.0, 0.0, 0.0], (len(image), 1))
        else:
            corners, weights = np.array(faces, dtype=np.int64), np.array(barycentric, dtype=np.float64)
            _require_precise(corners, weights, image, n_target)
        for name, array in (("vertices", image), ("faces", corners), ("barycentric", weights)):
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        object.__setattr__(self, "n_target", int(n_target))

    def __repr__(self) -> str:
        missing = int((~self.matched).sum())
        tail = f", {missing} unmatched" if missing else ""
        return f"Correspondence(source {len(self.vertices)} → target {self.n_target}{tail})"

    @property
    def shape(self) -> tuple[int, int]:
        """(n_source, n_target), the shape of the map as a matrix."""
        return len(self.vertices), self.n_target

    @property
    def matched(self) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        """(n_source,) which source vertices have an image."""
        return self.vertices >= 0

    def pull_back(self, values: ArrayLike) -> FloatArray:
        """Carry values from the target to the source.

        Parameters
        ----------
        values : (n_target,) or (n_target, q) array_like
            One row for each target vertex.

        Returns
        -------
        (n_source,) or (n_source, q) array of float
            Interpolated at the precise image; ``nan`` where unmatched.
        """
        rows = np.asarray(values, dtype=np.float64)
        if rows.shape[:1] != (self.n_target,):
            raise MapError(
                f"values have {rows.shape[:1]} rows, the target has {self.n_target} vertices; "
                "pull_back goes from the target to the source, use reversed() for the other way"
            )
        weights = self.barycentric.reshape(-1, 3, *(1,) * (rows.ndim - 1))
        carried: FloatArray = (weights * rows[self.faces]).sum(axis=1)
        carried[~self.matched] = np.nan
        return carried

    def __matmul__(self, values: ArrayLike) -> FloatArray:
        """Pull back: the map as a matrix, applied."""
        return self.pull_back(values)

    def then(self, other: Correspondence) -> Correspondence:
        """Compose on vertices: source → target of this map → target of the other."""
        if len(other.vertices) != self.n_target:
            raise MapError(
                f"cannot compose {self!r} with {other!r}: the first ends on {self.n_target} vertices, the second "
                f"starts from {len(other.vertices)}"
            )
        image = np.where(self.matched, other.vertices[self.vertices], UNMATCHED)
        return Correspondence(image, other.n_target)

    def reversed(self) -> Correspondence:
        """Turn around: for each target vertex the first source vertex mapped to it, −1 for none."""
        back = np.full(self.n_target, UNMATCHED, dtype=np.int64)
        source = np.flatnonzero(self.matched)[::-1]
        back[self.vertices[source]] = source
        return Correspondence(back, len(self.vertices))

    def save(self, path: str | Path) -> None:
        """Write ``.npz`` (everything) or text (``.txt``: target vertex of each source vertex, header with ``#``)."""
        path = Path(path)
        if path.suffix == ".npz":
            np.savez_compressed(
                path,
                direction=np.array("source -> target"),
                vertices=self.vertices,
                n_target=self.n_target,
                faces=self.faces,
                barycentric=self.barycentric,
            )
            return
        header = (
            "isomatch map, source -> target\n"
            f"{len(self.vertices)} source vertices, {self.n_target} target vertices\n"
            "line i (from 0): 0-based target vertex of source vertex i, -1 if unmatched"
        )
        np.savetxt(path, self.vertices, fmt="%d", header=header)

    @classmethod
    def load(cls, path: str | Path, n_target: int | None = None) -> Correspondence:
        """Read what `save` wrote, or any text file with one 0-based target vertex a line.

        ``n_target`` is needed for text files that do not tell it in their header; by default the largest index + 1.
        """
        path = Path(path)
        try:
            if path.suffix == ".npz":
                with np.load(path, allow_pickle=False) as data:
                    stored = int(data["n_target"]) if "n_target" in data else n_target
                    if n_target is not None and stored != n_target:
                        raise ValueError(f"it was made for a target of {stored} vertices, not {n_target}")
                    if stored is None:
                        stored = int(data["vertices"].max(initial=-1)) + 1
                    optional = [data.get(key) for key in ("faces", "barycentric")]
                    return cls(data["vertices"], stored, *optional)
            if n_target is None:
                head = path.read_text(encoding="utf-8").split(" target vertices", 1)
                n_target = int(head[0].rsplit(" ", 1)[-1]) if len(head) == 2 else None
            words = [line.split("#", 1)[0] for line in path.read_text(encoding="utf-8").splitlines()]
            image = np.array([word for word in words if word.strip()], dtype=np.int64)
            if not len(image):
                raise ValueError("the file is empty")
        except (OSError, EOFError, ValueError, KeyError, zipfile.BadZipFile) as error:
            raise FormatError(
                f"{path}: not a map ({error}); expected an .npz with 'vertices', or one target index a line"
            ) from error
        return cls(image, int(image.max(initial=-1)) + 1 if n_target is None else n_target)


def _require_precise(corners: IntArray, weights: FloatArray, image: IntArray, n_target: int) -> None:
    """Raise `MapError` unless corners and weights are precise images of the matched vertices."""
    if corners.shape != (len(image), 3) or weights.shape != (len(image), 3):
        raise MapError("faces and barycentric must both have one row of three for each source vertex")
    held = image >= 0
    if ((corners[held] < 0) | (corners[held] >= n_target)).any():
        raise MapError(f"faces name vertices outside the target's 0…{n_target - 1}")
    if (weights[held] < -1e-9).any() or (np.abs(weights[held].sum(axis=1) - 1) > 1e-6).any():
        raise MapError("barycentric weights must not be negative and must sum to 1 in each row")
