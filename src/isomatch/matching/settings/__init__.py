"""The settings of each stage of a match: one file for each table of a file of settings."""

from isomatch.matching.settings.anchors import AnchorSettings
from isomatch.matching.settings.components import ComponentSettings
from isomatch.matching.settings.elastic import ElasticSettings
from isomatch.matching.settings.levels import LevelSettings
from isomatch.matching.settings.outcome import OutcomeSettings
from isomatch.matching.settings.parts import PartSettings
from isomatch.matching.settings.preparation import PreparationSettings
from isomatch.matching.settings.refining import RefinementSettings
from isomatch.matching.settings.search import SearchSettings
from isomatch.matching.settings.selection import SelectionSettings
from isomatch.matching.settings.symmetry import SymmetrySettings

__all__ = [
    "AnchorSettings",
    "ComponentSettings",
    "ElasticSettings",
    "LevelSettings",
    "OutcomeSettings",
    "PartSettings",
    "PreparationSettings",
    "RefinementSettings",
    "SearchSettings",
    "SelectionSettings",
    "SymmetrySettings",
]
