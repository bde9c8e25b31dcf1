"""The words for what can be chosen; apart, so that the command line knows them before anything slow is loaded."""

from typing import Literal

Labelling = Literal["nearest", "majority"]
Side = Literal["source", "target"]
