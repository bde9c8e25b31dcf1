"""Values at the vertices of a surface, and the colours that show them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import Normalize
from numpy.typing import ArrayLike

from isomatch.errors import DescriptorError, SettingError
from isomatch.values.arrays import FloatArray, numbers_of
from isomatch.values.cached import cached_property
from isomatch.view.panels import colour_scale

OUTLIERS = 0.01  # share of the values beyond either end of the colour bar
EITHER_SIGN = (
    0.2  # of the largest magnitude; values that reach so far on both sides of 0 have colours of either sign
)
FROM_ZERO = 0.5  # of the highest value; values above 0 that begin below this are shown from 0
ONE_SIGN, BOTH_SIGNS = "cividis", "PuOr_r"  # both safe for the colour-blind


@dataclass(frozen=True, eq=False)
class ValuePanel:
    """Another view of the source, coloured by a value at each vertex.

    Parameters
    ----------
    values : (n_source,) array_like of float
        The values; ``nan`` is drawn grey.
    label : str
        Label of the colour bar, with the unit; it is broken into lines where a picture is lower than it is long.
    highest : float, optional
        Value of the brightest colour, from 0; by default the bar spans all but a per cent of the values at either end,
        from 0 if they begin near it, and as far on both sides of 0 if they have either sign.
    colour_map : str, optional
        Name of a colour map of matplotlib; by default ``"cividis"``, or ``"PuOr_r"`` for values of either sign.

    Raises
    ------
    SettingError
        If matplotlib has no such colour map.
    """

    values: ArrayLike
    label: str = ""
    highest: float | None = None
    colour_map: str | None = None

    def __post_init__(self) -> None:
        if self.colour_map is not None and self.colour_map not in colormaps:
            raise SettingError(
                f"colour_map = {self.colour_map!r} is no colour map of matplotlib; 'cividis', 'viridis' and 'PuOr_r' are"
            )

    def scale(self) -> Normalize:
        """Return the values of the first and the last colour."""
        return Normalize(*self._ends)

    @property
    def colours(self) -> str:
        """Name of the colour map."""
        return self.colour_map or (BOTH_SIGNS if self._ends[0] == -self._ends[1] else ONE_SIGN)

    @property
    def beyond(self) -> Literal["neither", "min", "max", "both"]:
        """On which ends of the scale there are values beyond it."""
        low, high = self._ends
        below, above = bool((self._finite < low).any()), bool((self._finite > high).any())
        return "both" if below and above else "min" if below else "max" if above else "neither"

    def rows(self, n: int) -> FloatArray:
        """(n,) the values, nan where they are not finite; `DescriptorError` if there are not as many."""
        rows = numbers_of(self.values, "values", DescriptorError)
        if rows.shape != (n,):
            raise DescriptorError(f"values have shape {rows.shape}; expected ({n},), one for each vertex")
        return np.where(np.isfinite(rows), rows, np.nan)

    def paint(self, values: FloatArray) -> FloatArray:
        """Screen colours (m, 3) of values (m, 1); nan of nan."""
        return colour_scale(self.colours, *self._ends)(values)

    @cached_property
    def _finite(self) -> FloatArray:
        values = np.asarray(self.values, dtype=np.float64).ravel()
        return values[np.isfinite(values)]

    @cached_property
    def _ends(self) -> tuple[float, float]:
        if self.highest:
            return 0.0, self.highest
        if not len(self._finite):
            return 0.0, 1.0
        low, high = np.quantile(self._finite, [OUTLIERS, 1 - OUTLIERS]).tolist()
        if low == high:
            low, high = float(self._finite.min()), float(self._finite.max())
        most = max(abs(low), abs(high))
        if -low > EITHER_SIGN * most and high > EITHER_SIGN * most:
            return -most, most
        low = 0.0 if 0.0 <= low < FROM_ZERO * high else low
        return low, high if high > low else low + 1.0
