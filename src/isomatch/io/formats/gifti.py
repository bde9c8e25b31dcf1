"""GIFTI: surfaces of brains in XML, with values on their points, by nibabel."""

from __future__ import annotations

import base64
import zlib
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from io import BytesIO
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import iterparse

import numpy as np

from isomatch._core.errors import FormatError
from isomatch._core.first_use import package
from isomatch.io.asset import COMMENTS, NEW_VOLUME, SPACE, Asset, Frame
from isomatch.io.attribute import Attribute, guess_kind, number_equal_names
from isomatch.io.formats._reading import Room, reading, unexpected
from isomatch.io.polygons import Polygons

_PIECE_BYTES = 2**20  # bytes of a compressed array that are unpacked at once; chosen
# codes of NIfTI that tell what an array holds
_LABEL, _VECTOR, _POINTS, _TRIANGLES = 1002, 1007, 1008, 1009
_NODES, _RGB, _RGBA, _SHAPE = 2002, 2003, 2004, 2005
# keys of the meta data that name the part of the brain
_STRUCTURE_KEYS = ("AnatomicalStructurePrimary", "AnatomicalStructureSecondary")
_SURFACE_SUFFIX = ".surf.gii"  # end of the name of a file with a surface
VALUES = (".func", ".label", ".rgba", ".shape", ".tensor", ".time", ".vector")
"""Second suffixes, before ``.gii``, of files without a surface."""
# spaces of coordinates, in the order of their codes in NIfTI
_SPACES = ("unknown", "scanner_anat", "aligned_anat", "talairach", "mni_152", "template_other")
# first letter in GIFTI's keys for an axis, or for the centre, by the key in nibabel's ``volume_info``
_AXIS_LETTERS = {"xras": "X", "yras": "Y", "zras": "Z", "cras": "C"}
_VOLUME_KEYS = {
    "volume": ("Width", "Height", "Depth"),
    "voxelsize": ("Xsize", "Ysize", "Zsize"),
    **{key: tuple(f"{axis}_{way}" for way in "RAS") for key, axis in _AXIS_LETTERS.items()},
}
"""Keys of GIFTI for the entries of nibabel's ``volume_info``, without the prefix VolGeom."""


@dataclass(frozen=True)
class GiftiDocument:
    """Meta data of a file, its points (without the frame) and triangles; the intents of scalars."""

    of_file: Mapping[str, str] = field(default_factory=dict)
    of_points: Mapping[str, str] = field(default_factory=dict)
    of_triangles: Mapping[str, str] = field(default_factory=dict)
    intents: Mapping[str, int] = field(default_factory=dict)


def read_asset(data: bytes, name: str) -> Asset:
    """Read points, triangles and all values on the points."""
    image = _image(data, name)
    arrays = {array.intent: array for array in reversed(image.darrays)}
    for intent, what in ((_POINTS, "points"), (_TRIANGLES, "triangles")):
        if intent not in arrays:
            raise unexpected(name, f"an array of {what}", "none", "values alone are for read_attributes")
    with reading(name, "points and triangles of a GIFTI surface"):
        points, triangles = arrays[_POINTS], arrays[_TRIANGLES]
        names = [name for name in points.meta if "VolGeom" not in name and name not in (SPACE, COMMENTS)]
        plain = {name: points.meta[name] for name in names}
        attributes, intents = _values(image, len(points.data), "values")
        document = GiftiDocument(dict(image.meta), plain, dict(triangles.meta), intents)
        polygons = Polygons.of_triangles(triangles.data)
        return Asset(points.data, polygons, attributes, document=document, frame=_frame(points))


def read_attributes(data: bytes, name: str, surface: Asset | None) -> tuple[Attribute, ...]:
    """Read the values on points, as in ``.shape.gii``, ``.func.gii`` and ``.label.gii`` files."""
    image = _image(data, name)
    with reading(name, "values of a GIFTI file"):
        title = Path(Path(name).stem)
        title = title.with_suffix("") if title.suffix.lower() in VALUES else title
        return _values(image, len(surface.points) if surface else None, str(title))[0]


def write_attributes(attributes: Sequence[Attribute], surface: Asset | None = None) -> bytes:
    """Write values on points without the surface, but with its anatomical structure."""
    return _write_arrays(attributes, [], GiftiDocument(structure_of(surface) if surface else {}))


def structure_of(surface: Asset) -> dict[str, str]:
    """Return the meta data with the anatomical structure of a surface."""
    document = surface.document if isinstance(surface.document, GiftiDocument) else GiftiDocument()
    meta = {**document.of_file, **document.of_points}
    return {name: meta[name] for name in _STRUCTURE_KEYS if name in meta}


def with_structure_of(asset: Asset, other: Asset) -> Asset:
    """Give an asset the anatomical structure of another one, if that has any."""
    if not (structure := structure_of(other)) or not isinstance(asset.document, GiftiDocument | None):
        return asset
    document = asset.document or GiftiDocument()
    return replace(asset, document=replace(document, of_points={**document.of_points, **structure}))


def split_off_values(path: Path, asset: Asset) -> tuple[Asset, dict[Path, bytes]]:
    """Move the values of a ``.surf.gii`` file, which has no place for them, to other files."""
    if not path.name.lower().endswith(_SURFACE_SUFFIX):
        return asset, {}
    values_of = dict[Path, list[Attribute]]()
    for attribute in filter(keeps, asset.attributes):
        kind = {"label": ".label", "scalar": ".func", "colour": ".rgba"}.get(attribute.kind, ".vector")
        file = path.with_name(f"{path.name[: -len(_SURFACE_SUFFIX)]}{kind}.gii")
        values_of.setdefault(file, []).append(attribute)
    kept = tuple(attribute for attribute in asset.attributes if not keeps(attribute))
    files = {file: write_attributes(values, asset) for file, values in values_of.items()}
    return replace(asset, attributes=kept), files


def keeps(attribute: Attribute) -> bool:
    """Whether GIFTI has a place for an attribute."""
    return attribute.domain == "point" and attribute.kind != "weights"


def write(asset: Asset) -> bytes:
    """Write a surface in single precision, with the meta data of the file that it was read from."""
    array = _package().GiftiDataArray
    document = asset.document if isinstance(asset.document, GiftiDocument) else GiftiDocument()
    system, volume = _describe_frame(asset.frame)
    of_points = {**document.of_points, **volume}
    points = array(asset.points.astype(np.float32), _POINTS, coordsys=system, meta=of_points)
    faces = array(asset.polygons.triangles.astype(np.int32), _TRIANGLES, meta=dict(document.of_triangles))
    return _write_arrays(asset.attributes, [points, faces], document)


def _write_arrays(attributes: Sequence[Attribute], arrays: list[Any], document: GiftiDocument) -> bytes:
    gifti, one_table = _package(), _renumber_labels(attributes)
    values = [_array(gifti, attribute, document.intents) for attribute in one_table]
    image = gifti.GiftiImage(meta=gifti.GiftiMetaData(document.of_file), darrays=arrays + values)
    labels: dict[int, Any] = {}
    for attribute in one_table:
        for key, word in attribute.names.items() if attribute.kind == "label" else ():
            label = gifti.GiftiLabel(key, *attribute.colors.get(key, (None,) * 4))
            # surrogates, which XML does not allow, become escapes
            label.label = word.encode(errors="backslashreplace").decode()
            labels.setdefault(key, label)
    image.labeltable.labels.extend(labels.values())
    return bytes(image.to_xml())


def _image(data: bytes, name: str) -> Any:
    with reading(name, "a GIFTI file"):
        _require_room(data)
        return _package().GiftiImage.from_bytes(data)


def _require_room(data: bytes) -> None:
    """Raise `FormatError` if compressed data is far larger than the file, without keeping it."""
    room, encoding = Room(len(data)), ""
    for event, element in iterparse(BytesIO(data), ("start", "end")):
        if event == "start":
            encoding = element.get("Encoding", "") if element.tag == "DataArray" else encoding
            if "External" in encoding:
                remedy = "write it as one file, as by wb_command -gifti-convert GZIP_BASE64_BINARY"
                raise FormatError(f"its arrays are in another file, and are not read; {remedy}")
            continue
        if element.tag == "Data" and "GZip" in encoding:
            stream, rest = zlib.decompressobj(), base64.b64decode(element.text or "")
            with suppress(zlib.error):  # the data are not compressed, or nibabel refuses them later
                while part := stream.decompress(rest, _PIECE_BYTES):
                    room.take(len(part), "an array")
                    rest = stream.unconsumed_tail
        element.clear()


def _values(image: Any, n_points: int | None, title: str) -> tuple[tuple[Attribute, ...], dict[str, int]]:
    """Read all values; values of some points are spread over all."""
    table = {label.key: label for label in image.labeltable.labels}
    names = {key: str(label.label) for key, label in table.items()}
    colors = {key: tuple(label.rgba) for key, label in table.items() if None not in label.rgba}
    nodes = [a for a in image.darrays if a.intent == _NODES and np.size(a.data) == len(a.data)]
    arrays = [a for a in image.darrays if a.intent not in (_POINTS, _TRIANGLES) and a not in nodes]
    attributes = []
    for i, array in enumerate(arrays):
        values = np.asarray(array.data)
        values = values[:, 0] if values.ndim == 2 and values.shape[1] == 1 else values
        is_colour = array.intent in (_RGB, _RGBA)
        unnamed = "color" if is_colour else f"{title}_{i}" if len(arrays) > 1 else title
        name = str(array.meta.get("Name") or unnamed)
        if array.intent == _LABEL:
            attribute = Attribute(name, "point", "label", values, names=names, colors=colors)
        else:
            kind = "colour" if is_colour else guess_kind(name, values)
            attribute = Attribute(name, "point", "scalar" if kind == "label" else kind, values)
        if nodes:
            rows = np.ravel(nodes[0].data).astype(np.int64)
            attribute = attribute.spread(rows, n_points or int(rows.max(initial=-1)) + 1)
        attributes.append(attribute)
    numbered = number_equal_names(attributes)
    return numbered, {attribute.name: array.intent for attribute, array in zip(numbered, arrays)}


def _frame(points: Any) -> Frame:
    """Read the frame of points, which FreeSurfer may write as meta data."""
    meta, volume = points.meta, None
    texts = {key: [meta.get(f"VolGeom{word}") for word in words] for key, words in _VOLUME_KEYS.items()}
    if all(None not in numbers for numbers in texts.values()):
        volume = {**NEW_VOLUME, "filename": str(meta.get("VolGeomFname", "none"))}
        for key, numbers in texts.items():
            volume[key] = np.array(numbers).astype(int if key == "volume" else float)
    of_words, system = Frame.of_named(meta), points.coordsys
    frame = Frame(volume=volume)
    if system is not None:
        spaces = [_SPACES[int(code)] for code in (system.dataspace, system.xformspace)]
        frame = Frame(spaces[0], spaces[1], np.array(system.xform, dtype=np.float64), volume)
        frame = Frame.of_volume(volume) if volume is not None and not frame.has_space else frame
    return replace(frame, words=of_words.words) if of_words else frame


def _describe_frame(frame: Frame | None) -> tuple[Any, dict[str, str]]:
    """Return the coordinate system of a frame, and meta data with its volume and words."""
    if frame is None:
        return None, {}
    codes = [f"NIFTI_XFORM_{space.upper()}" for space in (frame.space, frame.to)]
    volume = frame.named if frame.words else {}
    if frame.volume is not None and frame.has_space:
        for key, words in _VOLUME_KEYS.items():
            for word, number in zip(words, frame.volume[key]):
                volume[f"VolGeom{word}"] = f"{number:g}" if key == "volume" else f"{number:.6f}"
        volume["VolGeomFname"] = str(frame.volume.get("filename", "none"))
    return _package().GiftiCoordSystem(*codes, frame.matrix), volume


def _array(gifti: Any, attribute: Attribute, intents: Mapping[str, int]) -> Any:
    values, intent, kind = attribute.plain, _VECTOR, "float32"
    if attribute.kind == "colour":
        intent, values = _RGB if values.shape[1] == 3 else _RGBA, attribute.fractions
    elif attribute.kind == "label":
        intent, kind = _LABEL, "int32"
    elif attribute.kind == "scalar":
        intent = intents.get(attribute.name, _SHAPE)
    return gifti.GiftiDataArray(values.astype(kind), intent, meta={"Name": attribute.name})


def _renumber_labels(attributes: Sequence[Attribute]) -> list[Attribute]:
    """Renumber labels whose number means another label in an earlier attribute: a file has one table."""
    table: dict[int, str] = {}
    numbered = []
    for attribute in attributes:
        if attribute.kind == "label":
            attribute = attribute.coded
            names = {int(code): str(code) for code in np.unique(attribute.values)} if table else {}
            names |= attribute.names
            free = max([*table, *names], default=0) + 1
            others = [code for code, word in names.items() if table.get(code, word) != word]
            if new := {code: free + i for i, code in enumerate(others)}:
                values = np.array([new.get(code, code) for code in attribute.values.tolist()], dtype=np.int64)
                colors = {new.get(code, code): color for code, color in attribute.colors.items()}
                names = {new.get(code, code): word for code, word in names.items()}
                attribute = replace(attribute, values=values, names=names, colors=colors)
            table |= attribute.names
        numbered.append(attribute)
    return numbered


def _package() -> Any:
    return package("nibabel.gifti", "io", "a GIFTI file")
