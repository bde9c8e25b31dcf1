"""Materials of assets in any format: read them, carry them to another asset, convert them."""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping
from dataclasses import replace
from itertools import chain, count
from pathlib import Path, PurePosixPath

import numpy as np

from isomatch._core.arrays import AnyArray, IntArray
from isomatch.io.asset import Asset
from isomatch.io.attribute import Attribute, unused_names
from isomatch.io.formats import gifti, gltf_carried, obj
from isomatch.io.formats.gltf import GltfDocument
from isomatch.io.formats.obj import ObjDocument
from isomatch.io.formats.ply import TEXTURE_NUMBER, PlyDocument
from isomatch.io.materials import UNTINTED, Layer, Look, Looks, Picture, as_png, unreadable_pictures

_MATERIAL_LABEL = "material"  # name of the attribute that holds the material of each face of an OBJ file
_UNDEFINED_LAYER = Layer((0.5, 0.5, 0.5, 1.0))  # grey, for materials that no library of an OBJ file defines


def looks_of(asset: Asset) -> Looks | None:
    """Return the materials of the triangles, grey if no library defines them; None without materials."""
    if isinstance(asset.document, GltfDocument):
        return gltf_carried.materials_of(asset.document)
    if isinstance(asset.document, PlyDocument):
        return _ply_looks(asset, asset.document)
    labels = [a for a in asset.attributes if (a.name, a.domain) == (_MATERIAL_LABEL, "face")]
    if not isinstance(asset.document, ObjDocument) or not labels:
        return None
    look_of = obj.materials_of(asset.document)
    coded = labels[0].coded
    codes, place = np.unique(coded.values, return_inverse=True)
    names = [coded.names.get(code, str(code)) for code in codes.tolist()]
    if not look_of.keys() & set(names):
        return None
    used = [name for name in names if name]
    look = np.array([used.index(name) if name else -1 for name in names], dtype=np.int64)
    materials = tuple(look_of.get(name) or Look(name, _UNDEFINED_LAYER) for name in used)
    return _split_tiles(asset, Looks(look[place][asset.polygons.of_triangle], materials))


def _split_tiles(asset: Asset, materials: Looks) -> Looks:
    """Split materials with <UDIM> in the names of their pictures into one for each used tile."""
    pictures = [(i, picture.name) for i, look in enumerate(materials.looks) for picture in look.pictures]
    tiled = dict.fromkeys(i for i, name in pictures if len(obj.tiles_of(name)) > 1)
    uv = next(iter(asset.of_kind("uv")), None)
    if not tiled or uv is None or not isinstance(asset.document, ObjDocument):
        return materials
    polygons, files = asset.polygons, asset.document.files
    rows = polygons.corner_of_triangle if uv.domain == "corner" else polygons.triangles
    column, row = np.floor(np.nan_to_num(uv.values[rows][..., :2].mean(axis=1))).clip(0, 9).astype(int).T
    looks, of_triangle = list(materials.looks), materials.of_triangle.copy()
    for i in tiled:
        for tile in np.unique((column + 10 * row)[materials.of_triangle == i]).tolist():
            shown = (materials.of_triangle == i) & (column + 10 * row == tile)
            of_tile = (_tile_layer(layer, tile, files) for layer in materials.looks[i].layers)
            of_triangle[shown] = len(looks)
            looks.append(Look(materials.looks[i].name, *of_tile))
    # materials that were split into tiles are left out, as no triangle shows them any more
    kept = [i for i in range(len(looks)) if i not in tiled]
    place = np.append(np.cumsum(np.isin(np.arange(len(looks)), kept)) - 1, -1)
    return Looks(place[of_triangle], tuple(looks[i] for i in kept))


def _tile_layer(layer: Layer, tile: int, files: Mapping[str, bytes]) -> Layer:
    """Return a layer with the picture of a tile, counted from 0, if it has a picture for each."""
    names = obj.tiles_of(layer.picture.name) if layer.picture else []
    return replace(layer, picture=Picture.among(files, names[tile])) if len(names) > 1 else layer


def _ply_looks(asset: Asset, document: PlyDocument) -> Looks | None:
    """Return the pictures that comments of a PLY file name; faces refer to them by number."""
    names, of_triangle = document.textures, np.zeros(len(asset.polygons.of_triangle), dtype=np.int64)
    if not names or not asset.of_kind("uv"):
        return None
    for number in asset.attributes:
        if (number.name, number.domain) == (TEXTURE_NUMBER, "face") and number.values.ndim == 1:
            of_triangle = number.coded.values.astype(np.int64)[asset.polygons.of_triangle]
            of_triangle = np.where((of_triangle >= 0) & (of_triangle < len(names)), of_triangle, -1)
    uv = asset.of_kind("uv")[0].name
    looks = (Look(name, Layer(picture=Picture.among(document.files, name), uv=uv)) for name in names)
    return Looks(of_triangle, tuple(looks))


def unreadable_files(asset: Asset) -> tuple[str, ...]:
    """Explain which pictures of an asset, materials and libraries of an OBJ file cannot be read."""
    materials, document = looks_of(asset), asset.document
    pictures = unreadable_pictures(materials.pictures if materials else ())
    notes = [f"{picture.name!r}: {why}" for picture, why in pictures.items()]
    if isinstance(document, ObjDocument):
        look_of = obj.materials_of(document)
        undefined = [look.name for look in materials.looks if look.name not in look_of] if materials else []
        notes += [f"{name!r}: the material is in none of the libraries" for name in undefined]
        for line in document.libraries:  # each line has one file name with blanks, or several
            words = line.split()
            missing = [] if line in document.files else [word for word in words if word not in document.files]
            names = missing if len(missing) < len(words) else [line]
            notes += [f"{name!r}: there is no such file in the folder of the surface" for name in names]
    return tuple(notes)


def with_looks_of(receiver: Asset, giver: Asset, giver_triangle: IntArray) -> Asset:
    """Give the receiver the materials and pictures of the giver, if its file has any.

    ``giver_triangle`` (m,) is the triangle whose look each triangle of the receiver takes, −1 for the
    most frequent look.
    """
    document, materials = giver.document, looks_of(giver)
    if materials is None or not len(giver_triangle):
        return receiver
    if isinstance(document, GltfDocument):
        return gltf_carried.with_materials_of(receiver, document, giver_triangle)
    of_triangle = gltf_carried.take_looks(materials.of_triangle, giver_triangle)
    if isinstance(document, ObjDocument) and isinstance(receiver.document, ObjDocument):
        document = replace(receiver.document, libraries=document.libraries, files=document.files)
        names = tuple(look.name for look in materials.looks)
        return replace(_with_material_labels(receiver, of_triangle, names), document=document)
    return gltf_carried.with_materials(receiver, Looks(of_triangle, materials.looks))


def with_texture(receiver: Asset, png: bytes, tint: tuple[float, ...] = UNTINTED) -> Asset:
    """Return the receiver as a glTF file with one picture, multiplied by a tint of red to alpha, 0…1."""
    of_triangle = np.zeros(len(receiver.polygons.corner_of_triangle), dtype=np.int64)
    return with_tiles(receiver, of_triangle, {"baked": png}, tint)


def with_tiles(
    receiver: Asset, of_triangle: IntArray, pictures: Mapping[str, bytes], tint: tuple[float, ...] = UNTINTED
) -> Asset:
    """Return the receiver as a glTF file with a material for each named picture, which repeats."""
    uv = next((attribute.name for attribute in receiver.of_kind("uv")), "uv")
    layers = {name: Layer(tuple(tint), Picture(f"{name}.png", png), uv) for name, png in pictures.items()}
    looks = tuple(Look(name, layer) for name, layer in layers.items())
    return gltf_carried.with_materials(receiver, Looks(of_triangle, looks))


def prepare_for_writing(path: Path, asset: Asset) -> tuple[Asset, dict[Path, bytes]]:
    """Convert the materials to the format of a file to be written; return also the files beside it."""
    document, suffix = asset.document, path.suffix.lower()
    if suffix in (".glb", ".gltf"):
        materials = None if isinstance(document, GltfDocument) else looks_of(asset)
        if materials:
            asset = gltf_carried.with_materials(_without_texture_numbers(asset), materials)
        return asset, {}
    document_type = {".obj": ObjDocument, ".ply": PlyDocument}.get(suffix, ())
    materials = looks_of(asset) if document_type and not isinstance(document, document_type) else None
    if isinstance(document, GltfDocument):
        asset = replace(asset, document=document.former)
    if materials:
        asset = (_to_obj if document_type is ObjDocument else _to_ply)(asset, materials, path.stem)
    document = asset.document
    if not isinstance(document, ObjDocument | PlyDocument) or not isinstance(document, document_type):
        return gifti.split_off_values(path, asset)
    libraries = document.library_names if isinstance(document, ObjDocument) else ()
    names, files = _place_beside(document.files, libraries, path)
    return replace(asset, document=document.with_renamed_files(names)), files


def list_lost_looks(path: Path, asset: Asset) -> tuple[Attribute, ...]:
    """List what a file to be written has no place for: pictures and colours of materials."""
    suffix = path.suffix.lower()
    materials = None if suffix in (".glb", ".gltf", ".obj") else looks_of(asset)
    if materials is None:
        return ()
    has_pictures, is_ply = bool(materials.pictures), suffix == ".ply"
    has_colours = any(layer.tint != UNTINTED for look in materials.looks for layer in look.layers)
    words = ["pictures"] * (has_pictures and not is_ply) + ["colours"] * has_colours
    name = f"the {' and '.join(words)} of the materials"
    return (Attribute(name, "face", "label", np.zeros(len(asset.polygons), int)),) if words else ()


def prepare_one_texture(asset: Asset) -> tuple[Asset, AnyArray | None]:
    """Return an asset with coordinates for its one repeating texture, (h, w, 4) uint8; None otherwise."""
    materials = looks_of(asset)
    used = np.unique(materials.of_triangle) if materials else np.zeros(0)
    if materials is None or len(used) != 1 or used[0] < 0:
        return asset, None
    shown, layers = _make_repeating(asset, materials)
    pixels = layers[used[0]].pixels
    return (asset, None) if pixels is None else (shown, np.rint(255 * pixels).astype(np.uint8))


def _make_repeating(asset: Asset, materials: Looks) -> tuple[Asset, tuple[Layer, ...]]:
    """Convert the main layers to repeating pictures; return them with the asset and its coordinates."""
    layers = [look.main for look in materials.looks]
    first = [attribute.name for attribute in asset.of_kind("uv")][:1]
    plain = Layer(uv=first[0]) if first else Layer()
    lookups = {(layer.uv, layer.matrix, layer.wrap) for layer in layers if layer.picture}
    if not first or lookups <= {(plain.uv, plain.matrix, plain.wrap)}:
        return asset, tuple(layers)
    polygons = asset.polygons
    of_corner = polygons.from_triangles(materials.of_triangle)[polygons.of_corner]
    uv_of_corner = np.full((len(of_corner), 2), np.nan)
    for i, layer in enumerate(layers):
        for attribute in asset.of_kind("uv"):
            if attribute.name == layer.uv and attribute.domain != "face":
                corners_here = np.flatnonzero(of_corner == i)
                rows = corners_here if attribute.domain == "corner" else polygons.corners[corners_here]
                uv = attribute.values[rows].astype(np.float64)
                layers[i] = layer.unrolled(layer.looked_up(uv))
                uv_of_corner[corners_here] = layers[i].looked_up(uv)
    others = tuple(a for a in asset.attributes if a.name not in (*first, "uv"))
    return replace(asset, attributes=(Attribute("uv", "corner", "uv", uv_of_corner), *others)), tuple(layers)


def _name_pictures(
    pictures: Iterable[Picture | None], stem: str
) -> tuple[dict[Picture, str], dict[str, bytes]]:
    """Name the pictures that were found after the surface; return also their files, as PNG or JPEG."""
    kept = [picture for picture in dict.fromkeys(pictures) if picture and not picture.missing]
    names: dict[Picture, str] = {}
    files: dict[str, bytes] = {}
    for picture in kept:
        data, kind = as_png(picture.data)
        number = f"_{len(files)}" if len(kept) > 1 else ""
        names[picture] = f"{stem}{number}{'.jpg' if kind == 'jpeg' else '.png'}"
        files[names[picture]] = data
    return names, files


def _to_ply(asset: Asset, materials: Looks, stem: str) -> Asset:
    """Convert materials to the pictures of a PLY file, which has no other materials."""
    shown, layers = _make_repeating(asset, materials)
    names, files = _name_pictures((layer.picture for layer in layers), stem)
    if not files:
        return asset
    former = asset.document if isinstance(asset.document, PlyDocument) else PlyDocument()
    shown = replace(shown, document=former.with_textures(files))
    if len(files) == len(layers) == 1 and (materials.of_triangle == 0).all():
        return shown
    number = {name: i for i, name in enumerate(files)}
    pictures = [layer.picture for layer in layers]
    of_look = np.array([number[names[p]] if p in names else -1 for p in pictures] + [-1])
    of_polygon = asset.polygons.from_triangles(of_look[materials.of_triangle])
    return shown.with_attributes(Attribute(TEXTURE_NUMBER, "face", "scalar", of_polygon.astype(np.int32)))


def _to_obj(asset: Asset, materials: Looks, stem: str) -> Asset:
    """Convert materials to an OBJ library, with labels of the faces."""
    shown, layers = _make_repeating(asset, materials)
    shown = _without_texture_numbers(shown)
    names, files = _name_pictures((layer.picture for layer in layers), stem)
    former = asset.document if isinstance(asset.document, ObjDocument) else ObjDocument()
    words = unused_names(look.name for look in materials.looks)
    files[f"{stem}.mtl"] = obj.library_of(dict(zip(words, layers)), names, former.encoding)
    document = ObjDocument((f"{stem}.mtl",), former.elements, former.encoding, files)
    return replace(_with_material_labels(shown, materials.of_triangle, tuple(words)), document=document)


def _without_texture_numbers(asset: Asset) -> Asset:
    """Remove the picture numbers of a PLY file, which materials replace."""
    is_ply = isinstance(asset.document, PlyDocument)
    return asset.without_attributes(TEXTURE_NUMBER) if is_ply else asset


def _with_material_labels(asset: Asset, of_triangle: IntArray, names: tuple[str, ...]) -> Asset:
    """Label the faces by materials, −1 without a material."""
    of_polygon = asset.polygons.from_triangles(of_triangle)
    words = {-1: "", **dict(enumerate(names))}
    return asset.with_attributes(Attribute(_MATERIAL_LABEL, "face", "label", of_polygon, names=words))


def _place_beside(
    contents: Mapping[str, bytes], libraries: Container[str], path: Path
) -> tuple[dict[str, str], dict[Path, bytes]]:
    """Find names for files beside another one; return the new names, and the files to be written."""
    files, taken, names = dict[Path, bytes](), dict[Path, bytes](), dict[str, str]()
    folder = path.parent.resolve()
    # pictures are named before the libraries, which contain these names
    for name, content in sorted(contents.items(), key=lambda item: item[0] in libraries):
        changed = {old: new for old, new in names.items() if old != new}
        content = obj.rename_pictures(content, changed) if changed and name in libraries else content
        clean = name.replace("\\", "/")
        last = PurePosixPath(clean)
        inside = [clean] if (folder / clean).resolve().is_relative_to(folder) else []
        # an existing file with other contents is replaced only if its name begins with the surface's name
        has_stem = last.name.startswith((f"{path.stem}.", f"{path.stem}_"))
        stem = last.stem if has_stem else f"{path.stem}_{last.stem}"
        numbered = (f"{stem}_{i}{last.suffix}" for i in count(1))
        own_name = f"{stem}{last.suffix}"
        others = [candidate for candidate in (*inside, last.name) if candidate != own_name]
        for candidate in chain(others, [own_name], numbered):
            names[name], file = candidate, path.parent / candidate
            is_there = file.is_file() and file.read_bytes() == content
            may_be = candidate not in others or (file.parent.is_dir() and not file.exists())
            if taken.get(file, content) == content and (is_there or may_be):
                break
        taken[file] = content
        if not is_there:
            files[file] = content
    return names, files
