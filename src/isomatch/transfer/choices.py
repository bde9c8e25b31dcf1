"""The values of options, which the command line imports before anything slow."""

from typing import Literal

Labelling = Literal["nearest", "majority"]
NumbersAs = Literal["labels", "values"]
Side = Literal["source", "target"]
