"""The named errors. A message says what is wrong, where, why it matters and what to do.

::

    IsomatchError
    ├── InputError (ValueError)          something given does not fit
    │   ├── MeshError                    a surface, or distances on it
    │   ├── LandmarkError                pairs of corresponding points
    │   ├── MapError                     a correspondence
    │   ├── DescriptorError              values on the vertices
    │   └── SettingError                 a setting
    ├── FormatError (ValueError)         the contents of a file
    │   ├── MissingFileError (FileNotFoundError)
    │   └── UnwritableFileError (OSError)
    ├── MemoryBudgetError (MemoryError)
    ├── MissingDependencyError (ImportError)
    └── NotConvergedError
"""

from collections.abc import Iterable


class IsomatchError(Exception):
    """Base class of every error raised on purpose by isomatch."""


class InputError(IsomatchError, ValueError):
    """Something given cannot be used: base class of the errors about surfaces, landmarks, maps, values and settings."""


class MeshError(InputError):
    """A surface cannot be used: bad indices, non-finite coordinates, no faces, no area; or distances do not fit it."""


class LandmarkError(InputError):
    """Landmarks do not fit the two shapes."""


class MapError(InputError):
    """A correspondence does not fit the shapes: wrong length, direction or range, or too little of it is known."""


class DescriptorError(InputError):
    """Values on the vertices, or on those of two shapes, have the wrong shape or are not finite."""


class SettingError(InputError):
    """A setting has a value that makes no sense; the message names the setting and what is allowed."""


class FormatError(IsomatchError, ValueError):
    """A file cannot be read; the message starts with ``file:line`` or ``file: byte offset``."""


class MissingFileError(FormatError, FileNotFoundError):
    """A file or a data set is not where it was looked for."""


class UnwritableFileError(FormatError, OSError):
    """A file cannot be written, exists already, or is being written by another process."""


class MemoryBudgetError(IsomatchError, MemoryError):
    """An allocation would exceed the budget; the message names the alternative."""


class MissingDependencyError(IsomatchError, ImportError):
    """An optional package is needed; the message gives the install command."""


class NotConvergedError(IsomatchError):
    """An iteration ended without a result that could be returned honestly."""


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
