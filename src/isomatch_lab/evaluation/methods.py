"""The methods that a benchmark can run, by name."""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from hashlib import sha256
from typing import Any, TypeAlias

from isomatch.correspondence import Correspondence
from isomatch.errors import SettingError
from isomatch.matching import MatchResult, match
from isomatch.settings import Config
from isomatch.shapes import PreparedShape
from isomatch.surfaces import Mesh
from isomatch.values.settings import Settings
from isomatch_lab.baselines import BASELINES, Baseline
from isomatch_lab.evaluation.true_landmarks import N_LANDMARKS

MatchInput: TypeAlias = Mesh | PreparedShape


@dataclass(frozen=True)
class Method:
    """How a benchmark runs a method.

    Parameters
    ----------
    function : callable
        Takes source and target, and ``landmarks``, ``initial_map`` and ``config`` where these are given.
    n_landmarks : int
        Number of true landmarks that the method is given.
    preparation : Config, optional
        Settings of the prepared shapes that the method is given; None if it is given meshes.
    config : optional
        Settings that the method is given; None if it takes none.
    reads_maps : bool
        The method is given the names of the pair as well, as `MapsInFolder` is.
    """

    function: Callable[..., Any]
    n_landmarks: int = 0
    preparation: Config | None = field(default_factory=Config)
    config: Settings | None = None
    reads_maps: bool = False

    def __call__(
        self, source: MatchInput, target: MatchInput, hints: Mapping[str, Any]
    ) -> tuple[Correspondence, dict[str, Any]]:
        """Match source to target with hints, by argument name; return the map and the method's diagnostics."""
        settings = {} if self.config is None else {"config": self.config}
        result = self.function(source, target, **hints, **settings)
        if self.reads_maps:
            found, note = result
            return found, {"read": note} if note else {}
        return (result.map, result.to_dict()) if isinstance(result, MatchResult) else (result, {})

    def to_dict(self) -> dict[str, Any]:
        """Return everything that the method is set to, as plain values."""
        return {
            "n_landmarks": self.n_landmarks,
            "preparation": self.preparation and self.preparation.to_dict(),
            "config": self.config and self.config.to_dict(),
        }


def methods_of(baselines: Mapping[str, Baseline]) -> dict[str, Method]:
    """Make the methods of some baselines: without hints, and with true landmarks as "NAME_5pt".

    A baseline that needs hints is given true landmarks under its own name.
    """
    methods = {}
    for name, baseline in baselines.items():
        plain = Method(baseline.function, 0, baseline.preparation, baseline.config)
        led = replace(plain, n_landmarks=N_LANDMARKS)
        if baseline.needs_hint:
            methods[name] = led
        else:
            methods[name] = plain
            if baseline.preparation is not None:
                methods[f"{name}_{N_LANDMARKS}pt"] = led
    return methods


METHODS = {
    "isomatch": Method(match, config=Config()),
    f"isomatch_{N_LANDMARKS}pt": Method(match, N_LANDMARKS, config=Config()),
    **methods_of(BASELINES),
}

CONTINUATIONS = {
    "isomatch": Method(match, config=Config(hypotheses="given")),
    **{name: replace(METHODS[name], n_landmarks=0) for name in ("gdd", "gdd_post")},
}
"""Methods that can start from the map of another: "sgmds_5pt+gdd" is GDD started from the map of SGMDS."""


def parts_of(name: str, own: Collection[str] = ()) -> tuple[str, str]:
    """Split the name of a method into a key of ``METHODS`` or a name of one's own, and one of ``CONTINUATIONS``, or "".

    Raises
    ------
    SettingError
        If there is no such method.
    """
    base, plus, ending = name.partition("+")
    if base not in (*METHODS, *own) or (plus and ending not in CONTINUATIONS):
        raise SettingError(
            f"unknown method {name}; choose from {', '.join([*METHODS, *own])}, and any of them followed by "
            + " or ".join(f"+{known}" for known in CONTINUATIONS)
            + "; a function of your own is MODULE:FUNCTION"
        )
    return base, ending


def settings_digest(name: str) -> str:
    """Hash the settings of a method, and of the method that it starts from, in 12 hexadecimal digits.

    Equal for equal settings on every machine, and different as soon as one of them changes.

    Examples
    --------
    >>> settings_digest("gdd") == settings_digest("gdd_post"), settings_digest("gdd") == settings_digest("phi")
    (True, False)
    """
    base, ending = parts_of(name)
    return digest_of(METHODS[base].to_dict(), ending)


def digest_of(settings: Mapping[str, Any], ending: str = "") -> str:
    """Hash the settings of a method, and of the continuation named by ``ending``, see `settings_digest`."""
    every = [settings] + ([CONTINUATIONS[ending].to_dict()] if ending else [])
    return sha256(json.dumps(every, sort_keys=True).encode()).hexdigest()[:12]
