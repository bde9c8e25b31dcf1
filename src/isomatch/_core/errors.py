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
    """Base class of every error raised on purpose by isomatch.

    Examples
    --------
    >>> from isomatch import Mesh
    >>> try:
    ...     Mesh([[0, 0]], [[0, 0, 0]])
    ... except IsomatchError as error:
    ...     print(type(error).__name__)
    MeshError
    """

    __module__ = "isomatch"  # the public place of the class, which tracebacks name

    def __init_subclass__(cls, **options: object) -> None:
        super().__init_subclass__(**options)
        if cls.__module__ == __name__:
            cls.__module__ = "isomatch"


class InputError(IsomatchError, ValueError):
    """An input cannot be used: base class of errors about surfaces, landmarks, maps, values, settings.

    Examples
    --------
    >>> issubclass(MapError, InputError), issubclass(MapError, ValueError), issubclass(FormatError, InputError)
    (True, True, False)
    """


class MeshError(InputError):
    """A surface cannot be used: bad indices, non-finite coordinates, no faces, no area; or distances do not fit it.

    Examples
    --------
    >>> from isomatch import Mesh
    >>> Mesh([[0, 0], [1, 0], [0, 1]], [[0, 1, 2]])
    Traceback (most recent call last):
    isomatch.MeshError: vertices have shape (3, 2), expected (n, 3): one row x, y, z per vertex
    """


class LandmarkError(InputError):
    """Landmarks do not fit the two shapes.

    Examples
    --------
    >>> from isomatch import Mesh, nearest_landmarks
    >>> triangle = Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    >>> nearest_landmarks(triangle, triangle, [[0, 0, 0]], [[0, 0, 0], [1, 0, 0]])
    Traceback (most recent call last):
    isomatch.LandmarkError: 1 source and 2 target landmarks; give as many
    """


class MapError(InputError):
    """A correspondence does not fit the shapes: wrong length, direction or range, or too little of it is known.

    Examples
    --------
    >>> from isomatch import Correspondence
    >>> Correspondence([0, 2], n_target=2)  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    isomatch.MapError: source vertices 1 are mapped outside the target's vertices 0…1; indices count from 0, ...
    """


class DescriptorError(InputError):
    """Values on the vertices, or on those of two shapes, have the wrong shape or are not finite.

    Examples
    --------
    >>> from isomatch import Correspondence
    >>> Correspondence([0, 1], n_target=2).push_forward(["arm", "leg"], source_areas=[1.0, 1.0])  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    isomatch.DescriptorError: values have type <U3, and labels have no mean; carry them with ...
    """


class SettingError(InputError):
    """A setting has a value that makes no sense; the message names the setting and what is allowed.

    Examples
    --------
    >>> import numpy as np
    >>> from isomatch import distance_basis
    >>> distance_basis(np.array([[0.0, 1.0], [1.0, 0.0]]), k=5, p=3)
    Traceback (most recent call last):
    isomatch.SettingError: k = 5 must lie in 1…p = 3: the rank cannot exceed the number of columns
    """


class FormatError(IsomatchError, ValueError):
    """A file cannot be read; the message starts with ``file:line`` or ``file: byte offset``.

    Examples
    --------
    >>> from isomatch import Mesh, write_mesh
    >>> write_mesh("triangle.doc", Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]))  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    isomatch.FormatError: triangle.doc: suffix '.doc' is not a mesh format; use one of .off, .obj, ...
    """


class MissingFileError(FormatError, FileNotFoundError):
    """A file or a data set is not where it was looked for.

    Examples
    --------
    >>> from isomatch import read_mesh
    >>> read_mesh("missing.off")
    Traceback (most recent call last):
    isomatch.MissingFileError: missing.off: no such file; check the name and the folder
    """


class UnwritableFileError(FormatError, OSError):
    """A file cannot be written, exists already, or is being written by another process.

    Examples
    --------
    >>> from isomatch import Correspondence
    >>> Correspondence([0], n_target=1).save("no_such_folder/map.npz")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    isomatch.UnwritableFileError: no_such_folder/map.npz: cannot be written ...
    """


class MemoryBudgetError(IsomatchError, MemoryError):
    """An allocation would exceed the budget; the message names the alternative.

    Examples
    --------
    >>> import numpy as np
    >>> from isomatch import distance_engine, farthest_point_sampling
    >>> engine = distance_engine(lambda sources: np.zeros((len(sources), 10)))
    >>> farthest_point_sampling(engine, 10**12, start=0)  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    isomatch.MemoryBudgetError: 1000000000000 distance columns needs ... GiB, the budget is ...; ask for fewer ...
    """


class MissingDependencyError(IsomatchError, ImportError):
    """An optional package is needed; the message gives the install command.

    Examples
    --------
    It is an `ImportError` too, for code that tries one engine after the other.

    >>> issubclass(MissingDependencyError, ImportError)
    True
    """


class NotConvergedError(IsomatchError):
    """An iteration ended without a result that could be returned honestly.

    Examples
    --------
    >>> import numpy as np
    >>> from isomatch import distance_basis
    >>> places = np.arange(30.0)
    >>> roots = np.sqrt(np.abs(places[:, None] - places))  # no matrix of low rank comes near them
    >>> distance_basis(roots, tolerance=1e-12)  # doctest: +ELLIPSIS
    Traceback (most recent call last):
    isomatch.NotConvergedError: the estimated error is ...% with 30 columns, not 0.00%: ...
    """


MAX_INDICES = 5  # largest number of indices that a message lists; chosen, so that a message stays short


def some(indices: Iterable[int]) -> str:
    """Write the first indices, and the count of longer lists: 0, 1, 2, 3, 4, … (8 in all)."""
    shown = [int(i) for i in indices]
    head = ", ".join(map(str, shown[:MAX_INDICES]))
    return head if len(shown) <= MAX_INDICES else f"{head}, … ({len(shown)} in all)"
