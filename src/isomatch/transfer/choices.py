"""The values of options, which the command line imports before anything slow."""

from typing import Literal

Labelling = Literal["nearest", "majority"]  # the nearest label, or the label with most area around a point
NumbersAs = Literal["labels", "values"]  # whether numbers are carried like labels, or interpolated
Side = Literal["source", "target"]  # the shape that receives
