"""The values of options, in a file of their own: the command line lists them before anything slow is loaded."""

from typing import Literal

Labelling = Literal["nearest", "majority"]
NumbersAs = Literal["labels", "values"]
Side = Literal["source", "target"]
