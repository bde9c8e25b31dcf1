"""Settings: frozen dataclasses with checked values and a source for each default."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from typing import Any, Literal, Self, get_args, get_origin, get_type_hints

import numpy as np

from isomatch._core.errors import SettingError


def require_one_of(name: str, value: object, words: Any) -> None:
    """Raise `SettingError` unless a value is one of some words, or of those of a ``Literal``."""
    options = get_args(words) or tuple(words)
    if value not in options:
        raise SettingError(f"{name} = {value!r} is not one of {', '.join(map(repr, options))}")


def setting(
    default: Any,
    source: str = "",
    *,
    least: float | None = None,
    most: float | None = None,
    empty: bool = False,
) -> Any:
    """Declare a setting: its default, the source of the default, and inclusive bounds of all entries."""
    return field(default=default, metadata={"source": source, "least": least, "most": most, "empty": empty})


@dataclass(frozen=True)
class Settings:
    """Base class of all settings: frozen, checked when made, turned into plain values and back."""

    def __post_init__(self) -> None:
        hints = get_type_hints(type(self))
        for setting in fields(self):
            # numpy's numbers become Python's, since only those can be written to a file
            if isinstance(getattr(self, setting.name), np.generic):
                object.__setattr__(self, setting.name, getattr(self, setting.name).item())
            _require_allowed(setting.name, getattr(self, setting.name), hints[setting.name], setting.metadata)

    def to_dict(self) -> dict[str, Any]:
        """Return the settings as plain values, with a mapping for each stage."""
        return asdict(self)

    def changed(self) -> dict[str, Any]:
        """Return the settings that differ from their defaults, of a stage as "stage.name"."""
        different: dict[str, Any] = {}
        for setting in fields(self):
            value = getattr(self, setting.name)
            if isinstance(value, Settings):
                different |= {f"{setting.name}.{name}": inner for name, inner in value.changed().items()}
            elif value != setting.default:
                different[setting.name] = value
        return different

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Self:
        """Make settings from plain values, such as `to_dict` returns; others keep their defaults."""
        hints = get_type_hints(cls)
        names = [setting.name for setting in fields(cls)]
        unknown = sorted(set(values) - set(names))
        if unknown:
            raise SettingError(f"unknown setting {', '.join(unknown)}; known are {', '.join(names)}")
        return cls(**{name: _typed(value, hints[name], name) for name, value in values.items()})


def _typed(value: Any, hint: Any, name: str) -> Any:
    """Convert mappings and lists, as files have them, to the types of settings."""
    if isinstance(hint, type) and issubclass(hint, Settings) and isinstance(value, Mapping):
        try:
            return hint.from_dict(value)
        except SettingError as error:
            raise SettingError(f"{name}: {error}") from None
    if isinstance(value, list):
        return tuple(_typed(entry, Any, name) for entry in value)
    return value


def _require_allowed(name: str, value: Any, hint: Any, bounds: Mapping[str, Any]) -> None:
    """Raise `SettingError` unless a value has the type of a setting and lies within its bounds."""
    options = get_args(hint)
    if get_origin(hint) is Literal:
        require_one_of(name, value, hint)
        return
    if type(None) in options:
        if value is not None:
            (hint,) = (option for option in options if option is not type(None))
            _require_allowed(name, value, hint, bounds)
        return
    if isinstance(hint, type) and issubclass(hint, Settings) and not isinstance(value, hint):
        raise SettingError(f"{name} = {value!r} is not a {hint.__name__}")
    if get_origin(hint) is tuple:
        if not isinstance(value, tuple):
            raise SettingError(f"{name} = {value!r} is not a tuple")
        if not value and not bounds.get("empty"):
            raise SettingError(f"{name} is empty; give at least one value")
        for entry in value:
            _require_allowed(name, entry, get_args(hint)[0], bounds)
    if hint in (bool, str) and not isinstance(value, hint):
        raise SettingError(f"{name} = {value!r} is not {'true or false' if hint is bool else 'a word'}")
    least, most = bounds.get("least"), bounds.get("most")
    if hint in (int, float):
        kinds: Any = int if hint is int else (int, float)
        is_number = isinstance(value, kinds) and not isinstance(value, bool)
        fits = is_number and value == value  # nan differs from itself
        if not fits or (least is not None and value < least) or (most is not None and value > most):
            limits = [f"at least {least}"] if least is not None else []
            limits += [f"at most {most}"] if most is not None else []
            what = "an integer" if hint is int else "a number"
            raise SettingError(
                f"{name} = {value!r} is not {what}" + " of " * bool(limits) + " and ".join(limits)
            )


def require_least(settings: object, **least: float) -> None:
    """Raise `SettingError` if a setting is below a bound that depends on others; None is a setting left open."""
    for name, bound in least.items():
        value = getattr(settings, name)
        if value is not None and value < bound:
            raise SettingError(f"{name} = {value} is not at least {bound}")


def generator(seed: int, *more: int) -> np.random.Generator:
    """Make a random generator; `SettingError` unless the seed is an integer of at least 0."""
    _require_allowed("seed", seed.item() if isinstance(seed, np.generic) else seed, int, {"least": 0})
    return np.random.default_rng([seed, *more] if more else seed)
