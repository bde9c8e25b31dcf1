"""Why something is computed again: what differs between its earlier row and the new one."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from hashlib import blake2b
from importlib.metadata import version
from itertools import chain
from typing import Any

from isomatch.collections.map_file import Record
from isomatch.settings import Config

UNTOLD = "—"  # a setting that there was not


def made_with(config: Config, seed: int) -> tuple[str, Record]:
    """Return what a key depends on beside the surfaces, as plain values, with their digest, by which rows name it."""
    found = {"isomatch": version("isomatch"), "seed": seed, **config.to_dict()}
    text = json.dumps(found, sort_keys=True)
    return blake2b(text.encode(), digest_size=8).hexdigest(), json.loads(text)


def why_again(
    old: Record, new: Record, contents: Mapping[str, str], origins: Mapping[str, Record]
) -> list[str]:
    """Say what differs between two rows of a shape or a pair.

    Parameters
    ----------
    old, new : dict
        The rows.
    contents : mapping of str to str
        Name of the shape whose hash is in a field, such as ``source_hash``.
    origins : mapping of str to dict
        What was computed with which version and settings, by ``made_with`` of the rows; see `made_with`.
    """
    reasons = list(old.get("again", [])) if old["state"] == "todo" else []
    for field, name in contents.items():
        if field in old and field in new and old[field] != new[field]:
            reasons.append(f"the contents of {name} changed")
    before, now = (_turned(row, contents) for row in (old, new))
    reasons += [f"{name} is matched as its mirror image" for name in sorted(now - before)]
    reasons += [f"{name} is not matched as its mirror image any more" for name in sorted(before - now)]
    known = [origins.get(row.get("made_with", "")) for row in (old, new)]
    if None not in known:
        reasons += _differences(*(dict(_flat(origin["made_with"])) for origin in known if origin))
    return reasons


def _turned(row: Record, contents: Mapping[str, str]) -> set[str]:
    turned = row.get("reflected", ())
    return set(contents.values() if turned is True else turned or ())


def _differences(old: Record, new: Record) -> list[str]:
    return [
        f"{name} {old.get(name, UNTOLD)} → {new.get(name, UNTOLD)}"
        for name in dict.fromkeys(chain(old, new))
        if old.get(name, UNTOLD) != new.get(name, UNTOLD)
    ]


def _flat(values: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield settings with those of stages named as in a file of settings: ``search.rank``."""
    for name, value in values.items():
        if isinstance(value, dict):
            yield from _flat(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value
