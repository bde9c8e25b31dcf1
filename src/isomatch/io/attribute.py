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

Domain = Literal["point", "corner", "face"]
Kind = Literal["colour", "label", "scalar", "vector", "normal", "uv", "weights", "key"]

_WIDTHS = {"colour": (3, 4), "normal": (3,), "uv": (2, 3), "key": (3,)}
_ROUNDING = 1e-3  # by which interpolated white may exceed 1
_UV_NAMES = {
    "uv", "st", "uvs", "uvmap", "texcoord",
    "texcoords", "tcoords", "texturecoordinates", "texturecoords",
}  # fmt: skip


@dataclass(frozen=True, eq=False, repr=False)
class Attribute:
    """Values on the points, corners or faces of a surface.

    Parameters
    ----------
    name : str
        Its name in the file; ``"color"``, ``"normal"``, ``"uv"`` and ``"weights"`` where the format has no other.
    domain : {"point", "corner", "face"}
        What has a value. A corner is a point of one polygon; at a seam the corners of a point differ.
    kind : {"colour", "label", "scalar", "vector", "normal", "uv", "weights", "key"}
        What the values mean, which determines how they are carried and written.
    values : (k,) or (k, d) array_like
        One row for each point, corner or face, in the type of the file. Colours have 3 or 4 columns, as integers from 0
        to the largest of 8 or 16 bits, as floats from 0 to 1, or from 0 to 255 in any other type; nan where there is
        none. Labels are (k,) integers or strings, scalars (k,) numbers, normals (k, 3), texture coordinates (k, 2) or
        (k, 3), from the lower left of the picture, with nan at corners that have none. Shape keys are (k, 3)
        displacements.
    joints : (k, d) array_like of int, optional
        For skinning weights of few joints: the joint that each weight belongs to. Without it, column j is joint j.
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
        for what, said, options in (("domain", self.domain, Domain), ("kind", self.kind, Kind)):
            if said not in get_args(options):
                expected = ", ".join(get_args(options))
                raise DescriptorError(f"attribute {self.name!r} has {what} {said!r}; use one of {expected}")
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
        """Return other values of the same name, kind and label names; skinning weights are dense: column j is joint j."""
        return replace(self, domain=domain or self.domain, values=values, joints=None)

    def at(self, index: IntArray, domain: Domain | None = None) -> Attribute:
        """Return the values of some rows, in this order."""
        joints = None if self.joints is None else self.joints[index]
        return replace(self, domain=domain or self.domain, values=self.values[index], joints=joints)

    def spread(self, rows: IntArray, n: int) -> Attribute:
        """Return n rows, of which some have the values; the others have nan, the label −1, an empty text, or 0.

        Colours of integers become floats if there are others.
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
        """A sentence about rows that are nan, empty if there are none."""
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
        """The values for formats and libraries that know but numbers: codes of labels, one column for each joint."""
        if self.kind == "weights":
            return self.dense_weights
        values = self.coded.values
        return values.astype(np.uint8) if values.dtype.kind == "b" else values

    @property
    def is_tangent(self) -> bool:
        """Whether these are tangents, along which the first texture coordinate rises."""
        return self.kind == "vector" and self.name.startswith("tangent")

    @property
    def seems_labels(self) -> bool:
        """Whether these are labels, or numbers like those of regions: whole, at most half as many as rows; nan is none.

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
        """The number of full colour: the largest of 8 or 16 bits, 1 in floats up to 1, otherwise 255."""
        kind = self.values.dtype
        if kind.kind == "f":
            return 255.0 if np.fmax.reduce(self.values, axis=None, initial=0) > 1 + _ROUNDING else 1.0
        return 255.0 if kind.itemsize > 2 else float(np.iinfo(kind).max) if kind.kind != "b" else 1.0

    @property
    def fractions(self) -> FloatArray:
        """Colours as numbers from 0 to 1."""
        return np.asarray(self.values / self.full, dtype=np.float64)

    @property
    def n_joints(self) -> int:
        """Number of joints that skinning weights may refer to."""
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
        """Return the joints and weights of the n largest weights of each row, (k, n) each; smaller ones are left out.

        The weights of a row are scaled to their former sum, which is 1 in most files.
        """
        dense = self.dense_weights
        dense = np.pad(dense, ((0, 0), (0, max(n - dense.shape[1], 0))))
        joints = np.argsort(-dense, axis=1, kind="stable")[:, :n]
        weights = np.take_along_axis(dense, joints, axis=1)
        sums = weights.sum(axis=1, keepdims=True)
        scale = np.divide(dense.sum(axis=1, keepdims=True), sums, out=np.ones_like(sums), where=sums > 0)
        return np.where(weights > 0, joints, 0), weights * scale


def srgb_of(linear: ArrayLike) -> FloatArray:
    """Encode amounts of light 0…1 of red, green and blue, as glTF has them, as pictures and other files do.

    By IEC 61966-2-1. A fourth column is opacity, and stays.
    """
    light = np.array(linear, dtype=np.float64)
    colours = light[..., :3]
    root = np.maximum(colours, 0) ** (1 / 2.4)
    light[..., :3] = np.where(colours <= 0.0031308, 12.92 * colours, root + 0.055 * (root - 1))  # 1 stays 1
    return light


def linear_of(srgb: ArrayLike) -> FloatArray:
    """Decode what `srgb_of` encoded."""
    light = np.array(srgb, dtype=np.float64)
    colours = light[..., :3]
    low, high = colours / 12.92, (np.maximum(colours + 0.055, 0) / 1.055) ** 2.4
    light[..., :3] = np.where(colours <= 0.04045, low, high)
    return light


def without_labels(labels: AnyArray, rows: BoolArray) -> AnyArray:
    """Put −1, False, nan or an empty text in some rows; unsigned integers become signed ones for that."""
    if not rows.any():
        return labels
    labels = labels.astype(np.int64) if labels.dtype.kind == "u" else labels.copy()
    labels[rows] = {"i": -1, "b": False, "f": np.nan, "U": ""}[labels.dtype.kind]
    return labels


def require_lengths(attributes: tuple[Attribute, ...], n: Mapping[str, int]) -> None:
    """Raise `DescriptorError` unless the attributes have different names and a row for each point, corner or face."""
    for attribute in attributes:
        if len(attribute) != n[attribute.domain]:
            there = f"{n[attribute.domain]} {attribute.domain}s; give one for each"
            raise DescriptorError(f"attribute {attribute.name!r} has {len(attribute)} rows for {there}")
    keys = [(attribute.name, attribute.domain) for attribute in attributes]
    twice = [f"{name!r} of {domain}s" for name, domain in keys if keys.count((name, domain)) > 1]
    if twice:
        raise DescriptorError(f"attributes with the same name: {', '.join(sorted(set(twice)))}; rename one")


def guessed_kind(name: str, values: AnyArray) -> Kind:
    """Say what values mean by their name, type and width, in formats that do not tell."""
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


def told_apart(attributes: Iterable[Attribute], *, of_all: bool = False) -> tuple[Attribute, ...]:
    """Return the same, numbered if one before of the same domain, or of all, has the name: uv, uv_1, uv_2."""
    numbered: list[Attribute] = []
    for attribute in attributes:
        taken = [other.name for other in numbered if of_all or other.domain == attribute.domain]
        name = unused_name(attribute.name, taken)
        numbered.append(attribute if name == attribute.name else replace(attribute, name=name))
    return tuple(numbered)


def unused_name(name: str, taken: Container[str]) -> str:
    """Return a name, with the next number if it is taken."""
    return next(each for i in count() if (each := f"{name}_{i}" if i else name) not in taken)
