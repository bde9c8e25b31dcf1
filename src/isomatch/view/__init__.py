"""Pictures and reports of maps: both shapes side by side, one colour for what corresponds."""

from isomatch.view.colours import position_colours
from isomatch.view.report import write_report
from isomatch.view.stills import ValuePanel, draw_map

__all__ = ["ValuePanel", "draw_map", "position_colours", "write_report"]
