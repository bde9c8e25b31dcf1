"""Values on the points, corners or polygons of a surface file: colours, labels, texture coordinates and others."""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping
from dataclasses import dataclass, field, replace
from itertools import count
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from isomatch._core.arrays import AnyArray, BoolArray, FloatArray, IntArray, read_only
from isomatch._core.errors import DescriptorError
from isomatch._core.memory import require_memory

Domain = Literal["point", "corner", "face"]  # what an attribute has values on
Kind = Literal["colour", "label", "scalar", "vector", "normal", "uv", "weights", "key"]

# allowed numbers of columns of an attribute, by its kind
_WIDTHS = {"colour": (3, 4), "normal": (3,), "uv": (2, 3), "key": (3,)}
# If a float colour exceeds 1 by more than this, colours range to 255, otherwise to 1; interpolation may leave
# white a little above 1; chosen.
_WHITE_TOLERANCE = 1e-3
_UV_NAMES = {  # lower-case names of texture coordinates, without blanks and underscores
    "uv", "st", "uvs", "uvmap", "texcoord",
    "texcoords", "tcoords", "texturecoordinates", "texturecoords",
}  # fmt: skip


@dataclass(frozen=True, eq=False, repr=False)
class Attribute:
    """Values on the points, corners or faces of a surface.

    Parameters
    ----------
    name : str
        Its name in the file; ``"color"``, ``"normal"``, ``"uv"`` and ``"weights"`` if the format has no names.
    domain : {"point", "corner", "face"}
        What has the values. A corner is a point of one polygon; the corners of a point differ at a seam.
    kind : {"colour", "label", "scalar", "vector", "normal", "uv", "weights", "key"}
        Meaning of the values, which determines how they are carried and written.
    values : (k,) or (k, d) array_like
        One row for each point, corner or face, in the type of the file. Colours have 3 or 4 columns:
        integers of 8 or 16 bits from 0 to the largest, floats from 0 to 1, or other types from 0 to 255;
        nan is no colour. Labels are (k,) integers or strings, scalars (k,) numbers, normals (k, 3),
        texture coordinates (k, 2) or (k, 3) from the lower left of the picture, or nan. Shape keys are
        (k, 3) displacements.
    joints : (k, d) array_like of int, optional
        Joint of each skinning weight; without it, column j is joint j.
    names : mapping of int to str
        Names of labels or of joints.
    colors : mapping of int to tuple of 4 floats
        Red, green, blue and opacity of labels, 0…1.

    Raises
    ------
    DescriptorError
        If the values do not fit their kind.

    Examples
    --------
    >>> Attribute("part", "face", "label", [0, 0, 1], names={0: "head", 1: "tail"})
    Attribute('part', label of 3 faces)
    """

    name: str
    domain: Domain
    kind: Kind
    values: AnyArray
    joints: IntArray | None = None
    names: Mapping[int, str] = field(default_factory=dict)
    colors: Mapping[int, tuple[float, ...]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for what, value, options in (("domain", self.domain, Domain), ("kind", self.kind, Kind)):
            if value not in get_args(options):
                expected = ", ".join(get_args(options))
                raise DescriptorError(f"attribute {self.name!r} has {what} {value!r}; use one of {expected}")
        object.__setattr__(self, "values", read_only(np.array(self.values)))
        self._require_kind()
        if self.joints is not None:
            object.__setattr__(self, "joints", read_only(np.array(self.joints)))
            if self.joints.dtype.kind not in "iu" or self.joints.shape != self.values.shape:
                self._refuse("joints", self.joints, f"integers of shape {self.values.shape}")

    def __repr__(self) -> str:
        return f"Attribute({self.name!r}, {self.kind} of {len(self)} {self.domain}s)"

    def __len__(self) -> int:
        return len(self.values)

    def _require_kind(self) -> None:
        values, widths = self.values, _WIDTHS.get(self.kind)
        types, n_axes, expected = {
            "label": ("iubU", 1, "(k,) integers or strings"),
            "scalar": ("fiub", 1, "(k,) numbers"),
        }.get(self.kind, ("fiub", 2, "(k, d) numbers"))
        if values.ndim != n_axes or values.dtype.kind not in types:
            self._refuse("values", values, expected)
        if widths and values.shape[1] not in widths:
            self._refuse("values", values, f"{' or '.join(map(str, widths))} columns")

    def _refuse(self, what: str, values: AnyArray, expected: str) -> None:
        found = f"{what} of {self.kind} have shape {values.shape} and type {values.dtype}"
        raise DescriptorError(f"attribute {self.name!r}: {found}, expected {expected}")

    def with_values(self, values: AnyArray, domain: Domain | None = None) -> Attribute:
        """Replace the values; column j of skinning weights is then joint j."""
        return replace(self, domain=domain or self.domain, values=values, joints=None)

    def at(self, index: IntArray, domain: Domain | None = None) -> Attribute:
        """Select rows, in the given order."""
        joints = None if self.joints is None else self.joints[index]
        return replace(self, domain=domain or self.domain, values=self.values[index], joints=joints)

    def spread(self, rows: IntArray, n: int) -> Attribute:
        """Put the values into some of n rows; the others get nan, the label −1, an empty text, or 0.

        Integer colours become floats if there are rows without a colour.
        """
        values = self.fractions if self.kind == "colour" and len(rows) < n else self.values
        kind, none = values.dtype, 0.0
        if kind.kind != "U" and self.kind == "label":
            kind, none = (kind if kind.kind == "i" else np.dtype(np.int64)), -1
        elif self.kind in ("scalar", "vector") or (kind.kind == "f" and self.kind in ("colour", "uv")):
            kind, none = np.result_type(values, np.nan), np.nan
        everywhere = np.full((n, *values.shape[1:]), "" if kind.kind == "U" else none, dtype=kind)
        everywhere[rows] = values
        return self.with_values(everywhere)

    @property
    def note_of_missing(self) -> str:
        """A sentence about rows with nan, empty if there are none."""
        is_float = self.values.dtype.kind == "f"
        n = np.isnan(self.values).reshape(len(self), -1).any(axis=1).sum() if is_float and len(self) else 0
        return f"{n} of {len(self)} {self.domain}s have no {self.kind}; it is nan there" if n else ""

    @property
    def coded(self) -> Attribute:
        """The same labels as integers, with the strings as their names."""
        if self.values.dtype.kind != "U":
            return self
        words, codes = np.unique(self.values, return_inverse=True)
        return replace(self, values=codes, names=dict(enumerate(words.tolist())))

    @property
    def plain(self) -> AnyArray:
        """The values as plain numbers: codes of labels, and one column for each joint."""
        if self.kind == "weights":
            return self.dense_weights
        values = self.coded.values
        return values.astype(np.uint8) if values.dtype.kind == "b" else values

    @property
    def is_tangent(self) -> bool:
        """Whether these are tangents: directions of the first texture coordinate."""
        return self.kind == "vector" and self.name.startswith("tangent")

    @property
    def seems_labels(self) -> bool:
        """Whether these are labels, or integers that repeat as those of regions do; nan is no label.

        Examples
        --------
        >>> Attribute("region", "point", "scalar", [1000.0, 1000.0, 39.0, 39.0, np.nan]).seems_labels
        True
        >>> Attribute("depth", "point", "scalar", [0.5, 0.5, 0.25, 0.25]).seems_labels
        False
        """
        if self.kind not in ("scalar", "vector") or self.is_tangent:
            return self.kind == "label"
        none = np.isnan(self.values)
        rows = self.values[~(none.any(axis=1) if none.ndim > 1 else none)]
        is_whole = bool((rows == np.rint(rows)).all())
        return is_whole and 2 * len(np.unique(rows, axis=0 if rows.ndim > 1 else None)) <= len(rows)

    @property
    def full(self) -> float:
        """The value of full colour: the largest integer of 8 or 16 bits, 1 of floats up to 1, otherwise 255."""
        kind = self.values.dtype
        if kind.kind == "f":
            return 255.0 if np.fmax.reduce(self.values, axis=None, initial=0) > 1 + _WHITE_TOLERANCE else 1.0
        return 255.0 if kind.itemsize > 2 else float(np.iinfo(kind).max) if kind.kind != "b" else 1.0

    @property
    def fractions(self) -> FloatArray:
        """Colours as numbers from 0 to 1."""
        return np.asarray(self.values / self.full, dtype=np.float64)

    @property
    def n_joints(self) -> int:
        """Number of joints of skinning weights."""
        used = self.values.shape[1] if self.joints is None else int(self.joints.max(initial=-1)) + 1
        return max([used, *(joint + 1 for joint in self.names)])

    @property
    def joint_names(self) -> list[str]:
        """Names of all joints; those without one are numbered."""
        return [self.names.get(i, f"joint_{i}") for i in range(self.n_joints)]

    @property
    def dense_weights(self) -> AnyArray:
        """(k, n_joints) float64 skinning weights, one column for each joint."""
        if self.kind != "weights":
            raise DescriptorError(f"attribute {self.name!r} is {self.kind}, not skinning weights")
        purpose = f"a table of {len(self)} points and {self.n_joints} joints"
        require_memory(8.0 * len(self) * self.n_joints, purpose, "number the joints from 0, without gaps")
        dense = np.zeros((len(self), self.n_joints))
        joints = np.arange(self.values.shape[1]) if self.joints is None else self.joints
        np.add.at(dense, (np.arange(len(self))[:, None], joints), self.values)
        return dense

    def strongest(self, n: int) -> tuple[IntArray, AnyArray]:
        """Return the joints and values of the n largest weights of each row, (k, n) each.

        They are scaled to the former sum of the row, which is 1 in most files.
        """
        dense = self.dense_weights
        dense = np.pad(dense, ((0, 0), (0, max(n - dense.shape[1], 0))))
        joints = np.argsort(-dense, axis=1, kind="stable")[:, :n]
        weights = np.take_along_axis(dense, joints, axis=1)
        sums = weights.sum(axis=1, keepdims=True)
        scale = np.divide(dense.sum(axis=1, keepdims=True), sums, out=np.ones_like(sums), where=sums > 0)
        return np.where(weights > 0, joints, 0), weights * scale


def srgb_of(linear: ArrayLike) -> FloatArray:
    """Encode linear red, green and blue, 0…1, as sRGB (IEC 61966-2-1); a fourth column is opacity.

    glTF has linear colours, pictures and other files have sRGB.
    """
    light = np.array(linear, dtype=np.float64)
    colours = light[..., :3]
    root = np.maximum(colours, 0) ** (1 / 2.4)
    # 1.055 root − 0.055, written so that 1 stays exactly 1
    light[..., :3] = np.where(colours <= 0.0031308, 12.92 * colours, root + 0.055 * (root - 1))
    return light


def linear_of(srgb: ArrayLike) -> FloatArray:
    """Decode sRGB to linear colours, the inverse of `srgb_of`."""
    light = np.array(srgb, dtype=np.float64)
    colours = light[..., :3]
    low, high = colours / 12.92, (np.maximum(colours + 0.055, 0) / 1.055) ** 2.4
    light[..., :3] = np.where(colours <= 0.04045, low, high)
    return light


def without_labels(labels: AnyArray, rows: BoolArray) -> AnyArray:
    """Put −1, False, nan or an empty text into some rows; unsigned integers become signed."""
    if not rows.any():
        return labels
    labels = labels.astype(np.int64) if labels.dtype.kind == "u" else labels.copy()
    labels[rows] = {"i": -1, "b": False, "f": np.nan, "U": ""}[labels.dtype.kind]
    return labels


def require_lengths(attributes: tuple[Attribute, ...], n: Mapping[str, int]) -> None:
    """Raise `DescriptorError` for equal names, or for a number of rows that does not fit the domain."""
    for attribute in attributes:
        if len(attribute) != n[attribute.domain]:
            n_rows = f"{n[attribute.domain]} {attribute.domain}s; give one for each"
            raise DescriptorError(f"attribute {attribute.name!r} has {len(attribute)} rows for {n_rows}")
    keys = [(attribute.name, attribute.domain) for attribute in attributes]
    twice = [f"{name!r} of {domain}s" for name, domain in keys if keys.count((name, domain)) > 1]
    if twice:
        raise DescriptorError(f"attributes with the same name: {', '.join(sorted(set(twice)))}; rename one")


def guess_kind(name: str, values: AnyArray) -> Kind:
    """Guess the kind of values from their name, type and width."""
    word = name.lower().strip("_").rstrip("0123456789").rstrip("_")
    width = values.shape[1] if values.ndim == 2 else 1
    if values.ndim == 1:
        return "label" if values.dtype.kind in "iubU" else "scalar"
    if width in (3, 4) and ("rgb" in word or "color" in word or "colour" in word):
        is_float = values.dtype.kind == "f" and len(values) > 0
        if values.dtype == np.uint8 or (is_float and values.min() >= 0 and values.max() <= 1):
            return "colour"
    if word == "weights":
        return "weights"
    if width == 3 and word in ("normal", "normals", "nxnynz", "vertex_normals", "point_normals"):
        return "normal"
    if width == 2 and word.replace(" ", "").replace("_", "") in _UV_NAMES:
        return "uv"
    return "vector"


def number_equal_names(attributes: Iterable[Attribute], *, of_all: bool = False) -> tuple[Attribute, ...]:
    """Add numbers to equal names of the same domain, or of all domains: uv, uv_1, uv_2."""
    numbered: list[Attribute] = []
    for attribute in attributes:
        taken = [other.name for other in numbered if of_all or other.domain == attribute.domain]
        name = unused_name(attribute.name, taken)
        numbered.append(attribute if name == attribute.name else replace(attribute, name=name))
    return tuple(numbered)


def unused_names(names: Iterable[str], taken: Iterable[str] = ()) -> list[str]:
    """Add numbers to equal names, and to those that are taken."""
    unused = list(taken)
    n_taken = len(unused)
    for name in names:
        unused.append(unused_name(name, unused))
    return unused[n_taken:]


def unused_name(name: str, taken: Container[str]) -> str:
    """Return a name, with the next free number if it is taken."""
    return next(numbered for i in count() if (numbered := f"{name}_{i}" if i else name) not in taken)
