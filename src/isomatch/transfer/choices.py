"""The values of options; a separate file, so that the command line can list them without slow imports."""

from typing import Literal

Labelling = Literal["nearest", "majority"]
NumbersAs = Literal["labels", "values"]
Side = Literal["source", "target"]
