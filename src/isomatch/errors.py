"""Everything that can go wrong has a name; a message says what, where, why it matters and what to do."""

from collections.abc import Iterable


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
