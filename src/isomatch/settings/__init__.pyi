from isomatch.settings.config import (
    Config,
    Hypotheses,
    MatchSettings,
    Orientation,
    RefinementName,
    Resolution,
    Start,
)
from isomatch.settings.matching import (
    COVERAGE_RADIUS,
    ElasticSettings,
    OutcomeSettings,
    PartSettings,
    RefinementSettings,
    SearchSettings,
    SelectionSettings,
)
from isomatch.settings.shape import LevelSettings, PreparationSettings, SymmetrySettings

__all__ = [
    "COVERAGE_RADIUS",
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
