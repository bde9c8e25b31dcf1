"""A folder that ``isomatch match`` wrote, read to be continued: by `choose`, or in a page."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from json import loads
from math import nan
from pathlib import Path
from typing import Any

import isomatch
from isomatch import matching
from isomatch.cli.inputs import read_surface
from isomatch.cli.outputs import BACK, MESH_LEFT, Back, ResultFolder
from isomatch.errors import FormatError
from isomatch.storage.files import opened

_NEEDED: dict[str, type] = {
    "source": str,
    "target": str,
    "match_again": str,
    "landmarks": list,
    "config": dict,
    "seed": int,
    "origin": str,
    "alternatives": list,
    "files": dict,
}


@dataclass(frozen=True)
class Earlier:
    """What the folder of a result holds.

    Parameters
    ----------
    folder : ResultFolder
        The folder.
    record : dict
        Contents of ``result.json``.
    """

    folder: ResultFolder
    record: dict[str, Any]

    @classmethod
    def read(cls, folder: Path) -> Earlier:
        """Read ``result.json``, and require what a match writes."""
        path = ResultFolder(folder).result
        with opened(path) as file:
            text = file.read()
        try:
            record = loads(text)
        except ValueError:
            record = None
        fields = record if isinstance(record, dict) else {}
        missing = [name for name, kind in _NEEDED.items() if not isinstance(fields.get(name), kind)]
        if missing:
            raise FormatError(
                f"{path}: lacks {', '.join(missing)}; give the folder of a result of isomatch match"
            )
        return cls(ResultFolder(folder, report="report" in fields["files"]), fields)

    @property
    def source(self) -> Path:
        """Path of the source, as it was given to the match."""
        return Path(self.record["source"])

    @property
    def target(self) -> Path:
        """Path of the target."""
        return Path(self.record["target"])

    @property
    def landmarks(self) -> list[list[int]]:
        """Pairs of vertices; empty if none were given."""
        return list(self.record["landmarks"])

    def surfaces(self) -> tuple[isomatch.Mesh | isomatch.PointCloud, isomatch.Mesh | isomatch.PointCloud]:
        """Read both shapes."""
        return read_surface(self.source), read_surface(self.target)

    def result(self, *surfaces: isomatch.Mesh | isomatch.PointCloud) -> isomatch.MatchResult:
        """Read the map with all alternatives that were saved; `MapError` if it is of other surfaces."""
        n_saved = sum(name.startswith("alternative") for name in self.record["files"])
        result = isomatch.MatchResult.load(self.folder.files["map"])
        result.map.check_fits(*surfaces)
        others = tuple(
            _alternative(
                evidence, isomatch.Correspondence.load(self.folder.alternative(i), surfaces[1].n_vertices)
            )
            for i, evidence in enumerate(self.record["alternatives"][:n_saved], 1)
        )
        return replace(result, alternatives=others)

    def back(self, source: isomatch.Mesh | isomatch.PointCloud) -> Back | None:
        """Read the map of the other direction, if there is one."""
        described = self.record.get("back")
        if not isinstance(described, dict) or not self.folder.has_back:
            return None
        found = isomatch.Correspondence.load(self.folder.folder / BACK, source.n_vertices)
        return found, described

    @property
    def as_mesh(self) -> dict[str, Any]:
        """What is told of the mesh file of the result; empty if there is none."""
        told = self.record.get("as_mesh")
        return told if isinstance(told, dict) and isinstance(told.get("file"), str) else {}

    @property
    def mesh_left(self) -> list[str]:
        """Say that the mesh file is not of another map; empty if there is none."""
        return [MESH_LEFT.format(self.as_mesh["file"])] if self.as_mesh else []


def _alternative(evidence: Mapping[str, Any], found: isomatch.Correspondence) -> matching.Alternative:
    energy, orientation = (
        nan if evidence.get(name) is None else evidence[name] for name in ("energy", "orientation")
    )
    return matching.Alternative(lambda: found, energy, orientation, evidence["origin"])
