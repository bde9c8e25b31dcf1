"""The file of a prepared shape: a tree of frozen dataclasses, its arrays, and their digest."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import fields
from hashlib import blake2b
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from isomatch.bases import DistanceBasis, LaplaceBasis
from isomatch.errors import FormatError, InputError
from isomatch.geodesics import Sampling
from isomatch.resolution import Decimated, Prolongation
from isomatch.settings import Config
from isomatch.shapes.body import Body
from isomatch.shapes.levels import Detail, Level
from isomatch.storage.array_file import Archive, ArrayFormat, Stored, save_arrays
from isomatch.surfaces import Graph, Mesh, PointCloud
from isomatch.values.arrays import AnyArray

FORMAT = ArrayFormat(
    what="a prepared shape",
    writer="PreparedShape.save",
    version=3,  # raise it whenever shapes are prepared in another way: earlier files are not read
    arrays={"about": Stored("text"), "digest": Stored("text")},
)
_ARRAY = re.compile(r"array_[0-9]{1,9}")
KINDS: dict[str, Any] = {
    kind.__name__: kind
    for kind in (
        Body,
        Decimated,
        Detail,
        DistanceBasis,
        LaplaceBasis,
        Level,
        Mesh,
        PointCloud,
        Sampling,
        Prolongation,
    )
}
KINDS["Graph"] = lambda **parts: Graph(*parts.values())  # whose fields and parameters have different names

NUMBERED: dict[
    str, tuple[int, Callable[[Any], int]]
] = {  # fields of vertices: the least, and how many there are
    "body_vertex": (-1, lambda part: len(part.user_vertex)),
    "user_vertex": (0, lambda part: len(part.body_vertex)),
    "sample_vertices": (0, lambda part: part.body.n_vertices),
    "column_vertices": (0, lambda part: part.body.n_vertices),
    "extremities": (0, lambda part: part.body.n_vertices),
    "owner": (0, lambda part: part.mesh.n_vertices),
}


def write_prepared(path: Path, shape: Any) -> None:
    """Write a prepared shape. What occurs several times in it is written once."""
    arrays: list[AnyArray] = []
    numbers: dict[int, int] = {}  # of objects by identity, in the order in which they are complete

    def plain(value: Any) -> Any:
        if value is None or isinstance(value, str | int | float):
            return value
        if isinstance(value, np.generic):
            return value.item()
        if isinstance(value, tuple):
            return ["tuple", *map(plain, value)]
        if isinstance(value, dict | Config):
            return {
                "values": value if isinstance(value, dict) else value.to_dict(),
                "is": type(value).__name__,
            }
        if id(value) in numbers:
            return {"again": numbers[id(value)]}
        if isinstance(value, np.ndarray):
            arrays.append(value)
            found: dict[str, Any] = {"array": len(arrays) - 1}
        else:
            parts = {each.name: plain(getattr(value, each.name)) for each in fields(value)}
            found = {"parts": parts, "is": type(value).__name__}
        numbers[id(value)] = len(numbers)
        return found

    about = json.dumps(plain(shape))
    named = {f"array_{i}": array for i, array in enumerate(arrays)}
    save_arrays(path, FORMAT.version, {"about": about, "digest": _digest(about, arrays), **named})


def read_prepared(path: Path, kind: type[Any]) -> Any:
    """Read a shape of the class of prepared shapes; `FormatError` if it is not as it was written."""

    def refuse(problem: str) -> NoReturn:
        raise FormatError(f"{path}: not {FORMAT.what} ({problem}); prepare the shape and save it again")

    head = FORMAT.read(path)
    with Archive.opened(path, refuse) as stored:
        if "format_version" not in stored or int(stored.read("format_version")) != FORMAT.version:
            refuse("shapes were prepared in another way then")
        names = sorted(
            (name for name in stored.names if _ARRAY.fullmatch(name)), key=lambda name: int(name[6:])
        )
        arrays = list(stored.read_all(names).values())
    if head["digest"] != _digest(head["about"], arrays):
        refuse("it was changed after it was written")
    kinds = {**KINDS, kind.__name__: kind}
    made: list[Any] = []

    def built(plain: Any) -> Any:
        if isinstance(plain, list):
            return tuple(map(built, plain[1:]))
        if not isinstance(plain, dict):
            return plain
        if "again" in plain:
            return made[plain["again"]]
        if "values" in plain:
            return Config.from_dict(plain["values"]) if plain["is"] == "Config" else plain["values"]
        if "array" in plain:
            found = arrays[plain["array"]]
        else:
            found = kinds[plain["is"]](**{name: built(part) for name, part in plain["parts"].items()})
            _require_vertices(found)
        made.append(found)
        return found

    try:
        shape = built(json.loads(head["about"]))
        if not isinstance(shape, kind):
            raise ValueError("it holds something else")
        for n, numbers in (
            (shape.surface.n_vertices, shape.body_vertex),
            (shape.body.n_vertices, shape.user_vertex),
        ):
            if len(numbers) != n:
                raise ValueError(f"{len(numbers)} numbers of vertices for {n} vertices")
    except (InputError, AttributeError, KeyError, IndexError, TypeError, ValueError, RecursionError) as error:
        refuse(str(error))
    return shape


def _require_vertices(part: Any) -> None:
    """Raise `ValueError` if fields of a part that hold numbers of vertices hold others."""
    for name, (least, count) in NUMBERED.items():
        numbers = getattr(part, name, None)
        if numbers is None:
            continue
        if numbers.ndim != 1 or numbers.dtype.kind != "i":
            raise ValueError(f"{name} are not numbers of vertices")
        if len(numbers) and not least <= numbers.min() <= numbers.max() < count(part):
            raise ValueError(f"{name} {numbers.min()}…{numbers.max()} are outside {least}…{count(part) - 1}")


def _digest(about: str, arrays: list[AnyArray]) -> str:
    found = blake2b(about.encode(), digest_size=16)
    for array in arrays:
        found.update(f"{array.dtype.str} {array.shape}".encode())
        found.update(np.ascontiguousarray(array).data)
    return found.hexdigest()
