"""Files of paths: polylines, as OBJ and as VTP."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from isomatch.errors import FormatError
from isomatch.geodesics.paths import GeodesicPath
from isomatch.storage.files import write_text
from isomatch.values.arrays import AnyArray

PATH_SUFFIXES = (".obj", ".vtp")


def write_paths(file: str | Path, paths: Sequence[GeodesicPath]) -> None:
    """Write paths as polylines.

    Parameters
    ----------
    file : path_like
        ``.obj``: a line for each path. ``.vtp``: also the ``corners`` and ``barycentric`` weights of each point, and the
        ``length`` of each path.
    paths : sequence of GeodesicPath

    Raises
    ------
    FormatError
        If the suffix is another.
    UnwritableFileError
        If the file cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> from isomatch import Mesh, geodesic_path
    >>> square = Mesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_paths(f"{folder}/path.obj", [geodesic_path(square, 0, 1)])
    ...     print(Path(folder, "path.obj").read_text())
    v 0.0 0.0 0.0
    v 1.0 0.0 0.0
    l 1 2
    <BLANKLINE>
    """
    file = Path(file)
    if file.suffix.lower() not in PATH_SUFFIXES:
        raise FormatError(
            f"{file}: suffix {file.suffix!r} cannot hold paths; use {' or '.join(PATH_SUFFIXES)}"
        )
    write_text(file, (_obj if file.suffix.lower() == ".obj" else _vtp)(paths))


def _obj(paths: Sequence[GeodesicPath]) -> str:
    lines, first = [], 1
    for path in paths:
        lines += [f"v {x!r} {y!r} {z!r}" for x, y, z in path.positions.tolist()]
        lines.append("l " + " ".join(map(str, range(first, first + len(path.positions)))))
        first += len(path.positions)
    return "\n".join([*lines, ""])


def _vtp(paths: Sequence[GeodesicPath]) -> str:
    ends = np.cumsum([len(path.positions) for path in paths])
    n = int(ends[-1]) if len(paths) else 0

    def together(parts: Iterable[AnyArray], width: int) -> AnyArray:
        return np.concatenate([np.zeros((0, width)), *parts])

    corners = together((path.points.corners for path in paths), 3).astype(np.int64)
    weights = together((path.points.barycentric for path in paths), 3)
    arrays = (
        ("PointData", [_array("corners", corners), _array("barycentric", weights)]),
        ("CellData", [_array("length", np.array([path.length for path in paths], dtype=np.float64))]),
        ("Points", [_array("points", together((path.positions for path in paths), 3))]),
        (
            "Lines",
            [_array("connectivity", np.arange(n)), _array("offsets", np.asarray(ends, dtype=np.int64))],
        ),
    )
    parts = [line for tag, inside in arrays for line in (f"<{tag}>", *inside, f"</{tag}>")]
    return "\n".join(
        [
            '<?xml version="1.0"?>',
            '<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian" header_type="UInt64">',
            "<PolyData>",
            f'<Piece NumberOfPoints="{n}" NumberOfVerts="0" NumberOfLines="{len(paths)}" NumberOfStrips="0" '
            'NumberOfPolys="0">',
            *parts,
            "</Piece>",
            "</PolyData>",
            "</VTKFile>",
            "",
        ]
    )


def _array(name: str, values: AnyArray) -> str:
    kind = "Float64" if values.dtype.kind == "f" else "Int64"
    width = f' NumberOfComponents="{values.shape[1]}"' if values.ndim == 2 else ""
    words = " ".join(map(repr, values.ravel().tolist()))
    return f'<DataArray type="{kind}" Name="{name}"{width} format="ascii">{words}</DataArray>'
