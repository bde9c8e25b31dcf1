"""Attributes carried from one asset to another: labels by nearest or majority, other values by interpolation."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import get_args

import numpy as np

from isomatch._core.arrays import AnyArray, FloatArray, IntArray
from isomatch._core.errors import DescriptorError, SettingError
from isomatch.correspondence import Correspondence
from isomatch.io import (
    Asset,
    Attribute,
    Domain,
    Kind,
    animation_channels,
    is_posed,
    unreadable_files,
    with_key_weights_of,
    with_looks_of,
    with_names_of,
    with_skin_of,
    without_labels,
)
from isomatch.transfer.bridge import Bridge, Patches, columns, interpolated_at_corners, is_seamless
from isomatch.transfer.choices import Labelling, NumbersAs, Side

_SYNONYMS: dict[str, Kind] = {  # kinds of attributes by other words for them
    "color": "colour",
    "texture": "uv",
    "skin": "weights",
    "weight": "weights",
    **dict.fromkeys(("shape key", "morph target", "blend shape"), "key"),
}
UNMATCHED_COLOUR = 0.5  # grey of unmatched vertices, as a fraction of white; chosen


@dataclass(frozen=True, eq=False)
class Carried:
    """What `carry_attributes` returns.

    Parameters
    ----------
    asset : Asset
        The asset that receives, with the attributes of the other.
    names : tuple of str
        The attributes that were carried.
    unmatched : int
        Number of vertices without an image. They get nan, −1 or an empty text, grey, the weights of the
        first joint alone, their own normals, and the displacements around them.
    across_seams : int
        Number of polygons across a texture seam of the other, whose corners were kept on one side.
    notes : tuple of str
        Losses and obstacles, such as pictures that cannot be read, or a skeleton that is posed.
    taken_as_labels : tuple of str
        Attributes that were carried as labels because they are integers, or few whole numbers.
    """

    asset: Asset
    names: tuple[str, ...]
    unmatched: int
    across_seams: int
    notes: tuple[str, ...] = ()
    taken_as_labels: tuple[str, ...] = ()


def carry_attributes(
    correspondence: Correspondence,
    source: Asset,
    target: Asset,
    data: str | Iterable[str] = "all",
    *,
    to: Side = "source",
    labels: Labelling = "nearest",
    numbers_as: NumbersAs | None = None,
) -> Carried:
    """Carry attributes from one asset to the other.

    All else of the asset that receives stays as it is. Colours, scalars, vectors and skinning weights
    are interpolated at the precise images; as many weights are kept as the other has, with sum 1.
    Normals turn with the surface. So do shape keys, by rotations averaged over a tenth of √area, and
    they grow with it. Values that differ at the corners of one point, as at a texture seam, are carried
    to corners, all of a polygon from one side. Labels are never averaged; other values of polygons are,
    by area. With texture coordinates go materials and pictures, with weights the joints.

    Parameters
    ----------
    correspondence : Correspondence
        Source → target, between the points of the two files, as `match` finds it for their paths.
    source, target : Asset
        From `read_asset`.
    data : str or iterable of str
        Names of attributes, or kinds: ``"label"``, ``"colour"``, ``"scalar"``, ``"vector"``,
        ``"normal"``, ``"uv"``, ``"weights"``, ``"key"`` (shape keys); ``"all"`` for everything.
    to : {"source", "target"}
        Which of the two receives. To the target, the map is reversed on the surfaces.
    labels : {"nearest", "majority"}
        Labels of points: the label of the nearest vertex, or the one with most area around the
        point. Polygons always take the label with most area.
    numbers_as : {"labels", "values"}, optional
        Whether numbers are carried as labels or interpolated. By default those named or declared as
        labels, integers, and floats of `Attribute.seems_labels` are labels. Labels that have names, or
        are texts, always are.

    Raises
    ------
    MapError, DescriptorError, SettingError
        If the map is a map of other surfaces, there is no such attribute, or an option is unknown.

    Examples
    --------
    >>> from isomatch.io import Attribute, Polygons
    >>> square = Asset([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], Polygons([0, 1, 2, 3], [4]))
    >>> named = square.with_attributes(Attribute("side", "point", "label", ["left", "right", "right", "left"]))
    >>> half_turn = Correspondence([2, 3, 0, 1], n_target=4)
    >>> carry_attributes(half_turn, square, named).asset.attribute("side").values.tolist()
    ['right', 'left', 'left', 'right']
    """
    of_options = ("to", to, Side), ("labels", labels, Labelling), ("numbers_as", numbers_as, NumbersAs)
    for name, value, options in of_options:
        if value not in get_args(options) and not (value is None and options is NumbersAs):
            raise SettingError(f"{name} = {value!r} is unknown; use one of {', '.join(get_args(options))}")
    receiver, giver = (source, target) if to == "source" else (target, source)
    chosen = select_attributes(giver.placed, data)
    bridge = Bridge.between(correspondence, source, target, to_source=to == "source")
    names = [attribute.name for attribute in chosen]
    asset, across = receiver.without_attributes(*names), 0
    as_labels = [_is_label(attribute, numbers_as) for attribute in chosen]
    for attribute, is_label in zip(chosen, as_labels):
        if attribute.kind == "label" and not is_label:
            attribute = replace(attribute, kind="scalar")
        if is_label:
            new = _carry_labels(attribute, bridge, labels)
        elif attribute.domain == "face":
            new = _carry_means(attribute, bridge)
        elif attribute.kind == "weights":
            new = _carry_weights(attribute, bridge)
        elif attribute.kind == "key":
            new = _carry_key(attribute, bridge)
        else:
            new, n_across = _interpolate(attribute, bridge)
            across = max(across, n_across)
        asset = asset.with_attributes(receiver.from_placed(new))
    # Carried attributes come first, as formats that store one attribute of a kind write the first.
    carried_first = sorted(asset.attributes, key=lambda attribute: attribute.name not in names)
    asset = replace(asset, attributes=tuple(carried_first))
    kinds, notes = {attribute.kind for attribute in chosen}, list[str]()
    if "uv" in kinds:
        asset = asset.without_attributes(*(a.name for a in asset.attributes if a.is_tangent))
        asset = with_looks_of(asset, giver, bridge.at_polygons.triangle[receiver.polygons.of_triangle])
        notes += unreadable_files(giver)
    if "weights" in kinds:
        asset = with_skin_of(asset, giver)
        if is_posed(giver):
            notes.append("the skeleton is posed, and the surface is bound to it so; pose it back before")
    if "key" in kinds:
        asset = with_key_weights_of(asset, giver.document)
    asset = with_names_of(asset, giver.document)
    if animation_channels(asset) < animation_channels(receiver):
        notes.append("animations of joints and shape keys that the receiver had before are left out")
    remaining_names = {attribute.name for attribute in asset.attributes}
    guessed_labels = () if numbers_as else (a for a, is_label in zip(chosen, as_labels) if is_label)
    taken_as_labels = tuple(a.name for a in guessed_labels if not _is_declared(a))
    unmatched = int((~bridge.at_vertices.has_place).sum())
    kept = tuple(name for name in names if name in remaining_names)
    return Carried(asset, kept, unmatched, across, tuple(notes), taken_as_labels)


def select_attributes(asset: Asset, data: str | Iterable[str]) -> tuple[Attribute, ...]:
    """Return attributes by names or kinds; `DescriptorError` for a word that matches none."""
    words = [data] if isinstance(data, str) else list(data)
    if words == ["all"]:
        return asset.attributes
    chosen: set[Attribute] = set()
    for word in words:
        kind = word.lower().removesuffix("s")
        kind = _SYNONYMS.get(kind.replace("_", " ").replace("-", " "), kind)
        like_labels = [a for a in asset.attributes if kind == "label" and a.seems_labels]
        matching = [a for a in asset.attributes if word == a.name or kind == a.kind or a in like_labels]
        if not matching:
            available = ", ".join(f"{a.name} ({a.kind})" for a in asset.attributes) or "nothing"
            raise DescriptorError(
                f"nothing to carry is named {word!r} or of that kind ({', '.join(get_args(Kind))}); there is {available}"
            )
        chosen.update(matching)
    return tuple(a for a in asset.attributes if a in chosen)


def _interpolate(attribute: Attribute, bridge: Bridge) -> tuple[Attribute, int]:
    """Interpolate at points or, across seams, at corners; count the polygons across a seam."""
    receiver, across = bridge.receiver, 0
    domain: Domain = "point"
    if is_seamless(bridge.giver, attribute):
        vertex, places = receiver.vertex_of_point, bridge.at_vertices
        carried = places.interpolated(columns(attribute), places.rows(attribute))[vertex]
    else:
        vertex, domain = receiver.vertex_of_corner, "corner"
        carried, across = interpolated_at_corners(bridge, attribute)
    if attribute.kind == "normal":
        carried = _turn_normals(bridge, carried, vertex)
    return attribute.with_values(_to_type_of(carried, attribute), domain), across


def _turn_normals(bridge: Bridge, normals: FloatArray, vertex: IntArray) -> FloatArray:
    """Turn normals with the surface; unmatched vertices keep the receiver's normals."""
    turned = np.einsum("nij,nj->ni", bridge.rotations[vertex], normals)
    length = np.linalg.norm(turned, axis=1, keepdims=True)
    receiver_normals = bridge.receiver.mesh.vertex_normals[vertex]
    with np.errstate(invalid="ignore"):
        return np.where(length > 0, turned / length, receiver_normals)


def _carry_key(attribute: Attribute, bridge: Bridge) -> Attribute:
    """Turn interpolated displacements by averaged rotations, scale and extend them."""
    places, turn = bridge.at_vertices, bridge.growth * bridge.smooth_rotations
    carried = places.interpolated(columns(attribute), places.rows(attribute))
    moves = bridge.extended(np.einsum("nij,nj->ni", turn, carried))
    return attribute.with_values(_to_type_of(moves[bridge.receiver.vertex_of_point], attribute), "point")


def _carry_weights(attribute: Attribute, bridge: Bridge) -> Attribute:
    """Interpolate skinning weights; the smallest are left out, and the others sum to 1."""
    places = bridge.at_vertices
    dense = places.interpolated(attribute.dense_weights, places.rows(attribute))
    dense[~places.has_place, 0] = 1.0
    dense = np.nan_to_num(dense)[bridge.receiver.vertex_of_point]
    dense /= np.maximum(dense.sum(axis=1, keepdims=True), np.finfo(float).tiny)
    if attribute.joints is None:
        return attribute.with_values(dense, "point")
    joints, weights = attribute.with_values(dense, "point").strongest(attribute.values.shape[1])
    return Attribute(attribute.name, "point", "weights", weights, joints, attribute.names)


def _is_declared(attribute: Attribute) -> bool:
    """Whether the attribute is a label by its names or type, whatever `numbers_as` says."""
    return attribute.kind == "label" and (bool(attribute.names) or attribute.values.dtype.kind not in "iu")


def _is_label(attribute: Attribute, numbers_as: NumbersAs | None) -> bool:
    if _is_declared(attribute):
        return True
    is_number = attribute.kind in ("label", "scalar", "vector") and not attribute.is_tangent
    return is_number and (attribute.seems_labels if numbers_as is None else numbers_as == "labels")


def _carry_labels(attribute: Attribute, bridge: Bridge, labels: Labelling) -> Attribute:
    """Carry labels to the same domain: the nearest, or those with most area around a row."""
    receiver = bridge.receiver
    if attribute.domain == "point" and labels == "nearest":
        places = bridge.at_vertices
        nearest = without_labels(attribute.values[places.nearest_rows(attribute)], ~places.has_place)
        return attribute.with_values(nearest[receiver.vertex_of_point])
    patches = Patches.of(attribute, bridge)
    rows = attribute.values
    distinct, code = np.unique(rows, axis=0 if rows.ndim > 1 else None, return_inverse=True)
    votes = patches.sums(code.ravel()[patches.rows], len(distinct))
    winner = without_labels(distinct[votes.argmax(axis=1)], votes.sum(axis=1) == 0)
    return attribute.with_values(winner[patches.owner_of_row])


def _carry_means(attribute: Attribute, bridge: Bridge) -> Attribute:
    """Carry values of polygons to the same domain, as the mean by area."""
    patches = Patches.of(attribute, bridge)
    sums = patches.sums(patches.rows, len(attribute))
    with np.errstate(invalid="ignore"):
        means = sums @ columns(attribute) / sums.sum(axis=1)[:, None]
    if attribute.kind == "normal":
        receiver = bridge.receiver
        means = _turn_normals(bridge, means, receiver.vertex_of_corner[receiver.polygons.starts])
    return attribute.with_values(_to_type_of(means, attribute)[patches.owner_of_row])


def _to_type_of(values: FloatArray, attribute: Attribute) -> AnyArray:
    """Return interpolated columns in the shape and type of an attribute; integers are rounded."""
    kind = attribute.values.dtype
    if attribute.kind == "colour":
        grey = attribute.full * np.array([UNMATCHED_COLOUR, UNMATCHED_COLOUR, UNMATCHED_COLOUR, 1.0])
        values = np.where(np.isnan(values), grey[: values.shape[1]], values).clip(0, attribute.full)
    if kind.kind in "iu" and attribute.kind == "colour":
        values = np.rint(values)
    elif kind.kind != "f":
        kind = np.dtype(np.float64)
    return values.reshape(len(values), *attribute.values.shape[1:]).astype(kind)
