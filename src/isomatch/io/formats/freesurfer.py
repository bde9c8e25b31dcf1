"""FreeSurfer: surfaces of brains, annotations and curvatures, by nibabel."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from isomatch._core.first_use import package
from isomatch._core.texts import encoding_of
from isomatch.io.asset import SPACE, TURN, Asset, Frame
from isomatch.io.attribute import Attribute
from isomatch.io.formats._reading import on_disk, reading
from isomatch.io.polygons import Polygons

SURFACES = (
    ".pial", ".white", ".inflated", ".sphere", ".reg", ".orig", ".smoothwm", ".midthickness", ".graymid",
)  # fmt: skip
"""Ends of the names of surfaces, such as ``lh.pial``."""
VALUES = (".curv", ".sulc", ".thickness", ".area", ".volume", ".avg_curv")
"""Ends of the names of files with numbers at points."""
# First bytes of footers: of surfaces with the origin at the centre of the volume, and in scanner coordinates.
_VOXEL_FOOTER, _SCANNER_FOOTER = (
    np.array([2, real, 20], dtype=">i4").tobytes() + b"valid" for real in (0, 1)
)


def read_asset(data: bytes, name: str) -> Asset:
    """Read the points and triangles of a surface, in its own coordinates, in millimetres."""
    freesurfer = _package()
    # nibabel reads no data on the volume if the coordinates are of the scanner, so the footer is changed
    plain = data.replace(_SCANNER_FOOTER, _VOXEL_FOOTER)
    with reading(name, "a FreeSurfer surface"), on_disk(plain, "") as path:
        points, faces, volume, stamp = freesurfer.read_geometry(path, read_metadata=True, read_stamp=True)
        if plain != data:
            volume["head"] = np.array([2, 1, 20], dtype=np.int32)
        polygons = Polygons.of_triangles(np.asarray(faces, dtype=np.int64))
        frame = Frame.of_volume(volume) if volume else Frame(words=(f"{SPACE}=RAS",))
        return Asset(points, polygons, document=stamp, frame=frame)


def read_attributes(data: bytes, name: str, surface: Asset | None) -> tuple[Attribute, ...]:
    """Read an annotation, as labels with names and colours, or a curvature, as scalars."""
    freesurfer = _package()
    title = Path(name).suffix[1:].lower()
    with reading(name, "a FreeSurfer annotation or curvature"), on_disk(data, "") as path:
        if title != "annot":
            values = np.asarray(freesurfer.read_morph_data(path))
            return (Attribute(title, "point", "scalar", values.astype(values.dtype.newbyteorder("="))),)
        labels, table, words = freesurfer.read_annot(path)
        shares = (table[:, :4] / 255).tolist()
        colors = {i: (red, green, blue, 1 - clear) for i, (red, green, blue, clear) in enumerate(shares)}
        encoding = encoding_of(b"\n".join(words))
        names = {i: word.decode(encoding) for i, word in enumerate(words)}
        return (Attribute(title, "point", "label", labels, names=names, colors=colors),)


def write(asset: Asset) -> bytes:
    """Write a surface in RAS, in single precision, with the volume that its coordinates belong to."""
    freesurfer = _package()
    stamp = asset.document if isinstance(asset.document, str) else "created by isomatch"
    volume = asset.frame.in_volume if asset.frame else None
    with on_disk(b"", "") as path, warnings.catch_warnings(action="ignore"):
        points = asset.points * (TURN if asset.frame and asset.frame.axes == "LPS" else 1)
        freesurfer.write_geometry(path, points, asset.polygons.triangles, stamp, volume)
        return path.read_bytes()


def write_attributes(attributes: Sequence[Attribute], surface: Asset | None = None) -> bytes:
    """Write the labels of one attribute as an annotation, its scalars as a curvature."""
    freesurfer, (attribute,) = _package(), attributes
    with on_disk(b"", "") as path:
        if attribute.kind == "scalar":
            freesurfer.write_morph_data(path, attribute.values)
            return path.read_bytes()
        coded = attribute.coded
        used = set(coded.values[coded.values >= 0].tolist())
        keys = sorted(set(coded.names) | used)
        table = np.zeros((len(keys), 5), dtype=np.int64)
        taken: set[tuple[int, ...]] = set()
        for row, key in enumerate(keys):
            *color, opacity = coded.colors.get(key, (*(share / 255 for share in _distinct_colour(row)), 1.0))
            octets, other = tuple(round(255 * share) for share in color), row
            # A label is identified by its colour, so no two have the same one. Black means no label.
            while octets in taken or (key in used and not any(octets)):
                octets = _distinct_colour(other)
                other += len(keys)
            taken.add(octets)
            table[row, :4] = (*octets, round(255 * (1 - opacity)))
        numbers = np.searchsorted(keys, np.maximum(coded.values, keys[0] if keys else 0))
        numbers = np.where(coded.values < 0, -1, numbers)
        words = [coded.names.get(key, str(key)).encode(errors="backslashreplace") for key in keys]
        freesurfer.write_annot(path, numbers, table, words, fill_ctab=True)
        return path.read_bytes()


def _distinct_colour(row: int) -> tuple[int, ...]:
    """Return a colour that no other row has, as annotations identify labels by colours."""
    return tuple(((row + 1) * 2654435761 % 2**24).to_bytes(3, "little"))


def _package() -> Any:
    return package("nibabel.freesurfer", "io", "a FreeSurfer file")
