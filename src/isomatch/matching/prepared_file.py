"""The file of a prepared shape: a tree of frozen dataclasses, its arrays, and their digest."""

from __future__ import annotations

import json
from dataclasses import fields
from hashlib import blake2b
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from isomatch._array_file import Archive, ArrayFormat, Stored, save_arrays
from isomatch._arrays import AnyArray
from isomatch.bases import DistanceBasis, LaplaceBasis
from isomatch.errors import FormatError, InputError
from isomatch.geodesics import Sampling
from isomatch.matching.body import Body
from isomatch.matching.config import Config
from isomatch.matching.levels import Detail, Level
from isomatch.resolution import Decimated, Prolongation
from isomatch.surfaces import Graph, Mesh, PointCloud

FORMAT = ArrayFormat(
    what="a prepared shape",
    writer="PreparedShape.save",
    version=1,  # raise it whenever shapes are prepared in another way: earlier files are not read
    arrays={"about": Stored("text"), "digest": Stored("text")},
)
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
        if int(stored.read("format_version")) != FORMAT.version:
            refuse("shapes were prepared in another way then")
        names = sorted(
            (name for name in stored.names if name.startswith("array_")), key=lambda name: int(name[6:])
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
        made.append(found)
        return found

    try:
        shape = built(json.loads(head["about"]))
    except (InputError, KeyError, IndexError, TypeError, ValueError, RecursionError) as error:
        refuse(str(error))
    return shape if isinstance(shape, kind) else refuse("it holds something else")


def _digest(about: str, arrays: list[AnyArray]) -> str:
    found = blake2b(about.encode(), digest_size=16)
    for array in arrays:
        found.update(f"{array.dtype.str} {array.shape}".encode())
        found.update(np.ascontiguousarray(array).data)
    return found.hexdigest()
