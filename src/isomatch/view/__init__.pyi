from isomatch.view.camera import camera_of, turn_to_target
from isomatch.view.colours import position_colours, to_screen
from isomatch.view.inline import ResultView, show_result
from isomatch.view.measures import Measure, quality_bounds, quality_measures
from isomatch.view.page import MOST_ALTERNATIVES
from isomatch.view.panels import arranged_panels, colour_scale
from isomatch.view.plots import plot_basis, plot_surface
from isomatch.view.points import drawable
from isomatch.view.report import write_landmark_picker, write_report
from isomatch.view.representations import html_of
from isomatch.view.stills import draw_map
from isomatch.view.summary import HEADLINES, Summary, summary_of
from isomatch.view.surface_image import surface_image
from isomatch.view.value_panel import ValuePanel
from isomatch.view.work_page import WorkPage

__all__ = [
    "HEADLINES",
    "MOST_ALTERNATIVES",
    "Measure",
    "ResultView",
    "Summary",
    "ValuePanel",
    "WorkPage",
    "arranged_panels",
    "camera_of",
    "colour_scale",
    "draw_map",
    "drawable",
    "html_of",
    "plot_basis",
    "plot_surface",
    "position_colours",
    "quality_bounds",
    "quality_measures",
    "show_result",
    "summary_of",
    "surface_image",
    "to_screen",
    "turn_to_target",
    "write_landmark_picker",
    "write_report",
]
