"""Shapes and maps of a collection as files for other programs."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from isomatch.assets import read_asset, write_asset
from isomatch.collections.collection import Collection
from isomatch.collections.finish import surfaces_written
from isomatch.collections.kept import require_unchanged
from isomatch.collections.shapes import BETWEEN
from isomatch.collections.tables import write_table
from isomatch.errors import FormatError, InputError
from isomatch.storage.files import claimed, made_folder, staged


def export(
    collection: Collection,
    folder: str | Path,
    meshes: str | None = ".ply",
    maps: str | None = ".npz",
    force: bool = False,
) -> Iterator[Path]:
    """Write the shapes in the topology of the template, and the maps of all pairs as they are now; yield each file.

    Parameters
    ----------
    collection : Collection
        The collection; of its shapes, those that `surfaces_written` names.
    folder : path_like
        Folder for ``meshes/NAME``, in the units of the collection, with ``measured`` as far as the format has a place for
        it, for ``maps/SOURCE__TARGET``, a file for each
        direction, and for ``pairs.csv``, which is written last.
    meshes : str, optional
        Suffix of the meshes, of `FORMATS`; None for none.
    maps : str, optional
        Suffix of the maps, see `Correspondence.save`: ".npz" for all arrays, ".txt" for a target vertex on each line;
        None for none.
    force : bool
        Whether to write over files of an earlier export; others in the folder stay. All are replaced once the last one
        is written.

    Raises
    ------
    InputError
        If there is nothing to export, or the folder is that of the collection.
    FormatError
        If the format of the meshes is unknown, or does not keep the order of vertices; or if files of the collection
        were changed after they were written.
    UnwritableFileError
        If a file cannot be written, or there are files of an earlier export.
    """
    if meshes and meshes.lower() == ".stl":
        raise FormatError(
            "STL files do not keep the order of vertices, which corresponds; give another format"
        )
    rows, last = collection.rows(), Path(folder) / "pairs.csv"
    if last.parent.resolve() == collection.folder.resolve():
        raise InputError(f"{folder}: is the folder of the collection itself; give another one")
    folders = {"corresponded": meshes, "maps": maps}
    require_unchanged(collection.layout, [folder for folder, suffix in folders.items() if suffix])
    names = surfaces_written(collection) if meshes else []
    pairs = [pair for pair in rows.pairs if rows.is_current(pair)] if maps else []
    if not names and not pairs:
        raise InputError(
            f"{collection.folder}: nothing to export; run isomatch collect to its end, or see shapes.csv"
        )
    earlier = [last, *(file for kind in ("meshes", "maps") for file in sorted(last.parent.glob(f"{kind}/*")))]
    with (
        made_folder(last.parent),
        claimed(last, [] if force else earlier),
        staged(last.parent, last.name) as new,
    ):
        for kind in ("meshes", "maps"):
            (new / kind).mkdir()
        for name in names:
            path = new / "meshes" / f"{name}{meshes}"
            write_asset(path, read_asset(collection.layout.corresponded(name)))
            yield last.parent / path.relative_to(new)
        for pair in pairs:
            pair_maps = collection.maps(*pair)
            for ends, correspondence in ((pair, pair_maps.there), (pair[::-1], pair_maps.back)):
                path = new / "maps" / f"{BETWEEN.join(ends)}{maps}"
                correspondence.save(path)
                yield last.parent / path.relative_to(new)
        write_table(rows, new / last.name)
    yield last
