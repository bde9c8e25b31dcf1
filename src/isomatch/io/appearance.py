"""Materials of assets whatever their format: found, put onto another asset, and into the format of a file."""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping
from dataclasses import replace
from itertools import chain, count
from pathlib import Path, PurePosixPath

import numpy as np

from isomatch._core.arrays import AnyArray, IntArray
from isomatch.io.asset import Asset
from isomatch.io.attribute import Attribute, unused_name
from isomatch.io.formats import gifti, gltf_carried, obj
from isomatch.io.formats.gltf import GltfDocument
from isomatch.io.formats.obj import ObjDocument
from isomatch.io.formats.ply import TEXTURE_NUMBER, PlyDocument
from isomatch.io.materials import UNTINTED, Layer, Look, Looks, Picture, as_png, unread

_MATERIAL = "material"
_UNDEFINED = Layer((0.5, 0.5, 0.5, 1.0))


def looks_of(asset: Asset) -> Looks | None:
    """Return the materials of the triangles, grey for those that no library has; None if the file has none at all."""
    if isinstance(asset.document, GltfDocument):
        return gltf_carried.materials_of(asset.document)
    if isinstance(asset.document, PlyDocument):
        return _textures_of(asset, asset.document)
    labels = [a for a in asset.attributes if (a.name, a.domain) == (_MATERIAL, "face")]
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
    materials = tuple(look_of.get(name) or Look(name, _UNDEFINED) for name in used)
    return _tiled(asset, Looks(look[place][asset.polygons.of_triangle], materials))


def _tiled(asset: Asset, materials: Looks) -> Looks:
    """Return materials whose pictures have <UDIM> in their names as one for each tile that triangles lie in."""
    tiled = [
        i
        for i, look in enumerate(materials.looks)
        if any(len(obj.tiles_of(p.name)) > 1 for p in look.pictures)
    ]
    uv = next(iter(asset.of_kind("uv")), None)
    if not tiled or uv is None or not isinstance(asset.document, ObjDocument):
        return materials
    polygons, files = asset.polygons, asset.document.files
    rows = polygons.corner_of_triangle if uv.domain == "corner" else polygons.triangles
    column, row = np.floor(np.nan_to_num(uv.values[rows][..., :2].mean(axis=1))).clip(0, 9).astype(int).T
    looks, of_triangle = list(materials.looks), materials.of_triangle.copy()
    for i in tiled:
        for tile in np.unique((column + 10 * row)[materials.of_triangle == i]).tolist():
            here = (materials.of_triangle == i) & (column + 10 * row == tile)
            of_tile = (_of_tile(each, tile, files) for each in materials.looks[i].layers)
            of_triangle[here] = len(looks)
            looks.append(Look(materials.looks[i].name, *of_tile))
    # those of all tiles, which no triangle shows, are left out
    kept = [i for i in range(len(looks)) if i not in tiled]
    place = np.append(np.cumsum(np.isin(np.arange(len(looks)), kept)) - 1, -1)
    return Looks(place[of_triangle], tuple(looks[i] for i in kept))


def _of_tile(layer: Layer, tile: int, files: Mapping[str, bytes]) -> Layer:
    """Return a layer with the picture of a tile, from 0, if its own has one for each."""
    names = obj.tiles_of(layer.picture.name) if layer.picture else []
    return replace(layer, picture=Picture.among(files, names[tile])) if len(names) > 1 else layer


def _textures_of(asset: Asset, document: PlyDocument) -> Looks | None:
    """Return the pictures that comments of a PLY file name, which faces show by their numbers."""
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


def unread_files(asset: Asset) -> tuple[str, ...]:
    """Say of each picture of an asset, and each material and library of an OBJ file, that cannot be read, why not."""
    materials, document = looks_of(asset), asset.document
    pictures = unread(materials.pictures if materials else ())
    notes = [f"{picture.name!r}: {why}" for picture, why in pictures.items()]
    if isinstance(document, ObjDocument):
        look_of = obj.materials_of(document)
        undefined = [look.name for look in materials.looks if look.name not in look_of] if materials else []
        notes += [f"{name!r}: the material is in none of the libraries" for name in undefined]
        for line in document.libraries:  # one, whose name may have blanks, or several
            words = line.split()
            missing = [] if line in document.files else [word for word in words if word not in document.files]
            names = missing if len(missing) < len(words) else [line]
            notes += [f"{name!r}: there is no such file in the folder of the surface" for name in names]
    return tuple(notes)


def with_looks_of(receiver: Asset, giver: Asset, giver_triangle: IntArray) -> Asset:
    """Return the receiver with the materials and pictures of the giver, if its file has any.

    ``giver_triangle`` (m,) is the triangle whose look each triangle of the receiver takes; −1 for the most frequent.
    """
    theirs, materials = giver.document, looks_of(giver)
    if materials is None or not len(giver_triangle):
        return receiver
    if isinstance(theirs, GltfDocument):
        return gltf_carried.with_materials_of(receiver, theirs, giver_triangle)
    of_triangle = gltf_carried.seen(materials.of_triangle, giver_triangle)
    if isinstance(theirs, ObjDocument) and isinstance(receiver.document, ObjDocument):
        document = replace(receiver.document, libraries=theirs.libraries, files=theirs.files)
        names = tuple(look.name for look in materials.looks)
        return replace(_labelled(receiver, of_triangle, names), document=document)
    return gltf_carried.with_materials(receiver, Looks(of_triangle, materials.looks))


def with_texture(receiver: Asset, png: bytes, tint: tuple[float, ...] = UNTINTED) -> Asset:
    """Return the receiver as a glTF file with one material of one picture, multiplied by a tint of red to alpha, 0…1."""
    of_triangle = np.zeros(len(receiver.polygons.corner_of_triangle), dtype=np.int64)
    return with_tiles(receiver, of_triangle, {"baked": png}, tint)


def with_tiles(
    receiver: Asset, of_triangle: IntArray, pictures: Mapping[str, bytes], tint: tuple[float, ...] = UNTINTED
) -> Asset:
    """Return the receiver as a glTF file with a material for each of some pictures by name, which repeat."""
    uv = next((attribute.name for attribute in receiver.of_kind("uv")), "uv")
    layers = {name: Layer(tuple(tint), Picture(f"{name}.png", png), uv) for name, png in pictures.items()}
    looks = tuple(Look(name, layer) for name, layer in layers.items())
    return gltf_carried.with_materials(receiver, Looks(of_triangle, looks))


def as_written(path: Path, asset: Asset) -> tuple[Asset, dict[Path, bytes]]:
    """Return an asset with its materials in the format of a file to be written, and the files to be written beside it."""
    document, suffix = asset.document, path.suffix.lower()
    if suffix in (".glb", ".gltf"):
        materials = None if isinstance(document, GltfDocument) else looks_of(asset)
        return (gltf_carried.with_materials(_unnumbered(asset), materials) if materials else asset), {}
    own = {".obj": ObjDocument, ".ply": PlyDocument}.get(suffix, ())
    materials = looks_of(asset) if own and not isinstance(document, own) else None
    if isinstance(document, GltfDocument):
        asset = replace(asset, document=document.former)
    if materials:
        asset = (_in_obj if own is ObjDocument else _in_ply)(asset, materials, path.stem)
    document = asset.document
    if not isinstance(document, ObjDocument | PlyDocument) or not isinstance(document, own):
        return gifti.values_beside(path, asset)
    libraries = document.library_names if isinstance(document, ObjDocument) else ()
    names, files = _beside(document.files, libraries, path)
    return replace(asset, document=document.with_renamed_files(names)), files


def left_looks(path: Path, asset: Asset) -> tuple[Attribute, ...]:
    """Return what a file to be written has no place for: pictures and colours of materials."""
    suffix = path.suffix.lower()
    materials = None if suffix in (".glb", ".gltf", ".obj") else looks_of(asset)
    if materials is None:
        return ()
    has_pictures, is_ply = bool(materials.pictures), suffix == ".ply"
    has_colours = any(layer.tint != UNTINTED for look in materials.looks for layer in look.layers)
    words = ["pictures"] * (has_pictures and not is_ply) + ["colours"] * has_colours
    name = f"the {' and '.join(words)} of the materials"
    return (Attribute(name, "face", "label", np.zeros(len(asset.polygons), int)),) if words else ()


def with_one_texture(asset: Asset) -> tuple[Asset, AnyArray | None]:
    """Return an asset with coordinates for its one texture, (h, w, 4) of uint8, which repeats; None if it has not one."""
    materials = looks_of(asset)
    used = np.unique(materials.of_triangle) if materials else np.zeros(0)
    if materials is None or len(used) != 1 or used[0] < 0:
        return asset, None
    shown, layers = _repeating(asset, materials)
    pixels = layers[used[0]].pixels
    return (asset, None) if pixels is None else (shown, np.rint(255 * pixels).astype(np.uint8))


def _repeating(asset: Asset, materials: Looks) -> tuple[Asset, tuple[Layer, ...]]:
    """Return the main layers for those who know but pictures that repeat, and the asset with coordinates for them."""
    layers = [look.main for look in materials.looks]
    first = [attribute.name for attribute in asset.of_kind("uv")][:1]
    own = Layer(uv=first[0]) if first else Layer()
    ways = {(layer.uv, layer.matrix, layer.wrap) for layer in layers if layer.picture}
    if not first or ways <= {(own.uv, own.matrix, own.wrap)}:
        return asset, tuple(layers)
    polygons = asset.polygons
    of_polygon = np.full(len(polygons), -1)
    of_polygon[polygons.of_triangle] = materials.of_triangle
    of_corner = of_polygon[polygons.of_corner]
    uv_of_corner = np.full((len(of_corner), 2), np.nan)
    for i, layer in enumerate(layers):
        for attribute in asset.of_kind("uv"):
            if attribute.name == layer.uv and attribute.domain != "face":
                here = np.flatnonzero(of_corner == i)
                rows = here if attribute.domain == "corner" else polygons.corners[here]
                uv = attribute.values[rows].astype(np.float64)
                layers[i] = layer.unrolled(layer.looked_up(uv))
                uv_of_corner[here] = layers[i].looked_up(uv)
    others = tuple(a for a in asset.attributes if a.name not in (*first, "uv"))
    return replace(asset, attributes=(Attribute("uv", "corner", "uv", uv_of_corner), *others)), tuple(layers)


def _named(pictures: Iterable[Picture | None], stem: str) -> tuple[dict[Picture, str], dict[str, bytes]]:
    """Name the pictures that were found after a surface; return also their files, as PNG or JPEG."""
    kept = [each for each in dict.fromkeys(pictures) if each and not each.missing]
    names: dict[Picture, str] = {}
    files: dict[str, bytes] = {}
    for picture in kept:
        data, kind = as_png(picture.data)
        number = f"_{len(files)}" if len(kept) > 1 else ""
        names[picture] = f"{stem}{number}{'.jpg' if kind == 'jpeg' else '.png'}"
        files[names[picture]] = data
    return names, files


def _in_ply(asset: Asset, materials: Looks, stem: str) -> Asset:
    """Return an asset with the pictures of its materials as those of a PLY file, which has no other materials."""
    shown, layers = _repeating(asset, materials)
    names, files = _named((layer.picture for layer in layers), stem)
    if not files:
        return asset
    former = asset.document if isinstance(asset.document, PlyDocument) else PlyDocument()
    shown = replace(shown, document=former.with_textures(files))
    if len(files) == len(layers) == 1 and (materials.of_triangle == 0).all():
        return shown
    number = {name: i for i, name in enumerate(files)}
    of_look = np.array(
        [number[names[each.picture]] if each.picture in names else -1 for each in layers] + [-1]
    )
    of_polygon = np.full(len(asset.polygons), -1, dtype=np.int32)
    of_polygon[asset.polygons.of_triangle] = of_look[materials.of_triangle]
    return shown.with_attributes(Attribute(TEXTURE_NUMBER, "face", "scalar", of_polygon))


def _in_obj(asset: Asset, materials: Looks, stem: str) -> Asset:
    """Return an asset with a library of its materials, which it has as labels of its faces."""
    shown, layers = _repeating(asset, materials)
    shown = _unnumbered(shown)
    names, files = _named((layer.picture for layer in layers), stem)
    former = asset.document if isinstance(asset.document, ObjDocument) else ObjDocument()
    words: list[str] = []
    for look in materials.looks:
        words.append(unused_name(look.name, words))
    files[f"{stem}.mtl"] = obj.library_of(dict(zip(words, layers)), names, former.encoding)
    document = ObjDocument((f"{stem}.mtl",), former.elements, former.encoding, files)
    return replace(_labelled(shown, materials.of_triangle, tuple(words)), document=document)


def _unnumbered(asset: Asset) -> Asset:
    """Leave out the numbers of a PLY file's pictures, where materials say the same."""
    is_ply = isinstance(asset.document, PlyDocument)
    return asset.without_attributes(TEXTURE_NUMBER) if is_ply else asset


def _labelled(asset: Asset, of_triangle: IntArray, names: tuple[str, ...]) -> Asset:
    """Return an asset whose faces are labelled by materials; −1 is none."""
    of_polygon: AnyArray = np.full(len(asset.polygons), -1)
    of_polygon[asset.polygons.of_triangle] = of_triangle
    words = {-1: "", **dict(enumerate(names))}
    return asset.with_attributes(Attribute(_MATERIAL, "face", "label", of_polygon, names=words))


def _beside(
    contents: Mapping[str, bytes], libraries: Container[str], path: Path
) -> tuple[dict[str, str], dict[Path, bytes]]:
    """Find names for files beside another file; return those to be written, and the new name of each."""
    files, taken, names = dict[Path, bytes](), dict[Path, bytes](), dict[str, str]()
    folder = path.parent.resolve()
    # pictures first, as libraries name them
    for name, content in sorted(contents.items(), key=lambda item: item[0] in libraries):
        changed = {old: new for old, new in names.items() if old != new}
        content = obj.renamed(content, changed) if changed and name in libraries else content
        clean = name.replace("\\", "/")
        last = PurePosixPath(clean)
        inside = [clean] if (folder / clean).resolve().is_relative_to(folder) else []
        # of files that are there with other contents, only those are replaced whose names begin as that of the other
        own = last.name.startswith((f"{path.stem}.", f"{path.stem}_"))
        stem = last.stem if own else f"{path.stem}_{last.stem}"
        numbered = (f"{stem}_{i}{last.suffix}" for i in count(1))
        mine = f"{stem}{last.suffix}"
        others = [each for each in (*inside, last.name) if each != mine]
        for each in chain(others, [mine], numbered):
            names[name], file = each, path.parent / each
            is_there = file.is_file() and file.read_bytes() == content
            may_be = each not in others or (file.parent.is_dir() and not file.exists())
            if taken.get(file, content) == content and (is_there or may_be):
                break
        taken[file] = content
        if not is_there:
            files[file] = content
    return names, files
