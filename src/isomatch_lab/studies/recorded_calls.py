"""Every array that the calls of ``public_calls.py`` return, so that two revisions can be compared to the last bit.

    python -m isomatch_lab.studies.recorded_calls record OUT.npz [--data DIR] [--cases DIR] [--only PREFIX]
    python -m isomatch_lab.studies.recorded_calls compare OLD.npz NEW.npz [--only PREFIX]

``compare`` ends with 1 unless all arrays are identical: in shape, type and every bit. An array that has another name
in NEW, in the same call, is identical too, and its new name is told. Text (names of outcomes, notes, messages) is
compared as well; where only words differ, that is told, and is no failure. A call that fails is recorded by the class of
its error. Times and settings are not recorded. Set ISOMATCH_NUM_THREADS=1 and OPENBLAS_NUM_THREADS=1, and record both
revisions on one machine with the same packages. Calls of shapes or cases that are not there are recorded as errors.
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from scipy.sparse import find, issparse

from isomatch import Config, MatchResult, Quality
from isomatch_lab.studies.public_calls import CALLS, Attempt, Folders

REAL_DATA = Path(__file__).parents[4] / "shared" / "data"  # folder of the sets, by default
SKIPPED = ("timings", "document")  # fields that differ at every run, or hold a format's own data
MAX_SHOWN = 20  # largest number of differences that are printed for each call; chosen
Arrays = Mapping[str, np.ndarray]


def attempt(act: Callable[[], Any]) -> dict[str, np.ndarray]:
    """Return the arrays of what a call returns, or the class of its error."""
    try:
        return dict(flatten(act()))
    except Exception as error:
        return {"error": np.array([type(error).__name__]), "message": np.array(str(error))}


def flatten(value: Any, name: str = "") -> Iterator[tuple[str, np.ndarray]]:
    """Walk through what a call returns: each array by the path to it, and texts as arrays of no dimension."""
    parts: Iterable[tuple[object, Any]] = ()
    if isinstance(value, Attempt):
        parts = attempt(value).items()
    elif isinstance(value, Enum):
        parts = ("place", list(type(value)).index(value)), ("name", value.name)
    elif isinstance(value, bytes):
        yield name, np.frombuffer(value, dtype=np.uint8)
    elif isinstance(value, bool | int | float | str | Path | np.generic | np.ndarray):
        array = np.array(str(value) if isinstance(value, Path) else value)
        yield name, array.astype(str) if array.dtype.kind == "O" else array
    elif isinstance(value, Quality):
        names = [field.name for field in fields(value)]
        parts = ("numbers", np.array([getattr(value, field) for field in names])), ("names", names)
    elif issparse(value):
        parts = enumerate(find(value))
    elif is_dataclass(value) and not isinstance(value, Config):
        parts = [(field.name, getattr(value, field.name)) for field in fields(value)]
        if isinstance(value, MatchResult):
            others = [other.map for other in value.alternatives]
            parts = [*parts, ("confidence", value.confidence), ("others", others)]
    elif isinstance(value, Mapping) or hasattr(value, "_asdict"):
        parts = (value if isinstance(value, Mapping) else value._asdict()).items()
    elif isinstance(value, tuple | list):
        are_words = value and all(isinstance(text, str) for text in value)
        parts = [("words", "\n".join(value))] if are_words else enumerate(value)
    for key, part in parts:
        if key not in SKIPPED:
            yield from flatten(part, f"{name}|{key}".strip("|"))


def record(at: Folders, only: str) -> dict[str, np.ndarray]:
    """Make the calls whose names begin with ``only``; paths of folders are taken out of texts."""
    recorded = {}
    for name in filter(lambda name: name.startswith(only), CALLS):
        started = time.perf_counter()
        arrays = attempt(lambda function=CALLS[name]: function(at))
        for key, array in arrays.items():
            if array.dtype.kind == "U":
                for folder in (at.scratch, at.cases, at.data):
                    array = np.char.replace(array, str(folder), "")
            recorded[f"{name}|{key}"] = array
        error = f"; {arrays['error'][0]}: {arrays['message']}" if "error" in arrays else ""
        print(f"{name}: {len(arrays)} arrays, {time.perf_counter() - started:.1f} s{error}", flush=True)
    return recorded


def difference(old: np.ndarray, new: np.ndarray) -> str:
    """Tell how two arrays differ; empty if they do not."""
    if old.dtype.kind == new.dtype.kind == "U" and old.shape == new.shape:
        return "" if (old == new).all() else f"{str(old)[:60]!r} became {str(new)[:60]!r}"
    if (old.shape, old.dtype) != (new.shape, new.dtype):
        return f"{old.dtype} {old.shape} became {new.dtype} {new.shape}"
    if old.tobytes() == new.tobytes():
        return ""
    before, after = old.astype(complex), new.astype(complex)
    is_different = ~((before == after) | (np.isnan(before) & np.isnan(after)))
    with np.errstate(all="ignore"):
        share = np.abs(before - after) / np.maximum(np.abs(before), np.abs(after))
    greatest = share[is_different].max(initial=0)
    return f"greatest relative difference {greatest:.2g}, at {np.count_nonzero(is_different)} of {is_different.size}"


def is_text(array: np.ndarray) -> bool:
    """Whether these are words about a result."""
    return array.dtype.kind == "U" and array.ndim == 0


def differences(old: Arrays, new: Arrays) -> tuple[list[str], list[str]]:
    """Tell which arrays of a call differ, and which words."""
    arrays: list[str] = []
    words: list[str] = []
    added = [key for key in new if key not in old]
    for key, array in old.items():
        again = [other for other in added if key not in new and not difference(array, new[other])]
        if again:
            added.remove(again[0])
            words.append(f"{key} is {again[0]} now")
        elif change := difference(array, new[key]) if key in new else "missing":
            (words if is_text(array) else arrays).append(f"{key}: {change}")
    for key in added:
        (words if is_text(new[key]) else arrays).append(f"{key}: new")
    return arrays, words


def compare(old_file: Path, new_file: Path, only: str) -> bool:
    """Print for each call whether it is the same in two files; tell whether all arrays are."""
    sides: list[dict[str, dict[str, np.ndarray]]] = [{}, {}]
    for calls, file in zip(sides, (old_file, new_file)):
        with np.load(file, allow_pickle=False) as stored:
            for key in filter(lambda key: key.startswith(only), stored):
                calls.setdefault(key.split("|")[0], {})[key.partition("|")[2]] = stored[key]
    same = True
    for name in dict.fromkeys((*sides[0], *sides[1])):
        old, new = (calls.get(name, {}) for calls in sides)
        arrays, words = differences(old, new)
        same &= not arrays
        print(
            f"{name}: {'DIFFERS' if arrays else 'words differ' if words else 'identical'}, {len(old)} arrays"
        )
        for line in (*arrays[:MAX_SHOWN], *words[:MAX_SHOWN]):
            print(f"    {line}")
    return same


def main() -> int:
    """Read the command line, and do what it asks for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("what", choices=("record", "compare"))
    parser.add_argument("files", type=Path, nargs="+", help="file to write, or two files to compare")
    parser.add_argument("--data", type=Path, default=REAL_DATA, help="folder of real shapes")
    parser.add_argument("--cases", type=Path, help="folder of small files; by default cases, beside that")
    parser.add_argument("--only", default="", help="calls of which the names begin so")
    asked = parser.parse_args()
    if len(asked.files) != {"record": 1, "compare": 2}[asked.what]:
        parser.error("record takes one file, compare two")
    if asked.what == "compare":
        return 0 if compare(*asked.files, asked.only) else 1
    with TemporaryDirectory() as scratch, warnings.catch_warnings(action="ignore"):
        at = Folders(asked.data, asked.cases or asked.data.parent / "cases", Path(scratch))
        np.savez(asked.files[0], **record(at, asked.only))
    return 0


if __name__ == "__main__":
    sys.exit(main())
