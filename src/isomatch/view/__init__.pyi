from isomatch.view.camera import camera_of, turn_to_target
from isomatch.view.colours import position_colours, to_screen
from isomatch.view.measures import Measure, quality_bounds, quality_measures
from isomatch.view.panels import arranged_panels, colour_scale
from isomatch.view.points import drawable
from isomatch.view.report import MOST_ALTERNATIVES, write_landmark_picker, write_report
from isomatch.view.stills import ValuePanel, draw_map
from isomatch.view.summary import HEADLINES, Summary, summary_of
from isomatch.view.surface_image import surface_image

__all__ = [
    "HEADLINES",
    "MOST_ALTERNATIVES",
    "Measure",
    "Summary",
    "ValuePanel",
    "arranged_panels",
    "camera_of",
    "colour_scale",
    "draw_map",
    "drawable",
    "position_colours",
    "quality_bounds",
    "quality_measures",
    "summary_of",
    "surface_image",
    "to_screen",
    "turn_to_target",
    "write_landmark_picker",
    "write_report",
]
