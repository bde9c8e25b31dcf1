"""Settings of the match of several components."""

from __future__ import annotations

from dataclasses import dataclass

from isomatch.values.settings import Settings, setting


@dataclass(frozen=True)
class ComponentSettings(Settings):
    """Settings of the match of shapes of several components.

    Parameters
    ----------
    held : float
        Distance of a component from those that carry it, over its √area, up to which its place tells how it is turned.
    """

    held: float = setting(1.0, "chosen: a thing farther away than its own size may turn by itself", least=0)
