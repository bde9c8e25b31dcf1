"""Pictures of maps: both shapes side by side, one colour for what corresponds."""

from isomatch.view.colours import position_colours
from isomatch.view.stills import ValuePanel, draw_map

__all__ = ["ValuePanel", "draw_map", "position_colours"]
