"""The modes of a shape model in 3D: the mean, which sliders move along each of them."""

from __future__ import annotations

from html import escape
from pathlib import Path

import numpy as np

from isomatch._core.files import write_text
from isomatch.cohort.shape_statistics import ShapeModel
from isomatch.cohort.specimen_page import MAX_SHOWN_VERTICES, simplified, stops, template_of, text_of
from isomatch.visualization import DrawnSurface, camera_of, html_page, scripts_of, stage_of

SLIDER_END = 3  # standard deviations from the mean to either end of a slider; chosen
SLIDER_STEP = 0.1  # standard deviations between two positions of a slider; chosen
CLIPPED_SHARE = 0.005  # share of the vertices with displacements beyond the end of the colour scale; chosen


def write_modes(path: str | Path, model: ShapeModel, n_modes: int = 3) -> None:
    """Write a page of the mean in 3D, which sliders move along the leading modes; it loads nothing.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> from isomatch import Mesh
    >>> from isomatch.cohort.shape_statistics import CorrespondedShapes
    >>> triangle = Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    >>> shapes = CorrespondedShapes.of_meshes({str(s): triangle.moved(s * triangle.vertices) for s in (1, 2, 3)})
    >>> with TemporaryDirectory() as folder:
    ...     write_modes(f"{folder}/modes.html", ShapeModel.fit(shapes))
    ...     Path(f"{folder}/modes.html").read_text().count('type="range"')
    1
    """
    view, scripts = mode_view(model, n_modes)
    page = html_page("Modes", f"<h1>Modes</h1>\n{view}{scripts}", style=text_of("cohort.css"))
    write_text(Path(path), page)


def mode_view(model: ShapeModel, n_modes: int) -> tuple[str, str]:
    """Make the view of the leading modes, and its scripts, which come last on the page.

    The data are the vertices of the mean, and for each mode their displacements (n, 3) by one standard deviation.
    """
    mean, shown = model.mesh(), range(min(n_modes, model.n_modes))
    surface = DrawnSurface(mean, camera_of(mean), MAX_SHOWN_VERTICES)
    moves = [model.deviations[mode] * model.modes[mode] for mode in shown]
    outward = [np.abs((move * mean.vertex_normals).sum(axis=1)) for move in moves]
    farthest = max((float(np.quantile(lengths, 1 - CLIPPED_SHARE)) for lengths in outward), default=0.0)
    high = SLIDER_END * farthest or 1.0
    packed = surface.packed()
    ends = [mean.vertices + SLIDER_END * side * move for move in moves for side in (-1, 1)]
    seen = [np.ptp(end @ camera_of(mean).T, axis=0) / np.sqrt(mean.area) for end in ends]
    packed["extent"] = np.max([packed["extent"], *seen], axis=0).tolist()
    scene = {
        "mean": packed,
        "modes": [{"vertices": surface.packed_vectors(move)} for move in moves],
        "unit": float(np.sqrt(mean.area)),
        "high": high,
        "ramp": stops("RdBu_r"),
    }
    sliders = "".join(
        f'<label for="mode{mode + 1}">mode {mode + 1}: {model.variance_ratios[mode]:.1%} of the variance</label>'
        f'<input type="range" id="mode{mode + 1}" min="-{SLIDER_END}" max="{SLIDER_END}" '
        f'step="{SLIDER_STEP}" value="0"><output for="mode{mode + 1}"></output>'
        for mode in shown
    )
    less = simplified(surface, "The mean")
    view = template_of("modes.html").substitute(
        stage=stage_of([], "The mean, moved along modes, in 3D"),
        sliders=sliders,
        high=f"{high:.3g}",
        remarks=escape(f" {less}" if less else ""),
    )
    return view, scripts_of(scene, text_of("modes.js"))
