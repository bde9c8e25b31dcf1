"""Match surfaces in 3D Slicer: colours that correspond, landmarks carried, where the map is doubtful, and cohorts.

All coordinates are those of the nodes, in RAS, as Slicer holds them in memory; its files are in LPS. Landmarks are moved
between the world and the coordinates of each model, so transforms of nodes count.
"""

import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

import ctk
import numpy as np
import qt
import slicer
import vtk
from slicer.ScriptedLoadableModule import (
    ScriptedLoadableModule,
    ScriptedLoadableModuleLogic,
    ScriptedLoadableModuleTest,
    ScriptedLoadableModuleWidget,
)
from vtk.util.numpy_support import numpy_to_vtk, vtk_to_numpy

COLOURS, ERROR, DOUBT = "isomatch map", "isomatch expected error", "isomatch doubt"  # arrays of the points
UNMATCHED_GREY = 0.15  # Vertices without an image have this linear light.
RAS_TO_LPS = np.array([-1.0, -1.0, 1.0])  # These factors turn RAS coordinates into LPS, and back.
# Points farther from their model, in √area, are refused, as in landmark files.
MAX_LANDMARK_DISTANCE = 0.1
POLL_SECONDS = 0.05  # seconds between two looks at a computation
RAMP = "vtkMRMLColorTableNodeFileViridis.txt"
CURVES = "vtkMRMLMarkupsCurveNode", "vtkMRMLMarkupsClosedCurveNode"


class IsomatchModule(ScriptedLoadableModule):
    """What the list of modules says."""

    def __init__(self, parent):
        ScriptedLoadableModule.__init__(self, parent)
        self.parent.title = "isomatch"
        self.parent.categories = ["Registration", "Shape Analysis"]
        self.parent.dependencies = []
        self.parent.contributors = ["The isomatch authors"]
        self.parent.helpText = (
            "Finds for each point of one surface the corresponding point of another one that is bent, and carries "
            "landmarks along. Choose two models and press Match; the source's points get images on the target."
        )
        self.parent.acknowledgementText = "Shamai & Kimmel, Geodesic Distance Descriptors, CVPR 2017."


class Refused(Exception):
    """What cannot be done with these nodes, in words for the user."""


class Cancelled(Exception):
    """The user gave up."""


class IsomatchModuleLogic(ScriptedLoadableModuleLogic):
    """What the module does, without its widgets."""

    def surface(self, model):
        """Return the surface of a model node as an `isomatch.Mesh`, in its own coordinates.

        Its vertices are the points of the node in their order; polygons and strips are cut into triangles.

        Raises
        ------
        Refused
            If it has no polygons.
        """
        from isomatch import Mesh

        data = model.GetPolyData()
        if data is None or not data.GetNumberOfPolys() + data.GetNumberOfStrips():
            raise Refused(f"{model.GetName()} has no surface; choose a model with polygons")
        cut = vtk.vtkTriangleFilter()
        cut.PassVertsOff()
        cut.PassLinesOff()
        cut.SetInputData(data)
        cut.Update()
        triangles = vtk_to_numpy(cut.GetOutput().GetPolys().GetData()).reshape(-1, 4)[:, 1:]
        points = vtk_to_numpy(data.GetPoints().GetData())
        return Mesh(np.array(points, dtype=np.float64), np.array(triangles))

    def landmarks(self, markups, model):
        """Return the control points of a markups node as `isomatch.Landmarks`, in the coordinates of a model.

        Those that are not placed are nan. The points of a curve are a curve.
        """
        from isomatch import Landmarks
        from isomatch.landmarks import Curve

        n = markups.GetNumberOfControlPoints()
        positions = np.full((n, 3), np.nan)
        to_model = between(None, model)
        for i in range(n):
            if markups.GetNthControlPointPositionStatus(i) == slicer.vtkMRMLMarkupsNode.PositionDefined:
                world = [0.0, 0.0, 0.0]
                markups.GetNthControlPointPositionWorld(i, world)
                positions[i] = to_model.TransformPoint(world)
        curves = []
        if markups.GetClassName() in CURVES:
            curves = [Curve(markups.GetName(), tuple(range(n)), markups.GetClassName() == CURVES[1])]
        names = [markups.GetNthControlPointLabel(i) for i in range(n)]
        return Landmarks(positions, names, curves, axes="RAS")

    def planned(self, source, target, source_marks=None, target_marks=None, either_side=False) -> Callable:
        """Read two models and return their match, a function of its progress that touches no node.

        Parameters
        ----------
        source, target : vtkMRMLModelNode
            The result maps the points of the first to the second.
        source_marks, target_marks : vtkMRMLMarkupsNode, optional
            Landmarks as priors. They are joined by their labels if they share any, otherwise in order.
        either_side : bool
            Whether the map may be a mirror image.

        Returns
        -------
        callable
            Takes a function of a stage and a share, and returns an `isomatch.MatchResult`.

        Raises
        ------
        Refused, isomatch.IsomatchError
            If the nodes cannot be used.
        """
        from isomatch import Config, match, nearest_landmarks

        if source is target:
            raise Refused("source and target are the same model; choose two")
        if bool(source_marks) != bool(target_marks):
            raise Refused("landmarks are chosen on one model only; choose them on both, or on none")
        surfaces = self.surface(source), self.surface(target)
        pairs = None
        if source_marks and target_marks:
            both = self.landmarks(source_marks, source), self.landmarks(target_marks, target)
            rows = joined(*both)
            if len(rows) < 3:
                raise Refused(f"the landmarks make {len(rows)} pairs; place at least three on both models")
            pairs = nearest_landmarks(
                *surfaces, *(marks.positions[[row[side] for row in rows]] for side, marks in enumerate(both))
            )
        config = Config(orientation="any" if either_side else "preserve")
        return lambda tell: match(*surfaces, landmarks=pairs, config=config, progress=tell)

    def match(self, source, target, source_marks=None, target_marks=None, either_side=False, progress=None):
        """Match two models and wait for it; see `planned`."""
        work = self.planned(source, target, source_marks, target_marks, either_side)
        return work(progress or (lambda stage, share: None))

    def checked(self, result, source, target):
        """Return the surfaces of two models; `Refused` if they are not those that were matched."""
        surfaces = self.surface(source), self.surface(target)
        hashes = result.map.source_hash, result.map.target_hash
        for model, surface, matched in zip((source, target), surfaces, hashes):
            if surface.content_hash != matched:
                raise Refused(f"{model.GetName()} is not the surface that was matched; match again")
        return surfaces

    def show_map(self, result, source, target) -> None:
        """Give corresponding points of both models the same colour, in a point array that is displayed."""
        from isomatch.visualization import position_colours, to_screen

        own = position_colours(self.checked(result, source, target)[1])
        pulled = result.map.pull_back(own)
        for model, colours in ((source, np.where(np.isnan(pulled), UNMATCHED_GREY, pulled)), (target, own)):
            shown = np.rint(255 * np.clip(to_screen(colours), 0, 1)).astype(np.uint8)
            put(model, COLOURS, shown)
            display(model, COLOURS).SetScalarRangeFlag(slicer.vtkMRMLDisplayNode.UseDirectMapping)

    def show_error(self, result, source, target) -> None:
        """Display on the source how far each image may be off, in the units of the target; −1 where it has none."""
        target_surface = self.checked(result, source, target)[1]
        error = result.expected_error * np.sqrt(target_surface.area)
        high = float(np.nanmax(error)) if np.isfinite(error).any() else 1.0
        put(source, ERROR, np.where(np.isnan(error), -1.0, error))
        shown_as(display(source, ERROR), 0.0, high)

    def show_doubt(self, result, source, target) -> list[str]:
        """Display on the source the regions of doubt, numbered from 1, all else 0; return what is said of each."""
        self.checked(result, source, target)
        number = np.zeros(len(result.map.vertices))
        for i, region in enumerate(result.regions, start=1):
            number[region.vertices] = i
        put(source, DOUBT, number)
        shown_as(display(source, DOUBT), 0.0, max(1.0, len(result.regions)))
        return [f"{i}: {region}" for i, region in enumerate(result.regions, start=1)]

    def carry(self, result, source, target, markups, to="target"):
        """Carry a markups node from one model to the other.

        Parameters
        ----------
        result : isomatch.MatchResult
            Source → target.
        source, target : vtkMRMLModelNode
            Its two ends.
        markups : vtkMRMLMarkupsNode
            Points or a curve on the source; on the target if ``to="source"``.
        to : {"target", "source"}
            Where they go.

        Returns
        -------
        vtkMRMLMarkupsNode
            A new node of the same class with the same labels. The description of a point is its expected error. Points
            that have no place are not placed.

        Raises
        ------
        Refused
            If points are not on the model.
        """
        from isomatch import Landmarks, carry_landmarks
        from isomatch.surfaces import nearest_on_surface

        ends = self.checked(result, source, target)
        giver, receiver = (source, target) if to == "target" else (target, source)
        on = ends[0] if to == "target" else ends[1]
        marks: Landmarks = self.landmarks(markups, giver)
        placed = marks.positions[marks.placed]
        if not len(placed):
            raise Refused(f"{markups.GetName()} has no placed points; place some on {giver.GetName()}")
        away = np.linalg.norm(nearest_on_surface(on, placed).interpolated(on.vertices) - placed, axis=1)
        if away.max() > MAX_LANDMARK_DISTANCE * np.sqrt(on.area):
            raise Refused(
                f"{markups.GetName()} has points {away.max():.3g} away from {giver.GetName()}; choose the markups that "
                "were placed on it"
            )
        carried = carry_landmarks(result, *ends, marks, to=to)
        return self.markups(carried, receiver, markups)

    def markups(self, landmarks, model, like):
        """Make a markups node of landmarks in the coordinates of a model, of the class of another node."""
        node = slicer.mrmlScene.AddNewNodeByClass(
            like.GetClassName(), f"{like.GetName()} on {model.GetName()}"
        )
        to_world = between(model, None)
        for position, name, error in zip(landmarks.positions, landmarks.names, landmarks.expected_error):
            found = np.isfinite(position).all()
            world = to_world.TransformPoint(position) if found else (0.0, 0.0, 0.0)
            i = node.AddControlPointWorld(vtk.vtkVector3d(*world), name)
            if not found:
                node.UnsetNthControlPointPosition(i)
            elif np.isfinite(error):
                node.SetNthControlPointDescription(i, f"expected error {error:.3g}")
        return node

    def cohort(self, shapes, folder, template=None, marks=None, progress=lambda what, share: None) -> dict:
        """Match all surfaces of a folder with a template, as ``isomatch collect`` does; again, to continue.

        Parameters
        ----------
        shapes : path
            Folder of surface files.
        folder : path
            Where maps, surfaces in the topology of the template, tables and ``index.html`` are written.
        template : str, optional
            Name of a shape; by default the one in the middle of all.
        marks : isomatch.Landmarks, optional
            Of the template, in RAS, from `landmarks`. They are carried to all shapes, into ``landmarks``.
        progress : callable
            Called with what was done and the share of the work. What it raises ends the run.

        Returns
        -------
        dict
            How many ``shapes`` and ``pairs`` are done, the ``failed`` with their errors, and names with ``landmarks``.
        """
        from isomatch import Collection, Landmarks, write_landmarks
        from isomatch.cohort import collected_landmarks, finish

        if marks is not None and template is None:
            raise Refused("landmarks are those of a template; choose which shape it is")
        collection = Collection.create(folder, shapes, template=template)
        with ThreadPoolExecutor(1) as one:  # Slicer's own Python starts no others
            for event in collection.run(one, jobs=1):
                progress(f"{event.what} {event.name}", 0.8 * event.done / max(event.of, 1))
            for line in finish(collection, one, jobs=1):
                progress(f"surface of {line.name}", 0.9)
        rows = collection.rows()
        carried = []
        if marks is not None:
            file = Path(folder) / f"{template}_marked.mrk.json"
            write_landmarks(file, Landmarks(marks.positions * RAS_TO_LPS, marks.names, marks.curves))
            collection.layout.landmarks.mkdir(exist_ok=True)
            for name, found in collected_landmarks(collection, {template: file}):
                write_landmarks(collection.layout.landmarks / f"{name}.mrk.json", found)
                carried.append(name)
                progress(f"landmarks of {name}", 0.95)
        every = {**rows.shapes, **rows.pairs}
        return {
            "shapes": sum(row.state == "done" for row in rows.shapes.values()),
            "pairs": sum(row.state == "done" for row in rows.pairs.values()),
            "failed": {str(name): row.error for name, row in every.items() if row.state == "failed"},
            "landmarks": carried,
        }


def between(first, second):
    """Return the transform from the coordinates of one node to those of another; None is the world."""
    transform = vtk.vtkGeneralTransform()
    slicer.vtkMRMLTransformNode.GetTransformBetweenNodes(
        first.GetParentTransformNode() if first else None,
        second.GetParentTransformNode() if second else None,
        transform,
    )
    return transform


def joined(source, target) -> list[tuple[int, int]]:
    """Return rows of placed landmarks that belong together: by label if they share any, otherwise in order."""
    placed = [[i for i in range(len(marks)) if marks.placed[i]] for marks in (source, target)]
    rows = [{marks.names[i]: i for i in on if marks.names[i]} for marks, on in zip((source, target), placed)]
    if shared := [name for name in rows[0] if name in rows[1]]:
        return [(rows[0][name], rows[1][name]) for name in shared]
    if len(placed[0]) != len(placed[1]):
        raise Refused(
            f"{len(placed[0])} and {len(placed[1])} landmarks that share no labels; place as many, or give equal labels"
        )
    return list(zip(*placed))


def put(model, name: str, values: np.ndarray) -> None:
    """Store values at the points of a model; an array of the same name is replaced."""
    array = numpy_to_vtk(np.ascontiguousarray(values), deep=True)
    array.SetName(name)
    points = model.GetPolyData().GetPointData()
    points.RemoveArray(name)
    points.AddArray(array)
    model.GetPolyData().Modified()


def display(model, name: str):
    """Show an array of the points of a model, and return its display node."""
    if model.GetDisplayNode() is None:
        model.CreateDefaultDisplayNodes()
    node = model.GetDisplayNode()
    node.SetActiveScalar(name, vtk.vtkAssignAttribute.POINT_DATA)
    node.SetScalarVisibility(True)
    return node


def shown_as(node, low: float, high: float) -> None:
    """Let a display node show numbers by a ramp between two values."""
    node.SetAndObserveColorNodeID(RAMP)
    node.SetScalarRangeFlag(slicer.vtkMRMLDisplayNode.UseManualScalarRange)
    node.SetScalarRange(low, high)


class Job:
    """A computation on a thread that touches no node; Slicer goes on while it is waited for.

    Parameters
    ----------
    work : callable
        Called with a function of what is done and the share of the work, which raises `Cancelled` after `cancel`.
    """

    def __init__(self, work: Callable) -> None:
        self.what, self.share, self.cancelled = "starting", 0.0, False
        self._outcome: list = []
        self._thread = threading.Thread(target=self._run, args=(work,), daemon=True)
        self._thread.start()

    def _run(self, work: Callable) -> None:
        try:
            self._outcome = [work(self._tell), None]
        except BaseException as error:
            self._outcome = [None, error]

    def _tell(self, what: str, share: float) -> None:
        if self.cancelled:
            raise Cancelled
        self.what, self.share = what, share

    def cancel(self) -> None:
        """Give up; the thread ends at its next step, and is not waited for."""
        self.cancelled = True

    def result(self, look: Callable[[str, float], None]):
        """Wait for the result, and call a function of what is done and the share again and again meanwhile."""
        while self._thread.is_alive() and not self.cancelled:
            look(self.what, self.share)
            time.sleep(POLL_SECONDS)  # lets the thread run
        if self.cancelled:
            raise Cancelled
        result, error = self._outcome
        if error is not None:
            raise error
        return result


class IsomatchModuleWidget(ScriptedLoadableModuleWidget):
    """The panel: two models, their match, what is carried, and cohorts."""

    def setup(self) -> None:
        """Make the widgets."""
        ScriptedLoadableModuleWidget.setup(self)
        self.logic = IsomatchModuleLogic()
        self.result, self.ends, self.job = None, (None, None), None

        form = self.section("Shapes")
        self.source = self.selector(form, "Source:", ["vtkMRMLModelNode"], "Model whose points get images")
        self.target = self.selector(form, "Target:", ["vtkMRMLModelNode"], "Model that the images lie on")
        form = self.section("Match")
        tip = "At least three points with the labels, or in the order, of those on the other model"
        markups = ["vtkMRMLMarkupsFiducialNode"]
        self.source_marks = self.selector(form, "Landmarks on source:", markups, tip, none=True)
        self.target_marks = self.selector(form, "Landmarks on target:", markups, tip, none=True)
        self.either = qt.QCheckBox("Allow the mirror image")
        form.addRow("", self.either)
        self.match_button = self.button(form, "Match", self.on_match)
        self.bar = qt.QProgressBar()
        self.bar.setRange(0, 100)
        self.cancel_button = self.button(form, "Cancel", self.on_cancel)
        form.addRow(self.bar)
        self.said = qt.QLabel("")
        self.said.setWordWrap(True)
        form.addRow(self.said)

        form = self.section("Look")
        self.button(form, "Corresponding colours", lambda: self.show(self.logic.show_map))
        self.button(form, "Expected error", lambda: self.show(self.logic.show_error))
        self.button(form, "Regions of doubt", lambda: self.show(self.logic.show_doubt))

        form = self.section("Carry landmarks and curves")
        kinds = ["vtkMRMLMarkupsFiducialNode", *CURVES]
        self.carried = self.selector(form, "Markups:", kinds, "On the source; on the target to go back")
        self.button(form, "From source to target", lambda: self.on_carry("target"))
        self.button(form, "From target to source", lambda: self.on_carry("source"))

        form = self.section("Cohort")
        self.shapes, self.output = (ctk.ctkPathLineEdit() for _ in range(2))
        for line, label in ((self.shapes, "Folder of surfaces:"), (self.output, "Output folder:")):
            line.filters = ctk.ctkPathLineEdit.Dirs
            form.addRow(label, line)
        self.template = qt.QLineEdit()
        self.template.setToolTip(
            "File name of the template without its suffix; empty: the shape in the middle of all"
        )
        form.addRow("Template:", self.template)
        self.template_model = self.selector(
            form,
            "Template as model:",
            ["vtkMRMLModelNode"],
            "The same file, loaded, if it has landmarks",
            none=True,
        )
        self.template_marks = self.selector(form, "Its landmarks:", kinds, "Carried to all", none=True)
        self.button(form, "Match all", self.on_cohort)
        self.button(form, "Open the overview", self.on_overview)

        form = self.section("Installation")
        self.button(form, "Install isomatch from its folder…", self.on_install)
        self.layout.addStretch(1)
        self.set_running(False)

    def section(self, title: str):
        """Make a part that can be folded, and return its form."""
        part = ctk.ctkCollapsibleButton()
        part.text = title
        self.layout.addWidget(part)
        return qt.QFormLayout(part)

    def selector(self, form, label: str, kinds: list[str], tip: str, none: bool = False):
        """Add a choice of nodes."""
        box = slicer.qMRMLNodeComboBox()
        box.nodeTypes = kinds
        box.addEnabled = box.removeEnabled = False
        box.noneEnabled = none
        box.setMRMLScene(slicer.mrmlScene)
        box.setToolTip(tip)
        form.addRow(label, box)
        return box

    def button(self, form, text: str, action: Callable[[], None]):
        """Add a button; what goes wrong is shown in words."""
        made = qt.QPushButton(text)

        def press(*_) -> None:
            with told():
                action()

        made.connect("clicked(bool)", press)
        form.addRow(made)
        return made

    def set_running(self, running: bool) -> None:
        """Show whether something is computed."""
        self.match_button.enabled = not running
        self.cancel_button.enabled = self.bar.visible = running

    def waited(self, work: Callable):
        """Compute on a thread while Slicer goes on, and return the result."""
        if self.job:
            raise Refused("something is computed already; wait or cancel")
        self.job = Job(work)
        self.set_running(True)

        def look(what: str, share: float) -> None:
            self.bar.setValue(int(100 * share))
            self.said.setText(what)
            slicer.app.processEvents()

        try:
            return self.job.result(look)
        except Cancelled:
            self.said.setText("cancelled")
            return None
        finally:
            self.job = None
            self.set_running(False)

    def on_match(self) -> None:
        """Match the two models, and show the map."""
        ends = self.source.currentNode(), self.target.currentNode()
        if None in ends:
            raise Refused("choose a source and a target")
        work = self.logic.planned(
            *ends, self.source_marks.currentNode(), self.target_marks.currentNode(), self.either.checked
        )
        result = self.waited(work)
        if result is not None:
            self.result, self.ends = result, ends
            self.said.setText(f"{result.outcome.value}: {result.outcome.advice}")
            self.logic.show_map(result, *ends)

    def on_cancel(self) -> None:
        """Give up what is computed."""
        if self.job:
            self.job.cancel()

    def matched(self) -> tuple:
        """Return the result and its models; `Refused` without."""
        if self.result is None:
            raise Refused("there is no map yet; match first")
        return (self.result, *self.ends)

    def show(self, way: Callable) -> None:
        """Show the map in one of the ways."""
        words = way(*self.matched())
        if words is not None:
            self.said.setText("\n".join(words) or "no region is doubtful")

    def on_carry(self, to: str) -> None:
        """Carry the markups that are chosen."""
        if self.carried.currentNode() is None:
            raise Refused("choose markups to carry")
        self.logic.carry(*self.matched(), self.carried.currentNode(), to)

    def on_cohort(self) -> None:
        """Match a folder of surfaces."""
        shapes, output = self.shapes.currentPath, self.output.currentPath
        if not shapes or not output:
            raise Refused("choose a folder of surfaces and one for the output")
        marks, model = self.template_marks.currentNode(), self.template_model.currentNode()
        if marks and not model:
            raise Refused("choose the model that the landmarks of the template were placed on")
        landmarks = self.logic.landmarks(marks, model) if marks else None
        template = self.template.text or None
        found = self.waited(
            lambda tell: self.logic.cohort(shapes, output, template, landmarks, progress=tell)
        )
        if found is not None:
            failed = "".join(f"\n{name}: {error}" for name, error in found["failed"].items())
            self.said.setText(f"{found['shapes']} shapes and {found['pairs']} pairs are matched{failed}")

    def on_overview(self) -> None:
        """Open the page of the cohort in a browser."""
        page = Path(self.output.currentPath) / "index.html"
        if not page.exists():
            raise Refused(f"{page} is not there; match all first")
        qt.QDesktopServices.openUrl(qt.QUrl.fromLocalFile(str(page)))

    def on_install(self) -> None:
        """Install isomatch into Slicer's Python, from a folder that holds its source."""
        folder = qt.QFileDialog.getExistingDirectory(None, "Folder of isomatch, with pyproject.toml")
        if folder and slicer.util.confirmOkCancelDisplay(
            f"Install isomatch from {folder} into Slicer's Python?"
        ):
            slicer.util.pip_install([str(folder)])

    def cleanup(self) -> None:
        """Give up what is computed when the module goes."""
        self.on_cancel()


@contextmanager
def told() -> Iterator[None]:
    """Show errors of isomatch and of this module in words."""
    try:
        yield
    except ModuleNotFoundError as error:
        if error.name != "isomatch":
            raise
        slicer.util.errorDisplay("isomatch is not installed in Slicer's Python; see Installation below")
    except Refused as error:
        slicer.util.errorDisplay(str(error))
    except Exception as error:
        from isomatch import IsomatchError

        if not isinstance(error, IsomatchError):
            raise
        slicer.util.errorDisplay(str(error))


class IsomatchModuleTest(ScriptedLoadableModuleTest):
    """Match the pair that isomatch brings along; Slicer runs this with its Reload and Test."""

    def runTest(self) -> None:
        """Start with an empty scene."""
        slicer.mrmlScene.Clear()
        self.test_landmarks_come_back()

    def test_landmarks_come_back(self) -> None:
        """Points of the source, carried to the target and back, are where they were."""
        from isomatch.datasets import example_pair

        logic, models = IsomatchModuleLogic(), []
        for name, made in zip(("source", "target"), example_pair()):
            model = slicer.mrmlScene.AddNewNodeByClass("vtkMRMLModelNode", name)
            model.SetAndObservePolyData(polydata_of(made.mesh.vertices, made.mesh.faces))
            model.CreateDefaultDisplayNodes()
            models.append(model)
        result = logic.match(*models)
        assert result.outcome.name == "CONVERGED"
        for show in (logic.show_error, logic.show_doubt, logic.show_map):
            show(result, *models)
        marks = slicer.mrmlScene.AddNewNodeByClass("vtkMRMLMarkupsFiducialNode", "marks")
        given = logic.surface(models[0]).vertices[[0, 500, 1000]]
        for i, position in enumerate(given):
            marks.AddControlPointWorld(vtk.vtkVector3d(*position), f"mark {i}")
        there = logic.carry(result, *models, marks)
        back = logic.carry(result, *models, there, to="source")
        found = logic.landmarks(back, models[0]).positions
        assert np.linalg.norm(found - given, axis=1).max() < 0.05


def polydata_of(vertices: np.ndarray, faces: np.ndarray):
    """Make polydata of vertices (n, 3) and triangles (m, 3)."""
    data, points, cells = vtk.vtkPolyData(), vtk.vtkPoints(), vtk.vtkCellArray()
    points.SetData(numpy_to_vtk(np.asarray(vertices, dtype=np.float64), deep=True))
    for face in np.asarray(faces).tolist():
        cells.InsertNextCell(3, face)
    data.SetPoints(points)
    data.SetPolys(cells)
    return data
