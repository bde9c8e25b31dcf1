"""The values of options, which the command line imports before anything slow."""

from typing import Literal

Labelling = Literal["nearest", "majority"]  # whether a point gets the nearest label, or that with most area
NumbersAs = Literal["labels", "values"]  # whether numbers are carried like labels, or interpolated
Side = Literal["source", "target"]  # the shape that receives
