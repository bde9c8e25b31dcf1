"""Drawing and hashing, which all kinds of surfaces share."""

from __future__ import annotations

from hashlib import blake2b
from threading import Lock
from typing import TYPE_CHECKING, Protocol, Unpack
from weakref import WeakSet

import numpy as np
from numpy.typing import ArrayLike

from isomatch._core.arrays import AnyArray
from isomatch._core.first_use import PlotOptions, Shown, visualization

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Plotted(Shown):
    """A surface with positions, which can be drawn."""

    __slots__ = ()

    def plot(self, values: ArrayLike | None = None, **options: Unpack[PlotOptions]) -> Figure:
        """Draw the surface, coloured by values (n,) or (n, 3) at its vertices; `isomatch.visualization.plot_surface`."""
        figure: Figure = visualization().plot_surface(self, values, **options)
        return figure


class Hashed(Protocol):
    """Anything with a hash of its contents."""

    @property
    def content_hash(self) -> str:
        """Hash of its arrays."""


_IN_USE: WeakSet[Hashed] = WeakSet()  # surfaces whose hash is known, as long as they exist
_LOCK = Lock()  # held while _IN_USE is listed, as the set must not grow meanwhile


def hash_of(surface: Hashed, *arrays: AnyArray) -> str:
    """Hash a surface and its arrays of float64 or int64: 32 hexadecimal digits, on every machine alike."""
    digest = blake2b(type(surface).__name__.encode(), digest_size=16)
    for array in arrays:
        digest.update(str(array.shape).encode())
        digest.update(np.ascontiguousarray(array, array.dtype.newbyteorder("<")).data)
    with _LOCK:
        _IN_USE.add(surface)
    return digest.hexdigest()


def surface_in_use(content_hash: str) -> Hashed | None:
    """Find a surface by its hash, if it was computed and the surface still exists."""
    with _LOCK:
        surfaces = list(_IN_USE)
    return next((surface for surface in surfaces if surface.content_hash == content_hash), None)
