"""The list of pairs of a set: ``pairs.txt``, with a group in front of each pair if there are groups."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from isomatch._core.errors import FormatError, MissingFileError
from isomatch._core.texts import text_lines

FILES = ("pairs.txt", "test_pairs.txt")  # files that list pairs; the first that exists is read
_MAX_NAMED = 8  # largest number of shapes that a message names; chosen


@dataclass(frozen=True)
class PairList:
    """Pairs of names, and the group of each."""

    pairs: tuple[tuple[str, str], ...]
    groups: Mapping[tuple[str, str], str] = field(default_factory=dict)

    def group(self, source: str, target: str) -> str:
        """Group of a pair, or an empty text."""
        return self.groups.get((source, target), "")

    @classmethod
    def read(cls, root: Path, names: Collection[str]) -> PairList | None:
        """Read the list in a folder, if there is one."""
        path = next((root / name for name in FILES if (root / name).is_file()), None)
        if path is None:
            return None
        groups: dict[tuple[str, str], str] = {}
        for number, line in text_lines(path):
            words = line.replace(",", " ").split()
            if len(words) not in (2, 3):
                raise FormatError(
                    f"{path}:{number}: {line[:80]!r} is no pair; write source and target, after their group if there is "
                    "one"
                )
            source, target = (_shape_name(word, names, f"{path}:{number}") for word in words[-2:])
            if (source, target) in groups:
                raise FormatError(f"{path}:{number}: {source} and {target} are listed twice; remove one line")
            groups[source, target] = words[0] if len(words) == 3 else ""
        if not groups:
            raise FormatError(f"{path}: lists no pairs; write source and target on each line")
        return cls(tuple(groups), groups)


def _shape_name(word: str, names: Collection[str], where: str) -> str:
    """Name of a shape, which may be written with the suffix of its file."""
    if word in names:
        return word
    if Path(word).stem in names:
        return Path(word).stem
    some = ", ".join([*sorted(names)[:_MAX_NAMED], *["…"] * (len(names) > _MAX_NAMED)])
    raise MissingFileError(f"{where}: there is no shape {word!r}; the set has {some}")
