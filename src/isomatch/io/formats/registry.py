"""The format of each suffix: its reader and writer, and what it keeps."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from isomatch._core.arrays import FloatArray
from isomatch._core.errors import FormatError, InputError
from isomatch.io.asset import Asset, Axes, Frame
from isomatch.io.attribute import Attribute
from isomatch.io.formats import clouds, freesurfer, gifti, gltf, obj, off, ply, stl, vtk
from isomatch.surfaces import Mesh


@dataclass(frozen=True)
class MeshFormat:
    """The reader and writer of a format, and what it keeps."""

    read: Callable[[bytes, str], Mesh]  # takes the bytes of a file and its name, for messages
    write: Callable[..., bytes]  # takes an asset, and options by keyword
    options: frozenset[str] = frozenset()  # the keywords that ``write`` takes: "binary", "single"
    read_asset: Callable[[bytes, str], Asset] | None = None  # reads attributes too, if there are any
    keeps: Callable[[Attribute], bool] = lambda attribute: False  # whether files keep an attribute
    single: frozenset[str] = frozenset()  # kinds of attributes that files keep at most once
    has_parts: bool = False  # whether files keep parts with transforms
    keeps_names: Callable[[Attribute], bool] = lambda attribute: False  # whether files keep names of labels
    has_opacity: bool = True  # whether files keep the opacity of colours
    # whether files keep a frame of coordinates; by default only a frame that is just comments
    keeps_frame: Callable[[Frame], bool] = lambda frame: not frame.has_space
    axes: Axes | None = None  # the axes, if all files of the format have the same
    # what is subtracted from points before they are rounded to single precision
    middles: Callable[[Asset], FloatArray] | None = None

    def missing(self, attribute: Attribute) -> list[Attribute]:
        """List the properties that the format does not keep of an attribute."""
        missing = []
        if attribute.coded.names and not self.keeps_names(attribute):
            missing.append(replace(attribute, name=f"names of {attribute.name}"))
        if attribute.kind == "colour" and not self.has_opacity:
            opacity = attribute.fractions[:, 3:]
            if (opacity < 1).any():
                name = f"opacity of {attribute.name}"
                missing.append(Attribute(name, attribute.domain, "scalar", opacity[:, 0]))
        return missing


def _with_attributes(
    read_asset: Callable[[bytes, str], Asset], write: Callable[..., bytes], **others: Any
) -> MeshFormat:
    """Make a format whose meshes are read with all contents of the file."""

    def read(data: bytes, name: str) -> Mesh:
        with naming(name):
            asset = read_asset(data, name)
        return Mesh(asset.placed_points, asset.polygons.triangles)

    return MeshFormat(read, write, read_asset=read_asset, **others)


def _fits_title(frame: Frame) -> bool:
    return not frame.has_space and frame.title(stl.TITLE_BYTES) == "; ".join(frame.lines)


# Values of fields of `MeshFormat` that several formats share. Here: options of formats with a binary variant.
_BINARY = frozenset({"binary"})
# at most one colour, normal and texture coordinate, and no opacity
_FEW_KINDS: dict[str, Any] = {"single": frozenset({"colour", "normal", "uv"}), "has_opacity": False}
_ROUNDED: dict[str, Any] = {"middles": lambda asset: np.zeros(3)}  # rounds points to single precision
_NAMED: dict[str, Any] = {"keeps_names": lambda attribute: True}  # all names are kept
_GLTF: dict[str, Any] = {"keeps": gltf.keeps, "has_parts": True, "middles": gltf.middles, **_NAMED}
# all names and frames of coordinates are kept; points are rounded to single precision
_GIFTI = {"keeps": gifti.keeps, "keeps_frame": lambda frame: True, **_NAMED, **_ROUNDED}
_VTK: dict[str, Any] = {  # attributes of corners, and names of numbered labels, are not kept
    "keeps": lambda attribute: attribute.domain != "corner",
    "keeps_names": lambda attribute: attribute.values.dtype.kind == "U",
    "options": _BINARY,
}
_FREESURFER: dict[str, Any] = {"keeps_frame": lambda frame: frame.is_in_volume, "axes": "RAS", **_ROUNDED}

FORMATS: dict[str, MeshFormat] = {
    ".off": MeshFormat(off.read, off.write, read_asset=off.read_asset, keeps=off.keeps, **_FEW_KINDS),
    ".obj": MeshFormat(
        obj.read, obj.write, read_asset=obj.read_asset, keeps=obj.keeps, **_NAMED, **_FEW_KINDS
    ),
    ".ply": MeshFormat(
        ply.read,
        ply.write,
        _BINARY | {"single"},
        ply.read_asset,
        ply.keeps,
        keeps_names=lambda a: a.kind == "weights",
    ),
    ".stl": _with_attributes(stl.read_asset, stl.write, options=_BINARY, keeps_frame=_fits_title, **_ROUNDED),
    ".glb": _with_attributes(gltf.read_asset, partial(gltf.write, is_glb=True), **_GLTF),
    ".gltf": _with_attributes(gltf.read_asset, partial(gltf.write, is_glb=False), **_GLTF),
    **{
        suffix: _with_attributes(partial(vtk.read, suffix), partial(vtk.write, suffix), **_VTK)
        for suffix in (".vtk", ".vtp", ".vtu")
    },
    ".gii": _with_attributes(gifti.read_asset, gifti.write, **_GIFTI),
    **dict.fromkeys(
        freesurfer.SURFACES, _with_attributes(freesurfer.read_asset, freesurfer.write, **_FREESURFER)
    ),
}
"""The format of each suffix, in lower case with its dot. To add a format, add an entry."""


CLOUDS: dict[str, Callable[[bytes, str], Asset]] = {
    ".xyz": clouds.read_xyz,
    ".asc": clouds.read_xyz,
    ".pcd": clouds.read_pcd,
    ".npy": clouds.read_npy,
}
"""The reader of each suffix of point clouds, which are not written."""


UNREADABLE = {
    **dict.fromkeys(
        (".fbx", ".blend", ".dae", ".3ds", ".usd", ".usda", ".usdc", ".usdz"), "export it as GLB"
    ),
    **dict.fromkeys(
        (".wrl", ".x3d", ".3mf", ".ctm", ".step", ".stp", ".iges", ".igs", ".mz3"), "export it as PLY"
    ),
    **dict.fromkeys((".bin", ".las", ".laz", ".e57", ".ptx"), "save it as PLY"),
}
"""What to do with files of surfaces and clouds that cannot be read, by suffix."""


def format_of(path: Path, reading: bool = False) -> MeshFormat:
    """Find the format of a file by its suffix; `FormatError` if it is unknown, or a cloud to write."""
    suffix = path.suffix.lower()
    if suffix in FORMATS:
        return FORMATS[suffix]
    if reading and suffix in CLOUDS:
        return _with_attributes(CLOUDS[suffix], ply.write)
    found = f"suffix {path.suffix!r}" if path.suffix else "no suffix"
    known = ", ".join([*FORMATS, *CLOUDS] if reading else FORMATS)
    remedy = f"use one of {known}"
    if reading and suffix in UNREADABLE:
        remedy = f"{UNREADABLE[suffix]}, or one of {known}"
    raise FormatError(f"{path}: {found} is not a mesh format; {remedy}")


@contextmanager
def naming(name: str) -> Iterator[None]:
    """Name the file in errors about its contents."""
    try:
        yield
    except InputError as error:
        raise FormatError(f"{name}: {error}") from None
