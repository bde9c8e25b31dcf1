"""The values of options, in a file of their own: the command line lists them before anything slow is loaded."""

from typing import Literal

Labelling = Literal["nearest", "majority"]
Side = Literal["source", "target"]
