"""What a row of a ledger must hold to be used; others were damaged, or are of another program."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Any

from isomatch.collections.likeness import N_RANKS
from isomatch.collections.map_file import SIDES, Record
from isomatch.collections.template import N_EIGENVALUES, N_QUANTILES
from isomatch.matching import Outcome

Kind = Callable[[Any], bool]
Kinds = Mapping[str, Mapping[str, Kind]]
"""What the values of a row must be, by its state and their names."""


def _is_text(value: Any) -> bool:
    return isinstance(value, str)


def _is_whole(value: Any) -> bool:
    return isinstance(value, int)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float)


def _are_texts(value: Any) -> bool:
    return isinstance(value, list) and all(map(_is_text, value))


def _numbers(count: int) -> Kind:
    return lambda value: isinstance(value, list) and len(value) == count and all(map(_is_number, value))


def _is_result(value: Any) -> bool:
    quality = value.get("quality") if isinstance(value, dict) else None
    return (
        isinstance(quality, dict)
        and value.get("outcome") in Outcome.__members__
        and {"misfit", "orientation", "mirrored"} <= quality.keys()
        and all(each is None or _is_number(each) for each in quality.values())
    )


OF_SHAPES: Kinds = {
    "done": {
        "key": _is_text,
        "hash": _is_text,
        "bytes": _is_whole,
        "area": _is_number,
        "features": _numbers(N_EIGENVALUES + N_QUANTILES),
        "notes": _are_texts,
    },
    "failed": {"error": _is_text},
}
OF_PAIRS: Kinds = {
    "done": {
        "key": _is_text,
        "attempt": _is_whole,
        "source_hash": _is_text,
        "target_hash": _is_text,
        **dict.fromkeys(SIDES, _is_result),
    },
    "failed": {"key": _is_text, "attempt": _is_whole, "error": _is_text},
    "todo": {"attempt": _is_whole},
}
OF_FILES: Kinds = {"done": {"file": _is_text}}
OF_ORIGINS: Kinds = {"done": {"made_with": lambda value: isinstance(value, dict)}}
OPTIONAL: Mapping[str, Kind] = {
    "file": _is_text,
    "error": _is_text,
    "source_hash": _is_text,
    "target_hash": _is_text,
    "seconds": _is_number,
    "memory": lambda value: value is None or _is_number(value),
    "again": _are_texts,
    "replaced_by": _are_texts,
    "reflected": lambda value: isinstance(value, bool) or _are_texts(value),
    "made_with": lambda value: isinstance(value, str | dict),
    "agreement": lambda value: isinstance(value, dict) and _is_number(value.get("inconsistency", 0.0)),
    "not_reflected": lambda value: isinstance(value, dict) and all(map(_is_text, value.values())),
    "n_points": _is_whole,
    "spread": _is_number,
    "ranks": _numbers(N_RANKS),
    "handedness": _is_number,
    "holes": lambda value: value is None or _numbers(2)(value),
}
"""What other values must be, where a row has them."""


def record_of(text: Any, kinds: Kinds) -> Record | None:
    """Read a row, which has a state and the time and what belongs to its state; None if it is no such row."""
    try:
        record = json.loads(text)
        needed = {"time": _is_number, **kinds[record["state"]]}
    except (ValueError, TypeError, KeyError, RecursionError):
        return None
    known = {name: kind for name, kind in OPTIONAL.items() if name in record}
    return record if all(kind(record.get(name)) for name, kind in {**known, **needed}.items()) else None
