"""GIFTI: surfaces of brains in XML, with values on their points, by nibabel."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from isomatch.assets.asset import Asset
from isomatch.assets.attribute import Attribute
from isomatch.assets.attribute_names import guessed_kind
from isomatch.assets.formats._reading import reading
from isomatch.assets.polygons import Polygons
from isomatch.errors import FormatError
from isomatch.loading.packages import package

_POINTS, _TRIANGLES, _LABEL, _SHAPE, _VECTOR, _RGB, _RGBA = 1008, 1009, 1002, 2005, 1007, 2002, 2003


@dataclass(frozen=True)
class GiftiDocument:
    """The image as it was read, and the array of each attribute, in their order."""

    image: Any
    arrays: tuple[tuple[Attribute, Any], ...]


def read_asset(data: bytes, name: str) -> Asset:
    """Read points, triangles and all values on the points."""
    image, attributes = _read(data, name)
    found = {array.intent: array.data for array in reversed(image.darrays)}
    for intent, what in ((_POINTS, "points"), (_TRIANGLES, "triangles")):
        if intent not in found:
            raise FormatError(
                f"{name}: expected an array of {what}, found none; give the surface (.surf.gii), and the values on "
                "it by read_attributes"
            )
    with reading(name, "points and triangles of a GIFTI surface"):
        return Asset(
            found[_POINTS],
            Polygons.of_triangles(found[_TRIANGLES]),
            tuple(attribute for attribute, _ in attributes),
            document=GiftiDocument(image, attributes),
        )


def read_attributes(data: bytes, name: str) -> tuple[Attribute, ...]:
    """Read the values on points, as in ``.shape.gii``, ``.func.gii`` and ``.label.gii`` files."""
    return tuple(attribute for attribute, _ in _read(data, name)[1])


def write_attribute(attribute: Attribute) -> bytes:
    """Write values on points without a surface."""
    gifti = _package()
    image = gifti.GiftiImage(darrays=[_array(gifti, attribute)])
    image.labeltable = _table(gifti, [attribute.coded] if attribute.kind == "label" else [])
    return bytes(image.to_xml())


def keeps(attribute: Attribute) -> bool:
    """Whether GIFTI has a place for an attribute."""
    return attribute.domain == "point" and attribute.kind != "weights"


def write(asset: Asset) -> bytes:
    """Write a surface; what was read and did not change is written as it was."""
    gifti = _package()
    document = asset.document if isinstance(asset.document, GiftiDocument) else GiftiDocument(None, ())
    image = gifti.GiftiImage()
    given: dict[int, Any] = {}
    if document.image is not None:
        image.meta = document.image.meta
        given = {array.intent: array for array in reversed(document.image.darrays)}
    for intent, values in (
        (_POINTS, asset.points.astype(np.float32)),
        (_TRIANGLES, asset.polygons.triangles.astype(np.int32)),
    ):
        array = given.get(intent)
        described = {} if array is None else {"coordsys": array.coordsys, "meta": array.meta}
        image.add_gifti_data_array(gifti.GiftiDataArray(values, intent, **described))
    same = {id(attribute): array for attribute, array in document.arrays}
    attributes = sorted(asset.attributes, key=lambda attribute: id(attribute) not in same)
    one_table = _numbered(attributes)
    for attribute, numbered in zip(attributes, one_table):
        image.add_gifti_data_array(same.get(id(attribute)) or _array(gifti, numbered))
    image.labeltable = _table(gifti, [a for a in one_table if a.kind == "label"])
    return bytes(image.to_xml())


def _read(data: bytes, name: str) -> tuple[Any, tuple[tuple[Attribute, Any], ...]]:
    gifti = _package()
    with reading(name, "a GIFTI file"):
        image = gifti.GiftiImage.from_bytes(data)
        table = {label.key: label for label in image.labeltable.labels}
        names = {key: str(label.label) for key, label in table.items()}
        colors = {key: tuple(label.rgba) for key, label in table.items() if None not in label.rgba}
        found: list[tuple[Attribute, Any]] = []
        for i, array in enumerate(image.darrays):
            if array.intent in (_POINTS, _TRIANGLES):
                continue
            title = str(array.meta.get("Name") or f"values_{i}")
            while any(title == attribute.name for attribute, _ in found):
                title += "_"
            values = np.asarray(array.data)
            if array.intent == _LABEL:
                attribute = Attribute(title, "point", "label", values, names=names, colors=colors)
            elif array.intent in (_RGB, _RGBA):
                attribute = Attribute(title, "point", "colour", values)
            else:
                kind = guessed_kind(title, values)
                attribute = Attribute(title, "point", "scalar" if kind == "label" else kind, values)
            found.append((attribute, array))
    return image, tuple(found)


def _array(gifti: Any, attribute: Attribute) -> Any:
    values = attribute.plain
    intent, kind = _VECTOR, "NIFTI_TYPE_FLOAT32"
    if attribute.kind == "colour":
        intent, values = _RGB if values.shape[1] == 3 else _RGBA, attribute.fractions
    elif attribute.kind == "label":
        intent, kind = _LABEL, "NIFTI_TYPE_INT32"
    elif attribute.kind == "scalar":
        intent = _SHAPE
    values = values.astype(np.int32 if kind.endswith("INT32") else np.float32)
    return gifti.GiftiDataArray(values, intent, datatype=kind, meta={"Name": attribute.name})


def _numbered(attributes: list[Attribute]) -> list[Attribute]:
    """Give new numbers to labels that have the number of another of an attribute before: a file has one table."""
    table: dict[int, str] = {}
    found = []
    for attribute in attributes:
        if attribute.kind == "label":
            attribute = attribute.coded
            names = {int(code): str(code) for code in np.unique(attribute.values)} if table else {}
            names |= attribute.names
            free = max([*table, *names], default=0) + 1
            new = {
                code: free + i
                for i, code in enumerate(c for c, word in names.items() if table.get(c, word) != word)
            }
            if new:
                values = np.array([new.get(code, code) for code in attribute.values.tolist()], dtype=np.int64)
                colors = {new.get(code, code): color for code, color in attribute.colors.items()}
                names = {new.get(code, code): word for code, word in names.items()}
                attribute = replace(attribute, values=values, names=names, colors=colors)
            table |= attribute.names
        found.append(attribute)
    return found


def _table(gifti: Any, labels: list[Attribute]) -> Any:
    """Make the one table of a file, of the names of all labels."""
    table = gifti.GiftiLabelTable()
    names = {key: word for attribute in labels for key, word in attribute.names.items()}
    colors = {key: color for attribute in labels for key, color in attribute.colors.items()}
    for key, word in names.items():
        label = gifti.GiftiLabel(key, *colors.get(key, (None,) * 4))
        label.label = word
        table.labels.append(label)
    return table


def _package() -> Any:
    return package("nibabel.gifti", "io", "a GIFTI file")
