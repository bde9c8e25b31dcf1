"""Settings of the resolutions of large meshes."""

from __future__ import annotations

from dataclasses import dataclass

from isomatch.errors import SettingError
from isomatch.values.settings import Settings, setting


@dataclass(frozen=True)
class LevelSettings(Settings):
    """Sizes of the levels on which large meshes are matched.

    Parameters
    ----------
    matched, polished : int
        Vertices on which shapes are matched, and on which the map is then polished.
    fast_matched, fast_polished : int
        The same with ``resolution="fast"``.
    spared : float
        A mesh of up to so many times these sizes is not decimated.
    """

    matched: int = setting(5000, "docs/performance.md, resolution", least=200)
    polished: int = setting(16000, "docs/performance.md, resolution", least=200)
    fast_matched: int = setting(2500, "docs/performance.md, resolution", least=200)
    fast_polished: int = setting(5000, "docs/performance.md, resolution", least=200)
    spared: float = setting(1.25, "chosen: less is hardly faster", least=1)

    def __post_init__(self) -> None:
        super().__post_init__()
        for kind in ("", "fast_"):
            matched, polished = getattr(self, f"{kind}matched"), getattr(self, f"{kind}polished")
            if polished < matched:
                raise SettingError(
                    f"{kind}polished = {polished} is below {kind}matched = {matched}; a map is polished on more vertices"
                )
