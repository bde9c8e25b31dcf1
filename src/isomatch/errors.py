"""Everything that can go wrong has a name; a message says what, where, why it matters and what to do."""

from collections.abc import Iterable, Sequence


class IsomatchError(Exception):
    """Base class of every error raised on purpose by isomatch."""


class MeshError(IsomatchError):
    """A surface cannot be used: bad indices, non-finite coordinates, no faces, no area."""


class FormatError(IsomatchError):
    """A file cannot be read; the message starts with ``file:line`` or ``file:byte offset``."""


class LandmarkError(IsomatchError):
    """Landmarks, an initial map or initial descriptors do not fit the two shapes."""


class NotConvergedError(IsomatchError):
    """An iteration ended without an answer that could be returned honestly."""


class MemoryBudgetError(IsomatchError):
    """An allocation would exceed the budget; the message names the alternative."""


class MissingDependencyError(IsomatchError):
    """An optional package is needed; the message gives the install command."""


class SettingError(IsomatchError, ValueError):
    """A setting has a value that makes no sense; the message names the setting and what is allowed."""


def some(indices: Iterable[int], limit: int = 5) -> str:
    """Write at most ``limit`` indices and the total count, for error messages.

    Examples
    --------
    >>> some(range(8))
    '0, 1, 2, 3, 4, … (8 in all)'
    >>> some([4, 2])
    '4, 2'
    """
    shown = [int(i) for i in indices]
    head = ", ".join(str(i) for i in shown[:limit])
    return head if len(shown) <= limit else f"{head}, … ({len(shown)} in all)"


def require_least(settings: object, **least: float) -> None:
    """Raise `SettingError` if a setting is below its bound; None is a setting left open."""
    for name, bound in least.items():
        value = getattr(settings, name)
        if value is not None and value < bound:
            raise SettingError(f"{name} = {value} is not at least {bound}")


def require_known(settings: object, **known: Sequence[str]) -> None:
    """Raise `SettingError` if a setting is not one of its words."""
    for name, words in known.items():
        value = getattr(settings, name)
        if value not in words:
            raise SettingError(f"{name} = {value!r} is not one of {', '.join(words)}")


def require_weights(settings: object) -> None:
    """Raise `SettingError` if a setting whose name ends in "weight" is negative."""
    for name, value in vars(settings).items():
        if name.endswith("weight") and not value >= 0:
            raise SettingError(f"{name} = {value!r} is not a weight of at least 0")
