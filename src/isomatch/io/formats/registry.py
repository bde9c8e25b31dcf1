"""The format of each suffix: how its files are read and written, and what they keep."""

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
    """How one format is read and written."""

    read: Callable[[bytes, str], Mesh]  # the bytes of a file and its name, which is for messages
    write: Callable[..., bytes]  # an asset, and the options that the format has, by keyword
    options: frozenset[str] = frozenset()  # that it has: "binary" of `write_mesh`, "single" precision
    read_asset: Callable[[bytes, str], Asset] | None = None  # by default points and triangles alone
    keeps: Callable[[Attribute], bool] = lambda attribute: False  # whether it has a place for an attribute
    single: frozenset[str] = frozenset()  # kinds of attributes of which it has only one
    has_parts: bool = False  # and their transforms
    keeps_names: Callable[[Attribute], bool] = lambda attribute: False  # of labels or joints
    has_opacity: bool = True  # of colours
    keeps_frame: Callable[[Frame], bool] = lambda frame: not frame.has_space  # but axes and a unit, in words
    axes: Axes | None = None  # in which all its files are
    middles: Callable[[Asset], FloatArray] | None = None  # taken from points before they become floats

    def missing(self, attribute: Attribute) -> list[Attribute]:
        """Return what has no place of an attribute that has one."""
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
    """Make a format whose meshes are read with all that the file holds."""

    def read(data: bytes, name: str) -> Mesh:
        with naming(name):
            asset = read_asset(data, name)
        return Mesh(asset.placed_points, asset.polygons.triangles)

    return MeshFormat(read, write, read_asset=read_asset, **others)


def _fits_title(frame: Frame) -> bool:
    return not frame.has_space and frame.title(stl.TITLE) == "; ".join(frame.lines)


def _all(attribute: Attribute) -> bool:
    return True


_BINARY = frozenset({"binary"})
_PLAIN: dict[str, Any] = {"single": frozenset({"colour", "normal", "uv"}), "has_opacity": False}
_SINGLE: dict[str, Any] = {"middles": lambda asset: np.zeros(3)}
_GLTF: dict[str, Any] = {"keeps": gltf.keeps, "has_parts": True, "keeps_names": _all, "middles": gltf.middles}
_GIFTI = {"keeps": gifti.keeps, "keeps_names": _all, "keeps_frame": lambda frame: True, **_SINGLE}
_VTK: dict[str, Any] = {"keeps": vtk.keeps, "keeps_names": vtk.keeps_names, "options": _BINARY}
_FREESURFER: dict[str, Any] = {"keeps_frame": lambda frame: frame.is_in_volume, "axes": "RAS", **_SINGLE}

FORMATS: dict[str, MeshFormat] = {
    ".off": MeshFormat(off.read, off.write, read_asset=off.read_asset, keeps=off.keeps, **_PLAIN),
    ".obj": MeshFormat(
        obj.read, obj.write, read_asset=obj.read_asset, keeps=obj.keeps, keeps_names=_all, **_PLAIN
    ),
    ".ply": MeshFormat(
        ply.read, ply.write, _BINARY | {"single"}, ply.read_asset, ply.keeps, keeps_names=ply.keeps_names
    ),
    ".stl": MeshFormat(stl.read, stl.write, _BINARY, stl.read_asset, keeps_frame=_fits_title, **_SINGLE),
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
"""The format of each suffix, in lower case and with its dot. To add a format, add an entry."""


CLOUDS: dict[str, Callable[[bytes, str], Asset]] = {
    ".xyz": clouds.read_xyz,
    ".asc": clouds.read_xyz,
    ".pcd": clouds.read_pcd,
    ".npy": clouds.read_npy,
}
"""The reader of each suffix of files with points alone, which are not written."""


UNREAD = {
    **dict.fromkeys(
        (".fbx", ".blend", ".dae", ".3ds", ".usd", ".usda", ".usdc", ".usdz"), "export it as GLB"
    ),
    **dict.fromkeys(
        (".wrl", ".x3d", ".3mf", ".ctm", ".step", ".stp", ".iges", ".igs", ".mz3"), "export it as PLY"
    ),
    **dict.fromkeys((".bin", ".las", ".laz", ".e57", ".ptx"), "save it as PLY"),
}
"""What to do with files of surfaces and clouds that are not read, by their suffixes."""


def format_of(path: Path, reading: bool = False) -> MeshFormat:
    """Return the format of a file by its suffix; `FormatError` if that is unknown, or of a cloud and not for reading."""
    suffix = path.suffix.lower()
    if suffix in FORMATS:
        return FORMATS[suffix]
    if reading and suffix in CLOUDS:
        return _with_attributes(CLOUDS[suffix], ply.write)
    told = f"suffix {path.suffix!r}" if path.suffix else "no suffix"
    known = ", ".join([*FORMATS, *CLOUDS] if reading else FORMATS)
    remedy = f"{UNREAD[suffix]}, or one of {known}" if suffix in UNREAD else f"use one of {known}"
    raise FormatError(f"{path}: {told} is not a mesh format; {remedy}")


@contextmanager
def naming(name: str) -> Iterator[None]:
    """Name a file where what it holds does not fit together."""
    try:
        yield
    except InputError as error:
        raise FormatError(f"{name}: {error}") from None
