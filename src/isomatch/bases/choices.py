"""Names of the methods and of the weightings of a basis."""

from typing import Literal

BasisMethod = Literal["predicted", "nystrom", "fmds", "smds", "exact"]
Weighting = Literal["area", "uniform"]
