"""The map from the vertices of one surface to another, as an operator on values at vertices."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

import numpy as np
from numpy.typing import ArrayLike

from isomatch._array_file import FIRST_VERSION, ArrayFormat, Stored, require_known_version, save_arrays
from isomatch._arrays import AnyArray, FloatArray, IntArray, array_of, numbers_of
from isomatch._files import opened, read_integers, replaced
from isomatch.errors import DescriptorError, FormatError, MapError, some

UNMATCHED = -1
DIRECTION = "source -> target"
FORMAT = ArrayFormat(
    what="a map",
    writer="Correspondence.save",
    version=1,  # raise it when earlier versions of isomatch could not read the files
    arrays={
        "direction": Stored("text", group="direction"),
        "n_target": Stored("integer", group="n_target"),
        "vertices": Stored("integer", ("n",)),
        "faces": Stored("integer", ("n", 3), group="precise"),
        "barycentric": Stored("float", ("n", 3), group="precise"),
    },
)

_HEADER = re.compile(
    r"# isomatch map(?:, format version (?P<version>[0-9]{1,9}))?,.*\n"
    r"# (?P<n_source>[0-9]{1,18}) source vertices, (?P<n_target>[0-9]{1,18}) target vertices"
)
LONGEST_HEADER = 1000  # bytes of a text
_LINES = "write one 0-based target vertex on each line, -1 where unmatched"


@dataclass(frozen=True, eq=False, repr=False)
class Correspondence:
    """A map from a source to a target, source → target.

    Parameters
    ----------
    vertices : (n_source,) array of int
        Target vertex of each source vertex; −1 if unmatched.
    n_target : int
        Number of target vertices.
    faces : (n_source, 3) array of int, optional
        Corners of the target triangle that contains the precise image; −1 if unmatched. By default the target vertex
        three times.
    barycentric : (n_source, 3) array of float, optional
        Barycentric coordinates of the precise image in that triangle: not negative, with sum 1. By default (1, 0, 0).

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
        given = array_of(vertices, "the vertices of a map", MapError)
        if given.ndim != 1 or (given.size and given.dtype.kind not in "iu"):
            raise MapError(
                f"a map needs one integer target vertex for each source vertex, not {given.dtype} of shape "
                f"{given.shape}"
            )
        if n_target < 0:
            raise MapError(f"n_target = {n_target} is not a number of target vertices")
        bad = np.flatnonzero((given < UNMATCHED) | (given >= n_target))
        if len(bad):
            raise MapError(
                f"source vertices {some(bad)} are mapped outside the target's vertices 0…{n_target - 1}; "
                "indices count from 0, and −1 means unmatched"
            )
        image = np.array(given, dtype=np.int64)
        if (faces is None) != (barycentric is None):
            raise MapError("faces and barycentric describe the precise image together; give both or neither")
        if faces is None or barycentric is None:
            corners = np.repeat(image[:, None], 3, axis=1)
            weights = np.tile([1.0, 0.0, 0.0], (len(image), 1))
        else:
            given_weights = numbers_of(barycentric, "barycentric weights", MapError)
            corners, weights = _precise(array_of(faces, "faces", MapError), given_weights, image, n_target)
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
        """(n_source, n_target): the shape of the map as a matrix."""
        return len(self.vertices), self.n_target

    @property
    def matched(self) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
        """(n_source,) which source vertices have an image."""
        return self.vertices >= 0

    def pull_back(self, values: ArrayLike) -> FloatArray:
        """Pull values back from the target to the source.

        Parameters
        ----------
        values : (n_target,) or (n_target, q) array_like
            One row for each target vertex.

        Returns
        -------
        (n_source,) or (n_source, q) array of float
            Values interpolated at the precise images; ``nan`` where unmatched.

        Raises
        ------
        DescriptorError
            If the number of rows is not that of the target's vertices.
        """
        rows = np.asarray(values, dtype=np.float64)
        if rows.shape[:1] != (self.n_target,):
            raise DescriptorError(
                f"values have shape {rows.shape}, expected one row for each of the {self.n_target} target vertices; "
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
        """Compose two maps on vertices: the source of this map → the target of the other. Precise images are lost."""
        if len(other.vertices) != self.n_target:
            raise MapError(
                f"cannot compose {self!r} with {other!r}: the first ends on {self.n_target} vertices, the second "
                f"starts from {len(other.vertices)}"
            )
        image = np.where(self.matched, other.vertices[self.vertices], UNMATCHED)
        return Correspondence(image, other.n_target)

    def reversed(self) -> Correspondence:
        """Return the map target → source: the first source vertex mapped to each target vertex, −1 if there is none."""
        back = np.full(self.n_target, UNMATCHED, dtype=np.int64)
        source = np.flatnonzero(self.matched)[::-1]
        back[self.vertices[source]] = source
        return Correspondence(back, len(self.vertices))

    def save(self, path: str | Path) -> None:
        """Write everything to an ``.npz`` file, or the vertices alone to a text file (any other suffix).

        Line i of the text, counted from 0 and without the header, is the target vertex of source vertex i. An
        earlier file is replaced only once the new one is complete.

        Raises
        ------
        UnwritableFileError
            If the file cannot be written.
        """
        path = Path(path)
        if path.suffix == ".npz":
            arrays = {"direction": np.array(DIRECTION), **vars(self)}
            save_arrays(path, FORMAT.version, arrays, compressed=True)
            return
        header = (
            f"isomatch map, format version {FORMAT.version}, {DIRECTION}\n"
            f"{len(self.vertices)} source vertices, {self.n_target} target vertices\n"
            "line i (from 0): 0-based target vertex of source vertex i, -1 if unmatched"
        )
        with replaced(path) as file:
            np.savetxt(file, self.vertices, fmt="%d", header=header)

    @classmethod
    def load(cls, path: str | Path, n_target: int | None = None) -> Correspondence:
        """Read what `save` wrote, or any text file with one 0-based target vertex on each line.

        Parameters
        ----------
        path : path_like
            An ``.npz`` file, or text (any other suffix). Files of earlier versions of isomatch are read too.
        n_target : int, optional
            Number of target vertices. A file that names another number is refused; for a file that names none the
            default is its largest index + 1.

        Returns
        -------
        Correspondence
            The map source → target.

        Raises
        ------
        FormatError
            If the file is missing (`MissingFileError`), holds no map or one onto another target, or was written by an
            isomatch that is too new.
        """
        path = Path(path)
        stored, arrays = _read_arrays(path) if path.suffix == ".npz" else _read_text(path)
        if stored is None:
            stored = int(arrays["vertices"].max(initial=-1)) + 1 if n_target is None else n_target
        elif n_target not in (None, stored):
            raise FormatError(
                f"{path}: is a map onto a target of {stored} vertices, not {n_target}; give the map of these two shapes"
            )
        try:
            return cls(n_target=stored, **arrays)
        except MapError as error:
            raise FormatError(f"{path}: {error}") from None


def _read_arrays(path: Path) -> tuple[int | None, dict[str, AnyArray]]:
    """Read the number of target vertices, if the file has it, and the arrays of a map from an ``.npz`` file."""
    arrays = FORMAT.read(path)
    if arrays.pop("direction", DIRECTION) != DIRECTION:
        raise FormatError(f"{path}: does not map {DIRECTION}; exchange the shapes, or give another map")
    n_target = arrays.pop("n_target", None)
    return None if n_target is None else int(n_target), arrays


def _read_text(path: Path) -> tuple[int | None, dict[str, AnyArray]]:
    """Read the number of target vertices, if the header has it, and the vertices of a map from a text file."""
    with opened(path) as file:
        header = _HEADER.match(file.read(LONGEST_HEADER).decode("utf-8-sig", errors="replace"))
    if header:
        require_known_version(path, int(header["version"] or FIRST_VERSION), FORMAT.version)

    def refuse(number: int, line: str) -> NoReturn:
        raise FormatError(f"{path}:{number}: {line[:40]!r} is not a target vertex; {_LINES}")

    image = read_integers(path, 1, refuse)[:, 0]
    if header and len(image) != int(header["n_source"]):
        raise FormatError(
            f"{path}: {len(image)} lines for the {header['n_source']} source vertices of its header; "
            "it is cut short or was edited, copy it again or remove the header"
        )
    if not (header or len(image)):
        raise FormatError(f"{path}: no target vertices; {_LINES}")
    return int(header["n_target"]) if header else None, {"vertices": image}


def _precise(
    faces: AnyArray, weights: FloatArray, image: IntArray, n_target: int
) -> tuple[IntArray, FloatArray]:
    """Return corners and weights once they are precise images of the matched vertices; `MapError` if they are not."""
    if faces.shape != (len(image), 3) or weights.shape != (len(image), 3):
        raise MapError("faces and barycentric must both have one row of three for each source vertex")
    if faces.size and faces.dtype.kind not in "iu":
        raise MapError(f"faces have type {faces.dtype}, expected integers: three target vertices each")
    held = image >= 0
    if ((faces[held] < 0) | (faces[held] >= n_target)).any():
        raise MapError(f"faces name vertices outside the target's 0…{n_target - 1}")
    smallest, sums = (
        weights[held].min(initial=0.0),
        np.where(np.isfinite(weights), weights, np.inf)[held].sum(axis=1),
    )
    if smallest < -1e-9 or not (np.abs(sums - 1) <= 1e-6).all():
        raise MapError("barycentric weights must be numbers that are not negative and sum to 1 in each row")
    corners = faces.astype(np.int64)
    corners[~held], weights[~held] = UNMATCHED, (1.0, 0.0, 0.0)
    return corners, weights
