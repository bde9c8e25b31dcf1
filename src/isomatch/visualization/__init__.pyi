from isomatch.visualization.camera import camera_of, turn_to_target
from isomatch.visualization.colours import position_colours, to_screen
from isomatch.visualization.measures import Measure, quality_bounds, quality_measures
from isomatch.visualization.notebook import ResultView, html_of, show_result
from isomatch.visualization.picture import ValuePanel, arranged_panels, colour_scale
from isomatch.visualization.plots import draw_map, drawable, plot_basis, plot_surface
from isomatch.visualization.report import (
    MOST_ALTERNATIVES,
    write_judgement,
    write_landmark_picker,
    write_report,
)
from isomatch.visualization.summary import HEADLINES, Summary, summary_of
from isomatch.visualization.surface_image import surface_image
from isomatch.visualization.viewer import DrawnSurface, html_page, html_table, scripts_of, stage_of
from isomatch.visualization.work_page import WorkPage

__all__ = [
    "HEADLINES",
    "MOST_ALTERNATIVES",
    "DrawnSurface",
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
    "html_page",
    "html_table",
    "plot_basis",
    "plot_surface",
    "position_colours",
    "quality_bounds",
    "quality_measures",
    "scripts_of",
    "show_result",
    "stage_of",
    "summary_of",
    "surface_image",
    "to_screen",
    "turn_to_target",
    "write_judgement",
    "write_landmark_picker",
    "write_report",
]
