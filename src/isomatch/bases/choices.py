"""The names of what can be chosen about a basis."""

from typing import Literal

BasisMethod = Literal["predicted", "nystrom", "fmds", "smds", "exact"]
Weighting = Literal["area", "uniform"]
