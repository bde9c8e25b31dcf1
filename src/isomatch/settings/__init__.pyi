from isomatch.settings.config import (
    Config,
    Hypotheses,
    MatchSettings,
    Orientation,
    RefinementName,
    Resolution,
    Start,
)
from isomatch.settings.elastic import ElasticSettings
from isomatch.settings.levels import LevelSettings
from isomatch.settings.outcome import OutcomeSettings
from isomatch.settings.parts import PartSettings
from isomatch.settings.preparation import PreparationSettings
from isomatch.settings.refining import RefinementSettings
from isomatch.settings.search import SearchSettings
from isomatch.settings.selection import SelectionSettings
from isomatch.settings.symmetry import SymmetrySettings

__all__ = [
    "Config",
    "ElasticSettings",
    "Hypotheses",
    "LevelSettings",
    "MatchSettings",
    "Orientation",
    "OutcomeSettings",
    "PartSettings",
    "PreparationSettings",
    "RefinementName",
    "RefinementSettings",
    "Resolution",
    "SearchSettings",
    "SelectionSettings",
    "Start",
    "SymmetrySettings",
]
