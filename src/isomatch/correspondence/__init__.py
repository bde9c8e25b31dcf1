"""Maps between two surfaces, as plain arrays: the rooms above know shapes, this one knows rows and columns."""

from isomatch.correspondence.correspondence import UNMATCHED, Correspondence

__all__ = ["UNMATCHED", "Correspondence"]
